"""A small sample of the attack on every kind of file: refused in a sentence or answered, never anything else.

Each test runs in an interpreter of its own: an attack forks, and a fork inherits what other tests left in theirs
(callbacks for the end, threads).
"""

import subprocess
import sys
from pathlib import Path
from random import Random

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

for name in ("starlette", "uvicorn", "httpx2", "asammdf", "h5py", "mcap"):
    pytest.importorskip(name, reason="an extra is not installed")
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, and limits of Linux")
SLOW = (
    "recording, identified", "sweep", "number", "SSP, XML, run", "FMU, XML, run", "FMU, binary, run", "FMU, failing",
    "recording, binary", "crafted", "page, bytes",
)  # fmt: skip
"""Kinds of which a mutation takes a second or more: the whole attack has them."""
EACH = 1


def alone(part: str, folder: Path) -> None:
    """Run a part of this file in an interpreter of its own."""
    done = subprocess.run([sys.executable, __file__, part, folder], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr


def test_a_sample_of_spoilt_files_is_refused_or_answered(tmp_path: Path) -> None:
    alone("sample", tmp_path)


def test_each_defect_is_seen_as_what_it_is(tmp_path: Path) -> None:
    alone("defects", tmp_path)


def sample(folder: Path) -> None:
    import attack
    from attack_kinds import kinds
    from attack_targets import Yard

    targets = [one for one in kinds(Yard(folder)) if not one.kind.startswith(SLOW)]
    good = list(attack.controls([one for one in targets if one.kind in ("scenario", "machine file")]))
    assert [one for one in good if one.end != "answered"] == [], "else an attack means nothing"
    found = [attack.attack(target, 5, place) for target in targets for place in range(EACH)]
    assert [one for one in found if one.end in attack.DEFECTS] == []
    assert {"refused", "answered"} <= {one.end for one in found}


def defects(folder: Path) -> None:
    import attack
    from attack_targets import Target, spoke, told

    def ending(code: str, proof: object = spoke) -> str:
        def command(folder: Path, file: Path, dice: Random) -> object:
            return lambda: exec(code, {"folder": folder})

        target = Target("planted", 1, [("x", b"")], attack.untouched, command, proof)  # type: ignore[arg-type]
        return attack.attack(target, 1, 1).end

    assert ending("raise ValueError") == "traceback"
    assert ending("import os; os.kill(os.getpid(), 9)") == "crash"
    assert ending("pass") == "silent"
    assert ending("print('no JSON')", told) == "silent"
    assert ending("print('fine')") == "answered"
    assert ending("import sys; sys.exit(2)") == "unclear"
    assert ending("import sys; print('cosim: no.', file=sys.stderr); sys.exit(2)") == "refused"
    assert ending("import tempfile; tempfile.mkdtemp(); print('fine')") == "left"
    assert ending("(folder / '.a.1.partial').touch(); print('fine')") == "left"
    sleeper = "import subprocess; subprocess.Popen(['sleep', '9'], start_new_session=True); print('fine')"
    assert ending(sleeper) == "left"


if __name__ == "__main__":
    {"sample": sample, "defects": defects}[sys.argv[1]](Path(sys.argv[2]))

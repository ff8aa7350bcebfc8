"""The diagnosis in a world that others made: their generator, their truth, their score.

    python bench/abroad.py --data FOLDER --python PYTHON --cases 10 --nulls 100 --seed S \
        --out results/abroad --decks results/decks.md

FOLDER holds the generator (make_cases.py, score.py); PYTHON is an interpreter that has numba for it. Each family is a
call of its own with a seed of its own (S, S + 1, ...), then every case is diagnosed in process, without FMU and report,
then FOLDER's score.py judges. All of that goes on where it was ended, case by case, in the folder WORK. Where generator
or numba is missing, it says so and ends. Writes README.md and abroad.json.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

for library in ("OMP", "OPENBLAS"):  # one case a process: libraries that thread inside only get into each other's way
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
sys.path.append(str(Path(__file__).parent))
from abroad_page import write  # noqa: E402

from cosim_studies.proof.conduct import code  # noqa: E402
from cosim_studies.proof.ledger import enlist  # noqa: E402

GENERATOR = "abroad"
RECORDINGS = ("train_1", "train_2", "heldout")
NEEDED = ("make_cases.py", "score.py")


@dataclass(frozen=True)
class Part:
    """One call of the generator: a family, how many of it, its seed."""

    family: str
    cases: int
    seed: int

    @property
    def name(self) -> str:
        """Name of its folder."""
        return f"{self.family}-{self.seed}-{self.cases}"


def main() -> None:
    """Make, diagnose, score, write; or say why not."""
    given = arguments()
    if reason := missing(given.data, given.python):
        print(f"skipped: {reason}")
        return
    began = time.perf_counter()
    deck = parts(families(given), given.cases, given.nulls, given.seed)
    work = given.work or Path(tempfile.gettempdir()) / f"cosim-abroad-{given.seed}"
    made(deck, given, work)
    answers = work / f"answers-{code()[:16]}"
    diagnosed(deck, work, answers, given.jobs)
    rows = [row for part in deck for row in scored(part, given, work, answers)]
    total = sum(part.cases for part in deck)
    if given.decks:
        enlist(given.decks, GENERATOR, given.seed, total, given.purpose, code())
    write(given.out, rows, facts(given, time.perf_counter() - began))
    print((given.out / "README.md").read_text("utf-8"))


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the generator")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has numba")
    parser.add_argument("--cases", type=int, default=10, help="cases a family")
    parser.add_argument("--nulls", type=int, default=100, help="cases with nothing concealed")
    parser.add_argument("--families", default="", help="comma list; all of them where not given")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--jobs", type=int, default=2, help="cases at a time")
    parser.add_argument("--work", type=Path, default=None, help="where cases and answers are kept")
    parser.add_argument("--purpose", default="scoring", help="scoring, or tuning: whether the code may be shaped by it")
    parser.add_argument("--decks", type=Path, default=None, help="list of all decks to which this one is added")
    parser.add_argument("--out", type=Path, required=True)
    return parser.parse_args()


def missing(data: Path, python: str) -> str:
    """Why the generator cannot run here; "" where it can."""
    if absent := [name for name in NEEDED if not (data / name).is_file()]:
        return f"{data} holds no {absent[0]}"
    try:
        done = subprocess.run([python, "-c", "import numba"], capture_output=True, text=True, check=False)
    except OSError as error:
        return f"{python} does not run: {error.strerror}"
    return "" if done.returncode == 0 else f"{python} has no numba, which the generator needs"


def families(given: argparse.Namespace) -> list[str]:
    """The families to be dealt, in the generator's order."""
    if given.families:
        return [name.strip() for name in given.families.split(",")]
    asked = [given.python, "-c", "import json, make_cases; print(json.dumps(list(make_cases.FAMILIES)))"]
    done = subprocess.run(asked, cwd=given.data, env=environment(), capture_output=True, text=True, check=True)
    return list(json.loads(done.stdout.splitlines()[-1]))


def parts(names: list[str], cases: int, nulls: int, seed: int) -> list[Part]:
    """One call a family, with seeds in a row; none where no case of a family is wanted."""
    counts = {name: nulls if name == "none" else cases for name in names}
    return [Part(name, count, seed + k) for k, (name, count) in enumerate(counts.items()) if count]


def environment() -> dict[str, str]:
    """For the generator: its compiled code is kept, and nothing is written beside its sources."""
    cache = Path(tempfile.gettempdir()) / "cosim-abroad-numba"
    return {"NUMBA_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1", **os.environ}


def made(deck: list[Part], given: argparse.Namespace, work: Path) -> None:
    """Make what is not made yet; a part is whole when its mark stands beside it."""
    work.mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(given.jobs) as pool:
        for part in pool.map(lambda part: make(part, given, work), deck):
            print(f"made {part.name}", flush=True)


def make(part: Part, given: argparse.Namespace, work: Path) -> Part:
    """Run the generator for one part."""
    mark = work / f"{part.name}.made"
    if not mark.exists():
        command = [given.python, str(given.data.resolve() / "make_cases.py"), "--seed", str(part.seed)]
        command += ["--n-per-family", str(part.cases), "--families", part.family, "--out", str(work / part.name)]
        done = subprocess.run(command, env=environment(), capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(f"The generator failed for {part.name}:\n{done.stderr[-2000:]}")
        mark.write_text(done.stdout, "utf-8")
    return part


def diagnosed(deck: list[Part], work: Path, answers: Path, jobs: int) -> None:
    """Diagnose what has no answer yet; an answer is one file, complete or not there."""
    rest = [(case, answers / part.name) for part in deck for case in cases_of(work / part.name)]
    rest = [(case, out) for case, out in rest if not (out / f"{case.name}.json").exists()]
    with ProcessPoolExecutor(jobs) as pool:
        for done, said in enumerate(pool.map(answer, *zip(*rest, strict=True)) if rest else (), 1):
            print(f"{done} of {len(rest)}: {said}", flush=True)


def cases_of(folder: Path) -> Iterator[Path]:
    """The case folders of a part."""
    return (path for path in sorted(folder.iterdir()) if path.is_dir())


def answer(case: Path, out: Path) -> str:
    """Diagnose one case as a user's script would; a traceback is an answer too."""
    from cosim.delivery.deliver import as_json
    from cosim.diagnosis.diagnose import diagnose
    from cosim.reading import read_recordings
    from pyfmi_models.card import read_card

    began = time.perf_counter()
    try:
        card = read_card(case / "model.toml")
        paths = [case / f"{name}.csv.gz" for name in RECORDINGS]
        *train, held = read_recordings(paths, card.columns, None, None, card.mount.motion)
        found = as_json(diagnose(train, [held], card).diagnosis)
    except Exception:
        found = {"crashed": traceback.format_exc()[-2000:]}
    found |= {"wall_seconds": time.perf_counter() - began}
    out.mkdir(parents=True, exist_ok=True)
    partial = out / f"{case.name}.partial"
    partial.write_text(json.dumps(found), "utf-8")
    partial.replace(out / f"{case.name}.json")
    said = "crashed" if "crashed" in found else " + ".join(found["verdict"]) or "none"
    return f"{out.name} {case.name}: {said}"


def scored(part: Part, given: argparse.Namespace, work: Path, answers: Path) -> list[dict[str, Any]]:
    """The rows of the generator's own score, each with the answer that it judges."""
    told = answers / f"{part.name}.score.json"
    command = [given.python, str(given.data.resolve() / "score.py"), "--truth", str(work / f"{part.name}_truth")]
    command += ["--results", str(answers / part.name), "--json", str(told), "--quiet"]
    subprocess.run(command, env=environment(), capture_output=True, text=True, check=True)
    rows = json.loads(told.read_text("utf-8"))["rows"]
    return [row | {"part": part.name, "answer": kept(answers / part.name / f"{row['case']}.json")} for row in rows]


def kept(path: Path) -> dict[str, Any]:
    """What of an answer is needed for the page."""
    if not path.exists():
        return {"crashed": "no answer"}
    found = json.loads(path.read_text("utf-8"))
    if "crashed" in found:
        return {name: found[name] for name in ("crashed", "wall_seconds")}
    offered = [{k: one[k] for k in ("effect", "answer", "probability")} for one in found["effects"]]
    offered = [one for one in offered if one["answer"] in ("found", "ambiguous")]
    return {name: found[name] for name in ("verdict", "ambiguous_with", "wall_seconds")} | {"effects": offered}


def facts(given: argparse.Namespace, seconds: float) -> dict[str, Any]:
    """What the page says of how it was made."""
    names = (f"--{name} {getattr(given, name)}" for name in ("cases", "nulls", "seed"))
    command = f"python bench/abroad.py --data FOLDER --python PYTHON {' '.join(names)}"
    command += f" --families {given.families}" if given.families else ""
    whole = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(given.data.glob("*.py"))))
    told = {"command": f"{command} --out results/abroad", "seed": given.seed, "purpose": given.purpose}
    return told | {"generator": whole.hexdigest()[:16], "code": code()[:16], "seconds": seconds}


if __name__ == "__main__":
    main()

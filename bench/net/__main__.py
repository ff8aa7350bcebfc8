"""python -m bench.net record|check|counts [--only WORD ...] [--small] [--jobs 2] [--cosim PATH]

`check` runs `cosim diagnose --quick --json` on every case and compares its answer with the stored one, `record` stores
it. A difference is printed with the case, the entry, what is stored and what is there; exit 1 if there is one.
`counts` stores what the small cases compute: fits, evaluations, rows times columns.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cosim
from bench.net.answers import STORED, Answer, answered, differences, read, write
from bench.net.cases import NetCase, cases
from bench.net.counts import counted


def main() -> int:
    """Run the cases, then compare or store."""
    given = _arguments()
    command = [given.cosim] if given.cosim else [sys.executable, "-m", "cosim"]
    chosen = [one for one in cases(given.foreign_python) if _is_wanted(one, given.only, given.small)]
    if given.what == "counts":
        return _count([one for one in chosen if one.small])
    with ThreadPoolExecutor(given.jobs) as several, tempfile.TemporaryDirectory() as work:
        folders = [Path(work) / one.name for one in chosen]
        answers = several.map(answered, [command] * len(chosen), chosen, folders)
        return _record(chosen, answers) if given.what == "record" else _check(chosen, answers)


def _is_wanted(case: NetCase, only: list[str], small: bool) -> bool:
    return (case.small or not small) and (not only or any(word in case.name for word in only))


def _record(chosen: list[NetCase], answers: Iterable[Answer]) -> int:
    for case, answer in zip(chosen, answers, strict=True):
        write(case, answer)
        print(f"{case.name}: {' + '.join(answer['verdict']) or 'none'}, {answer['seconds']:.0f} s", flush=True)
    return 0


def _check(chosen: list[NetCase], answers: Iterable[Answer]) -> int:
    wrong = 0
    for case, answer in zip(chosen, answers, strict=True):
        stored = read(case)
        found = differences(stored, answer) if stored else ["nothing is stored"]
        wrong += bool(found)
        print(
            f"{case.name}: {'the same' if not found else f'{len(found)} differences'}",
            *found[:12],
            sep="\n  ",
            flush=True,
        )
    print(f"{len(chosen) - wrong} of {len(chosen)} answers are the stored ones")
    return bool(wrong)


def _count(chosen: list[NetCase]) -> int:
    path = STORED / "counts.json"
    known = json.loads(path.read_text("utf-8")) if path.exists() else {}
    for case in chosen:
        with tempfile.TemporaryDirectory() as work, counted() as counts:
            folder = Path(work)
            case.write(folder)
            train, heldout = ([folder / one for one in names] for names in (case.train, case.heldout))
            cosim.diagnose(train, heldout, folder / case.card, quick=True)
        known[case.name] = counts.as_json()
        print(f"{case.name}: {known[case.name]}", flush=True)
    path.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", "utf-8")
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("record", "check", "counts"))
    parser.add_argument("--only", nargs="*", default=[], help="words, one of which is in a case's name")
    parser.add_argument("--small", action="store_true", help="the twelve small cases alone")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cosim", default="", help="command to run (default: this Python's)")
    parser.add_argument("--foreign-python", default="", help="interpreter that has numba, for the foreign generator")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())

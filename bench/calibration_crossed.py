"""Whether printed probabilities of one world come true when their curve is fitted in the other.

python bench/calibration_crossed.py ABROAD.json PROOF.json --out results/abroad

Of each deck Platt's curve is fitted to what was printed (offset 0, slope 1 leaves it as it is) and judges the other
deck: expected calibration error of 10 bins, with a bootstrap over cases. Writes crossed.md.
"""

import argparse
import json
from itertools import chain, permutations
from pathlib import Path
from typing import Any

from calibration import Pairs, fitted

import cosim
from cosim.diagnosis.decide.calibration import calibrated
from cosim_studies.proof.intervals import Estimate, bootstrap
from cosim_studies.proof.score import calibration_error_of

AS_PRINTED = (0.0, 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("decks", type=Path, nargs=2, metavar="DECK.json")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    decks = {path.parent.name: json.loads(path.read_text("utf-8")) for path in options.decks}
    command = " ".join(["python bench/calibration_crossed.py", *map(str, options.decks)])
    options.out.mkdir(parents=True, exist_ok=True)
    text = page(decks, f"{command} --out {options.out}")
    (options.out / "crossed.md").write_text(text, "utf-8")
    print(text)


def printed(row: dict[str, Any]) -> Pairs:
    """What one case printed of each effect that it offers, and whether that was concealed."""
    offered = row["answer"]["effects"] if row.get("status", "ok") == "ok" else ()
    return [
        (float(one["probability"]), one["effect"] in row["effects"])
        for one in offered
        if one["answer"] in ("found", "ambiguous")
    ]


def error(cases: list[Pairs], curve: tuple[float, float]) -> Estimate:
    """Expected calibration error of cases whose probabilities go through a curve."""
    return bootstrap(
        [[(calibrated(p, *curve), true) for p, true in case] for case in cases],
        lambda chosen: calibration_error_of(list(chain.from_iterable(chosen))),
    )


def told(one: Estimate) -> str:
    """A number with its interval."""
    return "-" if one.value is None else f"{one.value:.3f} [{one.low:.3f}, {one.high:.3f}]"


def page(decks: dict[str, dict[str, Any]], command: str) -> str:
    """The page of results/."""
    cases = {name: [pairs for row in deck["rows"] if (pairs := printed(row))] for name, deck in decks.items()}
    curves = {name: fitted(list(chain.from_iterable(found))) for name, found in cases.items()}
    lines = ["# Probabilities of one world by the curve of the other", "", f"    {command}", ""]
    lines += [
        f"mount-cosim {cosim.__version__}; "
        + "; ".join(
            f"{name}: seed {deck['seed']}, code {deck['code'][:16]}, {sum(map(len, cases[name]))} probabilities in "
            f"{len(cases[name])} cases"
            for name, deck in decks.items()
        )
        + ". Asked: at most 0.05 in each world with a curve fitted in the other.",
        "",
        "| world | as printed | curve fitted in the other (offset, slope) | by that curve |",
        "| --- | --- | --- | --- |",
    ]
    for here, there in permutations(decks):
        curve = curves[there]
        numbers = f"{there}: {curve[0]:.2f}, {curve[1]:.2f}"
        before, after = (told(error(cases[here], one)) for one in (AS_PRINTED, curve))
        lines.append(f"| {here} | {before} | {numbers} | {after} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()

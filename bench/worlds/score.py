"""Score diagnoses against sealed truths, of the machines here and of the foreign generator (same file format).

    python bench/worlds/score.py --truth DIR_truth --results RESULTS [--json out.json] [--markdown out.md] [--cases]

RESULTS holds CASE.json in the format of diagnosis.json. What is missing or unreadable counts as wrong.
"""

import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that it runs as a file as well as a module

from bench.worlds.marking import score, summary


def told(x):
    """Write a share with its interval."""
    return "-" if x is None else f"{x['share']:.2f} [{x['low']:.2f}, {x['high']:.2f}] ({x['hits']}/{x['n']})"


def _plain(x):
    return "-" if x is None else f"{x:.3g}"


def markdown(s):
    """Write the summary as tables."""
    c = s["calibration"]
    main = [
        ("cases (missing)", f"{s['cases']} ({s['missing']})"),
        ("singles: right name first", told(s["single"])),
        ("singles: right, or what the truth cannot tell from it", told(s["single_or_twin"])),
        ("singles: in the set", told(s["single_in_set"])),
        ("mean size of the set", _plain(s["mean_set"])),
        ('singles answered "none"', told(s["single_none"])),
        ('singles answered "unknown"', told(s["single_unknown"])),
        ("nulls: false alarms", told(s["false_alarms"])),
        ("nulls: an effect named", told(s["false_names"])),
        ('unknown: "unknown" first', told(s["unknown"])),
        ('unknown: "unknown" among the words', told(s["unknown_said"])),
        ("pairs, triples: precision", told(s["several_precision"])),
        ("pairs, triples: recall", told(s["several_recall"])),
        ("pairs, triples: exactly right", told(s["several_all"])),
        (
            "calibration error (10 bins)",
            f"{_plain(c['ece'])} (printed {_plain(c['mean'])}, right {_plain(c['right'])}, n = {c['n']})",
        ),
        (
            "removable held-out error removed, median",
            f"{_plain(s['closed_median'])} (n = {s['closed_cases']}, without a gap {s['without_gap']})",
        ),
        ('bounds of "not seen" that hold', told(s["bounds_hold"])),
    ]
    lines = ["| | |", "|---|---|", *[f"| {a} | {b} |" for a, b in main]]
    for by in ("level", "family", "machine", "card", "law", "rate"):
        lines += [
            "",
            f"| singles by {by} | right name first |",
            "|---|---|",
            *[f"| {k} | {told(v)} |" for k, v in s[f"single_by_{by}"].items()],
        ]
    for by in ("kind", "level"):
        lines += [
            "",
            f"| unknown by {by} | said |",
            "|---|---|",
            *[f"| {k} | {told(v)} |" for k, v in s[f"unknown_by_{by}"].items()],
        ]
    lines += ["", "| family | answered instead |", "|---|---|"]
    lines += [
        f"| {f} | {', '.join(f'{k} {n}' for k, n in wrong.most_common())} |"
        for f, wrong in s["wrong_names"].items()
        if wrong
    ]
    lines += ["", "| broken bound | true | bound |", "|---|---|---|"] if s["bounds_broken"] else []
    lines += [f"| {b['case']} {b['effect']} | {b['true']:.3g} | {b['bound']:.3g} |" for b in s["bounds_broken"]]
    return "\n".join(lines) + "\n"


def _line(r):
    """Say what became of a case, on one line."""
    what = "+".join(r["effects"]) or "none"
    machine = f"{r['machine']} {r['law']}/{r['card']} {r['rate']:.0f} Hz"
    answer = f"{'ok' if r['right'] else '--'} {'+'.join(r['verdict'])} p={_plain(r['p'])} closed={_plain(r['closed'])}"
    return f"{r['case']} {what} {r['kind']} {r['level']} ({machine}): {answer}"


def main():
    """Read the command line and print."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--truth", required=True, type=Path)
    p.add_argument("--results", required=True, type=Path)
    p.add_argument("--json", type=Path)
    p.add_argument("--markdown", type=Path)
    p.add_argument("--cases", action="store_true", help="one line a case as well")
    p.add_argument("--only-present", action="store_true", help="leave out cases without a result (an unfinished run)")
    a = p.parse_args()
    rows = [r for r in score(a.truth, a.results) if not (a.only_present and r["missing"])]
    if not rows:
        raise SystemExit(f"{a.truth} holds no truth that has a result")
    s = summary(rows)
    if a.json:
        a.json.write_text(json.dumps({"summary": s, "rows": rows}, indent=1), "utf-8")
    if a.markdown:
        a.markdown.write_text(markdown(s), "utf-8")
    print(markdown(s))
    for r in rows if a.cases else ():
        print(_line(r))


if __name__ == "__main__":
    main()

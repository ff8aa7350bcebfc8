"""Public logs of many tools, and what `cosim show` makes of them: read rightly, asked, refused or misread.

    python bench/public_logs.py --logs FOLDER --truth bench/public_logs.tsv --out PAGE

The logs are not stored here: the truth table names repository and path of each. It says what a log holds by its
repository's documents and code, read with other tools: duration [s] and range of torque, position and speed in SI
units, and the answers that whoever owns the machine can give. A log is shown without options; then each question is
answered, and only what was asked. A range that is wrong although nothing was asked is a silent misreading.
`--before scores.json` sets the outcomes of an earlier version, scored with `--cosim` and `--scores`, in a column of
the page.
"""

import argparse
import csv
import json
import re
import resource
import shlex
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from cosim.support.version import __version__

ROLES = ("tau", "q", "v", "q_d")
OPTIONS = ("columns", "units", "layout")
KEYS = {
    "columns": ("t", *ROLES),
    "units": ("t", *ROLES),
    "layout": ("period", "decimal", "separator", "header", "nan", "repeated"),
}
LONGEST = 20.0
"""Seconds of a processor within which a log is answered, read or refused."""
ROUNDS = 6
"""Times that questions are answered; later ones follow from earlier answers."""
CLOSE = 0.01
"""Difference of a range that counts as equal, relative to it: any wrong unit is further off."""
OUTCOMES = {
    "read": "read rightly without an option",
    "stated": "read rightly once an assumption that is stated with its option is corrected",
    "asks": "asked, and read rightly with the options that decide",
    "says": "not readable; the refusal says why or what to do",
    "refused": "refused, or not usable with the options that decide",
    "misread": "silently misread",
    "slow": f"more than {LONGEST:.0f} s",
    "crash": "a traceback",
}
RIGHT = ("read", "stated", "asks")
Asked = set[tuple[str, str]]


@dataclass
class Answer:
    """What one call of `cosim show` says: facts, or an error; which column serves as what; who is asked for what."""

    facts: dict[str, str] = field(default_factory=dict)
    error: str = ""
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    seconds: float = 0.0

    def asked(self) -> Asked:
        """Return the options that questions name, as (option, key)."""
        texts = [text for name, text in self.facts.items() if name.startswith(("undecided", "as an axis"))]
        return _named([*texts, self.error])

    def stated(self) -> Asked:
        """Return the options that notes name: assumptions that can be corrected."""
        return _named([text for name, text in self.facts.items() if name.startswith("note")])

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.facts.get("duration", "nan").split()[0])


@dataclass
class Score:
    """The outcome for one log and one sentence about it."""

    file: str
    outcome: str
    line: str
    seconds: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=Path, required=True)
    parser.add_argument("--truth", type=Path, required=True)
    parser.add_argument("--cosim", default=f"{sys.executable} -m cosim", help="the command to score")
    parser.add_argument("--scores", type=Path, help="write the scores here as JSON")
    parser.add_argument("--before", type=Path, help="scores of an earlier version")
    parser.add_argument("--only", nargs="*", default=[], help="files to score")
    parser.add_argument("--out", type=Path, help="write public_logs.md and public_logs.tsv into this folder")
    options = parser.parse_args()
    truths = [one for one in read_truth(options.truth) if not options.only or one["file"] in options.only]
    scores = []
    for truth in truths:
        scores.append(score(options.logs / truth["file"], truth, shlex.split(options.cosim)))
        print(f"{scores[-1].file:32} {scores[-1].outcome:8} {scores[-1].line}", flush=True)
    print(summary(scores))
    if options.scores:
        options.scores.write_text(json.dumps([asdict(one) for one in scores], indent=1), "utf-8")
    if options.out:
        before = json.loads(options.before.read_text("utf-8")) if options.before else []
        write(options.out, truths, scores, {one["file"]: Score(**one) for one in before})


def read_truth(path: Path) -> list[dict[str, str]]:
    """Return the rows of a truth table."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))


def score(path: Path, truth: Mapping[str, str], command: Sequence[str]) -> Score:
    """Show a log, answer what is asked of its owner, and compare what is read with the truth."""
    answers = {name: pairs(truth[name]) for name in OPTIONS}
    given: dict[str, dict[str, str]] = {name: {} for name in OPTIONS}
    asked: Asked = set()
    stated: Asked = set()
    path = path.with_name(path.name + truth["take"])
    first = seen = show(path, given, command)
    slowest = first.seconds
    for step in range(ROUNDS):
        asked |= seen.asked()
        stated |= seen.stated()
        more = _reply(answers, given, asked | stated)
        if not more and step and given["columns"] == answers["columns"]:
            break
        given = more or {**given, "columns": dict(answers["columns"])}
        seen = show(path, given, command)
        slowest = max(slowest, seen.seconds)
    outcome, line = _judge(truth, first, seen, asked, stated)
    if truth["take"] and outcome == "read":
        outcome, line = "asks", f"which of its recordings, {truth['take']}"
    if slowest > LONGEST:
        outcome = "slow"
    return Score(truth["file"], outcome, line, round(slowest, 2))


def show(path: Path, given: Mapping[str, Mapping[str, str]], command: Sequence[str]) -> Answer:
    """Call `cosim show --json` with options."""
    said = [part for name, one in given.items() for key, text in one.items() for part in (f"--{name}", f"{key}={text}")]
    started = _busy()
    try:
        done = subprocess.run(
            [*command, "show", "--json", path.name, *said],
            cwd=path.parent,
            capture_output=True,
            text=True,
            timeout=6 * LONGEST,
        )
    except subprocess.TimeoutExpired:
        return Answer(error="no answer", seconds=6 * LONGEST)
    seconds = _busy() - started
    if done.returncode or not done.stdout.lstrip().startswith("{"):
        return Answer(error=(done.stderr or done.stdout).strip(), seconds=seconds)
    told = json.loads(done.stdout)
    rows = told.get("columns", [])
    ranges = {row["serves as"].split(" ")[0]: (float(row["least"]), float(row["greatest"])) for row in rows}
    facts = {name: str(value) for name, value in told.items() if not isinstance(value, list)}
    facts["names"] = ", ".join(str(row["column"]) for row in rows)
    return Answer(facts, "" if rows else "; ".join(facts.values()), ranges, seconds)


def _busy() -> float:
    """Time of a processor that commands took so far [s]: other work on the machine costs none."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def pairs(text: str) -> dict[str, str]:
    """Return options as they are typed, `q=deg 'tau=0.1 N.m'`, by key."""
    return dict(one.split("=", 1) for one in shlex.split(text))


def _named(texts: Sequence[str]) -> Asked:
    """Return which keys of which options sentences name."""
    named: Asked = set()
    for chunk in (part for text in texts for part in text.split("--")[1:]):
        option = chunk.split(None, 1)[0] if chunk.split() else ""
        for key in KEYS.get(option, ()):
            if re.search(rf"(?:^|[\s'\"]){key}=", chunk):
                named.add((option, key))
    return named


def _reply(
    answers: Mapping[str, Mapping[str, str]], given: Mapping[str, Mapping[str, str]], asked: Asked
) -> dict[str, dict[str, str]]:
    """Add the answers to what was asked; an empty dictionary where there is nothing to add."""
    more = {
        name: {key: text for key, text in one.items() if key in given[name] or (name, key) in asked}
        for name, one in answers.items()
    }
    return {} if more == given else more


def _judge(truth: Mapping[str, str], first: Answer, last: Answer, asked: Asked, stated: Asked) -> tuple[str, str]:
    said = " ".join([*first.facts.values(), first.error, *last.facts.values(), last.error])
    if "Traceback" in said:
        return "crash", said[-200:]
    questions = {key for _, key in asked}
    wrong = _wrong(truth, first)
    if questions and "as an axis" in first.facts:  # which channels are joined, and so its length, is still open
        wrong.pop("t", None)
    silent = [text for key, text in wrong.items() if not ({key, *_clock(key)} & {*questions, *(k for _, k in stated)})]
    if first.ranges and silent:
        return "misread", "; ".join(silent)
    if truth["refusal"]:
        fits = bool(re.search(truth["refusal"], said))
        return ("says" if fits else "refused"), said.strip()[:160]
    if last.error:
        return "refused", last.error[:160]
    left = {
        key: text for key, text in _wrong(truth, last).items() if truth.get(key) or key == "t" or key not in questions
    }
    if left:
        units = {key for option, key in asked | stated if option != "columns"}
        unasked = [text for key, text in left.items() if not ({key, *_clock(key)} & units)]
        return ("misread" if unasked else "refused"), "; ".join(left.values())
    if truth["axis"] == "yes" and "as an axis" in last.facts:
        return "refused", last.facts["as an axis"][:160]
    if not wrong and not (questions - _unanswerable(truth)):
        return "read", ""
    named = ", ".join(sorted({f"--{option} {key}" for option, key in asked if pairs(truth[option]).get(key)}))
    if named:
        return "asks", named
    return ("stated" if wrong else "read"), ", ".join(sorted(f"--{option} {key}" for option, key in stated))


def _clock(key: str) -> tuple[str, ...]:
    """Return the options that decide a time."""
    return ("period",) if key == "t" else ()


def _unanswerable(truth: Mapping[str, str]) -> set[str]:
    """Return the roles that a log has no column for: that they are asked is no question to its owner."""
    had = {key for name in OPTIONS for key in pairs(truth[name])}
    return {key for key in ("tau", "q", "v", "q_d", "t", "period") if key not in had}


def _wrong(truth: Mapping[str, str], seen: Answer) -> dict[str, str]:
    """Say which of the roles that are served, and whether the time, differ from the truth."""
    if not seen.ranges:
        return {}
    found: dict[str, str] = {}
    for role in ROLES:
        if role not in seen.ranges:
            needed = role in ("tau", "q") or (role == "v" and not truth["q"])
            if truth[role] and needed and "as an axis" not in seen.facts:
                found[role] = f"{role} is not served"
            continue
        if role == "q_d" and not truth["q_d"]:
            continue
        low, high = seen.ranges[role]
        if not truth[role]:
            found[role] = f"{role} is taken from a column that is none"
        elif not _equal((low, high), tuple(float(part) for part in truth[role].split(".."))):
            found[role] = f"{role} is {low:.6g} to {high:.6g}, not {truth[role]}"
    if truth["duration"] and not _equal((0.0, seen.duration), (0.0, float(truth["duration"]))):
        found["t"] = f"it lasts {seen.duration:.6g} s, not {float(truth['duration']):.6g} s"
    return found


def _equal(seen: Sequence[float], true: Sequence[float]) -> bool:
    size = max(abs(value) for value in (*true, *seen)) or 1.0
    return all(abs(a - b) <= CLOSE * size for a, b in zip(seen, true, strict=True))


def summary(scores: Sequence[Score]) -> str:
    """Count the outcomes in one line."""
    counts = Counter(one.outcome for one in scores)
    right = sum(counts[name] for name in RIGHT)
    told = ", ".join(f"{counts[name]} {name}" for name in OUTCOMES if counts[name])
    return f"{len(scores)} logs: {told}; {right / max(len(scores), 1):.0%} read rightly or asked"


def write(out: Path, truths: Sequence[Mapping[str, str]], scores: Sequence[Score], before: Mapping[str, Score]) -> None:
    """Write the page and the table."""
    out.mkdir(parents=True, exist_ok=True)
    lines = ["\t".join(["file", "repository", "path", "tool", "kind", "holds", "before", "now", "line"])]
    for truth, one in zip(truths, scores, strict=True):
        old = before[one.file].outcome if one.file in before else ""
        cells = [truth[name] for name in ("file", "repository", "path", "tool", "kind", "says")]
        lines.append("\t".join(cell.replace("\t", " ") for cell in [*cells, old, one.outcome, one.line.split("\n")[0]]))
    (out / "public_logs.tsv").write_text("\n".join(lines) + "\n", "utf-8")
    (out / "public_logs.md").write_text("\n".join(page(truths, scores, before)) + "\n", "utf-8")


def page(truths: Sequence[Mapping[str, str]], scores: Sequence[Score], before: Mapping[str, Score]) -> list[str]:
    """Return the lines of the page."""
    old = Counter(before[one.file].outcome for one in scores if one.file in before)
    now = Counter(one.outcome for one in scores)
    tools = len({truth["tool"] for truth in truths})
    lines = [
        "# Public logs",
        "",
        "    python bench/public_logs.py --logs FOLDER --truth bench/public_logs.tsv --before BEFORE.json --out PAGE",
        "",
        f"mount-cosim {__version__}. {len(scores)} logs of {tools} tools from public repositories, found by search;",
        "they are not stored here, [public_logs.tsv](public_logs.tsv) names repository and path of each, what it",
        "holds, and both outcomes. bench/public_logs.tsv is what they hold by their repositories' documents and code,",
        "read with other tools: ranges in SI units, and the answers that an owner can give. Only what is asked is",
        "answered.",
        "*Before* is commit 2ad1e55, which was scored on the logs that were found first. Nothing in the code knows a",
        "name of these files, but they were at hand while it was written: they show what kinds are read, not how often",
        "an unknown log is.",
        "",
        "| outcome | means | before | now |",
        "| --- | --- | --- | --- |",
        *(f"| {name} | {text} | {old[name]} | {now[name]} |" for name, text in OUTCOMES.items()),
        "",
        f"Read rightly or asked: {sum(old[name] for name in RIGHT)} before, {sum(now[name] for name in RIGHT)} now, of "
        f"{len(scores)}. Slowest: {max((one.seconds for one in scores), default=0):.1f} s.",
    ]
    worse = [one for one in scores if one.outcome not in (*RIGHT, "says")]
    if worse:
        lines += ["", "| not right today | outcome | what |", "| --- | --- | --- |"]
        lines += [f"| {one.file} | {one.outcome} | {one.line.splitlines()[0] if one.line else ''} |" for one in worse]
    return lines


if __name__ == "__main__":
    main()

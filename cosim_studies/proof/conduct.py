"""A proof from its seed to its page: deal, play what is not played yet on all cores, score, write."""

import hashlib
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import sleep

from cosim.diagnosis.decide.calibration import OFFSET, SLOPE
from cosim.support.cell import cores
from cosim.support.cells import MOST
from cosim.support.errors import ProofError
from cosim.support.journal import Journal
from cosim.support.plain import Parsed
from cosim.support.version import __version__
from cosim_studies.proof.cases import CaseSpec, cases_of
from cosim_studies.proof.page import MADE, proof, write
from cosim_studies.proof.play import CaseRunner, Tool
from cosim_studies.proof.seal import Row, Seals
from cosim_studies.proof.tool import answer

OnProgress = Callable[[int, int, str], None]
"""Called after each case with cases done, cases in all, and what was the last."""
GENERATOR = "home"
"""What the list of benchmarks calls the generator of this package."""
LEAST_SECONDS = 10.0
"""Shorter recordings hold less than a soft start and a swing."""
ROOMS = ("cosim/diagnosis", "cosim_studies/proof", "cosim/estimation", "pyfmi_models")
"""Where the code lies that decides the scores."""
TELLS = ("cosim/report",)
"""What tells an answer that was given; nothing in it decides, so a better sentence does not age a page of scores."""


@dataclass(frozen=True)
class Benchmark:
    """What is played: seed, cases, seconds of each recording, how rough machines are."""

    seed: int
    cases: int
    seconds: float = 60.0
    rough: bool = False
    """Whether machines are not quite what equations say, see rough.py."""

    @property
    def generator(self) -> str:
        """What the list of benchmarks calls it."""
        return f"{GENERATOR}, rough" if self.rough else GENERATOR


def conduct(
    benchmark: Benchmark,
    out: Path,
    *,
    workers: int | None = None,
    force: bool = False,
    on_seal: Callable[[str], None] = lambda text: None,
    on_progress: OnProgress = lambda done, of, last: None,
    tool: Tool = answer,
    command: str = "",
) -> Parsed:
    """Run a benchmark, or what is left of it, write everything into `out`, and return what `proof.json` holds.

    Args:
        benchmark: what is played.
        out: folder; a proof begun there with the same seed and code is continued, also to more cases.
        workers: cases at a time; the cores of this machine where not given.
        force: start over.
        on_seal: told each seal before the tool runs.
        on_progress: called after each case.
        tool: what is tested.
        command: what the page says it was made by.

    Raises:
        ProofError: a wish cannot be met, or a seal is broken.
        OutputError: `out` holds another proof.
    """
    check(benchmark, workers)
    wanted = cases_of(benchmark.seed, benchmark.cases)
    identity = {
        "generator": benchmark.generator,
        "seed": str(benchmark.seed),
        "seconds": str(benchmark.seconds),
        "version": __version__,
        "code": code(),
    }
    with ExitStack() as stack:
        journal = stack.enter_context(Journal(out, identity, force, "proof", MADE))
        runner = CaseRunner(
            benchmark.seed, benchmark.seconds, Seals(out / "seals.jsonl"), on_seal, tool, benchmark.rough
        )
        rest = [case for case in wanted if case.number not in journal.rows]
        facts = {
            **identity,
            "seed": benchmark.seed,
            "seconds": benchmark.seconds,
            "cases": benchmark.cases,
            "command": command,
        }
        facts["calibration"] = [OFFSET, SLOPE]
        result = stack.enter_context(_written(out, journal, runner.seals, facts))
        rows = stack.enter_context(closing(_played(runner, rest, workers or cores())))
        for done, row in enumerate(rows, benchmark.cases - len(rest) + 1):
            runner.seals.write_answer(row)
            journal.append(row)
            on_progress(done, benchmark.cases, _last(row))
    return result


def check(benchmark: Benchmark, workers: int | None) -> None:
    """Refuse wishes that cannot be met (raises ProofError)."""
    wished = (("--cases", benchmark.cases, 1), ("--seed", benchmark.seed, 0), ("--workers", workers, 1))
    for name, value, least in wished:
        if value is not None and value < least:
            raise ProofError(f"{name} {value}: it must be at least {least}.", culprit=name, value=value)
    if workers is not None and workers > MOST:
        raise ProofError(f"--workers {workers}: {MOST:,} are the most.", culprit="--workers", value=workers)
    if benchmark.seconds < LEAST_SECONDS:
        text = f"--seconds {benchmark.seconds:g}: a recording must last {LEAST_SECONDS:g} s at least."
        raise ProofError(text, culprit="--seconds", value=benchmark.seconds)


def code() -> str:
    """SHA-256 of the code that decides the scores."""
    home = Path(__file__).parents[2]
    files = [path for room in ROOMS for path in (home / room).rglob("*") if path.suffix in (".py", ".c")]
    whole = hashlib.sha256()
    told = {home / one for one in TELLS}
    for path in sorted(path for path in files if not told & {path, *path.parents}):
        whole.update(f"{path.relative_to(home).as_posix()}\n".encode() + path.read_bytes())
    return whole.hexdigest()


def _played(table: CaseRunner, wanted: Sequence[CaseSpec], workers: int) -> Generator[Row, None, None]:
    """Yield the rows as they come; when this is closed early, what is still played is lost."""
    threads = ThreadPoolExecutor(workers, "proof")
    pending = [threads.submit(table.play, case) for case in wanted]
    try:
        for future in as_completed(pending):
            yield future.result()
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
        while not all(future.done() for future in pending):
            table.close()  # again and again: a thread may just have begun a process
            sleep(0.05)
        table.close()


@contextmanager
def _written(out: Path, journal: Journal, seals: Seals, facts: Parsed) -> Iterator[Parsed]:
    """Score and write what is done when the block ends, however it ends."""
    result: Parsed = {}
    try:
        yield result
    finally:
        rows: list[Row] = [row for number, row in sorted(journal.rows.items()) if number < facts["cases"]]
        if rows:
            seals.check(rows)
            seals.check_answers(rows)
            result |= proof(rows, facts)
            write(out, result)


def _last(row: Row) -> str:
    said = " + ".join(row["answer"]["verdict"]) or "none" if row["status"] == "ok" else row["status"]
    return f"case {row['run']}: {' + '.join(row['effects']) or 'none'}, answered {said}"

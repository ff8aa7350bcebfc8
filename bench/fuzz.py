"""Random calls of the C interface for long, as shipped, under sanitizers and under valgrind: docs/testing_fmus.md.

python bench/fuzz.py --watch plain --examples 1000 --seed 7
python bench/fuzz.py --examples 200 --seed 1 --out FOLDER      (all three; writes a page)

Each watcher is first shown planted errors, to see that it sees them.
"""

import argparse
import platform
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import hypothesis

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/tools"))
import fuzz_models
from fuzz_calls import functions
from fuzz_models import MODELS, PLANTED, Planted, Played

import cosim
from pyfmi_models.export.build import compile_shared, sources_of, units_of
from pyfmi_models.export.platforms import PLATFORMS, host

COMMAND = "python bench/fuzz.py"
GCC = ("gcc", "-std=c11", "-g", "-O1", "-ffp-contract=off", "-fno-omit-frame-pointer", "-shared", "-fPIC")
SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
VALGRIND = ("valgrind", "--leak-check=full", "--show-leak-kinds=definite,indirect", "--num-callers=30", "--xml=yes",
            "--xml-file=valgrind.xml")  # fmt: skip


@dataclass(frozen=True)
class Watcher:
    """A way to look at a run: what it is, how the library is built, how a player is started, its share of examples."""

    title: str
    build: Callable[[dict[str, bytes], Path], Path]
    play: Callable[..., Played]
    share: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--watch", choices=WATCHERS, action="append", help="may be repeated; default: all")
    parser.add_argument("--examples", type=int, default=100, help="programs a model and version of FMI")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rows, text = list[tuple[str, ...]](), ""
    with tempfile.TemporaryDirectory() as folder:
        for name in options.watch or WATCHERS:
            for row in watched(name, options, Path(folder)):
                rows.append(row)
                text = page(rows, " ".join([COMMAND, *sys.argv[1:]]))
                if options.out:  # what is done is kept if the rest is not
                    options.out.mkdir(parents=True, exist_ok=True)
                    (options.out / "fuzz.md").write_text(text, "utf-8")
    print(text)
    sys.exit(any(row[-1] in ("FAILED", "NOT SEEN") for row in rows))


def watched(name: str, options: argparse.Namespace, folder: Path) -> Iterator[tuple[str, ...]]:
    """Rows of (watcher, model, FMI, programs, calls, granted, functions, seconds, result)."""
    watcher = WATCHERS[name]
    for planted in [one for one in PLANTED if name in one.seen_by]:
        played = run(watcher, planted.model, 3, int(200 * watcher.share), options.seed, folder, planted)
        seen = "seen" if played.code else "NOT SEEN"
        print(f"{name}: planted error, {planted.what}: {seen}", file=sys.stderr)
        yield name, f"{planted.model} with a planted error: {planted.what}", "3", "", "", "", "", "", seen
    for model, fmi in product(MODELS, (2, 3)):
        begun, examples = time.monotonic(), max(1, int(options.examples * watcher.share))
        played = run(watcher, model, fmi, examples, options.seed, folder)
        print(f"{name}: {model}, FMI {fmi}: {played.reason if played.code else 'clean'}", file=sys.stderr)
        calls, granted = (f"{played.counts.get(key, 0):,}" for key in ("calls", "granted"))
        met = f"{len({*played.counts.get('functions', ())} & {*functions(fmi)})} of {len(functions(fmi))}"
        seconds, result = f"{time.monotonic() - begun:.0f}", "FAILED" if played.code else "clean"
        yield name, model, str(fmi), str(examples), calls, granted, met, seconds, result


def run(watcher: Watcher, model: str, fmi: int, examples: int, seed: int, folder: Path,
        planted: Planted | None = None) -> Played:  # fmt: skip
    generated = fuzz_models.code_of(model)
    sources = sources_of(generated)
    library = watcher.build(planted(sources) if planted else sources, folder)
    return watcher.play(fuzz_models.facts_of(generated, library, fmi, shrink=not planted), folder, examples, seed)


def shipped(sources: dict[str, bytes], folder: Path) -> Path:
    """The library as an archive holds it."""
    machine = PLATFORMS[host()]
    return compile_shared(sources, f"played{machine.suffix}", machine.target)


def by_gcc(*flags: str) -> Callable[[dict[str, bytes], Path], Path]:
    """A way to build with gcc and these flags, with names of functions for the reports."""

    def build(sources: dict[str, bytes], folder: Path) -> Path:
        own = Path(tempfile.mkdtemp(dir=folder))
        for name, content in sources.items():
            (own / name).write_bytes(content)
        subprocess.run([*GCC, *flags, *units_of(sources), "-o", "played.so", "-lm"], cwd=own, check=True)
        return own / "played.so"

    return build


def under_sanitizers(facts: dict[str, Any], folder: Path, examples: int, seed: int) -> Played:
    """The first finding ends the process. Python's own leaks are not looked for: valgrind looks for ours."""
    found = subprocess.run(["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    return fuzz_models.play(facts, folder, examples, seed, LD_PRELOAD=found.stdout.strip(), PYTHONMALLOC="malloc",
                            ASAN_OPTIONS="detect_leaks=0", UBSAN_OPTIONS="print_stacktrace=1")  # fmt: skip


def under_valgrind(facts: dict[str, Any], folder: Path, examples: int, seed: int) -> Played:
    """What valgrind reports counts where our library is on the stack."""
    played = fuzz_models.play(facts, folder, examples, seed, VALGRIND, PYTHONMALLOC="malloc")
    findings = list(concerning(facts["library"], folder / "valgrind.xml"))
    return replace(played, code=99, text="\n".join(findings)) if findings and not played.code else played


def concerning(library: str, report: Path) -> Iterator[str]:
    """Findings of valgrind with a frame of the library: what it is, and where."""
    for error in ET.parse(report).getroot().iter("error"):
        frames = [frame for frame in error.iter("frame") if frame.findtext("obj") == library]
        if frames:
            what = error.findtext("what") or error.findtext("xwhat/text")
            names = (f"{one.findtext('fn')} ({one.findtext('file')}:{one.findtext('line')})" for one in frames)
            yield f"{what}: {' < '.join(names)}"


WATCHERS = {
    "plain": Watcher("the library as shipped", shipped, fuzz_models.play, 1.0),
    "sanitizers": Watcher("gcc " + " ".join(SANITIZERS), by_gcc(*SANITIZERS), under_sanitizers, 1.0),
    "valgrind": Watcher(" ".join(VALGRIND[:3]), by_gcc(), under_valgrind, 0.1),
}


def version_of(command: str) -> str:
    return subprocess.run([command, "--version"], capture_output=True, text=True, check=False).stdout.splitlines()[0]


def page(rows: list[tuple[str, ...]], command: str) -> str:
    lines = [
        "# Random calls of the C interface",
        "",
        f"    {command}",
        "",
        f"mount-cosim {cosim.__version__}, Python {platform.python_version()}, hypothesis {hypothesis.__version__}, "
        f"{platform.machine()}; {version_of('gcc')}; {version_of('valgrind')}. How it is done and what must hold: "
        "docs/testing_fmus.md. A planted error is one put into the C for this run, to "
        "see that the watcher sees it.",
        "",
        *(f"- {name}: {watcher.title}" for name, watcher in WATCHERS.items() if name in {row[0] for row in rows}),
        "",
        "| watched by | model | FMI | programs | calls | granted | functions met | s | result |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
        *("| " + " | ".join(row) + " |" for row in rows),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()

"""The command of each page of `results/`: python bench/rebuild.py [WORD ...] prints them, --run runs them one by one.

    python bench/rebuild.py                     every page and its command
    python bench/rebuild.py master/fmu_step     those whose name holds a word
    python bench/rebuild.py fmu_step --run      run it, make pictures small (bench/slim.py), write SCORES.md

FOLDER is where measured recordings or models of others lie, PYTHON an interpreter with tools of others; a command with
a word in capitals is printed, not run. Afterwards `bench/slim.py` makes small what is committed, and `bench/scores.py`
sums up.
"""

import argparse
import re
import shlex
import subprocess
import sys
from pathlib import Path

HOME = Path(__file__).parents[1]
RESULTS = HOME / "results"
BENCH = "python bench/{} --out results/{}"
PAGES = {
    "abroad/README.md": "python bench/abroad.py --data FOLDER --python PYTHON --cases 10 --nulls 100 --seed 1110855611"
    " --out results/abroad --decks results/decks.md",
    "abroad/calibration.md": "python bench/calibration.py DECK/proof.json --played 0 1 --out results/abroad",
    "abroad/calibration_crossed.md": "python bench/calibration_crossed.py ABROAD.json PROOF.json --out results/abroad",
    "abroad/calibration_sets.md": "python bench/calibration_sets.py COMMIT:results/proof/proof.json"
    " --out results/abroad",
    "exchange/README.md": BENCH.format("exchange.py", "exchange"),
    "exchange/archive.md": BENCH.format("archive.py", "exchange"),
    "exchange/archives.md": "python bench/exchange.py --copies FOLDER --out results/exchange",
    "exchange/initialisation.md": BENCH.format("initialisation.py", "exchange"),
    "exchange/simulators.md": "python bench/simulators.py --data FOLDER --out results/exchange",
    "hardware/README.md": BENCH.format("hardware.py", "hardware"),
    "hardware/firmware.md": BENCH.format("firmware.py", "hardware"),
    "identify/README.md": BENCH.format("identification.py --seed 100", "identify"),
    "identify/foreign_calibration.md": "python bench/foreign_calibration.py --fmus DIR --out results/identify"
    " && python bench/foreign_machine.py --data DIR --out results/identify",
    "identify/modelica.md": "python bench/modelica_calibration.py edrive_mass.fmu --out results/identify/modelica.json",
    "investigate/README.md": BENCH.format("investigate.py --seed 544123761 --cases 48", "investigate"),
    "investigate/limits.md": BENCH.format("investigate_limits.py --runs 1000 --seed 1950420578", "investigate"),
    "learned/README.md": "python bench/learned_terms.py --cases 3 --nulls 100 --seed 431857433 --data FOLDER"
    " --python PYTHON --abroad 20 --out results/learned --decks results/decks.md",
    "learned/baselines.md": "python bench/learned_baselines.py --seed 1654548142 --cases 22 --out results/learned",
    "learned/before.md": "git checkout 80ca04f && python bench/learned_terms.py --seed 1911 --out FOLDER",
    "master/README.md": BENCH.format("master_step.py", "master"),
    "master/before.md": "python bench/master_before.py --before OLD --pairs 7 --steps 500000 --out results/master",
    "master/coupling.md": BENCH.format("coupling.py", "master"),
    "master/engine.md": "python -m bench.engine --before OLD --out results/master",
    "master/demo.md": BENCH.format("demo_time.py", "master"),
    "master/diagnosis_cost.md": BENCH.format("diagnosis_cost.py", "master"),
    "master/fmu_step.md": BENCH.format("fmu_step.py", "master"),
    "master/memory.md": BENCH.format("memory.py", "master"),
    "master/step_parts.md": BENCH.format("step_parts.py", "master"),
    "master/parallel.md": BENCH.format("parallel_step.py --rounds 60", "master"),
    "master/sweep.md": BENCH.format("sweep.py --runs 250 --rounds 4", "master"),
    "master/two_axis.md": BENCH.format("two_axis.py", "master"),
    "measured/README.md": "python bench/diagnosis.py measured --data FOLDER --out results/measured",
    "measured/corrupted.md": "python bench/corrupted.py --data FOLDER --out results/measured",
    "measured/emps.md": "python bench/diagnosis.py emps --data FOLDER --out results/measured",
    "measured/machines.md": "python bench/machines.py --data FOLDER --out results/measured",
    "measured/public_logs.md": "python bench/public_logs.py --logs FOLDER --truth bench/public_logs.tsv"
    " --out results/measured",
    "paper/README.md": "cosim paper --out results/paper --full --force",
    "proof/README.md": "cosim prove --cases 80 --seed 1129015731 --seconds 60 --out results/proof",
    "proof/rough.md": "cosim prove --rough --cases 150 --seed 1129015531 --seconds 60 --out rough"
    " && sed '/^!.*svg)$/d; /^## Others/,/^## By what rubbed/{/^## By/!d}' rough/README.md > results/proof/rough.md"
    " && cp rough/proof.json results/proof/rough.json",
    "proof/baselines.md": "cosim prove --cases 60 --seed 1515801327 --seconds 60 --out baselines"
    " && cp baselines/README.md results/proof/baselines.md && cp baselines/proof.json results/proof/baselines.json",
    "proof/bounds.md": BENCH.format("bounds.py --cases 12 --seed 1463892207", "proof"),
    "proof/left_out.md": BENCH.format("leave_one_out.py --cases 2 --seed 898481173", "proof"),
    "proof/null.md": BENCH.format("diagnosis.py null --cases 10 --seed 6000", "proof"),
    "proof/ablation.md": "python bench/ablation.py --home 281127341 --rough 730915562 --cases 120 --out results/proof",
    "proof/sensitivity.md": BENCH.format("sensitivity.py --cases 6 --seed 158358624", "proof"),
    "proof/class_first.md": "cosim prove --rough --cases 150 --seed 881102323 --seconds 60 --out rough"
    " && cosim prove --cases 100 --seed 344864908 --seconds 60 --out home"
    " && python -m bench.class_first rough home --out results/proof",
    "robustness/attack.md": BENCH.format("attack.py --seed 1 --count 5200", "robustness"),
    "robustness/fuzz.md": BENCH.format(
        "fuzz.py --watch plain --watch sanitizers --examples 500 --seed 7", "robustness"
    ),
    "robustness/fuzz_valgrind.md": "python bench/fuzz.py --watch valgrind --examples 80 --out valgrind"
    " && cp valgrind/fuzz.md results/robustness/fuzz_valgrind.md",
    "robustness/kills.md": BENCH.format("kills.py --trials 50 --seed 1920", "robustness"),
    "robustness/mutants.md": BENCH.format(
        "mutants.py --seed 41001 --count 150 --seconds 20 --map MAP --journal FILE"
        " --remarks results/robustness/mutants_remarks.toml",
        "robustness",
    ),
    "robustness/serve.md": BENCH.format("serve.py --drops 100 --rounds 3 --seed 17", "robustness"),
    "stiffness/README.md": "python -m cosim_studies.stiffness --out results/stiffness --force",
}
"""Pages that a command writes. What is read from them stands beside them in causes*.md, by hand."""
OTHERS = re.compile(r"\b[A-Z]{1,}\b")
"""A word that a person must fill in."""


def main() -> None:
    """Print commands, or run them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", metavar="WORD", help="part of a page's name")
    parser.add_argument("--run", action="store_true", help="run what is named, then bench/slim.py and bench/scores.py")
    given = parser.parse_args()
    chosen = {page: one for page, one in PAGES.items() if not given.words or any(word in page for word in given.words)}
    if not chosen:
        parser.error(f"no page has {' or '.join(given.words)} in its name; pages: {', '.join(PAGES)}")
    for page, command in chosen.items():
        print(f"{page}\n    {command}", flush=True)
        if given.run:
            run(page, command)


def run(page: str, command: str) -> None:
    """Rebuild one page and what is committed of it; a failure ends the run with its code."""
    if missing := OTHERS.findall(re.sub(r"results/\S+", "", command)):
        print(f"    not run: {', '.join(missing)} must be filled in", flush=True)
        return
    for part in command.split(" && "):
        words = shlex.split(part)
        words = [sys.executable, *words[1:]] if words[0] == "python" else words
        words = [sys.executable, "-m", *words] if words[0] == "cosim" else words
        done = subprocess.run(words, cwd=HOME, check=False)
        if done.returncode:
            sys.exit(done.returncode)
    for tool in (["slim.py", str(RESULTS / Path(page).parent)], ["scores.py"]):
        subprocess.run([sys.executable, str(HOME / "bench" / tool[0]), *tool[1:]], cwd=HOME, check=True)


if __name__ == "__main__":
    main()

"""What the player of fuzz_fmu.py plays with: models, what it must know about them, and the process that it runs in."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import export_models
from effect_examples import EXAMPLES

from pyfmi_models.card import read_card
from pyfmi_models.export.codegen import Generated, generate

PLAYER = Path(__file__).parent / "fuzz_fmu.py"
STEPS = 200
"""Steps of the solver, or ticks, that one call may take here, so that a step over 1e300 s fails soon."""


def plant():
    """The paper's mount with play, a soft shaft and cogging."""
    effects = tuple(one for one in EXAMPLES if one.id in ("backlash", "compliance", "cogging"))
    return replace(read_card("paper_mount"), effects=effects).plant().model()


def emptying():
    """A level that soon falls below zero, where its root is no number."""
    model = export_models.undefined_below_zero()
    inputs, states = ((replace(group[0], start=start),) for group, start in ((model.inputs, 1.0), (model.states, 0.1)))
    return replace(model, inputs=inputs, states=states)


MODELS: dict[str, Callable[[], Any]] = {
    "plant": plant,
    "controller": lambda: read_card("paper_mount").controller_model(),
    "root": emptying,
    "ticking_root": export_models.root_of_a_count,
}


def limited(generated: Generated) -> Generated:
    """The same model with less patience."""
    code = re.sub(r"\.most_steps = \d+", f".most_steps = {STEPS}", generated.files["model.c"])
    return replace(generated, files={**generated.files, "model.c": code})


def code_of(name: str) -> Generated:
    return limited(generate(MODELS[name]()))


def facts_of(generated: Generated, library: Path, fmi: int, *, shrink: bool = True) -> dict[str, Any]:
    """What a player knows: rows of (name, kind, start, low, high, fixed) by value reference, and sizes.

    With `shrink` a program that fails is made shorter before it is shown.
    """
    rows = [
        [row.variable.name, row.kind, row.variable.start, row.variable.low, row.variable.high, not row.variable.tunable]
        for row in generated.layout.rows
    ]
    period = generated.layout.model.period or 0.0
    return {"library": str(library), "fmi": fmi, "token": generated.token, "variables": rows, "period": period,
            "shrink": shrink, "bytes": 64 + 8 * len(rows) + 8}  # fmt: skip


@dataclass(frozen=True)
class Planted:
    """An error put into a C file to see that it is found: a piece of text and what replaces it."""

    what: str
    file: str
    text: str
    instead: str
    model: str = "root"
    seen_by: tuple[str, ...] = ("plain", "sanitizers")

    def __call__(self, sources: dict[str, bytes]) -> dict[str, bytes]:
        before = sources[self.file].decode()
        assert self.text in before, f"{self.text!r} is not in {self.file}"
        return {**sources, self.file: before.replace(self.text, self.instead).encode()}


MISSING, GETTING = "count && (!references || !values)", 'return fail(instance, FAILED, "getting values'
COPY = "memcpy(*memory, instance->memory, memory_size()"
GAP = 'fail(instance, FAILED, "a step from t = %.17g s leaves a gap: the model is at t = %.17g s", time, now)'
PLANTED = (
    Planted("an output that is no number", "values.c", "if (name) return not_finite", "if (0) return not_finite"),
    Planted("a refusal in silence", "step.c", GAP, "FAILED"),
    Planted("a state that is believed", "memory.c", "if (hash != hash_bytes(bytes, memory_size()))", "if (0)"),
    Planted("a fixed parameter that is set", "values.c", "variable->fixed ? 0 :", "0 ? 0 :", "ticking_root"),
    Planted("half of a step", "step.c", "memory->ticks = before;", "", "ticking_root"),
    Planted("a crash", "values.c", f"if ({MISSING}) {GETTING}", f"if (0) {GETTING}"),
    Planted("a read past the table", "values.c", ">= (uint32_t)", "> (uint32_t)", seen_by=("sanitizers",)),
    Planted("memory that nobody has written", "memory.c", COPY, f"{COPY} - 8", "ticking_root", ("valgrind",)),
    Planted("a leak", "memory.c", "free(*memory);", "", seen_by=("valgrind",)),
)


@dataclass(frozen=True)
class Played:
    """How a player ended: its exit code, what it counted, all that it wrote, its last calls."""

    code: int
    counts: dict[str, Any]
    text: str
    calls: list[str]

    @property
    def reason(self) -> str:
        """What to read after a failure."""
        return f"exit code {self.code}\n{self.text[-6000:]}\nlast calls:\n" + "\n".join(self.calls[-12:])


def play(facts: dict[str, Any], folder: Path, examples: int, seed: int, wrapper: tuple[str, ...] = (),
         timeout: float = 3600, **environment: str) -> Played:  # fmt: skip
    """Run a player in a process of its own; `wrapper` is a command before Python's."""
    trace, told = folder / "trace.txt", folder / "facts.json"
    told.write_text(json.dumps(facts))
    command = [*wrapper, sys.executable, str(PLAYER), str(told), str(trace), str(examples), str(seed)]
    surroundings = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment}
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=surroundings, cwd=folder,
                              timeout=timeout)  # fmt: skip
    except subprocess.TimeoutExpired:
        return Played(-1, {}, f"a call has not returned within {timeout} s", trace.read_text().splitlines())
    counts = json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 else {}
    return Played(done.returncode, counts, done.stdout + done.stderr, trace.read_text().splitlines())

"""One case from its specification to its row: make, seal, ask the tool, open, measure.

A row of `runs.jsonl` and of `proof.json`:
    run, seed, kind, effects, size       what was drawn
    seal, salt, truth              SHA-256 written before the tool ran, and what it seals (`seal.py`)
    status, reason                 "ok", or how the tool ended instead: "crashed", "timeout", "failed"
    answer                         what the tool said (`tool.py`), with the baselines' answers
    ceiling                        held-out RMS of the true structure refitted, or the reason why there is none
    seconds                        {"make", "tool", "ceiling"}
"""

from collections.abc import Callable
from threading import local
from time import perf_counter
from typing import Any

from cosim.support.cell import Cell, LostError
from cosim.support.errors import InputError, ProofError
from cosim.support.plain import Parsed
from cosim.support.scratch import Scratch
from cosim_studies.proof.cases import CaseSpec
from cosim_studies.proof.ceiling import ceiling
from cosim_studies.proof.make import make
from cosim_studies.proof.seal import Row, Seals, salt_of, seal
from cosim_studies.proof.tool import answer

Tool = Callable[[str], Parsed]
"""From a folder with recordings and card to an answer; a function of a module."""
TIMEOUT = 600.0
"""Seconds after which a tool is given up."""


class CaseRunner:
    """Where the cases of a benchmark are run, by several threads at once.

    Args:
        seed: of the benchmark.
        seconds: length of a recording.
        seals: where each truth is sealed.
        on_seal: told each seal before the tool runs.
        tool: what is tested.
        rough: whether machines are not quite what equations say.
    """

    def __init__(
        self,
        seed: int,
        seconds: float,
        seals: Seals,
        on_seal: Callable[[str], None],
        tool: Tool = answer,
        rough: bool = False,
    ) -> None:
        self.rough = rough
        self.seed, self.seconds, self.seals, self.on_seal, self.tool = seed, seconds, seals, on_seal, tool
        self._own, self._cells = local(), list[Cell]()

    def play(self, case: CaseSpec) -> Row:
        """Run one case.

        Raises:
            ProofError: it was sealed before with another truth, or could not be made.
        """
        maker, user = self._processes()
        head = {"run": case.number, "seed": case.seed, "kind": case.kind, "effects": list(case.effects)}
        head |= {"size": case.size}
        with Scratch() as folder:
            begun = perf_counter()
            truth = _made(maker, case, self.seconds, folder, self.rough)
            made = perf_counter() - begun
            opened = self._sealed(case, truth)
            said = _call_tool(user, self.tool, folder)
            knows = bool(truth["effects"]) and said["status"] == "ok"
            best = _ceiling(user, folder, truth, said) if knows else {"seconds": 0.0}
        seconds = {"make": made, "tool": said.pop("seconds"), "ceiling": best.pop("seconds")}
        return head | opened | said | {"ceiling": best.get("answer", best), "seconds": seconds}

    def close(self) -> None:
        """End all processes, whatever they are doing; may be called from another thread."""
        for cell in self._cells:
            cell.close()

    def _sealed(self, case: CaseSpec, truth: Parsed) -> Parsed:
        salt = salt_of(self.seed, case.number)
        sealed = seal(truth, salt)
        self.seals.write(case.number, sealed)
        self.on_seal(f"case {case.number}: truth sealed, SHA-256 {sealed}")
        return {"seal": sealed, "salt": salt, "truth": truth}

    def _processes(self) -> tuple[Cell, Cell]:
        """The two processes of this thread: one makes cases, the other is the tool."""
        if not hasattr(self._own, "cells"):
            self._own.cells = Cell(), Cell()
            self._cells.extend(self._own.cells)
        cells: tuple[Cell, Cell] = self._own.cells
        return cells


def _made(maker: Cell, case: CaseSpec, seconds: float, folder: str, rough: bool) -> Parsed:
    try:
        truth: Parsed = maker.call(make, case, seconds, folder, rough, timeout=TIMEOUT)
    except LostError as loss:
        raise ProofError(f"Case {case.number} could not be made: {loss}", culprit=case.label) from loss
    return truth


def _ceiling(user: Cell, folder: str, truth: Parsed, said: Parsed) -> Parsed:
    """The ceiling of a case, its errors in the band in which the answer tells its own, where it says that."""
    held = said["answer"]["heldout"]
    band = [(held["cutoff_hz"], held["motion_hz"])] if "cutoff_hz" in held else []
    return _call_tool(user, ceiling, folder, truth["effects"], truth["mount"], *band)


def _call_tool(user: Cell, function: Callable[..., Any], *arguments: Any) -> Parsed:
    """Call in the tool's process; whatever goes wrong there is an answer too."""
    begun, said = perf_counter(), Parsed()
    try:
        said = {"status": "ok", "reason": "", "answer": user.call(function, *arguments, timeout=TIMEOUT)}
    except LostError as loss:
        said = {"status": loss.status, "reason": str(loss)}
    except InputError as error:
        said = {"status": "failed", "reason": str(error)}
    return said | {"seconds": perf_counter() - begun}

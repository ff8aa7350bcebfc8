"""An axis of the compiled loop on a bench: its controller and its drive are made of Python, cycle by cycle."""

import ctypes
from collections.abc import Callable
from ctypes import CFUNCTYPE, POINTER, c_double, c_int, c_size_t, c_uint32, c_void_p
from typing import Any

from cosim.hardware.library import library
from cosim.hardware.structures import CAxis, CFeedback, CHeads, CRecord, CSample
from cosim.hardware.words import ASK_ENABLE, ASK_RESET, ENABLED, LIMITS
from cosim.master.loop.structures import CPart

STEP, QUANTUM = 1e-3, 1e-6
STATUSWORDS = (0x00, 0x40, 0x21, 0x23, 0x27, 0x07, 0x0F, 0x08)
"""What a drive in each state of CiA 402 says."""
WIDE = {"torque": 1e6, "slew": 1e12, "speed": 1e6, "following_error": 1e6, "jump": 1e6, "torque_mismatch": 1e6}
"""Limits that nothing meets; a test narrows the one that it is about."""
_SET = CFUNCTYPE(c_int, c_void_p, POINTER(c_uint32), c_size_t, POINTER(c_double))
_STEP = CFUNCTYPE(c_int, c_void_p, c_double, c_double, c_int)
_SAVE = CFUNCTYPE(c_int, c_void_p, POINTER(c_void_p))
_RESTORE = CFUNCTYPE(c_int, c_void_p, c_void_p)


class Bench:
    """An axis with a controller that commands `command(position)`, and a drive that follows into each state at once.

    `limits` narrows some of `WIDE`; other changes are fields of the axis: `ramp`, `stop_slew`, `lost_limit` ...
    """

    def __init__(self, limits: dict[str, float] | None = None, **changes: Any) -> None:
        self.command: Callable[[float], float] = lambda position: 0.0
        self.status = 0
        self.restored = 0
        self._input, self._output = (c_double * 2)(), (c_double * 1)()
        calls = (_SET(lambda *_: 0), _SET(self._get), _STEP(self._step), _SAVE(lambda *_: 0), _RESTORE(self._restore))
        self._kept = (calls, (c_uint32 * 2)())
        names = ("set", "get", "step", "save", "restore")
        part = CPart(version=2, inputs=2, outputs=1, **dict(zip(names, map(_address, calls), strict=True)))
        part.input, part.output = ctypes.addressof(self._input), ctypes.addressof(self._output)
        fields = {"ramp": 1, "patience": 5, "stop_slew": 1e12, "late_row_limit": 3, "late_limit": 4, "late_window": 100}
        self.axis = CAxis(
            **{"controller": part, "encoder_input": 0, "reference_input": 1, "step": STEP, "quantum": QUANTUM}
            | {"lost_limit": 2, "stale_limit": 2, "mismatch_limit": 2, "heads": CHeads()}
            | {"limit": tuple(({**WIDE, **(limits or {})})[name] for name in LIMITS)}
            | fields
            | changes
        )
        assert library().hardware_ready(self.axis)
        self.tick = 0
        self.counts = 0

    def _get(self, _: Any, __: Any, count: int, values: Any) -> int:
        values[0] = self.command(self._input[0])
        return 0

    def _step(self, _: Any, time: float, size: float, final: int) -> int:
        self.stepped = time
        return self.status

    def _restore(self, _: Any, __: Any) -> int:
        self.restored += 1
        return 0

    def cycle(self, request: int = ASK_ENABLE, *, reference: float | None = None, **sample: Any) -> CRecord:
        """One cycle; unless `sample` or `feedback` in it say otherwise the drive is well and follows the axis."""
        at_rest = QUANTUM * self.counts if reference is None else reference
        said = {"counts": self.counts % 2**32, "encoder": self.tick + 1, "torque": self.axis.torque}
        said |= {"statusword": STATUSWORDS[self._state()]} | sample.pop("feedback", {})
        one = CSample(tick=self.tick, request=request, feedback=CFeedback(**said), **sample)
        one.input[1] = at_rest
        record = CRecord(sample=one)
        library().hardware_replay(self.axis, record, 1)
        self.tick += 1
        return record

    def _state(self) -> int:
        """The state of a drive that obeys at once: it stays enabled in a quick stop of the axis."""
        return ENABLED if self.axis.state == 5 else int(self.axis.state)

    def enabled(self) -> "Bench":
        """Go up from power-on to just before the first cycle of operation that steps the controller."""
        self.cycle(0)
        self.cycle(0)
        self.cycle(ASK_RESET)
        while self.axis.state != ENABLED:
            self.cycle()
            assert self.tick < 20
        return self


def _address(call: Any) -> int:
    return ctypes.cast(call, c_void_p).value or 0

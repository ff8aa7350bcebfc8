"""Play with two instances of an FMU's binary at random and judge every answer.

python fuzz_fmu.py FACTS TRACE EXAMPLES SEED

FACTS is JSON (`fuzz_models.facts_of`); each call is written to TRACE before it is made, so that the last line names the
one that crashed. Prints counts as JSON. It imports no more than it needs: it runs under valgrind too.
"""

import ctypes
import hashlib
import json
import os
import struct
import sys
from collections import Counter
from math import isfinite
from typing import Any

from fuzz_calls import CELLS, PROGRAMS, SLOTS, Call, Calls, Parameter, length_of
from fuzz_rules import EVENT, EXCHANGE, HEAD, LEADS, ORDER, STEP, damaged, may_be_set
from hypothesis import HealthCheck, Phase, given, seed, settings

OK, DISCARD, ERROR = 0, 2, 3
Texts = tuple[bytes | None, bytes | None]  # token, folder of resources
LOGGER2 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
LOGGER3 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


class Slot:
    """One instance, with the bytes of its state and whether it tells errors."""

    def __init__(self) -> None:
        self.pointer: int | None = None
        self.state, self.logs, self.tells = b"", False, False

    @property
    def head(self) -> tuple[Any, ...]:
        return HEAD.unpack_from(self.state)

    @property
    def phase(self) -> int:
        return int(self.head[7])

    @property
    def time(self) -> float:
        return float(struct.unpack_from("<d", self.state, HEAD.size)[0]) if self.state else 0.0


class Player:
    """Makes the calls of a program and judges each; an answer that breaks a rule is an AssertionError."""

    def __init__(self, facts: dict[str, Any], library: ctypes.CDLL, calls: Calls) -> None:
        self.facts, self.library, self.functions = facts, library, calls.functions
        self.fmi, self.suffix = facts["fmi"], "state" if facts["fmi"] == 2 else "State"
        self.slots = [Slot() for _ in range(SLOTS)]
        self.cells = [ctypes.c_void_p() for _ in range(CELLS)]
        self.own, self.messages = ctypes.c_void_p(), list[tuple[int, str, str]]()
        self.granted = 0
        self.logger = (
            LOGGER2(lambda e, n, s, c, m: self.hear(s, c, m)) if self.fmi == 2 else LOGGER3(lambda e, *m: self.hear(*m))
        )
        self.null_logger = type(self.logger)()

    def hear(self, status: int, category: bytes, message: bytes) -> None:
        self.messages.append((status, category.decode(), message.decode("utf-8", "replace")))

    def call(self, name: str, slot: Slot | None, *arguments: Any) -> int:
        """Call a function of the interface on an instance, or on NULL; return its status."""
        pointer = ctypes.c_void_p(slot.pointer if slot else None)
        return int(getattr(self.library, f"fmi{self.fmi}{name}")(pointer, *arguments))

    def mode(self, place: int) -> tuple[int, int]:
        """Mode and interface of the instance in a slot, zeros if there is none."""
        slot = self.slots[place]
        return (slot.phase, slot.head[6]) if slot.pointer else (0, 0)

    def make(self, call: Call) -> None:
        """Make one call of a program."""
        slot = self.slots[call.slot]
        if call.name == "Instantiate":
            self.instantiate(slot, *call.arguments)
        elif call.name == "FreeInstance":
            self.free(slot)
        elif call.name.lower() == "deserializefmustate":
            self.deserialize(slot, call)
        else:
            self.judge_call(slot, call)

    def instantiate(self, slot: Slot, kind: str, texts: Texts, has_logger: bool, events: bool) -> None:
        self.free(slot)
        logger = self.logger if has_logger else self.null_logger
        self.messages.clear()
        slot.pointer = (self._instantiate2 if self.fmi == 2 else self._instantiate3)(kind, texts, logger, events)
        right = texts[0] == self.facts["token"].encode()
        assert bool(slot.pointer) == right, "an instance is made for the right token"
        assert len(self.messages) == (has_logger and not right), self.messages
        slot.logs = slot.tells = has_logger
        slot.state = self.saved(slot)

    def _instantiate2(self, kind: str, texts: Texts, logger: Any, events: bool) -> Any:
        # Only the logger is given; the other four are optional.
        self.callbacks = (ctypes.c_void_p * 5)(ctypes.cast(logger, ctypes.c_void_p).value)
        create = self.library.fmi2Instantiate
        create.restype = ctypes.c_void_p
        return create(b"it", int(kind == "CS"), *texts, self.callbacks, 0, int(events))

    def _instantiate3(self, kind: str, texts: Texts, logger: Any, events: bool) -> Any:
        simulation = kind == "CS"
        create = getattr(self.library, "fmi3Instantiate" + ("CoSimulation" if simulation else "ModelExchange"))
        create.restype = ctypes.c_void_p
        more = (ctypes.c_bool(), ctypes.c_bool(), None, ctypes.c_size_t()) if simulation else ()
        last = (None,) if simulation else ()
        return create(b"it", *texts, ctypes.c_bool(), ctypes.c_bool(events), *more, None, logger, *last)

    def free(self, slot: Slot) -> None:
        getattr(self.library, f"fmi{self.fmi}FreeInstance")(ctypes.c_void_p(slot.pointer))
        slot.pointer, slot.state = None, b""

    def saved(self, slot: Slot) -> bytes:
        """The serialized state of an instance, all of it finite but for a stop time that there is not."""
        if not slot.pointer:
            return b""
        content = ctypes.create_string_buffer(self.facts["bytes"])
        assert self.call(f"GetFMU{self.suffix}", slot, ctypes.byref(self.own)) == OK
        assert self.call(f"SerializeFMU{self.suffix}", slot, self.own, content, ctypes.c_size_t(len(content))) == OK
        values = struct.unpack_from(f"<{len(self.facts['variables'])}d", content.raw, HEAD.size)
        assert all(map(isfinite, values)), f"a state holds {values}"
        return content.raw

    def held(self, slot: Slot, cell: int) -> bytes:
        """What is saved in a cell, as far as an instance in this slot can tell."""
        content = ctypes.create_string_buffer(self.facts["bytes"])
        if not slot.pointer or not self.cells[cell]:
            return b""
        self.call(f"SerializeFMU{self.suffix}", slot, self.cells[cell], content, ctypes.c_size_t(len(content)))
        return content.raw

    def judge_call(self, slot: Slot, call: Call) -> None:
        parameters, target = self.functions[call.name], slot if call.arguments[0] and slot.pointer else None
        arrays = [
            self.converted(one, drawn, slot) for one, drawn in zip(parameters[1:], call.arguments[1:], strict=True)
        ]
        before, time = slot.state, slot.time
        phase, interface = self.mode(call.slot) if target else (0, 0)
        status = self.judged(call.name, slot, target, arrays)
        if target and (not phase & ORDER.get(call.name, 63) or (call.name in EXCHANGE and interface)):
            assert status == ERROR, "a function out of order"
        if target and call.name in ("SetReal", "SetFloat64"):
            self.judge_setting(call, phase, status)
        if status != OK or not target:
            return
        for i, one in enumerate(parameters):
            if one.kind == "double" and one.form and not one.constant:
                results, count = arrays[i - 1], length_of(parameters, call.arguments, i)
                assert not count or results is not None, "an ok without a place for the result"
                assert all(map(isfinite, (results or ())[:count])), f"an ok with {list(results)}"
        self.judge_effect(slot, call, before, phase, time)

    def judged(self, name: str, slot: Slot, target: Slot | None, arguments: list[Any]) -> int:
        """Call, and judge what holds for every call: status, messages, that nothing else changes."""
        others = [(one, one.state) for one in self.slots if one is not target]
        self.messages.clear()
        status = self.call(name, target, *arguments)
        told = [message for message in self.messages if message[1] == "logStatusError"]
        assert status in (OK, DISCARD, ERROR), f"status {status}"
        assert len(told) == (status != OK and target is not None and target.tells), f"status {status}, {self.messages}"
        assert all(message[0] == status and message[2] for message in told), told
        assert all(one.state == self.saved(one) for one, _ in others), "the other instance has changed"
        if target:
            now = self.saved(target)
            assert status == OK or now == target.state, "a refusal has changed the instance"
            target.state = now
            self.granted += status == OK
        else:
            assert status == ERROR, "a function without an instance"
        return status

    def judge_setting(self, call: Call, phase: int, status: int) -> None:
        """Refused exactly where the rules say, with the name of the variable."""
        references, count, values = call.arguments[1:4]
        if (self.fmi == 3 and count != call.arguments[4]) or (count and (references is None or values is None)):
            assert status == ERROR
            return
        for reference, value in zip((references or ())[:count], values or (), strict=False):
            if not may_be_set(self.facts, reference, value, phase):
                assert status == ERROR, f"{reference} may not be {value}"
                known = reference < len(self.facts["variables"])
                name = f'"{self.facts["variables"][reference][0]}"' if known else f"reference {reference}"
                assert all(name in message[2] for message in self.messages), (name, self.messages)
                return
        assert status == OK, self.messages

    def judge_effect(self, slot: Slot, call: Call, before: bytes, phase: int, time: float) -> None:
        """What an ok has changed: the mode, the time, the state, or nothing."""
        if call.name == f"SetFMU{self.suffix}":
            return
        leads = {"ExitInitializationMode": STEP if slot.head[6] else EVENT} | LEADS
        assert slot.phase == leads.get(call.name, phase), "the mode"
        if call.name == "DoStep":
            asked = [time if number == "now" else number for number in call.arguments[1:3]]
            assert slot.time == asked[0] + asked[1] >= time, "the time after a step"
        if call.name == "SetDebugLogging":
            chosen = call.arguments[3][: call.arguments[2]] if call.arguments[3] else ()
            if not chosen or b"logStatusError" in chosen:
                slot.tells = slot.logs and bool(call.arguments[1])
        if call.name.startswith("Get") and before != slot.state:
            assert self.facts["period"] and phase == EVENT, "asking has changed the instance"  # noqa: PT018

    def deserialize(self, slot: Slot, call: Call) -> None:
        """Load a state, whole or damaged, into a cell."""
        source, how, cell, missing = call.arguments
        content = self.slots[source].state
        if not content:
            return
        given = damaged(content, *how)
        data = None if missing == "bytes" else (ctypes.c_char * len(given)).from_buffer_copy(given)
        place = None if missing == "place" else ctypes.byref(self.cells[cell])
        target = None if missing == "instance" or not slot.pointer else slot
        held = self.held(slot, cell)
        status = self.judged(call.name, slot, target, [data, ctypes.c_size_t(len(given)), place])
        assert status == OK or self.held(slot, cell) == held, "a refusal has changed the saved state"
        if how[0] != "forged" or missing or not target:
            assert (status == OK) == (given == content and not missing and target is not None), f"{how}: {status}"

    def converted(self, one: Parameter, drawn: Any, slot: Slot) -> Any:
        """An argument as C wants it."""
        if one.kind == "state":
            cell = ctypes.c_void_p() if drawn is None else self.cells[drawn]
            return cell if not one.form else None if drawn is None else ctypes.byref(cell)
        if drawn is None:
            return None
        if not one.form:
            return VALUES[self.fmi].get(one.kind, ctypes.c_int)(slot.time if drawn == "now" else drawn)
        if one.kind in ("double", "reference", "text"):
            values = drawn if isinstance(drawn, tuple) else (0,) * drawn
            return (ELEMENTS[one.kind] * len(values))(*values)
        return (ctypes.c_char * (64 if one.kind == "event" else drawn * (1 if one.kind == "byte" else 8)))()

    def close(self) -> None:
        """Free all there is."""
        for slot in self.slots:
            self.free(slot)
        last = Slot()
        self.instantiate(last, "CS", (self.facts["token"].encode(), None), True, False)
        for cell in (*self.cells, self.own):
            self.call(f"FreeFMU{self.suffix}", last, ctypes.byref(cell))
            assert cell.value is None
        self.free(last)


ELEMENTS = {"double": ctypes.c_double, "reference": ctypes.c_uint, "text": ctypes.c_char_p}
VALUES: dict[int, dict[str, Any]] = {
    fmi: {"double": ctypes.c_double, "count": ctypes.c_size_t, "reference": ctypes.c_uint, "text": ctypes.c_char_p,
          "flag": ctypes.c_int if fmi == 2 else ctypes.c_bool}
    for fmi in (2, 3)
}  # fmt: skip


def main() -> None:
    with open(sys.argv[1]) as file:
        facts = json.load(file)
    trace = os.open(sys.argv[2], os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
    examples, number = map(int, sys.argv[3:])
    library, calls, counts, digest = ctypes.CDLL(facts["library"]), Calls(facts), Counter[str](), hashlib.sha256()

    phases = (Phase.generate, Phase.shrink) if facts["shrink"] else (Phase.generate,)

    @seed(number)
    @settings(max_examples=examples, phases=phases, deadline=None, database=None, suppress_health_check=[*HealthCheck])
    @given(PROGRAMS)
    def play(drawn: tuple[int, list[int]]) -> None:
        player = Player(facts, library, calls)
        os.ftruncate(trace, 0)
        try:
            for call in calls.program(*drawn, player.mode):
                line = f"{call.slot} {call.name}{call.arguments}\n".encode()
                os.write(trace, line)
                digest.update(line)
                counts[call.name] += 1
                player.make(call)
        finally:
            counts["granted"] += player.granted
            player.close()

    play()
    granted = counts.pop("granted")
    print(
        json.dumps(
            {"calls": counts.total(), "granted": granted, "functions": sorted(counts), "digest": digest.hexdigest()}
        )
    )


if __name__ == "__main__":
    main()

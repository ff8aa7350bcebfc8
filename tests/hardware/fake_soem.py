"""A stand-in for pysoem: one slave that keeps to CiA 402 and to whatever PDO mapping was written into it.

It knows nothing of the adapter's code: objects are found in the process image by the mapping objects, as a drive does.
"""

import struct
from collections.abc import Callable
from typing import Any

INIT_STATE, PREOP_STATE, SAFEOP_STATE, OP_STATE = 1, 2, 4, 8
STATUS = {"disabled": 0x40, "ready": 0x21, "on": 0x23, "enabled": 0x27, "fault": 0x08}
UP = {("disabled", 6): "ready", ("ready", 7): "on", ("on", 15): "enabled", ("enabled", 15): "enabled"}


class Slave:
    """The drive; its axis rests."""

    def __init__(self, refused: tuple[int, int] | None = None) -> None:
        self.objects: dict[tuple[int, int], bytes] = {}
        self.output = self.input = b""
        self.state, self.al_status, self.drive = PREOP_STATE, 0, "fault"
        self.watchdog: tuple[str, float] | None = None
        self.sync: tuple[bool, int] | None = None
        self.config_func: Callable[[int], None] | None = None
        self.before, self.mode, self.seen = 0, 0, {}
        self.refused = refused
        self.written: list[tuple[int, int, bytes]] = []

    def sdo_write(self, index: int, subindex: int, data: bytes) -> None:
        if self.refused == (index, subindex):
            raise RuntimeError("abort 0x06090030")
        self.objects[index, subindex] = data
        self.written.append((index, subindex, data))

    def set_watchdog(self, kind: str, milliseconds: float) -> None:
        self.watchdog = (kind, milliseconds)

    def dc_sync(self, act: bool, cycle: int) -> None:
        self.sync = (act, cycle)

    def mapped(self, assigned: int) -> list[tuple[int, int]]:
        """Return (object, bytes) of an assigned PDO, in their order."""
        pdo = struct.unpack("<H", self.objects[assigned, 1])[0]
        count = self.objects[pdo, 0][0]
        raw = [struct.unpack("<I", self.objects[pdo, place])[0] for place in range(1, count + 1)]
        return [(one >> 16, (one & 0xFF) // 8) for one in raw]

    def exchange(self) -> None:
        """Take the outputs and fill the inputs."""
        place = 0
        for index, size in self.mapped(0x1C12):
            signed = index not in (0x6040,)
            self.seen[index] = int.from_bytes(self.output[place : place + size], "little", signed=signed)
            place += size
        if self.state == OP_STATE:
            self.obey(self.seen[0x6040])
        torque = self.seen[0x6071] if self.drive == "enabled" else 0
        values = {0x6041: STATUS[self.drive], 0x6064: -5, 0x6077: torque, 0x6061: self.mode}
        self.input = b"".join(
            (values.get(index, 0) & (1 << 8 * size) - 1).to_bytes(size, "little") for index, size in self.mapped(0x1C13)
        )

    def obey(self, word: int) -> None:
        if self.drive == "fault":
            self.drive = "disabled" if word & 0x80 and not self.before & 0x80 else "fault"
        elif not word & 2:
            self.drive = "disabled"
        else:
            self.drive = UP.get((self.drive, word & 0xF), self.drive)
        self.before = word
        self.mode = self.seen.get(0x6060, self.objects.get((0x6060, 0), b"\0")[0])


class Master:
    """The bus; `change` is set by tests and called in each cycle with the number of the cycle."""

    last: "Master"
    count = 1
    goes_up = True
    refused: tuple[int, int] | None = None
    more, safe = (0, 0), SAFEOP_STATE
    change: Callable[["Master", int], Any] | None = None

    def __init__(self) -> None:
        type(self).last = self
        self.slaves = [Slave(self.refused) for _ in range(self.count)]
        self.expected_wkc, self.wkc, self.cycles, self.closed, self.state = 3, 3, 0, False, INIT_STATE
        self.states: list[int] = []
        self.told: list[tuple[object, ...]] = []

    def open(self, interface: str) -> None:
        if interface != "fake0":
            raise ConnectionError(f"could not open interface {interface}")

    def config_init(self) -> int:
        return self.count or -1

    def config_map(self) -> int:
        slave = self.slaves[0]
        slave.config_func(0)
        sizes = {side: sum(size for _, size in slave.mapped(side)) for side in (0x1C12, 0x1C13)}
        slave.output, slave.input = bytes(sizes[0x1C12] + self.more[0]), bytes(sizes[0x1C13] + self.more[1])
        slave.state = self.safe
        return sum(sizes.values())

    def config_dc(self) -> bool:
        self.told.append(("config_dc",))
        return True

    def state_check(self, expected: int, timeout: int) -> int:
        self.told.append(("state_check", expected, timeout))
        return self.slaves[0].state

    def read_state(self) -> int:
        self.told.append(("read_state",))
        return self.slaves[0].state

    def write_state(self) -> int:
        self.states.append(self.state)
        if self.goes_up or self.state == INIT_STATE:
            self.slaves[0].state = self.state
        return 1

    def send_processdata(self) -> int:
        self.cycles += 1
        self.told.append(("send",))
        if self.change:
            self.change(self.cycles)
        return 1

    def receive_processdata(self, timeout: int) -> int:
        self.told.append(("receive", timeout))
        self.slaves[0].exchange()
        return self.wkc

    def close(self) -> None:
        self.closed = True


def al_status_code_to_string(code: int) -> str:
    return {0: "No error", 0x1B: "Sync manager watchdog"}[code]

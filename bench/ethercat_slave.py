"""A slave of EtherCAT in software, for a veth pair: registers, EEPROM, mailbox with CoE, and process data by FMMUs.

python bench/ethercat_slave.py INTERFACE      (prints a line when it listens; needs the rights of root)

As much of ETG.1000 as SOEM uses to bring up one drive. What the drive does with its objects is `fake_soem.Slave`.
"""

import socket
import struct
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "tests/hardware"))

from fake_soem import OP_STATE, SAFEOP_STATE, Slave

ETHERTYPE = 0x88A4
APRD, APWR, APRW, FPRD, FPWR, FPRW, BRD, BWR, BRW, LRD, LWR, LRW = range(1, 13)
READS, WRITES = {APRD, APRW, FPRD, FPRW, BRD, BRW}, {APWR, APRW, FPWR, FPRW, BWR, BRW}
STATION, AL_CONTROL, AL_STATUS, AL_CODE, EEPROM, EEPROM_DATA, FMMU, SM = (
    *(0x0010, 0x0120, 0x0130, 0x0134, 0x0502, 0x0508),
    *(0x0600, 0x0800),
)
MAIL_IN, MAIL_OUT, MAIL_SIZE, OUTPUTS, INPUTS = 0x1000, 0x1080, 128, 0x1100, 0x1180
FULL = 0x08
"""Bit of a mailbox's sync manager that holds something."""


def eeprom() -> bytes:
    """Return the SII: identity, mailbox, and four sync managers."""
    words = [0] * 0x40
    words[0x08], words[0x0A], words[0x0C] = 0x5EED, 402, 1
    words[0x18:0x1D] = [MAIL_IN, MAIL_SIZE, MAIL_OUT, MAIL_SIZE, 0x0004]
    managers = [
        (MAIL_IN, MAIL_SIZE, 0x26, 1),
        (MAIL_OUT, MAIL_SIZE, 0x22, 2),
        (OUTPUTS, 0, 0x64, 3),
        (INPUTS, 0, 0x20, 4),
    ]
    category = b"".join(struct.pack("<HHBBBB", at, size, flags, 0, 1, kind) for at, size, flags, kind in managers)
    return struct.pack("<64H", *words) + struct.pack("<HH", 41, len(category) // 2) + category + b"\xff" * 64


class Controller:
    """The EtherCAT slave controller: its memory, and what happens when it is read or written."""

    def __init__(self) -> None:
        self.memory, self.sii, self.drive = bytearray(0x2000), eeprom(), Slave()
        self.memory[0x0000:0x0008] = bytes((0x11, 0, 0, 0, 8, 4, 8, 0x0F))
        self.memory[0x0110:0x0112] = struct.pack("<H", 0x5611)  # linked on port 0 only
        self.memory[0x0400:0x0402] = struct.pack("<H", 2498)  # watchdog in steps of 0.1 ms
        self.memory[AL_STATUS] = 1
        self.drive.objects |= {(0x1C00, 0): b"\x04"} | {(0x1C00, n): bytes((n,)) for n in (1, 2, 3, 4)}

    def answer(self, frame: bytearray) -> bytes:
        """Return a frame as it comes back."""
        place, more = 16, True
        while more:
            size = struct.unpack_from("<H", frame, place + 6)[0]
            more, size = bool(size & 0x8000), size & 0x07FF
            self._datagram(frame, place, size)
            place += 12 + size
        frame[6] |= 0x02
        return bytes(frame)

    def _datagram(self, frame: bytearray, place: int, size: int) -> None:
        command, _, station, offset = struct.unpack_from("<BBHH", frame, place)
        data = slice(place + 10, place + 10 + size)
        if command in (LRD, LWR, LRW):
            done = self._logical(frame, data, struct.unpack_from("<I", frame, place + 2)[0], command)
        elif not self._is_meant(command, station):
            done = 0
        else:
            done = self._physical(frame, data, offset, command)
        if command in (APRD, APWR, APRW, BRD, BWR, BRW):
            struct.pack_into("<H", frame, place + 2, (station + 1) & 0xFFFF)
        counter = struct.unpack_from("<H", frame, data.stop)[0]
        struct.pack_into("<H", frame, data.stop, counter + done)

    def _is_meant(self, command: int, station: int) -> bool:
        if command in (FPRD, FPWR, FPRW):
            return station == struct.unpack_from("<H", self.memory, STATION)[0]
        return command in (BRD, BWR, BRW) or (command in (APRD, APWR, APRW) and station == 0)

    def _physical(self, frame: bytearray, data: slice, offset: int, command: int) -> int:
        done, given = 0, bytes(frame[data])
        if command in READS:
            frame[data] = self.memory[offset : offset + len(given)]
            self._was_read(offset, len(given))
            done += 1
        if command in WRITES:
            self.memory[offset : offset + len(given)] = given
            self._was_written(offset, len(given))
            done += 1 if command in (APWR, FPWR, BWR) else 2
        return done

    def _was_read(self, offset: int, size: int) -> None:
        if offset <= MAIL_OUT + MAIL_SIZE - 1 < offset + size:
            self.memory[SM + 8 + 5] &= ~FULL

    def _was_written(self, offset: int, size: int) -> None:
        if offset == AL_CONTROL:
            self.memory[AL_STATUS] = self.memory[AL_CONTROL] & 0x0F
            self.drive.state = self.memory[AL_STATUS]
        if offset == EEPROM:
            address = struct.unpack_from("<I", self.memory, EEPROM + 2)[0]
            self.memory[EEPROM : EEPROM + 2] = b"\0\0"
            self.memory[EEPROM_DATA : EEPROM_DATA + 4] = self.sii[2 * address : 2 * address + 4].ljust(4, b"\xff")
        if offset == MAIL_IN:
            self._mail()

    def _mail(self) -> None:
        """Answer one SDO."""
        command, index, subindex = struct.unpack_from("<BHB", self.memory, MAIL_IN + 8)
        value = self.memory[MAIL_IN + 12 : MAIL_IN + 16]
        if command & 0xE0 == 0x20:
            self.drive.sdo_write(index, subindex, bytes(value[: 4 - (command >> 2 & 3)]))
            sdo = struct.pack("<BHBI", 0x60, index, subindex, 0)
        elif (found := self.drive.objects.get((index, subindex))) is not None:
            sdo = struct.pack("<BHB", 0x43 | (4 - len(found)) << 2, index, subindex) + found.ljust(4, b"\0")
        else:
            sdo = struct.pack("<BHBI", 0x80, index, subindex, 0x06020000)
        header = struct.pack("<HHBBH", 10, 0, 0, self.memory[MAIL_IN + 5], 3 << 12)
        self.memory[MAIL_OUT : MAIL_OUT + MAIL_SIZE] = (header + sdo).ljust(MAIL_SIZE, b"\0")
        self.memory[SM + 8 + 5] |= FULL

    def _logical(self, frame: bytearray, data: slice, start: int, command: int) -> int:
        """Exchange process data by the FMMUs."""
        done = 0
        for place in range(FMMU, FMMU + 8 * 16, 16):
            logical, size, _, _, _, _, kind, active = struct.unpack_from("<IHBBHBBB", self.memory, place)
            if not active & 1 or not start <= logical < start + data.stop - data.start:
                continue
            part = slice(data.start + logical - start, data.start + logical - start + size)
            if kind == 2 and command in (LWR, LRW):
                self.drive.output = bytes(frame[part])
                done += 2 if command == LRW else 1
            if kind == 1 and command in (LRD, LRW) and self.drive.state in (SAFEOP_STATE, OP_STATE):
                self.drive.exchange()
                frame[part] = self.drive.input.ljust(size, b"\0")[:size]
                done += 1
        return done


def main(interface: str) -> None:
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE)) as wire:
        wire.bind((interface, ETHERTYPE))
        controller = Controller()
        print("listening", flush=True)
        while True:
            frame, (_, _, direction, *_) = wire.recvfrom(2048)
            if direction != socket.PACKET_OUTGOING:
                wire.send(controller.answer(bytearray(frame)))


if __name__ == "__main__":
    main(sys.argv[1])

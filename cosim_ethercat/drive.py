"""An EtherCAT drive, CiA 402 in cyclic synchronous torque (mode 10), through `pysoem`: the extra `ethercat`.

Each cycle sends one process image and takes one back, from Python: see python_adapter.py for what that means for time.
Working counter, statusword, mode shown and, every few cycles, the state of the slave itself are looked at: after a bus
watchdog has tripped the working counter may stay good while the slave has left operation.

Not tried on a bus with a drive: tests use a stand-in for `pysoem`, and `pysoem` itself with a slave in software.
"""

import struct
from contextlib import suppress
from typing import Any, ClassVar

from cosim.hardware.machine import Machine
from cosim.hardware.python_adapter import Order, PythonAdapter, Reading
from cosim.support.errors import HardwareError, MissingPackageError
from cosim.support.extras import install
from cosim_ethercat.mapping import Entry, Ethercat, Layout

TORQUE_MODE = 10
"""Cyclic synchronous torque, object 0x6060."""
CHECKED_EVERY = 20
"""Cycles between two looks at the state of the slave."""
TRIES, STATE_US, FRAME_US = 200, 5000, 2000
"""Process images on the way to operation; microseconds that each waits for the state; that a frame may take."""


class EthercatDrive(PythonAdapter):
    """A drive at `ethercat:INTERFACE`, with `[ethercat]` of the machine file.

    Raises:
        HardwareError: no interface, no such slave, it does not go into operation, or it cannot do what is asked of it.
        MissingPackageError: `pysoem` is not installed.
    """

    section: ClassVar = Ethercat
    """What `[ethercat]` of a machine file must hold."""

    def __init__(self, machine: Machine, step: float) -> None:
        super().__init__(step)
        self._name, self._interface = machine.name, machine.adapter.partition(":")[2]
        given: Ethercat | None = getattr(machine, "ethercat", None)
        if given is None:
            raise HardwareError(f'{machine.name}: adapter "{machine.adapter}" needs a section [ethercat].')
        self._given, self._watchdog_ms = given, machine.watchdog_ms
        self._check_torque(machine)
        self._out, self._in = Layout(self._given.outputs), Layout(self._given.inputs)
        self._soem = _pysoem()
        self._master = self._soem.Master()
        self._master.always_release_gil = True  # the supervisor goes on while a frame is under way
        self._samples = self._cycles = 0
        self._order = self._out.pack({"mode": TORQUE_MODE})
        try:
            self._go_up()
        except BaseException:
            self.close()
            raise

    def write(self, order: Order) -> None:
        """Send the order; torque goes in per mille of the rated torque."""
        per_mille = round(1000 * order.torque / self._given.rated_torque)
        values = {"controlword": order.controlword, "torque": per_mille, "mode": TORQUE_MODE}
        self._slave.output = self._out.pack(values)
        self._master.send_processdata()

    def read(self) -> Reading | None:
        """Take the process image; None where not every slave has touched it."""
        if self._master.receive_processdata(FRAME_US) != self._master.expected_wkc:
            return None
        found = self._in.unpack(self._slave.input)
        if found.get("mode_shown", TORQUE_MODE) != TORQUE_MODE and found["statusword"] & 0x6F == 0x27:
            raise HardwareError(f"{self._name} is enabled in mode {found['mode_shown']}, not {TORQUE_MODE}.")
        self._samples += 1
        torque = found["torque"] * self._given.rated_torque / 1000
        return Reading(found["position"], self._samples, found["statusword"], torque)

    def status(self) -> int:
        """Return whether the slave has left operation, looked at every few cycles."""
        self._cycles += 1
        if self._cycles % CHECKED_EVERY == 0:
            self._master.read_state()
            if self._slave.state != self._soem.OP_STATE:
                raise HardwareError(f"{self._name} has left operation of the bus: {self._reason()}.")
        return 0

    def close(self) -> None:
        """Leave the bus without torque."""
        with suppress(Exception):  # the bus may be gone
            self._master.state = self._soem.INIT_STATE
            self._master.write_state()
        self._master.close()

    def _check_torque(self, machine: Machine) -> None:
        count, limits = self._given.rated_torque / 1000, machine.limits
        if limits.torque > 32767 * count:
            message = (
                f"{machine.name}: limits.torque = {limits.torque:g} N m does not fit into 16 bits of {count:g} N m."
            )
            raise HardwareError(message, culprit="limits.torque", value=limits.torque)
        if limits.torque_mismatch < count:
            message = (
                f"{machine.name}: limits.torque_mismatch = {limits.torque_mismatch:g} N m is below what the drive "
                f"counts torque in, {count:g} N m."
            )
            raise HardwareError(message, culprit="limits.torque_mismatch", value=limits.torque_mismatch)

    def _go_up(self) -> None:
        """Take the bus from init to operation, process data with no voltage on the way."""
        soem, master = self._soem, self._master
        try:
            master.open(self._interface)
        except OSError as error:
            raise HardwareError(f"{self._name}: {error} (EtherCAT needs the rights of root).") from error
        count = master.config_init()
        if count <= self._given.position:
            message = f"{self._name}: no slave {self._given.position} at {self._interface}, which has {max(count, 0)}."
            raise HardwareError(message, culprit="ethercat.position", value=self._given.position)
        self._slave = master.slaves[self._given.position]
        self._slave.config_func = self._configure
        self._ask("its PDOs", master.config_map)
        self._fits()
        if self._given.distributed_clock:
            master.config_dc()
            self._slave.dc_sync(True, round(self.step * 1e9))
        if master.state_check(soem.SAFEOP_STATE, 50_000) != soem.SAFEOP_STATE:
            raise HardwareError(f"{self._name} does not reach safe operation of the bus: {self._reason()}.")
        self._operate()

    def _operate(self) -> None:
        soem, master = self._soem, self._master
        self._slave.output = self._order
        master.state = soem.OP_STATE
        master.write_state()
        for _ in range(TRIES):
            master.send_processdata()
            master.receive_processdata(FRAME_US)
            if master.state_check(soem.OP_STATE, STATE_US) == soem.OP_STATE:
                return
        raise HardwareError(f"{self._name} does not reach operation of the bus: {self._reason()}.")

    def _configure(self, _: int) -> None:
        """Write mapping, mode and watchdog, in pre-operation."""
        self._map(0x1C12, self._given.receive_pdo, self._given.outputs)
        self._map(0x1C13, self._given.transmit_pdo, self._given.inputs)
        self._slave.sdo_write(0x6060, 0, struct.pack("<b", TORQUE_MODE))
        self._slave.set_watchdog("processdata", self._watchdog_ms)

    def _map(self, assigned: int, pdo: int, entries: tuple[Entry, ...]) -> None:
        """Write one PDO: unassign, empty, fill, assign (ETG.1000.6)."""
        write = self._slave.sdo_write
        write(assigned, 0, struct.pack("<B", 0))
        write(pdo, 0, struct.pack("<B", 0))
        for place, entry in enumerate(entries, 1):
            write(pdo, place, struct.pack("<I", entry.mapped))
        write(pdo, 0, struct.pack("<B", len(entries)))
        write(assigned, 1, struct.pack("<H", pdo))
        write(assigned, 0, struct.pack("<B", 1))

    def _fits(self) -> None:
        """Compare the process image that the slave has with what was asked for."""
        for side, layout, image in (
            ("outputs", self._out, self._slave.output),
            ("inputs", self._in, self._slave.input),
        ):
            if len(image) != layout.size:
                message = f"{self._name} has {len(image)} bytes of {side} and the mapping {layout.size}."
                raise HardwareError(message, culprit=f"ethercat.{side}", value=len(image))

    def _ask(self, what: str, call: Any) -> None:
        try:
            call()
        except Exception as error:  # pysoem's own exceptions have no common base
            text = f"{type(error).__name__} {error}".strip()
            raise HardwareError(f"{self._name} refuses {what}: {text}.", culprit="ethercat") from error

    def _reason(self) -> str:
        return str(self._soem.al_status_code_to_string(self._slave.al_status))


def _pysoem() -> Any:
    try:
        import pysoem
    except ImportError as error:
        message = f"EtherCAT needs the package pysoem: {install('ethercat')}"
        raise MissingPackageError(message) from error
    return pysoem

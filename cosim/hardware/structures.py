"""What hardware.h, drive.h and udp.h declare, for ctypes; see there for the meaning of each field."""

from ctypes import POINTER, Structure, c_byte, c_double, c_int64, c_uint32, c_uint64, c_void_p, sizeof

import numpy as np

from cosim.master.loop.structures import CPart

INPUTS, MISSES, LIMITS, HEADS = 8, 64, 6, 4
NONCE, TAG, KEY = 16, 16, 32


class CFeedback(Structure):
    """What a drive says."""

    _fields_ = [
        ("counts", c_uint32),
        ("encoder", c_uint32),
        ("statusword", c_uint32),
        ("link", c_uint32),
        ("torque", c_double),
        ("head", c_uint32 * HEADS),
        ("heads", c_uint32),
        ("unused", c_uint32),
    ]


class COrder(Structure):
    """What a drive shall do."""

    _fields_ = [("tick", c_int64), ("controlword", c_uint32), ("reserved", c_uint32), ("torque", c_double)]


class CAdapter(Structure):
    """The table of an adapter's functions."""

    _fields_ = [("self", c_void_p), ("read", c_void_p), ("write", c_void_p), ("status", c_void_p)]


class CSample(Structure):
    """What enters a cycle."""

    _fields_ = [
        ("tick", c_int64),
        ("feedback", CFeedback),
        ("read", c_uint32),
        ("status", c_uint32),
        ("late", c_uint32),
        ("request", c_uint32),
        ("change", c_uint32),
        ("reserved", c_uint32),
        ("value", c_double),
        ("input", c_double * INPUTS),
    ]


class CRecord(Structure):
    """A record of the black box."""

    _fields_ = [
        ("sequence", c_uint64),
        ("sample", CSample),
        ("state", c_uint32),
        ("faults", c_uint32),
        ("notes", c_uint32),
        ("controlword", c_uint32),
        ("command", c_double),
        ("torque", c_double),
        ("heads", c_uint32),
        ("unused", c_uint32),
        ("crc", c_uint32),
        ("reserved", c_uint32),
    ]


class CHeads(Structure):
    """The read heads of an encoder."""

    _fields_ = [
        *((name, c_int64) for name in ("used", "apart", "jump", "known", "shift")),
        *((name, c_uint32) for name in ("counts", "in", "reasons")),
        ("last", c_uint32 * HEADS),
        ("unused", c_uint32),
    ]


class CAxis(Structure):
    """An axis."""

    _fields_ = [
        ("controller", CPart),
        ("initial", c_void_p),
        ("encoder_input", c_int64),
        ("reference_input", c_int64),
        ("step", c_double),
        ("quantum", c_double),
        ("limit", c_double * LIMITS),
        ("stop_slew", c_double),
        *((name, c_int64) for name in ("ramp", "patience", "lost_limit", "stale_limit", "mismatch_limit")),
        *((name, c_int64) for name in ("late_row_limit", "late_limit", "late_window")),
        *((name, c_int64) for name in ("state", "faults", "wanted", "running", "known", "lost", "stale")),
        *((name, c_int64) for name in ("mismatched", "waiting", "late_row", "position", "rate", "fresh", "ran")),
        *((name, c_int64) for name in ("entered", "misses")),
        *((name, c_uint32) for name in ("last_counts", "last_encoder", "last_request", "controlword")),
        ("torque", c_double),
        ("miss", c_int64 * MISSES),
        ("refused", c_int64),
        ("heads", CHeads),
    ]


class CBox(Structure):
    """The ring of records."""

    _fields_ = [("record", c_void_p), ("capacity", c_int64), ("written", c_int64)]


class CSession(Structure):
    """A session."""

    _fields_ = [
        ("axis", POINTER(CAxis)),
        ("adapter", POINTER(CAdapter)),
        ("box", POINTER(CBox)),
        ("setpoint", c_void_p),
        *((name, c_int64) for name in ("setpoints", "tick", "period", "spin", "heartbeat_limit")),
        *((name, c_int64) for name in ("next", "late", "worst", "beat", "beaten", "locked", "fifo")),
        *((name, c_int64) for name in ("waits", "waited")),
        ("heartbeat", c_int64),
        ("stop", c_int64),
        ("lose", c_int64),
        ("request", c_uint32),
        ("change", c_uint32),
        ("value", c_double),
    ]


class CInjection(Structure):
    """A fault of the simulated drive."""

    _fields_ = [("kind", c_int64), ("first", c_int64), ("last", c_int64), ("size", c_double), ("head", c_int64)]


class CDrive(Structure):
    """The simulated drive."""

    _fields_ = [
        ("plant", CPart),
        ("torque_input", c_int64),
        ("watchdog", c_int64),
        ("injections", c_int64),
        ("injection", POINTER(CInjection)),
        ("step", c_double),
        ("quantum", c_double),
        *((name, c_double) for name in ("torque", "slew", "speed")),
        ("tick", c_int64),
        ("state", c_int64),
        ("failed", c_int64),
        ("epoch", c_int64),
        ("silent", c_int64),
        *((name, c_uint32) for name in ("control", "counts", "encoder", "reserved")),
        ("held", c_double),
        ("limited", c_int64),
        ("overspeeds", c_int64),
        ("heads", c_int64),
        ("eccentricity", c_double),
        ("shown", c_uint32 * HEADS),
    ]


COUNTED = ("sent", "good", "lost", "late", "duplicated", "reordered", "corrupted", "foreign", "early")
"""What is counted of the frames of a link."""


class CLink(Structure):
    """What came over a link."""

    _fields_ = [
        *((name, c_int64) for name in (*COUNTED, "worst")),
        ("newest", c_uint32),
        ("reserved", c_uint32),
        ("seen", c_uint64),
    ]


class CMac(Structure):
    """A key, as HMAC-SHA256 takes it."""

    _fields_ = [("inner", c_uint32 * 8), ("outer", c_uint32 * 8)]


class CUdp(Structure):
    """The adapter of process data over UDP."""

    _fields_ = [
        *((name, c_int64) for name in ("socket", "patience", "spin", "sent_at", "failed")),
        ("session", c_uint32),
        ("sequence", c_uint32),
        ("link", CLink),
        ("mac", CMac),
    ]


class CVirtual(Structure):
    """A drive at the other end of a network."""

    _fields_ = [
        ("drive", POINTER(CDrive)),
        *((name, c_int64) for name in ("socket", "period", "watchdog", "lease", "ahead")),
        *((name, c_uint32) for name in ("address", "port", "session", "waiting")),
        *((name, c_int64) for name in ("begun", "heard", "alive", "trips", "let_go", "silence")),
        ("taken", c_double),
        ("stop", c_int64),
        ("link", CLink),
        ("greetings", c_int64),
        ("secret", c_byte * KEY),
        ("hello", c_byte * NONCE),
        ("welcome", c_byte * NONCE),
        ("given", CMac),
        ("mac", CMac),
        ("delayed", c_byte * (64 * 104)),
    ]


RECORD = np.dtype(CRecord)
"""A record of the black box as NumPy sees it."""
LAYOUT = sum(
    weight * sizeof(one)
    for weight, one in (
        *((1, CAxis), (3, CSample), (5, CRecord), (7, CSession), (11, CAdapter), (13, CDrive)),
        *((17, CUdp), (19, CVirtual), (23, COrder)),
    )
)
"""What hardware_layout() of a library that fits returns."""

"""What loop.h declares, for ctypes; see there for the meaning of each field."""

from ctypes import POINTER, Structure, c_double, c_int64, c_void_p, sizeof


class CPart(Structure):
    """A component."""

    _fields_ = [
        ("version", c_int64),
        ("instance", c_void_p),
        ("set", c_void_p),
        ("get", c_void_p),
        ("step", c_void_p),
        ("save", c_void_p),
        ("restore", c_void_p),
        ("inputs", c_int64),
        ("outputs", c_int64),
        ("input_references", c_void_p),
        ("output_references", c_void_p),
        ("input", c_void_p),
        ("output", c_void_p),
        ("wire", c_int64),
        ("wires", c_int64),
        ("every", c_int64),
        ("state", c_void_p),
        ("altered", c_void_p),
    ]


class CFault(Structure):
    """What breaks a wire."""

    _fields_ = [
        ("first", c_int64),
        ("last", c_int64),
        ("noise", c_int64),
        ("freeze", c_int64),
        ("gain", c_double),
        ("offset", c_double),
        ("holds", c_int64),
        ("held", c_double),
    ]


class CWire(Structure):
    """A wire."""

    _fields_ = [
        ("source", c_int64),
        ("target", c_int64),
        ("noise", c_int64),
        ("gain", c_double),
        ("offset", c_double),
        ("quantum", c_double),
        ("faults", c_int64),
        ("fault", POINTER(CFault)),
    ]


class CInner(Structure):
    """A wire between components that are coupled."""

    _fields_ = [
        ("wire", c_int64),
        ("back", c_int64),
        ("from_", c_double),
        ("held", c_double),
        ("guess", c_double),
        ("residual", c_double),
        ("scale", c_double),
        ("slope", c_double),
    ]


class CBond(Structure):
    """Two inner wires that carry a power."""

    _fields_ = [("one", c_int64), ("other", c_int64), ("scale", c_double)]


class CStage(Structure):
    """A stage of a tick."""

    _fields_ = [
        ("kind", c_int64),
        ("part", c_int64),
        ("parts", c_int64),
        ("inners", c_int64),
        ("bonds", c_int64),
        ("inner", POINTER(CInner)),
        ("bond", POINTER(CBond)),
        ("tolerance", c_double),
        ("theta", c_double),
        ("most", c_int64),
        ("rounds", c_int64),
        ("greatest", c_int64),
        ("at_limit", c_int64),
        ("relaxation", c_double),
        ("error", c_double),
        ("size", c_double),
    ]


class CColumn(Structure):
    """A recorded column."""

    _fields_ = [
        ("source", c_int64),
        ("mean", c_int64),
        ("late", c_int64),
        ("value", c_double),
        ("sample", c_double),
        ("sum", c_double),
    ]


class CLoop(Structure):
    """The whole loop."""

    _fields_ = [
        ("parts", c_int64),
        ("wires", c_int64),
        ("stages", c_int64),
        ("signals", c_int64),
        ("columns", c_int64),
        ("means", c_int64),
        ("part", POINTER(CPart)),
        ("wire", POINTER(CWire)),
        ("stage", POINTER(CStage)),
        ("column", POINTER(CColumn)),
        ("bus", c_void_p),
        ("signal", c_void_p),
        ("step", c_double),
        ("decimation", c_int64),
        ("tick", c_int64),
        ("warnings", c_int64),
        ("half", c_int64),
        ("edge", c_int64),
        ("halves", c_int64),
        ("sampled", c_int64),
        ("failed", c_int64),
        ("status", c_int64),
        ("since", c_int64),
    ]


LAYOUT = sum(
    weight * sizeof(structure)
    for weight, structure in zip(
        (1, 3, 5, 7, 11, 13, 17, 19), (CLoop, CPart, CWire, CStage, CColumn, CInner, CBond, CFault), strict=True
    )
)
"""What loop_layout() of a library that fits returns."""

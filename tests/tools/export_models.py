"""Small models with known answers, and a bare driver of the two C interfaces, for the tests of the export."""

import ctypes
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np

from pyfmi_models.export import build_library
from pyfmi_models.export.codegen import generate
from pyfmi_models.model import Model, Variable

LUGRE = {"inertia": 30, "sigma0": 9.8e4, "sigma1": 521, "sigma2": 32.8, "Fc": 2.32, "Fs": 3.32, "Vs": 0.0413}


def variable(name, unit="1", **numbers):
    return Variable(name=name, unit=unit, description=f"the {name}", **numbers)


def symbols(states, inputs, parameters):
    return [ca.SX.sym(name, size) for name, size in zip("txup", (1, states, inputs, parameters), strict=True)]


def finish(name, arguments, following, shown, **lists):
    equations = ca.Function("equations", arguments, [ca.vertcat(*following), ca.vertcat(*shown)])
    groups = {"inputs": (), "parameters": (), "states": (), "outputs": ()} | lists
    return Model(name=name, description=f"Test model {name}.", equations=equations, **groups)


def lugre():
    t, x, u, p = symbols(3, 1, 7)
    inertia, sigma0, sigma1, sigma2, Fc, Fs, Vs = ca.vertsplit(p)
    _, w, z = ca.vertsplit(x)
    level = Fc + (Fs - Fc) * ca.exp(-ca.power(ca.fabs(w) / Vs + 1e-12, 2.0))
    rate = w - sigma0 * ca.fabs(w) * z / level
    friction = sigma0 * z + sigma1 * rate + sigma2 * w
    units = ("kg.m2", "N.m/rad", "N.m.s/rad", "N.m.s/rad", "N.m", "N.m", "rad/s")
    parameters = tuple(
        variable(f"friction.{name}" if name != "inertia" else name, unit, start=value, low=1e-9)
        for (name, value), unit in zip(LUGRE.items(), units, strict=True)
    )
    states = (variable("angle", "rad"), variable("speed", "rad/s", nominal=0.01), variable("z", "rad", nominal=1e-5))
    outputs = (variable("reading", "rad"), variable("torque", "N.m"))
    inputs = (variable("drive", "N.m", low=-100, high=100),)
    return finish("lugre", [t, x, u, p], [w, (u - friction) / inertia, rate], [x[0], friction], inputs=inputs,
                  parameters=parameters, states=states, outputs=outputs)  # fmt: skip


def van_der_pol():
    t, x, u, p = symbols(2, 0, 1)
    rates = [x[1], p * (1 - x[0] ** 2) * x[1] - x[0]]
    states = (variable("x", start=2.0), variable("v", "1/s"))
    return finish("vdp", [t, x, u, p], rates, [x[0]], parameters=(variable("mu", start=100.0),), states=states,
                  outputs=(variable("y"),))  # fmt: skip


def oscillator():
    """Forced oscillation, x'' = -x + sin(t) / 2 + u: explicit in time, every output depends on something else."""
    t, x, u, p = symbols(2, 1, 1)
    rates = [x[1], -p * x[0] + 0.5 * ca.sin(t) + u]
    outputs = [x[0], u + p, t]
    return finish("oscillator", [t, x, u, p], rates, outputs, inputs=(variable("force", "N"),),
                  parameters=(variable("stiffness", "N/m", start=1.0),),
                  states=(variable("position", "m", start=1.0), variable("velocity", "m/s")),
                  outputs=(variable("where", "m"), variable("direct"), variable("clock", "s")))  # fmt: skip


def controller(period=1e-3):
    """PD with a memory of the last error and a count of its ticks."""
    t, x, u, p = symbols(3, 2, 2)
    error = u[1] - u[0]
    command = p[0] * error + p[1] * (error - x[0]) / period
    return finish("pd", [t, x, u, p], [error, x[1] + 1, t], [command, x[1]], period=period,
                  inputs=(variable("measured", "rad"), variable("wanted", "rad")),
                  parameters=(variable("kp", "N.m/rad", start=10.0), variable("kd", "N.m.s/rad", start=0.5, low=0)),
                  states=(variable("last", "rad"), variable("count"), variable("moment", "s", start=-1.0)),
                  outputs=(variable("command", "N.m", start=0.25), variable("done")))  # fmt: skip


def undefined_below_zero():
    t, x, u, p = symbols(1, 1, 0)
    return finish("root", [t, x, u, p], [-u], [ca.sqrt(x)], inputs=(variable("sink"),),
                  states=(variable("level", start=1.0),), outputs=(variable("flow"),))  # fmt: skip


def root_of_a_count():
    """Count ticks, and show a root that is none after some of them: the middle of a step fails."""
    t, x, u, p = symbols(1, 1, 1)
    increment = variable("increment", start=1.0, low=0.0, high=2.0, tunable=False)
    return finish("ticking_root", [t, x, u, p], [x + p], [ca.sqrt(u + 3 - x), x], period=1e-3,
                  inputs=(variable("given", start=1.0),), parameters=(increment,), states=(variable("count"),),
                  outputs=(variable("root"), variable("shown")))  # fmt: skip


STATUS = ("ok", "warning", "discard", "error", "fatal")
RESOURCES: bytes | None = b""
"""Folder that an instance is told its resources lie in."""
LOGGER2 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
LOGGER3 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


class Callbacks2(ctypes.Structure):
    _fields_ = (("logger", LOGGER2), *((name, ctypes.c_void_p) for name in ("allocate", "free", "finished", "where")))


class Driver:
    """One instance behind the C interface of FMI 2 or 3, with the messages that it logged."""

    def __init__(self, model: Model, library: Path, fmi: int, kind: str = "CS", token: str | None = None, *,
                 logging: bool = False):  # fmt: skip
        generated = generate(model)
        self.fmi, self.messages, self.logging = fmi, [], logging
        self.references = {row.variable.name: row.reference for row in generated.layout.rows}
        self.library = ctypes.CDLL(str(library))
        token = (generated.token if token is None else token).encode()
        self.instance = self._instantiate2(kind, token) if fmi == 2 else self._instantiate3(kind, token)

    def _instantiate2(self, kind, token):
        logger = LOGGER2(lambda e, n, s, c, m: self.messages.append((STATUS[s], c.decode(), m.decode())))
        self.callbacks = Callbacks2(logger, None, None, None, None)
        self.library.fmi2Instantiate.restype = ctypes.c_void_p
        return self.library.fmi2Instantiate(
            b"it", int(kind == "CS"), token, RESOURCES, ctypes.byref(self.callbacks), 0, self.logging
        )

    def _instantiate3(self, kind, token):
        self.callbacks = LOGGER3(lambda e, s, c, m: self.messages.append((STATUS[s], c.decode(), m.decode())))
        create = self.library.fmi3InstantiateCoSimulation if kind == "CS" else self.library.fmi3InstantiateModelExchange
        create.restype = ctypes.c_void_p
        extra = (False, False, None, ctypes.c_size_t(0)) if kind == "CS" else ()
        tail = (None,) if kind == "CS" else ()
        return create(b"it", token, RESOURCES, False, self.logging, *extra, None, self.callbacks, *tail)

    def call(self, name, *arguments):
        """Call fmi<n><name> on the instance; return the status as a word."""
        function = getattr(self.library, f"fmi{self.fmi}{name}")
        function.restype = ctypes.c_int
        converted = [ctypes.c_double(a) if isinstance(a, float) else a for a in arguments]
        return STATUS[function(ctypes.c_void_p(self.instance), *converted)]

    def initialize(self, start=0.0, tolerance=None, stop=None, **values):
        """Set values and enter initialization mode, where everything may be set and asked."""
        arguments = (tolerance is not None, float(tolerance or 0), start, stop is not None, float(stop or 0))
        statuses = [self.call("SetupExperiment", *arguments)] if self.fmi == 2 else []
        statuses += [self.set(name, value) for name, value in values.items()]
        statuses.append(self.call("EnterInitializationMode", *(arguments if self.fmi == 3 else ())))
        assert set(statuses) == {"ok"}, (statuses, self.messages)
        return self

    def start(self, start=0.0, tolerance=None, stop=None, **values):
        """Bring the instance through initialization, setting values before; return the instance."""
        status = self.initialize(start, tolerance, stop, **values).call("ExitInitializationMode")
        assert status == "ok", self.messages
        return self

    def set(self, name, value):
        reference = self.references[name] if isinstance(name, str) else name
        count = (ctypes.c_size_t(1),) * (2 if self.fmi == 3 else 1)
        values = ctypes.byref(ctypes.c_double(value))
        name = "SetReal" if self.fmi == 2 else "SetFloat64"
        return self.call(name, ctypes.byref(ctypes.c_uint(reference)), count[0], values, *count[1:])

    def get(self, *names):
        """Values of the variables, or the status if it is not ok."""
        references = [self.references[name] if isinstance(name, str) else name for name in names]
        array, values = (ctypes.c_uint * len(names))(*references), (ctypes.c_double * len(names))()
        count = (ctypes.c_size_t(len(names)),) * (2 if self.fmi == 3 else 1)
        status = self.call("GetReal" if self.fmi == 2 else "GetFloat64", array, count[0], values, *count[1:])
        return np.array(values) if status == "ok" else status

    def step(self, time, length):
        if self.fmi == 2:
            return self.call("DoStep", float(time), float(length), 1)
        flags = [ctypes.byref(ctypes.c_bool()) for _ in range(3)]
        return self.call("DoStep", float(time), float(length), True, *flags, ctypes.byref(ctypes.c_double()))

    def run(self, start, count, length):
        for i in range(count):
            status = self.step(start + i * length, length)
            assert status == "ok", self.messages
        return self

    def update(self):
        """Update the discrete states; return the time of the next event, or the status if it is not ok."""
        if self.fmi == 2:
            flags = ctypes.create_string_buffer(32)  # five integers, padding, then the time
            status = self.call("NewDiscreteStates", ctypes.byref(flags))
            time = ctypes.c_double.from_buffer(flags, 24)
        else:
            flags, time = [ctypes.byref(ctypes.c_bool()) for _ in range(5)], ctypes.c_double()
            status = self.call("UpdateDiscreteStates", *flags, ctypes.byref(time))
        return time.value if status == "ok" else status

    def derivative(self, which, unknowns, knowns, seed, more=0):
        """Directional: seed of the knowns -> change of the unknowns; adjoint: the other way; room for `more` results.

        The status, and the results.
        """
        parts = [(ctypes.c_uint * len(part))(*(self.references[one] for one in part)) for part in (unknowns, knowns)]
        result = (ctypes.c_double * (len(knowns if which == "Adjoint" else unknowns) + more))()
        given, many = ((ctypes.c_size_t(len(one)),) if self.fmi == 3 else () for one in (seed, result))
        sizes = [ctypes.c_size_t(len(part)) for part in parts]
        arguments = parts[0], sizes[0], parts[1], sizes[1], (ctypes.c_double * len(seed))(*seed), *given, result, *many
        return self.call(f"Get{which}Derivative", *arguments), np.array(result)

    def save(self):
        state = ctypes.c_void_p()
        assert self.call("GetFMUstate" if self.fmi == 2 else "GetFMUState", ctypes.byref(state)) == "ok"
        return state

    def restore(self, state):
        return self.call("SetFMUstate" if self.fmi == 2 else "SetFMUState", state)

    def serialize(self, state):
        suffix, size = "state" if self.fmi == 2 else "State", ctypes.c_size_t()
        assert self.call(f"SerializedFMU{suffix}Size", state, ctypes.byref(size)) == "ok"
        buffer = ctypes.create_string_buffer(size.value)
        assert self.call(f"SerializeFMU{suffix}", state, buffer, size) == "ok"
        return buffer.raw

    def deserialize(self, content):
        state, name = ctypes.c_void_p(), "DeSerializeFMUstate" if self.fmi == 2 else "DeserializeFMUState"
        status = self.call(name, content, ctypes.c_size_t(len(content)), ctypes.byref(state))
        return state if status == "ok" else status


@cache
def library(make):
    """The compiled library of a model, built once."""
    return build_library(make())


def instance(make, fmi, kind="CS", **start):
    """An instance that has been started, with these values."""
    return Driver(make(), library(make), fmi, kind).start(**start)


def everything(driver):
    """The bytes of all its variables."""
    return driver.get(*driver.references).tobytes()

"""The plant of another team, known only as an FMU, as the base of a diagnosis.

Their model cannot be read, but it can be run: in a stiff loop it follows each recorded motion, low-passed, and the
torque which that takes is what it needs for the motion. A card with the same needs, as near as its parameters go, says
in numbers what their model is like; what is left between the two is taken off the recorded torque,

    tau' = tau - (needed by the FMU - needed by the card)

so recordings miss beside the card exactly what they miss beside the FMU. All of a diagnosis then works as it stands:
base parameters that are refitted, and effects that are found, are corrections to the FMU.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import ceil
from pathlib import Path

import numpy as np
from scipy.interpolate import BPoly, make_interp_spline

from cosim.data.recording import Recording
from cosim.estimation.filters import derivative, lowpass
from cosim.estimation.fit import fit
from cosim.estimation.identify.machine import LONGEST_SUBSTEP
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import Array, Piece, choose_cutoff, prepare
from cosim.fmi.alias import Alias
from cosim.master.simulate import simulate
from cosim.support.errors import InputError, StepError
from cosim.support.files import sha256
from cosim.support.scratch import Scratch
from cosim.support.statistics import rms
from cosim.system.system import System
from cosim.system.wire import Record, Wire
from pyfmi_models.card import Card
from pyfmi_models.controller_section import ControllerSection
from pyfmi_models.export import export_fmu

SET_POINT = ("q_d", "v_d", "a_d")
TRIAL = 5.0
"""Seconds of the first recording on which a loop is tried."""
APPROACH = 2.0
"""Seconds that the FMU is given to come from where it starts to where the recording begins."""
BANDWIDTHS = (600.0, 300.0, 150.0, 75.0)
"""Bandwidths of the loop [rad/s], the stiffest first: a drive with a lag allows less."""
CLOSELY = 0.02
"""The FMU follows if its error stays below this share of the motion, RMS."""


@dataclass(frozen=True)
class BlackBox:
    """A plant FMU with a torque or force input `tau` and an output `q`, and our names for what it calls otherwise."""

    fmu: Path
    variables: Mapping[str, Alias] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Name and content of the FMU."""
        return f"{self.fmu.name} (SHA-256 {sha256(self.fmu)[:12]})"


@dataclass(frozen=True)
class Base:
    """What stands for an FMU in a diagnosis: recordings without what it needs beyond the card that is most like it."""

    train: tuple[Recording, ...]
    heldout: tuple[Recording, ...]
    card: Card
    unlike: float
    """RMS of the torque by which the FMU and the card differ [N m or N]."""


def as_base(
    box: BlackBox,
    train: Sequence[Recording],
    heldout: Sequence[Recording],
    card: Card,
    on_progress: Callable[[str], None] = lambda _: None,
) -> Base:
    """Let an FMU take the place of a card.

    Args:
        box: the FMU; nothing but its input and its output is used.
        train: recordings that may be fitted.
        heldout: recordings that prove the result.
        card: what is believed of the FMU: inertia and friction within a factor of two or so.
        on_progress: told, in a few words, what is being done.

    Raises:
        InputError: no loop makes the FMU follow the recorded motion.
        WiringError, FmuError: the FMU has no such variables, or cannot be run.
    """
    cutoff = choose_cutoff(train, card.mount.inertia)
    recordings = (*train, *heldout)
    prepared = [prepare([one], cutoff) for one in recordings]
    with Scratch() as folder:
        follower = _Follower(box, card, Path(folder), _start(box)).fitting(prepared[0].pieces[0])
        followed = []
        for one in prepared:
            on_progress(f"letting {box.fmu.name} follow {one.names[0]}")
            followed.append([follower.followed(piece) for piece in one.pieces])
    fitted = len(train)
    like = _likeness([piece for pieces in followed[:fitted] for piece in pieces], card)
    inverse, misfits = Inverse(like.plant(), ()), []
    for pieces in followed:  # what the FMU needs beyond the card; nothing at the edges of pieces, where filters settle
        needed = [inverse.torque(piece, np.zeros(0))[0] for piece in pieces]
        misfits.append([np.where(p.inside, p.tau - one, 0.0) for p, one in zip(pieces, needed, strict=True)])
    unlike = rms(np.concatenate([misfit for one in misfits[:fitted] for misfit in one]))
    note = f"The base is {box.label}; the card that is most like it needs another torque by {unlike:.3g} RMS."
    beside = [_without(one, pieces, misfit) for one, pieces, misfit in zip(recordings, followed, misfits, strict=True)]
    beside[0] = replace(beside[0], notes=(*beside[0].notes, note))
    return Base(tuple(beside[:fitted]), tuple(beside[fitted:]), like, unlike)


@dataclass(frozen=True)
class _Follower:
    """A stiff loop around the FMU, without a friction model: the FMU is asked, not the card."""

    box: BlackBox
    card: Card
    folder: Path
    start: float
    """Position at which the FMU starts."""
    bandwidth: float = BANDWIDTHS[0]

    def fitting(self, piece: Piece) -> "_Follower":
        """The stiffest loop in which the FMU follows the first seconds of a motion."""
        count = ceil(TRIAL / piece.dt)
        start = replace(piece, t=piece.t[:count], q=piece.q[:count])
        for bandwidth in BANDWIDTHS:
            loop = replace(self, bandwidth=bandwidth)
            with suppress(StepError):
                if float(np.std(loop.run(start)[0])) < CLOSELY * float(np.std(start.q)):
                    return loop
        raise InputError(
            f"{self.box.fmu.name} does not follow the recorded motion in a loop around it: look at its torque input "
            "and position output (--variables), their signs and units, and at the card's inertia of "
            f"{self.card.mount.inertia:g}.",
            culprit=str(self.box.fmu),
        )

    def followed(self, piece: Piece) -> Piece:
        """The piece with the torque that the FMU needs for its motion, filtered once more."""
        error, tau = self.run(piece)
        slip = lowpass(error, piece.dt, piece.cutoff)
        needed = tau + self.card.mount.inertia * derivative(derivative(slip, piece.dt), piece.dt)
        return replace(piece, tau=piece.lowpass(needed))

    def run(self, piece: Piece) -> tuple[Array, Array]:
        """Let the FMU follow a motion; return its error and its torque at the rows of the piece."""
        per_row = ceil(piece.dt / LONGEST_SUBSTEP)
        step, before = piece.dt / per_row, ceil(APPROACH / piece.dt)
        ticks = (before + len(piece.t) - 1) * per_row + 1
        signals = _path(piece, step, before * per_row, ticks, self.start)
        run = self._simulate(step, ticks, signals, per_row)
        rows = slice(before, before + len(piece.t))
        return piece.q - run["q"][rows], run["tau"][rows]

    def _simulate(self, step: float, ticks: int, signals: Mapping[str, Array], decimation: int) -> Recording:
        wires = [Wire("controller.tau", "plant.tau"), Wire("plant.q", "controller.q")]
        system = System(
            components={"plant": self.box.fmu, "controller": self._loop(step)},
            wires=[*wires, *(Wire(name, f"controller.{name}") for name in signals)],
            records={"tau": Record("plant.tau", "mean"), "q": Record("plant.q")},
            step=step,
            ticks=ticks,
            signals=signals,
            variables={"plant": self.box.variables},
            decimation=decimation,
        )
        return simulate(system).recording

    def _loop(self, step: float) -> Path:
        path = self.folder / f"loop_{self.bandwidth:.0f}_{1e12 * step:.0f}.fmu"
        if not path.exists():
            w = self.bandwidth
            section = ControllerSection(loop_hz=1 / step, kp=w**2, kd=2 * w, observer_bandwidth=3 * w)
            mount = self.card.mount.model_copy(update={"torque_limit": 1e9})
            model = replace(self.card, mount=mount, controller=section).controller_model()
            export_fmu(model, path, fmi=3)
        return path


def _start(box: BlackBox) -> float:
    system = System(
        components={"plant": box.fmu},
        wires=[Wire("none", "plant.tau")],
        records={"q": Record("plant.q")},
        step=LONGEST_SUBSTEP,
        ticks=1,
        signals={"none": np.zeros(1)},
        variables={"plant": box.variables},
    )
    return float(simulate(system).recording["q"][0])


def _path(piece: Piece, step: float, before: int, ticks: int, start: float) -> dict[str, Array]:
    """Set point at every tick: from where the FMU is smoothly onto the motion of the piece, and along it."""
    spline = make_interp_spline(piece.t - piece.t[0], piece.q, k=5)
    t = step * (np.arange(ticks) - before)
    first = [float(spline(0.0, order)) for order in range(3)]
    approach = BPoly.from_derivatives([-before * step, 0.0], [[start, 0.0, 0.0], first])
    return {name: np.where(t < 0, approach(t, k), spline(np.maximum(t, 0), k)) for k, name in enumerate(SET_POINT)}


def _likeness(pieces: Sequence[Piece], card: Card) -> Card:
    """The card whose base needs most nearly the torque that the FMU needs for the motion of these pieces."""
    weight = np.ones(sum(len(piece.kept) for piece in pieces))
    base = fit(card.plant(), pieces, weight).mount
    section = card.mount.model_copy(update={"inertia": float(base.axis.inertia)})
    return replace(card, mount=section, friction=base.friction)


def _without(recording: Recording, pieces: Sequence[Piece], misfits: Sequence[Array]) -> Recording:
    """The recording without a torque that is known at the rows of its pieces."""
    tau = recording["tau"].copy()
    for piece, misfit in zip(pieces, misfits, strict=True):
        rows = (recording.t >= piece.t[0]) & (recording.t <= piece.t[-1])
        tau[rows] -= np.interp(recording.t[rows], piece.t, misfit)
    return replace(recording, table=recording.table | {"tau": tau})

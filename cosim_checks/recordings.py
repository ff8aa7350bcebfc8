"""Recordings of an axis that has the law or effect, made in a closed loop, and what identification makes of them."""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.data.recording import Recording
from cosim.delivery.closed_loop import close_loop
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.effects import TRIED
from cosim.estimation.fit import edges_of, fit, free_parameters, with_values
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import Piece, prepare
from cosim_checks.plant import Array
from cosim_checks.shared import Part, card_of
from cosim_checks.suite import NotApplicable, require
from pyfmi_models.card import Card
from pyfmi_models.controller_section import ControllerSection
from pyfmi_models.effects import Effect
from pyfmi_models.effects.base import TonalEffect
from pyfmi_models.export import export_fmu
from pyfmi_models.friction import FrictionLaw
from pyfmi_models.mount import Mount

CONTROLLER = ControllerSection(kp=225.0, kd=30.0, loop_hz=1000.0, record_hz=200.0, observer_bandwidth=100.0)
"""A loop of 15 rad/s with damping 1, whatever the inertia."""
TONES = ((0.5, 0.11), (0.1, 0.37), (0.03, 0.9))
"""Amplitude [rad] and frequency [Hz] of the set point's waves."""
SECONDS, NOISE = 20.0, 0.005
"""Length of a recording, and noise of its torque [N m]."""
START, BACK, LEAST_SHARE = 1.3, 0.1, 1e-3
"""A fit starts from numbers times the first, must come back within the second (relative), and counts numbers that
change the torque by more than this share of it."""
LEFT = 0.05
"""Share of the torque that a fit may leave of what it made itself."""
BAND = 20.0
"""Of the fit [Hz]."""


def fits_itself(part: Part) -> None:
    """From other numbers, a fit to its own torque comes back to those that it was made with."""
    if isinstance(part, Effect) and not part.is_determined:
        raise NotApplicable("is_determined = False: no fit is asked for it")
    if isinstance(part, TonalEffect):
        raise NotApplicable("its phase is another in each recording: it has no torque of its own")
    mount = card_of(part).plant()
    prefix = "friction" if isinstance(part, FrictionLaw) else list(mount.components())[-1]
    free = [name for name in free_parameters(mount) if name.startswith(f"{prefix}.")]
    if not free:
        raise NotApplicable("no parameter is fitted")
    prepared = prepare([_planned(mount, k) for k in range(2)], BAND)
    pieces = [_with_own_torque(mount, piece) for piece in prepared.pieces]
    true = {one.name: one.start for one in mount.parameters()}
    start = _moved(mount, free, edges_of(mount, pieces))
    found = fit(start, pieces, np.ones(len(prepared.stacked("tau"))), prior=mount, evaluations=60)
    left = float(found.rms / np.std(found.torque))
    require(left < LEFT, f"a fit to its own torque leaves {100 * left:.2g} % of it; are derivatives or bounds wrong?")
    shows = _shown(found.slopes, found.free, found.values, found.torque)
    wrong = {
        name: value
        for name, value in found.parameters().items()
        if name in free and shows[name] > LEAST_SHARE and not _is_back(value, true[name])
    }
    said = ", ".join(f"{name} = {value:.4g}, not {true[name]:.4g}" for name, value in wrong.items())
    require(not wrong, f"a fit to its own torque gives {said}.")


def _planned(mount: Mount, number: int) -> Recording:
    """The set point as a motion; its torque is filled in afterwards."""
    t = np.arange(round(SECONDS * CONTROLLER.record_hz)) / CONTROLLER.record_hz
    inputs = {one.name: _varied(one.start or one.nominal, t, number, k) for k, one in enumerate(mount.inputs())}
    return Recording.of({"t": t, "tau": np.sin(t), "q": _set_point(t, number)["q_d"], **inputs}, f"motion {number + 1}")


def _with_own_torque(mount: Mount, piece: Piece) -> Piece:
    return replace(piece, tau=Inverse(mount, ()).torque(piece, np.zeros(0))[0])


def _moved(mount: Mount, free: Sequence[str], edges: dict[str, tuple[float, float]]) -> Mount:
    known = {one.name: one for one in mount.parameters()}
    starts = [START * known[name].start or 0.1 * known[name].nominal for name in free]
    return with_values(mount, free, np.array([np.clip(x, *edges[n]) for x, n in zip(starts, free, strict=True)]))


def _is_back(value: float, true: float) -> bool:
    return abs(value - true) <= BACK * max(abs(true), 0.1)


def _shown(slopes: Array, free: Sequence[str], values: Array, torque: Array) -> dict[str, float]:
    """By how much of the torque each number shows beside all others."""
    found = {}
    for k, name in enumerate(free):
        others = np.delete(slopes, k, axis=1)
        rest = slopes[:, k] - others @ np.linalg.lstsq(others, slopes[:, k], rcond=1e-9)[0]
        found[name] = float(np.std(rest) * max(abs(values[k]), 0.1) / np.std(torque))
    return found


def found_where_concealed(effect: Effect) -> None:
    """A diagnosis of recordings with the effect, and a card without it, names it."""
    card_of(effect)
    if effect.id not in TRIED:
        raise NotApplicable("it has no hypothesis, so no diagnosis asks for it")
    *train, heldout = recordings_of(effect, 3)
    bare = replace(card_of(effect), effects=(), controller=CONTROLLER)
    found = diagnose(train, [heldout], bare).diagnosis
    answer = {one.effect: one for one in found.findings}.get(effect.id)
    told = ", ".join(found.verdict) or "none"
    why = f"; of it: {answer.statement}" if answer and answer.statement else ""
    require(effect.id in found.verdict, f"concealed, it is not found: the answer is {told}{why}")


def recordings_of(part: Part, count: int) -> list[Recording]:
    """Recordings of an axis with a law or effect under an ADRC, each with another motion and other inputs."""
    card = card_of(part, controller=CONTROLLER)
    plant = card.plant()
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / "plant.fmu", Path(folder) / "controller.fmu"]
        export_fmu(replace(plant.model(), name="plant"), paths[0])
        export_fmu(card.controller_model(), paths[1])
        return [_recorded(card, plant, paths, k) for k in range(count)]


def _recorded(card: Card, plant: Mount, paths: Sequence[Path], number: int) -> Recording:
    step = 1 / CONTROLLER.loop_hz
    t: Array = step * np.arange(round(SECONDS / step), dtype=np.float64)
    asked = _set_point(t, number)
    inputs = {one.name: _varied(one.start or one.nominal, t, number, k) for k, one in enumerate(plant.inputs())}
    given = {"t": t, "tau": np.sin(t), "q": asked["q_d"], **inputs}
    rows = slice(None, None, round(CONTROLLER.loop_hz / CONTROLLER.record_hz))
    frame = Recording.of({name: values[rows] for name, values in given.items()}, f"recording {number + 1}")
    made = close_loop(paths[0], paths[1], card, frame, frame.name, inputs=list(inputs), asked=asked)
    table = {name: np.array(made[name]) for name in ("t", "tau", "q", "q_d")}
    table["tau"] = table["tau"] + NOISE * np.random.default_rng(number).standard_normal(len(table["tau"]))
    return Recording.of(table | {n: values[rows][: len(table["t"])] for n, values in inputs.items()}, made.name)


def _set_point(t: Array, number: int) -> dict[str, Array]:
    """Waves from rest at zero, in other phases for each recording, with both derivatives."""
    found = {name: np.zeros_like(t) for name in ("q_d", "v_d", "a_d")}
    for k, (size, hertz) in enumerate(TONES):
        omega, phase = 2 * np.pi * hertz, 0.7 * number * (k + 1)
        found["q_d"] += size * (np.sin(omega * t + phase) - np.sin(phase))
        found["v_d"] += size * omega * np.cos(omega * t + phase)
        found["a_d"] -= size * omega**2 * np.sin(omega * t + phase)
    return found


def _varied(size: float, t: Array, number: int, k: int) -> Array:
    """An input that varies slowly by 40 %, in another way in each recording."""
    return size * (1 + 0.4 * np.sin(2 * np.pi * (0.07 + 0.05 * number + 0.03 * k) * t + k))

"""Arms of two and three links: what a joint needs while all move; first the elbow in a vertical plane.

    tau_2 = (I + m c^2) (a_1 + a_2) + m l c (cos(q_2) a_1 + sin(q_2) v_1^2) + m g c sin(q_1 + q_2) + friction

q_2 counts from the direction of the first link, both hang down at 0. Reference: Spong, Hutchinson, Vidyasagar, Robot
Modeling and Control (2006), section 7.4.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation
from wandering import swing

from cosim.data.recording import Recording

Array = npt.NDArray[np.float64]
OWN, LEVER, WEIGHT = 0.064, 0.03, 1.2
"""I + m c^2 and m l c [kg m2], and m g c [N m]."""
FC, VISCOUS = 0.15, 0.08
ELBOW, JOINT, WRIST = (
    f'[mount]\ninertia = {inertia}\n[friction]\nmodel = "coulomb"\nFc = {level}\nsigma2 = {viscous}\n'
    for inertia, level, viscous in ((0.064, 0.15, 0.08), (0.3, 0.5, 0.3), (0.06, 0.15, 0.08))
)
"""Cards of the arms' joints."""
SLOW = 2.5
"""As arms move: weights need more torque than accelerations do."""
NOISE, READING = 0.01, 2e-5
"""RMS of the torque's noise [N m] and of the encoders' [rad]."""


class Joint(NamedTuple):
    """Motion of a joint."""

    q: Array
    v: Array
    a: Array


def tones(t: Array, seed: int, size: float) -> Joint:
    """Swings at four frequencies that are another in each joint and recording."""
    dice = np.random.default_rng(seed)
    phases = dice.uniform(0, 2 * np.pi, 4)
    hertz = [f * dice.uniform(0.85, 1.15) for f in (0.15, 0.4, 0.9, 1.9)]
    return Joint(*swing(t, [(size / k, f, p) for k, f, p in zip((1, 2, 4, 8), hertz, phases, strict=True)]))


SLOWLY = np.arange(0.0, 24.0, 0.01)
"""Times at which a slow motion is recorded."""


def slow(one: Joint) -> Joint:
    """A motion of `t / SLOW` over t."""
    return Joint(one.q, one.v / SLOW, one.a / SLOW**2)


def taken(seed: int, t: Array, q: Array, tau: Array, others: Mapping[str, Array], noise: float = NOISE) -> Recording:
    """What is read of a joint and of the positions of others."""
    dice = np.random.default_rng([seed, 1])
    table = {"t": t, "tau": tau + dice.normal(0, noise, len(t))}
    table |= {name: one + dice.normal(0, READING, len(t)) for name, one in {"q": q, **others}.items()}
    return Recording.of(table, f"run {seed}")


def rubbing(own: Joint) -> Array:
    """Friction of a joint."""
    return np.asarray(FC * np.tanh(own.v / 1e-3) + VISCOUS * own.v)


def elbow(seed: int, neighbour: str = "tones", columns: bool = True) -> Recording:
    """A recording of the elbow, with the shoulder's position in column `q1`."""
    t = np.arange(0.0, 12.0, 1 / 250)
    own, held = tones(t, 10 + seed, 0.5), Joint(0.3 + 0 * t, 0 * t, 0 * t)
    moves = {"tones": tones(t, 50 + seed, 0.7), "still": held, "alike": Joint(*(0.7 * one for one in own))}
    other = moves[neighbour]
    tau = OWN * (other.a + own.a) + LEVER * (np.cos(own.q) * other.a + np.sin(own.q) * other.v**2)
    tau = tau + WEIGHT * np.sin(other.q + own.q) + rubbing(own)
    return taken(seed, t, own.q, tau, {"q1": other.q} if columns else {})


def joint(
    seed: int, acting: Mapping[int, tuple[float, float]], noise: float = 0.02, spare: float | None = None
) -> Recording:
    """A joint among three neighbours `q1`, `q2`, `q3` that all move, of which `acting` have h and w by their numbers.

        tau = .3 a + .5 sign(v) + .3 v + sum_n [ h_n a_n + w_n sin(q + q_n) ]

    Where `spare` is given, `q2` moves as `q1` does, but for so much of a motion of its own.
    """
    t = np.arange(0.0, 16.0, 1 / 250)
    own, *others = (tones(t, 1000 * seed + k, 0.8) for k in range(4))
    if spare is not None:
        others[1] = Joint(*(both + spare * one for both, one in zip(others[0], others[1], strict=True)))
    tau = 0.3 * own.a + 0.5 * np.tanh(own.v / 1e-3) + 0.3 * own.v
    for number, (inertia, weight) in acting.items():
        one = others[number - 1]
        tau = tau + inertia * one.a + weight * np.sin(own.q + one.q)
    return taken(seed, t, own.q, tau, {f"q{k}": one.q for k, one in enumerate(others, 1)}, noise)


LINKS, TIP = (0.4, 0.3), (0.05, 0.6, 0.2)
"""Lengths of the two links before a wrist [m]; behind it inertia about its axis [kg m2], mass [kg], lever arm [m]."""


def wrist(seed: int, idle: int = 0) -> Recording:
    """The third of three parallel joints, all of which swing, hand down at 0; shoulder and elbow are `q1`, `q2`.

        tau_3 = I (a_1 + a_2 + a_3) + m c (x'' cos(th) + y'' sin(th)) + m g c sin(th) + friction,  th = q_1 + q_2 + q_3

    (x, y) is where the wrist is, accelerated by both links before it: Newton and Euler's equations of the last link.
    So many joints `q4` and so on swing, too, and are `idle`.
    """
    t = SLOWLY
    shoulder, elbow, own, *others = (slow(tones(t / SLOW, 1000 * seed + 7 * k, 0.8)) for k in range(3 + idle))
    inertia, mass, lever = TIP
    ax, ay, angle, rate, turn = (0 * t for _ in range(5))
    for one, length in zip((shoulder, elbow), LINKS, strict=True):
        angle, rate, turn = angle + one.q, rate + one.v, turn + one.a
        ax = ax + length * (np.cos(angle) * turn - np.sin(angle) * rate**2)
        ay = ay + length * (np.sin(angle) * turn + np.cos(angle) * rate**2)
    angle, turn = angle + own.q, turn + own.a
    tau = inertia * turn + mass * lever * (np.cos(angle) * ax + np.sin(angle) * (ay + 9.81)) + rubbing(own)
    moved = {"q1": shoulder.q, "q2": elbow.q, **{f"q{k}": one.q for k, one in enumerate(others, 4)}}
    return taken(seed, t, own.q, tau, moved)


def forearm(seed: int) -> Recording:
    """A joint whose axis points along x behind one about x, `q1`, and one about y, `q2`; a weight hangs on it.

    Its torque is that of the weight about the axis, r x F turned by the rotations of the three joints; nothing else
    of the links has mass. The joint about y swings about .8 rad: at 0 the others are parallel.
    """
    shoulder, twist, own = (slow(tones(SLOWLY / SLOW, 1000 * seed + 7 * k, 0.8)) for k in range(3))
    twist = Joint(0.8 + twist.q, twist.v, twist.a)
    along, across = (Rotation.from_euler(a, one.q[:, None]) for a, one in (("x", shoulder), ("y", twist)))
    turned = along * across * Rotation.from_euler("x", own.q[:, None])
    torque = np.cross(turned.apply([0.0, 0.3, 0.0]), [0.0, 0.0, -9.81])
    axis = (along * across).apply([1.0, 0.0, 0.0])
    tau = OWN * own.a + rubbing(own) - np.sum(axis * torque, axis=1)
    return taken(seed, SLOWLY, own.q, tau, {"q1": shoulder.q, "q2": twist.q})

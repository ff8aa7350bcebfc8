"""The families of motion that are tried, each inside the room that an axis has: slow, with stops, with reversals, fast.

Each is a function of the room; what it cannot do there in the time it leaves out.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import ceil, pi, sqrt

import numpy as np

from cosim_investigation.motions import FADE, JERK, Motion, Move, Part, Rest, Room, Tones

SPEEDS = (0.03, 0.1, 0.3, 1.0)
"""Shares of the speed limit of a ladder of speeds: three a decade, down to a creep. Unit: 1."""
RESTS = (0.3, 1.0, 3.0)
"""Rests before the same move [s]."""
AT_RANDOM = "multisine"
"""The family of motion at random."""
TONES = 10
"""Tones of a multisine: a decade has four or more of them."""
RESTING = 0.6
"""Most of the time that a stop-and-go rests. Unit: 1."""
LEAST_ROOM = 0.95
"""Share of the time that a sweep at full speed may take: what is left covers rounding. Unit: 1."""
STEPS, WAY = 8, 5.0
"""Reversals of a ladder, and its way in units of the first half stroke: 1 + 3/2 + 3/4 + ..., and to its middle."""


def _filled(room: Room, one_round: list[Part]) -> tuple[Part, ...]:
    """A round again and again, as often as it fits, between two rests; then back to where it began."""
    parts: list[Part] = [Rest(FADE)]
    back = Move(0.0, room.speed, room.acceleration)
    here, left = 0.0, room.seconds - 2 * FADE
    for part in one_round * ceil(room.seconds / 0.1):
        lasts = part.seconds(here)
        if lasts + back.seconds(part.end(here)) > left or lasts <= 0:
            break
        parts.append(part)
        here, left = part.end(here), left - lasts
    return (*parts, back, Rest(FADE + left - back.seconds(here)))


def _stroke(room: Room, share: float) -> list[Part]:
    """Both ways over a part of the room, at one speed."""
    speed = share * room.speed
    return [Move(to, speed, room.acceleration) for to in _ends(room, speed)]


def _ends(room: Room, speed: float, takes: float | None = None) -> tuple[float, float]:
    """Ends about the middle that are reached in time at a speed; the whole room where there is time for it."""
    takes = takes if takes is not None else (room.seconds - 2 * FADE) / 2.5
    half = min(room.reach, max(0.5 * speed * takes, 0.0)) / 2
    sign = 1.0 if room.first >= room.second else -1.0
    around = 0.0 if half < room.reach / 2 and _holds(room, half) else room.middle
    return around + sign * half, around - sign * half


def _holds(room: Room, half: float) -> bool:
    return max(room.first, room.second) >= half and min(room.first, room.second) <= -half


def slow_sweep(room: Room) -> Motion:
    """From end to end as slowly as the time allows; shorter where even full speed would not do."""
    left, way = _seconds_to_move(room), _way(room)
    ramps = 3 / room.acceleration
    speed = min(room.speed, 2 * way / (left + sqrt(max(left**2 - 4 * ramps * way, 0.0))))
    share = way / (2 * room.reach)
    moves: list[Part] = [Move(share * to, speed, room.acceleration) for to in (room.first, room.second)]
    back = Move(0.0, speed, room.acceleration)
    rest = room.seconds - FADE - _lasts([*moves, back])
    return Motion("slow sweep", "a slow sweep from end to end and back", (Rest(FADE), *moves, back, Rest(rest)))


def _seconds_to_move(room: Room) -> float:
    """Seconds for three moves: there, over, back."""
    return room.seconds - 2 * FADE - 3 / JERK


def _way(room: Room) -> float:
    """From here to one end, to the other and back here; as much of it as full speed does in the time."""
    fastest = min(room.speed, _seconds_to_move(room) * room.acceleration / 6)
    return min(2 * room.reach, LEAST_ROOM * fastest * (_seconds_to_move(room) - 3 * fastest / room.acceleration))


def _lasts(parts: list[Part]) -> float:
    """Seconds of parts one after the other, from where the axis stands."""
    return Motion("", "", tuple(parts)).seconds


def fast_sweeps(room: Room) -> Motion:
    """End to end at full speed, which also warms it up."""
    share = _way(room) / (2 * room.reach)
    moves: list[Part] = [Move(share * to, room.speed, room.acceleration) for to in (room.first, room.second)]
    return Motion("warm-up", "sweeps at full speed, the same early and late", _filled(room, moves))


def creep(room: Room) -> Motion:
    """Slow reversals: a few percent of full speed."""
    return Motion("creep", "creeping strokes, both ways", _filled(room, _stroke(room, SPEEDS[0])))


def speed_ladder(room: Room) -> Motion:
    """The same place at several speeds, both ways."""
    parts: list[Part] = []
    for share in SPEEDS:
        speed, takes = share * room.speed, (room.seconds - 2 * FADE) / len(SPEEDS) / 2
        parts += [Move(to, speed, room.acceleration) for to in _ends(room, speed, takes)]
    return Motion("speed ladder", "strokes at 3, 10, 30 and 100 % of full speed, both ways", _filled(room, parts))


def stop_and_go(room: Room) -> Motion:
    """The same move after rests of different lengths: twice, or once and with shorter rests where the time is short."""
    left = room.seconds - 2 * FADE
    rests = RESTS * (2 if RESTING * left >= 2 * sum(RESTS) else 1)
    shorter = min(1.0, RESTING * left / sum(rests))
    takes = (left - shorter * sum(rests)) / (len(rests) + 1)
    speed = min(room.speed / 2, room.acceleration * max(takes - 1 / JERK, 0.0) / 3)
    way = min(speed * max(takes - speed / room.acceleration - 1 / JERK, 0.0), room.reach / 4)
    far = room.first if abs(room.first) >= way else room.second
    parts: list[Part] = []
    for number, rest in enumerate(rests):
        to = 0.0 if number % 2 else way * (1.0 if far > 0 else -1.0)
        parts += [Move(to, speed, room.acceleration), Rest(shorter * rest)]
    return Motion("stop-and-go", "the same move after rests of different lengths", _filled(room, parts))


def reversal_ladder(room: Room) -> Motion:
    """Reversals that get smaller and smaller."""
    speed, left = 0.2 * room.speed, room.seconds - 2 * FADE
    half = min(room.reach / 2, speed * max(left - STEPS / JERK, 0.0) / WAY)
    around = 0.0 if _holds(room, half) else room.middle
    sign = 1.0 if room.first >= room.second else -1.0
    sizes = [sign * half * 0.5**k * (-1) ** k for k in range(STEPS)]
    parts: list[Part] = [Move(around, room.speed, room.acceleration)] if around else []
    parts += [Move(around + size, speed, room.acceleration) for size in sizes]
    return Motion("reversal ladder", "slow reversals, each half as large as the one before", _filled(room, parts))


def tone(room: Room) -> Motion:
    """One sine that reaches full speed and full acceleration."""
    hertz = room.outside(min(room.acceleration / (2 * pi * room.speed), room.frequency))
    return Motion("tone", f"a sine of {hertz:.2g} Hz", _tones(room, [hertz], [0.0]))


def fast_tone(room: Room) -> Motion:
    """One sine as fast as the loop follows."""
    hertz = room.outside(room.frequency)
    return Motion("fast tone", f"a sine of {hertz:.2g} Hz", _tones(room, [hertz], [0.0]))


def multisine(room: Room) -> Motion:
    """Many tones at once, from a stroke in the time there is to what the loop follows; phases from a seed."""
    every = np.geomspace(2 / room.seconds, room.frequency, TONES).tolist()
    hertz = sorted({room.outside(one) for one in every})
    phases = np.random.default_rng(room.seed).uniform(0, 2 * pi, TONES).tolist()[: len(hertz)]
    return Motion(AT_RANDOM, "many tones at once", _tones(room, hertz, phases))


def _tones(room: Room, hertz: list[float], phases: list[float]) -> tuple[Part, ...]:
    """Tones with as much speed each, up to where the acceleration ends it, scaled so that all limits hold."""
    sizes = [min(1.0, room.acceleration / (room.speed * 2 * pi * f)) / (2 * pi * f) for f in hertz]
    half = min(abs(room.first), abs(room.second))
    move: list[Part] = []
    back: list[Part] = []
    to_middle = Move(room.middle, 0.5 * room.speed, room.acceleration)
    if half < room.reach / 4 and to_middle.seconds(0.0) < (room.seconds - 2 * FADE) / 4:  # half of the time for tones
        move, back, half = [to_middle], [replace(to_middle, to=0.0)], room.reach / 2
    lasts = room.seconds - 2 * FADE - 2 * sum(one.seconds(0.0) for one in move)
    whole = Tones(lasts, tuple(hertz), tuple(sizes), tuple(phases))
    q, v, a = whole.sampled(np.arange(0.0, lasts, min(0.02 / max(hertz), 0.02 * FADE)), 0.0)
    tops = zip((q, v, a), (half, room.speed, room.acceleration), strict=True)
    scale = min(limit / max(float(np.abs(one).max()), 1e-300) for one, limit in tops)
    scaled = replace(whole, sizes=tuple(scale * size for size in sizes))
    return (Rest(FADE), *move, scaled, *back, Rest(FADE))


FAMILIES: tuple[Callable[[Room], Motion], ...] = (
    *(slow_sweep, creep, speed_ladder, stop_and_go, reversal_ladder, fast_sweeps, tone, fast_tone, multisine),
)


def motions(room: Room) -> Iterator[Motion]:
    """One motion of each family that has room; the slowest first."""
    for family in FAMILIES:
        yield family(room)

"""Set points: position, speed and acceleration at every controller tick, starting at rest at 0."""

import numpy as np
from scipy.ndimage import uniform_filter1d


def _smooth(q, width):
    """Limit jerk: two moving averages, `width` ticks each."""
    width = max(int(width), 1)
    return uniform_filter1d(uniform_filter1d(q, width, mode="nearest"), width, mode="nearest")


def _derivatives(q, period):
    v = np.gradient(q, period)
    return q, v, np.gradient(v, period)


def _move(distance, speed, acceleration, period):
    """One move with trapezoidal speed, relative positions a tick."""
    reach = min(speed, np.sqrt(abs(distance) * acceleration))
    ramp, total = reach / acceleration, abs(distance) / reach + reach / acceleration
    t = np.arange(1, int(np.ceil(total / period)) + 1) * period
    up = 0.5 * acceleration * np.minimum(t, ramp) ** 2
    flat = reach * np.clip(t - ramp, 0, total - 2 * ramp)
    down = np.clip(t - (total - ramp), 0, ramp)
    return np.sign(distance) * (up + flat + reach * down - 0.5 * acceleration * down**2)


class Path:
    """Positions that grow move by move until the time is filled."""

    def __init__(self, ticks, period, rest):
        """Begin with a rest [s]."""
        self.ticks, self.period, self.here = ticks, period, 0.0
        self.parts, self.length = [np.zeros(int(rest / period))], int(rest / period)

    @property
    def open(self):
        return self.length < self.ticks

    def rest(self, seconds):
        self._add(np.full(max(int(seconds / self.period), 1), self.here))

    def go(self, target, speed, acceleration):
        if abs(target - self.here) > 1e-12:
            self._add(self.here + _move(target - self.here, speed, acceleration, self.period))
            self.here = target

    def _add(self, part):
        self.parts.append(part)
        self.length += len(part)

    def array(self):
        return np.concatenate(self.parts)


def sweeps(rng, path, m):
    """Strokes back and forth, each at another speed from slow to fast."""
    ends = m["stroke"] * np.array([rng.uniform(-1, -0.6), rng.uniform(0.6, 1)])
    side = int(rng.integers(2))
    while path.open:
        speed = m["v"] * np.exp(rng.uniform(np.log(m["slowest"]), 0))
        speed = max(speed, abs(ends[1] - ends[0]) / 12)
        path.go(ends[side], speed, m["a"] * rng.uniform(0.3, 1))
        path.rest(rng.uniform(0.02, 0.6) * m["rests"])
        side = 1 - side


def stop_and_go(rng, path, m):
    """Random moves with rests."""
    while path.open:
        target = np.clip(path.here + m["stroke"] * rng.uniform(-0.7, 0.7), -m["stroke"], m["stroke"])
        path.go(target, m["v"] * rng.uniform(0.08, 0.9), m["a"] * rng.uniform(0.2, 1))
        path.rest(rng.uniform(0.15, 1.5))


def long_rests(rng, path, m):
    """Moves apart by rests from tenths of a second to many seconds."""
    while path.open:
        target = m["stroke"] * rng.uniform(0.1, 0.5) * (1 if path.here <= 0 else -1)
        path.go(target, m["v"] * rng.uniform(0.05, 0.3), m["a"] * rng.uniform(0.2, 0.8))
        path.rest(np.exp(rng.uniform(np.log(0.2), np.log(10))))


def short_strokes(rng, path, m):
    """Reversals over a few times the pre-sliding distance up to a tenth of the stroke."""
    least = max(3 * m["presliding"], 25 * m["resolution"])
    most = max(0.12 * m["stroke"], 3 * least)
    while path.open:
        size = np.exp(rng.uniform(np.log(least), np.log(most))) * (1 if path.here <= 0 else -1)
        path.go(size, m["v"] * rng.uniform(0.02, 0.2), m["a"] * rng.uniform(0.1, 0.6))
        if rng.random() < 0.3:
            path.rest(rng.uniform(0.05, 0.8))


def steps(rng, path, m):
    """Steps; the smoothing that follows is the trajectory filter."""
    while path.open:
        path.here = m["stroke"] * rng.uniform(-0.6, 0.6)
        path.rest(rng.uniform(0.7, 2.5))


MOVES = {"sweeps": sweeps, "stop_and_go": stop_and_go, "long_rests": long_rests, "short_strokes": short_strokes}


def _lowest(m):
    """Frequency at which stroke and speed are used up together [Hz]."""
    return min(m["v"] / (2 * np.pi * m["stroke"]), 0.3 * m["f_top"])


def _multisine(rng, t, m, ticks):
    """Several sines whose speed and acceleration stay within limits; fades in."""
    count = int(rng.integers(4, 10))
    low = _lowest(m) * rng.uniform(0.5, 1.2)
    f = np.exp(rng.uniform(np.log(low), np.log(m["f_top"]), count))
    f[0] = low
    size = rng.uniform(0.4, 1, count) / f ** rng.uniform(1.2, 2.2)
    q = sum(a * np.sin(2 * np.pi * x * t + rng.uniform(0, 6.28)) for a, x in zip(size, f, strict=True))
    return q - q[0]


def _chirp(rng, t, m, ticks):
    """A sine whose frequency grows exponentially, on a slow drift."""
    top, low, span = (
        m["f_top"] * rng.uniform(0.6, 1),
        _lowest(m) * rng.uniform(0.6, 1.5),
        t[-1] / int(rng.integers(1, 3)),
    )
    x = (t % span) / span
    phase = 2 * np.pi * low * span / np.log(top / low) * ((top / low) ** x - 1)
    f = low * (top / low) ** x
    fade = np.clip((1 - x) * span / 0.5, 0, 1) * np.clip(x * span / 0.5, 0, 1)
    slow = np.sin(2 * np.pi * t * rng.uniform(0.03, 0.08))
    return fade * np.sin(phase) * (low / f) ** rng.uniform(1.2, 2.0) + rng.uniform(0.4, 2) * slow


def _triangle(rng, t, m, ticks):
    """Back and forth at one speed, then at another."""
    cycle = 4 * m["stroke"] * 0.8 / (m["v"] * np.exp(rng.uniform(np.log(max(m["slowest"], 0.1)), np.log(0.7), 3)))
    cycle = np.clip(cycle, 0.8, t[-1] / 3)
    rate = 1 / cycle[np.minimum((3 * t / (t[-1] + 1e-9)).astype(int), 2)]
    x = np.cumsum(rate) * (t[1] - t[0])
    return 2 / np.pi * np.arcsin(np.sin(2 * np.pi * x)) * 0.8 * m["stroke"]


WAVES = {"multisine": _multisine, "chirp": _chirp, "triangle": _triangle}
KINDS = (*MOVES, "steps", *WAVES)


def make(kind, rng, seconds, period, machine):
    """Make a set point of a kind; `machine` holds stroke, v, a, slowest, f_top, presliding and resolution."""
    ticks = int(seconds / period)
    more = ticks + int(3 / period)  # so that nothing stops where the recording does
    rest = rng.uniform(0.4, 1.5)
    if kind in WAVES:
        q = _wave(kind, rng, np.arange(more) * period, rest, period, machine)
    else:
        path = Path(more, period, rest)
        (steps if kind == "steps" else MOVES[kind])(rng, path, machine)
        q = path.array()
        if kind == "steps":
            q = _within(_smooth(_smooth(q, 0.15 / period), 0.2 / period), period, machine, kind)
        q = _smooth(q, rng.uniform(0.01, 0.03) / period)
    return tuple(x[:ticks] for x in _derivatives(q, period))


def _wave(kind, rng, t, rest, period, machine):
    q = WAVES[kind](rng, t, machine, len(t))
    corner = 2.2 * min(np.max(np.abs(np.diff(q))) / period, machine["v"]) / machine["a"] if kind == "triangle" else 0.0
    begin = np.clip((t - rest - corner) / 1.0, 0, 1)  # at rest until the filter of the corners has passed the start
    q = q * begin**2 * (3 - 2 * begin)
    return _within(_smooth(q, (0.01 + corner) / period), period, machine, kind)


def _within(q, period, m, kind):
    """Scale a wave into stroke, speed and acceleration."""
    end = -int(1 / period)  # a filter stops at the end of its input
    v = np.gradient(q, period)[:end]
    a = np.gradient(v, period)
    share = [np.max(np.abs(q)) / m["stroke"], np.max(np.abs(v)) / m["v"]]
    if kind != "triangle":
        share.append(np.max(np.abs(a)) / m["a"])
        return q / max(share)
    return q / max(max(share), 1.0)

"""A motor as another team would export it, with numbers to identify, for calibrations.

    J w' = gear kt i - d w - Fc tanh(w / 0.05),   phi' = w;   outputs w and phi, input i

`idle` does nothing. Beyond |J| = `crash_above` it crashes, below `nan_below` it gives NaN, below `hang_below` it hangs.
`planted` changes what it does: 1 the sign, 2 a gain of 1.05, 3 no friction, 4 one sample late, 5 an offset, 6 an
inertia 2 % larger, 7 a speed that ends at 2, 8 an angle by Euler's rule, 9 degrees, 10 an input one step late.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from compiling import compiled, with_stubs
from compiling import packed as pack
from tiny_fmu import SOURCE as TINY
from tiny_fmu import Row, description

SOURCE = (
    TINY[: TINY.index("enum {")]
    + r"""
enum { I, J, D, FC, KT, GEAR, IDLE, CRASH_ABOVE, NAN_BELOW, HANG_BELOW, PLANTED, W, PHI, COUNT };
typedef struct { double v[COUNT], late, before; char name[99]; void *log; int final; } M;
typedef void Log2(void *, const char *, int, const char *, const char *, ...);
typedef void Log3(void *, int, const char *, const char *);
enum { CHATTER = -1, END = -2, EARLY = -3, STATUS = IDLE };
static M *make(void) { M *m = calloc(1, sizeof(M));
  double start[COUNT] = {0, 0.02, 0.05, 0.1, 0.1, 2, 1, 1e9, -1e9, -1e9, BUILT, 0, 0};
  memcpy(m->v, start, sizeof start); return m; }
static int set(M *m, const unsigned *r, size_t n, const double *x) { while (n--) m->v[r[n]] = x[n]; return 0; }
static int get(M *m, const unsigned *r, size_t n, double *x) {
  int p = (int)m->v[PLANTED];
  while (n--) { double g = p == 1 ? -1 : p == 2 ? 1.05 : p == 9 ? 57.29578 : 1, o = p == 5 ? .02 : 0;
    double w = p == 4 ? m->late : p == 7 ? fmin(m->v[W], 2) : m->v[W];
    x[n] = r[n] == W ? g * w + o : m->v[r[n]]; }
  return 0; }
static int save(M *m, M **s) { if (!*s) *s = make(); **s = *m; return 0; }
static double rate(M *m, double w) { double f = m->v[PLANTED] == 3 ? 0 : m->v[FC];
  double i = m->v[PLANTED] == 10 ? m->before : m->v[I];
  return (m->v[GEAR] * m->v[KT] * i - m->v[D] * w - f * tanh(w / 0.05)) / m->v[J] / (m->v[PLANTED] == 6 ? 1.02 : 1); }
static int step(M *m, double t, double h) {
  if (m->v[J] > m->v[CRASH_ABOVE]) raise(SIGSEGV);
  while (m->v[J] < m->v[HANG_BELOW]) sleep(1);
  int n = (int)ceil(h / 1e-3 - 1e-9); double s = h / n;
  m->late = m->v[W];
  for (int k = 0; k < n; k++) { double w = m->v[W], a = rate(m, w), b = rate(m, w + s / 2 * a),
    c = rate(m, w + s / 2 * b), e = rate(m, w + s * c), next = w + s / 6 * (a + 2 * b + 2 * c + e);
    m->v[PHI] += m->v[PLANTED] == 8 ? s * w : s * (w + next) / 2; m->v[W] = next; }
  m->before = m->v[I];
  if (m->v[J] < m->v[NAN_BELOW]) m->v[W] = NAN;
  return 0; }
"""
    + TINY[TINY.index("#define API") :]
)
TRUTH = {"J": 0.013, "d": 0.08, "Fc": 0.16}
"""The numbers of what is recorded; the FMU states others."""
VARIABLES: tuple[Row, ...] = (
    ("i", "input", "A", "0", ""),
    ("J", "parameter", "kg.m2", "0.02", 'min="1e-6" nominal="0.01"'),
    ("d", "parameter", "N.m.s/rad", "0.05", 'min="0"'),
    ("Fc", "parameter", "N.m", "0.1", 'min="0"'),
    ("kt", "parameter", "N.m/A", "0.1", 'min="0"'),
    ("gear", "parameter", "1", "2", 'min="0"'),
    ("idle", "parameter", "1", "1", ""),
    ("crash_above", "parameter", "kg.m2", "1e9", ""),
    ("nan_below", "parameter", "kg.m2", "-1e9", ""),
    ("hang_below", "parameter", "kg.m2", "-1e9", ""),
    ("planted", "parameter", "1", "0", ""),
    ("w", "output", "rad/s", "0", ""),
    ("phi", "output", "rad", "0", ""),
)


EXPERIMENT = '<DefaultExperiment startTime="0" stopTime="2" stepSize="0.01"/>'
TIME = '<Float64 name="time" valueReference="99" causality="independent" variability="continuous"/>'


def motor(directory: Path, version: int, planted: int = 0) -> Path:
    """Compile and pack the motor for one FMI version, with an error planted in its binary."""
    stem = f"motor{version}{f'_{planted}' if planted else ''}"
    return packed(directory, stem, SOURCE, VARIABLES, version, "motor", f"-DBUILT={planted}")


def packed(
    directory: Path, stem: str, source: str, variables: Sequence[Row], version: int, name: str, *options: str
) -> Path:
    """Compile and pack an FMU written like the motor, whose value references are the places of its variables."""
    library = compiled(name, with_stubs(source), *options)
    xml = description(version, variables, name).replace("<ModelVariables>", EXPERIMENT + "<ModelVariables>")
    if version == 3:
        xml = xml.replace("</ModelVariables>", TIME + "</ModelVariables>")
    return pack(directory / f"{stem}.fmu", version, xml, library)


def driven(fmu, given, truth=None, *, into="i", outputs=("w", "phi"), step=0.01) -> dict[str, np.ndarray]:
    """What an FMU with these numbers answers to the samples of an input, a row a sample."""
    from cosim.master.simulate import simulate
    from cosim.system.system import System
    from cosim.system.wire import Record, Wire

    system = System(
        components={"m": fmu},
        records={name: Record(f"m.{name}") for name in outputs},
        wires=[Wire("given.value", f"m.{into}")],
        signals={"given": given},
        parameters={"m": truth or {}},
        step=step,
        ticks=len(given) - 1,
        last=True,
    )
    table = simulate(system).recording.table
    return {name: table[name] for name in outputs}


def recorded(fmu: Path, truth: dict[str, float], seed: int = 1, rows: int = 400, noise: float = 0.02) -> dict:
    """Columns of the motor with these numbers, with white noise on both outputs."""
    random = np.random.default_rng(seed)
    t = 0.01 * np.arange(rows)
    current = 3 * np.sin(2 * np.pi * (0.3 + 0.4 * t) * t) + random.choice([-1.0, 1.0]) * (t % 1.3 > 0.7)
    noisy = {name: one + noise * random.standard_normal(rows) for name, one in driven(fmu, current, truth).items()}
    return {"t": t, "i": current, **noisy}

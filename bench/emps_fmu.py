"""The EMPS axis as another team would export it: an FMU written from the equations of its benchmark, by hand.

    M v' = F - offset - Fv v - Fc sign(v),   q' = v;   input F [N]; outputs q [m], v [m/s] can be set at the start

Dry friction holds at rest whatever is below Fc: a step of 0.1 ms of Moreau's time stepping, in which friction takes at
most h Fc / M of the speed and never turns it. Numbers at the start are those that the benchmark publishes.
Reference: Janot, Gautier, Brunot, Data Set and Reference Models of EMPS, 2019.
"""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / one) for one in ("tests/tools", "tests/exchange")]
from motor_fmu import packed  # noqa: E402
from tiny_fmu import SOURCE as TINY  # noqa: E402

STARTS = {"M": 95.1089, "Fv": 203.5034, "Fc": 20.3935, "offset": 0.0}
SOURCE = (
    TINY[: TINY.index("enum {")]
    + r"""
enum { F, MASS, FV, FC, OFFSET, Q, V, COUNT };
typedef struct { double v[COUNT]; char name[99]; void *log; } M;
typedef void Log2(void *, const char *, int, const char *, const char *, ...);
typedef void Log3(void *, int, const char *, const char *);
enum { CHATTER = -1, END = -2, EARLY = -3, STATUS = OFFSET };
static M *make(void) { M *m = calloc(1, sizeof(M));
  m->v[MASS] = 95.1089; m->v[FV] = 203.5034; m->v[FC] = 20.3935; return m; }
static int set(M *m, const unsigned *r, size_t n, const double *x) { while (n--) m->v[r[n]] = x[n]; return 0; }
static int get(M *m, const unsigned *r, size_t n, double *x) { while (n--) x[n] = m->v[r[n]]; return 0; }
static int save(M *m, M **s) { if (!*s) *s = make(); **s = *m; return 0; }
static int step(M *m, double t, double h) {
  int n = (int)ceil(h / 1e-4 - 1e-9); double s = h / n, *v = m->v;
  for (int k = 0; k < n; k++) {
    double before = v[V], free = v[V] + s / v[MASS] * (v[F] - v[OFFSET] - v[FV] * v[V]), most = s / v[MASS] * v[FC];
    v[V] = fabs(free) <= most ? 0 : free - copysign(most, free);
    v[Q] += s * (before + v[V]) / 2; }
  return 0; }
"""
    + TINY[TINY.index("#define API") :]
)
VARIABLES = (
    ("F", "input", "N", "0", ""),
    ("M", "parameter", "kg", "95.1089", 'min="1"'),
    ("Fv", "parameter", "N.s/m", "203.5034", 'min="0"'),
    ("Fc", "parameter", "N", "20.3935", 'min="0"'),
    ("offset", "parameter", "N", "0", ""),
    ("q", "output", "m", "0", ""),
    ("v", "output", "m/s", "0", ""),
)


def emps(directory: Path) -> Path:
    """Compile and pack the axis for FMI 3.0."""
    return packed(directory, "emps", SOURCE, VARIABLES, 3, "emps")

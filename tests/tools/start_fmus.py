"""Small FMUs for what happens at the start, of FMI 2 and 3: one library holds them, and their token says which it is.

- `source`: y = c
- `lag`: x = u in initialisation mode, then x' = u - x
- `home`: what u is when initialisation ends is its home; tau = -100 (u - home) after each step
- `late`: y = u is computed when initialisation ends, and not before
- `gain`: y = k u + c at once
- `square`: y = c - k u^2 at once, of which it gives the derivative
- `once`: y = u; u may be set once, and y is refused before
- `inverse`: y = 1 / u; cannot be computed (discard) where u = 0
- `strict`: y = u; inputs are refused before initialisation mode, and what is no output cannot be read in it
- `liar`: y = k u + c at once, whatever its description says
- `integer`: n_out = n + 1, text_out = text, on_out = on (FMI 2)
- `array`: y = 2 u, three elements (FMI 3)
- `single`: y = k u + c in Float32 (FMI 3)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from compiling import compiled, with_stubs
from compiling import packed as pack

SOURCE = r"""
enum { U, Y, K, C, X, DX, CALLS, LOCAL, ARRAY_U = 8, ARRAY_Y = 12, SIZE = 16 };
enum { INSTANTIATED, INITIALISING, RUNNING };
typedef struct { double r[SIZE], home; float f[SIZE]; int n[2], b[2], mode; bool set; char text[2][64], model[32]; } M;
static bool is(const M *m, const char *name) { return !strcmp(m->model, name); }
static M *make(const char *model) {
  M *m = calloc(1, sizeof(M)); strncpy(m->model, model, 31);
  m->r[K] = 1; m->f[K] = 1; if (is(m, "inverse")) m->r[U] = 0; return m; }
static void compute(M *m) {
  bool begins = m->mode != RUNNING;
  if (is(m, "source")) m->r[Y] = m->r[C];
  if (is(m, "gain") || is(m, "strict") || is(m, "liar") || is(m, "once")) m->r[Y] = m->r[K] * m->r[U] + m->r[C];
  if (is(m, "square")) m->r[Y] = m->r[C] - m->r[K] * m->r[U] * m->r[U];
  if (is(m, "inverse")) m->r[Y] = 1 / m->r[U];
  if (is(m, "lag") && begins) m->r[X] = m->r[U];
  if (is(m, "lag")) { m->r[DX] = m->r[U] - m->r[X]; m->r[Y] = m->r[X]; }
  if (is(m, "integer")) { m->n[1] = m->n[0] + 1; m->b[1] = m->b[0]; strcpy(m->text[1], m->text[0]); }
  for (int i = 0; i < 3; i++) m->r[ARRAY_Y + i] = 2 * m->r[ARRAY_U + i];
  m->f[Y] = m->f[K] * m->f[U] + m->f[C];
  m->r[LOCAL] = m->r[U]; }
static int may_set(M *m, unsigned r) {
  if (r == U && m->mode == INSTANTIATED && is(m, "strict")) return 3;
  if (r == U && m->mode == INITIALISING && is(m, "once")) { if (m->set) return 3; m->set = true; }
  if (m->mode == INITIALISING) m->r[CALLS]++;
  return 0; }
static int may_get(M *m, unsigned r) {
  if (m->mode == INITIALISING && is(m, "strict") && r != Y) return 3;
  if (m->mode == INITIALISING && is(m, "once") && r == Y && !m->set) return 3;
  return is(m, "inverse") && r == Y && m->r[U] == 0 ? 2 : 0; }
static int size_of(unsigned r) { return r >= ARRAY_U ? 3 : 1; }
static int set(M *m, const unsigned *r, size_t n, const double *x) {
  for (size_t i = 0; i < n; i++) { int s = may_set(m, r[i]); if (s) return s;
    for (int e = 0; e < size_of(r[i]); e++) m->r[r[i] + e] = *x++; } return 0; }
static int get(M *m, const unsigned *r, size_t n, double *x) {
  compute(m);
  for (size_t i = 0; i < n; i++) { int s = may_get(m, r[i]); if (s) return s;
    for (int e = 0; e < size_of(r[i]); e++) *x++ = m->r[r[i] + e]; } return 0; }
static int leave(M *m) {
  compute(m); m->home = m->r[U]; if (is(m, "late")) m->r[Y] = m->r[U];
  m->mode = RUNNING; return 0; }
static int step(M *m, double h) {
  if (is(m, "lag")) m->r[X] += h * (m->r[U] - m->r[X]);
  if (is(m, "home")) m->r[Y] = -100 * (m->r[U] - m->home);
  if (is(m, "late")) m->r[Y] = m->r[U];
  return 0; }
static int slope(M *m, size_t n, size_t k, const double *seed, double *found) {
  if (!is(m, "square") || n != 1 || k != 1) return 3;
  m->r[CALLS] += 1000; found[0] = -2 * m->r[K] * m->r[U] * seed[0]; return 0; }
API void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, void *c, int v, int l) { return make(g); }
API int fmi2EnterInitializationMode(M *m) { m->mode = INITIALISING; return 0; }
API int fmi2ExitInitializationMode(M *m) { return leave(m); }
API int fmi2Reset(M *m) { M *n = make(m->model); *m = *n; free(n); return 0; }
API int fmi2SetReal(M *m, const unsigned *r, size_t n, const double *x) { return set(m, r, n, x); }
API int fmi2GetReal(M *m, const unsigned *r, size_t n, double *x) { return get(m, r, n, x); }
API int fmi2SetInteger(M *m, const unsigned *r, size_t n, const int *x) { while (n--) m->n[r[n]] = x[n]; return 0; }
API int fmi2GetInteger(M *m, const unsigned *r, size_t n, int *x) {
  compute(m); while (n--) x[n] = m->n[r[n]]; return 0; }
API int fmi2SetBoolean(M *m, const unsigned *r, size_t n, const int *x) { while (n--) m->b[r[n]] = x[n]; return 0; }
API int fmi2GetBoolean(M *m, const unsigned *r, size_t n, int *x) {
  compute(m); while (n--) x[n] = m->b[r[n]]; return 0; }
API int fmi2SetString(M *m, const unsigned *r, size_t n, const char **x) {
  while (n--) strncpy(m->text[r[n]], x[n], 63); return 0; }
API int fmi2GetString(M *m, const unsigned *r, size_t n, const char **x) {
  compute(m); while (n--) x[n] = m->text[r[n]]; return 0; }
API int fmi2DoStep(M *m, double t, double h, int p) { return step(m, h); }
API int fmi2GetDirectionalDerivative(M *m, const unsigned *y, size_t n, const unsigned *u, size_t k, const double *s,
  double *d) { return slope(m, n, k, s, d); }
typedef struct { int again, end, nominals, values, has_next; double next; } Event;
API int fmi2NewDiscreteStates(void *m, Event *e) { memset(e, 0, sizeof *e); return 0; }
API int fmi2CompletedIntegratorStep(void *m, int no, int *enter, int *end) { *enter = *end = 0; return 0; }
API int fmi2SetContinuousStates(M *m, const double *x, size_t n) { m->r[X] = x[0]; return 0; }
API int fmi2GetContinuousStates(M *m, double *x, size_t n) { compute(m); x[0] = m->r[X]; return 0; }
API int fmi2GetDerivatives(M *m, double *x, size_t n) { compute(m); x[0] = m->r[DX]; return 0; }
API int fmi2GetNominalsOfContinuousStates(M *m, double *x, size_t n) { x[0] = 1; return 0; }
API void *fmi3InstantiateCoSimulation(const char *n, const char *g, const char *r, bool a, bool b, bool c, bool d,
  const unsigned *q, size_t w, void *environment, void *log, void *i) { return make(g); }
API void *fmi3InstantiateModelExchange(const char *n, const char *g, const char *r, bool a, bool b, void *e, void *l) {
  return make(g); }
API int fmi3EnterInitializationMode(M *m, bool a, double b, double c, bool d, double e) {
  m->mode = INITIALISING; return 0; }
API int fmi3ExitInitializationMode(M *m) { return leave(m); }
API int fmi3Reset(M *m) { return fmi2Reset(m); }
API int fmi3SetFloat64(M *m, const unsigned *r, size_t n, const double *x, size_t k) { return set(m, r, n, x); }
API int fmi3GetFloat64(M *m, const unsigned *r, size_t n, double *x, size_t k) { return get(m, r, n, x); }
API int fmi3SetFloat32(M *m, const unsigned *r, size_t n, const float *x, size_t k) {
  while (n--) m->f[r[n]] = x[n]; return 0; }
API int fmi3GetFloat32(M *m, const unsigned *r, size_t n, float *x, size_t k) {
  compute(m); while (n--) x[n] = m->f[r[n]]; return 0; }
API int fmi3DoStep(M *m, double t, double h, bool p, bool *e, bool *x, bool *y, double *l) {
  *e = *x = *y = false; *l = t + h; return step(m, h); }
API int fmi3GetDirectionalDerivative(M *m, const unsigned *y, size_t n, const unsigned *u, size_t k, const double *s,
  size_t a, double *d, size_t b) { return slope(m, n, k, s, d); }
API int fmi3UpdateDiscreteStates(void *m, bool *a, bool *b, bool *c, bool *d, bool *e, double *f) {
  *a = *b = *c = *d = *e = false; return 0; }
API int fmi3CompletedIntegratorStep(void *m, bool no, bool *enter, bool *end) { *enter = *end = false; return 0; }
API int fmi3SetContinuousStates(M *m, const double *x, size_t n) { m->r[X] = x[0]; return 0; }
API int fmi3GetContinuousStates(M *m, double *x, size_t n) { compute(m); x[0] = m->r[X]; return 0; }
API int fmi3GetContinuousStateDerivatives(M *m, double *x, size_t n) { compute(m); x[0] = m->r[DX]; return 0; }
API int fmi3GetNominalsOfContinuousStates(M *m, double *x, size_t n) { x[0] = 1; return 0; }
"""


@dataclass(frozen=True)
class V:
    """A variable: its type as FMI 3 calls it, and what else its element says."""

    name: str
    reference: int
    causality: str = "output"
    type: str = "Float64"
    start: str = ""
    initial: str = ""
    more: str = ""
    size: int = 0
    variability: str = ""


U, Y = V("u", 0, "input", start="0"), V("y", 1)
K, C = V("k", 2, "parameter", start="1"), V("c", 3, "parameter", start="0")
X, DX = V("x", 4, initial="calculated"), V("der(x)", 5, "local", initial="calculated")
CALLS, LOCAL = V("calls", 6, "local"), V("w", 7, "local")
VARIABLES: Mapping[str, Sequence[V]] = {
    "source": (Y, C),
    "lag": (U, X, DX, Y),
    "home": (U, Y),
    "late": (U, Y),
    "gain": (U, Y, K, C, CALLS),
    "square": (U, Y, K, C, CALLS),
    "once": (U, Y, CALLS),
    "inverse": (U, Y),
    "strict": (U, Y, LOCAL),
    "liar": (U, Y, K, C),
    "integer": (
        V("n", 0, "input", "Int32", "0"),
        V("n_out", 1, "output", "Int32"),
        V("on", 0, "input", "Boolean", "false"),
        V("on_out", 1, "output", "Boolean"),
        V("text", 0, "input", "String", ""),
        V("text_out", 1, "output", "String"),
    ),
    "array": (V("u", 8, "input", start="0 0 0", size=3), V("y", 12, size=3)),
    "single": (
        V("u", 0, "input", "Float32", "0"),
        V("y", 1, "output", "Float32"),
        V("k", 2, "parameter", "Float32", "1"),
        V("c", 3, "parameter", "Float32", "0"),
    ),
}
OF_FMI2 = {"Float64": "Real", "Int32": "Integer"}


Make = Callable[..., Path]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Pack one of them."""
    return lambda model, version=2, **more: packed(tmp_path, model, version, **more)


def packed(folder: Path, model: str, version: int = 2, **description: str) -> Path:
    """Pack one of them; the rest says what its description shall say, see `described`."""
    number = len(list(folder.glob("*.fmu")))
    text = described(model, version, **description)
    return pack(folder / f"{model}{number}.fmu", version, text, compiled("start", with_stubs(SOURCE)))


def described(
    model: str,
    version: int,
    *,
    follows: str | None = None,
    running: str | None = None,
    interface: str = "CoSimulation",
    flags: str = "",
    variables: Sequence[V] | None = None,
    experiment: str = "",
) -> str:
    """Write a model description.

    Args:
        model: which of them.
        version: of FMI.
        follows: names of the inputs that its first output follows in initialisation mode; None: nothing is said.
        running: the same after it; None: as nothing is said.
        interface: the element of its interface.
        flags: attributes of that.
        variables: in the place of its own.
        experiment: an element before the variables.
    """
    own = variables or VARIABLES[model]
    token = "guid" if version == 2 else "instantiationToken"
    index = {one.name: number + 1 if version == 2 else one.reference for number, one in enumerate(own)}
    outputs = [one for one in own if one.causality == "output"]

    def unknown(element: str, one: V, names: str | None) -> str:
        known = "" if names is None else f' dependencies="{" ".join(str(index[name]) for name in names.split())}"'
        return f'<{element} {"index" if version == 2 else "valueReference"}="{index[one.name]}"{known}/>'

    def listed(group: str, element: str, known: Sequence[V], names: str | None) -> str:
        """Write a list of unknowns: FMI 2 has an element around them."""
        found = "".join(unknown("Unknown" if version == 2 else element, one, names) for one in known)
        return f"<{group}>{found}</{group}>" if version == 2 and found else found

    states = [one for one in own if one.name == "der(x)"]
    structure = listed("Outputs", "Output", outputs, running)
    structure += listed("Derivatives", "ContinuousStateDerivative", states, None)
    structure += "" if follows is None else listed("InitialUnknowns", "InitialUnknown", outputs, follows)
    rows = "".join(_variable(one, version, index) for one in own)
    return (
        f'<fmiModelDescription fmiVersion="{version}.0" modelName="{model}" {token}="{model}">'
        f'<{interface} modelIdentifier="start" {flags}/>{experiment}<ModelVariables>{rows}</ModelVariables>'
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def _variable(one: V, version: int, index: Mapping[str, int]) -> str:
    changing = "continuous" if one.type.startswith("Float") else "discrete"
    fixed = one.causality in ("parameter", "structuralParameter")
    variability = one.variability or ("fixed" if fixed else changing)
    said = {"name": one.name, "valueReference": one.reference, "causality": one.causality, "variability": variability}
    said |= {"initial": one.initial} if one.initial else {}
    common = " ".join(f'{key}="{value}"' for key, value in said.items())
    start = f'start="{one.start}"' if one.start or (one.type == "String" and one.causality == "input") else ""
    more = f'{one.more} derivative="{index["x"]}"' if one.name == "der(x)" else one.more
    if version == 2:
        return f"<ScalarVariable {common}><{OF_FMI2.get(one.type, one.type)} {start} {more}/></ScalarVariable>"
    size = f'<Dimension start="{one.size}"/>' if one.size else ""
    return f"<{one.type} {common} {start} {more}>{size}</{one.type}>"

"""Small FMUs for tests of the master, that can fail on demand.

mode 0: y' = k (a - b); mode 1: y = k (a - b) a step later; mode 2: y = k (a - b) at once.
From fail_at on a step returns the number `status`; 11 crashes the process, 12 never returns,
13 prints a line and goes on, 14 ends the process with exit code 0, 15 aborts, 16 starts a process that stays,
17 asks to end the simulation, 18 returns early from its step (FMI 3).
After a step that was said to be final (noSetFMUStatePriorToCurrentPoint) its state cannot be restored.
"""

import zipfile
from pathlib import Path

import pytest
from compiling import compiled, packed, with_stubs

SOURCE = r"""
enum { A, B, K, MODE, FAIL_AT, NAN_AT, Y, STATUS, COUNT, CRASH = 11, HANG, CHATTER, LEAVE, ABORT, SPAWN, END, EARLY };
typedef struct { double v[COUNT]; char name[99]; void *log; int final; } M;
typedef void Log2(void *, const char *, int, const char *, const char *, ...);
typedef void Log3(void *, int, const char *, const char *);
static M *make(void) {
  M *m = calloc(1, sizeof(M));
  m->v[K] = 1; m->v[STATUS] = 3; m->v[FAIL_AT] = m->v[NAN_AT] = 1e9;
  return m;
}
static int set(M *m, const unsigned *r, size_t n, const double *x) { while (n--) m->v[r[n]] = x[n]; return 0; }
static int get(M *m, const unsigned *r, size_t n, double *x) {
  if (m->v[MODE] > 1) m->v[Y] = m->v[K] * (m->v[A] - m->v[B]);
  while (n--) x[n] = m->v[r[n]];
  return 0;
}
static int save(M *m, M **s) { if (!*s) *s = make(); **s = *m; return 0; }
static int step(M *m, double t, double h) {
  double e = m->v[K] * (m->v[A] - m->v[B]);
  m->v[Y] = m->v[MODE] > 0 ? e : m->v[Y] + h * e;
  if (t + h / 2 > m->v[NAN_AT]) m->v[Y] = NAN;
  if (t + h / 2 <= m->v[FAIL_AT]) return 0;
  if (m->v[STATUS] == CRASH) raise(SIGSEGV);
  while (m->v[STATUS] == HANG) sleep(1);
  if (m->v[STATUS] == LEAVE) exit(0);
  if (m->v[STATUS] == ABORT) abort();
  if (m->v[STATUS] == SPAWN) { if (!fork()) { for (;;) sleep(1); } exit(3); }
  if (m->v[STATUS] == CHATTER) return printf("chatter\n"), 0;
  return (int)m->v[STATUS];
}
#define API __attribute__((visibility("default")))
API char calls[9]; /* what was called at the end: T terminate, F free */
static int noted(char c) { calls[strlen(calls)] = c; return 0; }
static int restore(M *m, M *s) { if (m->final) return 3; *m = *s; m->final = 0; return 0; }
typedef struct { Log2 *log; } Callbacks;
API void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, Callbacks *c, int v, int l) {
  M *m = make(); m->log = (void *)c->log; strncpy(m->name, n, 98); return m; }
API int fmi2Terminate(void *m) { return noted('T'); }
API int fmi2Reset(M *m) { M *n = make(); n->log = m->log; strcpy(n->name, m->name); *m = *n; free(n); return 0; }
API void fmi2FreeInstance(void *m) { noted('F'); free(m); }
API int fmi2GetFMUstate(M *m, M **s) { return save(m, s); }
API int fmi2SetFMUstate(M *m, M *s) { return restore(m, s); }
API int fmi2FreeFMUstate(M *m, M **s) { free(*s); *s = NULL; return 0; }
API int fmi3GetFMUState(M *m, M **s) { return save(m, s); }
API int fmi3SetFMUState(M *m, M *s) { return restore(m, s); }
API int fmi3FreeFMUState(M *m, M **s) { free(*s); *s = NULL; return 0; }
API int fmi2SetReal(M *m, const unsigned *r, size_t n, const double *x) { return set(m, r, n, x); }
API int fmi2GetReal(M *m, const unsigned *r, size_t n, double *x) { return get(m, r, n, x); }
API int fmi2DoStep(M *m, double t, double h, int p) {
  m->final = p; int s = step(m, t, h); if (s == END) return 2;
  if (s) ((Log2 *)m->log)(NULL, m->name, 3, "error", "the %s broke", "shaft"); return s; }
API int fmi2GetBooleanStatus(M *m, int kind, int *value) {
  return *value = kind == 3 && m->v[STATUS] == END, m->v[STATUS] == END ? 0 : 3; }
API void *fmi3InstantiateCoSimulation(const char *n, const char *g, const char *r, bool a, bool b, bool c, bool d,
  const unsigned *q, size_t w, void *environment, void *log, void *i) { M *m = make(); m->log = log; return m; }
API int fmi3Terminate(void *m) { return noted('T'); }
API int fmi3Reset(M *m) { return fmi2Reset(m); }
API void fmi3FreeInstance(void *m) { noted('F'); free(m); }
API int fmi3SetFloat64(M *m, const unsigned *r, size_t n, const double *x, size_t k) { return set(m, r, n, x); }
API int fmi3GetFloat64(M *m, const unsigned *r, size_t n, double *x, size_t k) { return get(m, r, n, x); }
API int fmi3DoStep(M *m, double t, double h, bool p, bool *e, bool *x, bool *y, double *l) {
  m->final = p; int s = step(m, t, h); if (s == END) return *x = true, 0;
  if (s == EARLY) return *y = true, *l = t + h / 2, 0;
  if (s) ((Log3 *)m->log)(NULL, 3, "error", "the shaft broke"); return s; }
"""


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """The tiny FMU for FMI 2 and 3."""
    directory = tmp_path_factory.mktemp("tiny")
    return {version: build(directory, version) for version in (2, 3)}


Row = tuple[str, str, str, str, str]
"""Name, causality, unit, start and limits of a variable."""
VARIABLES: list[Row] = [
    ("a", "input", "rad", "0", ""),
    ("b", "input", "rad", "0", ""),
    ("k", "parameter", "1", "1", 'min="0"'),
    ("mode", "parameter", "1", "0", ""),
    ("fail_at", "parameter", "s", "1e9", ""),
    ("nan_at", "parameter", "s", "1e9", ""),
    ("y", "output", "rad", "", ""),
    ("status", "parameter", "1", "3", ""),
]


def build(directory: Path, version: int) -> Path:
    """Compile and pack the tiny FMU for one FMI version."""
    library = compiled("tiny", with_stubs(SOURCE))
    return packed(directory / f"tiny{version}.fmu", version, description(version), library)


def described(fmu: Path, path: Path, xml: str) -> Path:
    """Pack the binary of a tiny FMU with another description."""
    with zipfile.ZipFile(fmu) as good, zipfile.ZipFile(path, "w") as archive:
        binary = next(name for name in good.namelist() if name.startswith("binaries/"))
        archive.writestr("modelDescription.xml", xml)
        archive.writestr(binary, good.read(binary))
    return path


def description(version, variables=VARIABLES, model="tiny", *, direct=False, state=True, can_vary_step=True) -> str:
    """Write the XML of one FMI version; the value references of variables are their places.

    `direct`: outputs follow a and b at once; `state`: it can be saved; `can_vary_step`: steps may differ in length.
    """
    token = "guid" if version == 2 else "instantiationToken"
    known = {2: "1 2", 3: "0 1"}[version] if direct else ""
    places = [place for place, row in enumerate(variables) if row[1] == "output"]
    outputs = "".join(f'<Output valueReference="{place}" dependencies="{known}"/>' for place in places)
    if version == 2:
        unknown = "".join(f'<Unknown index="{place + 1}" dependencies="{known}"/>' for place in places)
        outputs = f"<Outputs>{unknown}</Outputs>"
    saves = f'canGetAndSetFMU{"s" if version == 2 else "S"}tate="{str(state).lower()}"'
    saves += f' canHandleVariableCommunicationStepSize="{str(can_vary_step).lower()}"'
    units = "".join(f'<Unit name="{unit}"/>' for unit in dict.fromkeys(row[2] for row in variables))
    rows = "".join(_variable(version, number, *row) for number, row in enumerate(variables))
    return (
        f'<fmiModelDescription fmiVersion="{version}.0" modelName="{model}" {token}="t">'
        f'<CoSimulation modelIdentifier="{model}" {saves}/><UnitDefinitions>{units}</UnitDefinitions>'
        f"<ModelVariables>{rows}</ModelVariables><ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"
    )


def _variable(version: int, number: int, name: str, causality: str, unit: str, start: str, limits: str) -> str:
    variability = "fixed" if causality == "parameter" else "continuous"
    common = f'name="{name}" valueReference="{number}" causality="{causality}" variability="{variability}"'
    common += ' initial="exact"' if causality == "output" and start else ""
    value = f'unit="{unit}" {limits}' + (f' start="{start}"' if start else "")
    return (
        f"<Float64 {common} {value}/>" if version == 3 else f"<ScalarVariable {common}><Real {value}/></ScalarVariable>"
    )

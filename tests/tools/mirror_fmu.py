"""FMUs whose outputs are their inputs of the step before, in every type that FMI has; arrays of a size to be set.

Value references count anew for each type in FMI 2, and through all types in FMI 3. `text` says half the number of the
step, and the enumeration's values are not 1, 2, 3.
"""

from pathlib import Path

import pytest
from compiling import compiled, packed, with_stubs

SOURCE = r"""
enum { MOST = 16, VARIABLES = 64 };
/* Every variable has room for MOST elements of 8 bytes; an output stands 32 behind its input. */
typedef struct {
  union { double d; float f; int64_t i; uint64_t u; int32_t n; } v[VARIABLES][MOST];
  char text[VARIABLES][200]; unsigned char bytes[VARIABLES][200]; size_t length[VARIABLES];
  uint64_t n; int64_t steps; bool configuring;
} M;
static M *make(void) { M *m = calloc(1, sizeof(M)); m->n = 3; m->v[11][0].i = m->v[43][0].i = 10;
  for (int i = 0; i < MOST; i++) m->v[14][i].d = m->v[15][i].d = i + 1;
  return m; }
static size_t size_of(const M *m, unsigned r) { return r % 32 == 14 ? m->n : r % 32 == 15 ? 2 * m->n : 1; }
static int step(M *m) {
  for (int i = 0; i < 16; i++) {
    memcpy(m->v[i + 32], m->v[i], sizeof m->v[i]);
    memcpy(m->text[i + 32], m->text[i], 200);
    memcpy(m->bytes[i + 32], m->bytes[i], 200);
    m->length[i + 32] = m->length[i];
  }
  snprintf(m->text[63], 200, "step %d", (int)(++m->steps / 2));
  return 0; }
API void *fmi3InstantiateCoSimulation(const char *n, const char *g, const char *r, bool a, bool b, bool c, bool d,
  const unsigned *q, size_t w, void *environment, void *log, void *i) { return make(); }
API int fmi3EnterConfigurationMode(M *m) { m->configuring = true; return 0; }
API int fmi3ExitConfigurationMode(M *m) { m->configuring = false; return 0; }
API int fmi3Reset(M *m) { M *n = make(); *m = *n; free(n); return 0; }
API int fmi3DoStep(M *m, double t, double h, bool p, bool *e, bool *x, bool *y, double *l) {
  *e = *x = *y = false; *l = t + h; return step(m); }
#define VALUES(NAME, TYPE, FIELD) \
API int fmi3Set##NAME(M *m, const unsigned *r, size_t n, const TYPE *x, size_t k) { \
  for (size_t i = 0, j = 0; i < n; i++) { \
    if (r[i] == 16) { if (!m->configuring) return 3; m->n = (uint64_t)x[j++]; continue; } \
    for (size_t e = 0; e < size_of(m, r[i]); e++) m->v[r[i]][e].FIELD = x[j++]; if (j > k) return 3; } return 0; } \
API int fmi3Get##NAME(M *m, const unsigned *r, size_t n, TYPE *x, size_t k) { \
  for (size_t i = 0, j = 0; i < n; i++) for (size_t e = 0; e < size_of(m, r[i]); e++) { \
    if (j >= k) return 3; x[j++] = (TYPE)m->v[r[i]][e].FIELD; } return 0; }
VALUES(Float64, double, d) VALUES(Float32, float, f) VALUES(Int8, int8_t, i) VALUES(UInt8, uint8_t, u)
VALUES(Int16, int16_t, i) VALUES(UInt16, uint16_t, u) VALUES(Int32, int32_t, i) VALUES(UInt32, uint32_t, u)
VALUES(Int64, int64_t, i) VALUES(UInt64, uint64_t, u) VALUES(Boolean, bool, i)
API int fmi3SetString(M *m, const unsigned *r, size_t n, const char *const *x, size_t k) {
  for (size_t i = 0; i < n; i++) strncpy(m->text[r[i]], x[i], 199); return 0; }
API int fmi3GetString(M *m, const unsigned *r, size_t n, const char **x, size_t k) {
  for (size_t i = 0; i < n; i++) x[i] = m->text[r[i]]; return 0; }
API int fmi3SetBinary(M *m, const unsigned *r, size_t n, const size_t *s, const unsigned char *const *x, size_t k) {
  for (size_t i = 0; i < n; i++) memcpy(m->bytes[r[i]], x[i], m->length[r[i]] = s[i]); return 0; }
API int fmi3GetBinary(M *m, const unsigned *r, size_t n, size_t *s, const unsigned char **x, size_t k) {
  for (size_t i = 0; i < n; i++) { x[i] = m->bytes[r[i]]; s[i] = m->length[r[i]]; } return 0; }
API void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, void *c, int v, int l) { return make(); }
API int fmi2Reset(M *m) { return fmi3Reset(m); }
API int fmi2DoStep(M *m, double t, double h, int p) { return step(m); }
/* In FMI 2 value reference 0 is the input and 1 the output, of each type; the places differ. */
#define OLD(NAME, TYPE, FIELD, PLACE) \
API int fmi2Set##NAME(M *m, const unsigned *r, size_t n, const TYPE *x) { \
  for (size_t i = 0; i < n; i++) m->v[PLACE + 32 * r[i]][0].FIELD = x[i]; return 0; } \
API int fmi2Get##NAME(M *m, const unsigned *r, size_t n, TYPE *x) { \
  for (size_t i = 0; i < n; i++) x[i] = (TYPE)m->v[PLACE + 32 * r[i]][0].FIELD; return 0; }
OLD(Real, double, d, 0) OLD(Integer, int32_t, i, 6) OLD(Boolean, int32_t, i, 10)
API int fmi2SetString(M *m, const unsigned *r, size_t n, const char *const *x) {
  for (size_t i = 0; i < n; i++) strncpy(m->text[12 + 32 * r[i]], x[i], 199); return 0; }
API int fmi2GetString(M *m, const unsigned *r, size_t n, const char **x) {
  for (size_t i = 0; i < n; i++) x[i] = m->text[12 + 32 * r[i]]; return 0; }
"""
KINDS = (
    *("Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean"),
    *("Enumeration", "String", "Binary"),
)
"""In the order of their value references in FMI 3."""
EDGES = {
    "Int8": (-128, 127),
    "UInt8": (0, 255),
    "Int16": (-32_768, 32_767),
    "UInt16": (0, 65_535),
    "Int32": (-2_147_483_648, 2_147_483_647),
    "UInt32": (0, 4_294_967_295),
    "Int64": (-9_223_372_036_854_775_808, 9_223_372_036_854_775_807),
    "UInt64": (0, 18_446_744_073_709_551_615),
}
"""FMI 3.0.2, 2.4.3: what each integer type holds."""
LOOPS = pytest.mark.parametrize("compiled", [True, False])


def named(kind: str) -> tuple[str, str]:
    """Names of input and output of a type."""
    return f"{kind.lower()}_in", f"{kind.lower()}_out"


def description(version: int) -> str:
    """Write the model description."""
    return _fmi3() if version == 3 else _fmi2()


def _fmi3() -> str:
    rows = []
    for number, kind in enumerate(KINDS):
        declared = 'declaredType="Mood"' if kind == "Enumeration" else ""
        first = {"Boolean": "false", "Enumeration": "10"}.get(kind, "0")
        start = "" if kind in ("String", "Binary") else f'start="{first}"'
        inside = {"String": '<Start value=""/>', "Binary": '<Start value=""/>'}.get(kind, "")
        for name, reference, causality in zip(named(kind), (number, number + 32), ("input", "output"), strict=True):
            said = start if causality == "input" else ""
            body = inside if causality == "input" else ""
            rows.append(
                f'<{kind} name="{name}" valueReference="{reference}" causality="{causality}" '
                f'variability="discrete" {declared} {said}>{body}</{kind}>'
            )
    rows.append('<UInt64 name="n" valueReference="16" causality="structuralParameter" variability="fixed" start="3"/>')
    one, two = '<Dimension valueReference="16"/>', '<Dimension start="2"/><Dimension valueReference="16"/>'
    for number, (name, dimensions, start) in enumerate((("u", one, "1 2 3"), ("w", two, "1 2 3 4 5 6"))):
        for reference, causality in ((14 + number, "input"), (46 + number, "output")):
            called = name if causality == "input" else {"u": "y", "w": "z"}[name]
            said = f'causality="{causality}"' + (f' start="{start}"' if causality == "input" else "")
            rows.append(f'<Float64 name="{called}" valueReference="{reference}" {said}>{dimensions}</Float64>')
    rows.append('<String name="text" valueReference="63" causality="output" variability="discrete"/>')
    outputs = "".join(f'<Output valueReference="{number + 32}" dependencies=""/>' for number in range(16))
    return (
        '<fmiModelDescription fmiVersion="3.0" modelName="mirror" instantiationToken="m">'
        f'<CoSimulation modelIdentifier="mirror"/><TypeDefinitions>{_mood("EnumerationType")}</TypeDefinitions>'
        f"<ModelVariables>{''.join(rows)}</ModelVariables><ModelStructure>{outputs}</ModelStructure>"
        "</fmiModelDescription>"
    )


def _fmi2() -> str:
    rows = []
    for kind in ("Real", "Integer", "Boolean", "String"):
        start = {"Real": "0", "Integer": "0", "Boolean": "false", "String": ""}[kind]
        rows.append(_scalar(f"{kind.lower()}_in", 0, "input", f'<{kind} start="{start}"/>'))
        rows.append(_scalar(f"{kind.lower()}_out", 1, "output", f"<{kind}/>"))
    return (
        '<fmiModelDescription fmiVersion="2.0" modelName="mirror" guid="m"><CoSimulation modelIdentifier="mirror"/>'
        f"<ModelVariables>{''.join(rows)}</ModelVariables><ModelStructure><Outputs>"
        + "".join(f'<Unknown index="{index}" dependencies=""/>' for index in (2, 4, 6, 8))
        + "</Outputs></ModelStructure></fmiModelDescription>"
    )


def _scalar(name: str, reference: int, causality: str, kind: str) -> str:
    variability = "continuous" if kind.startswith("<Real") else "discrete"
    common = f'name="{name}" valueReference="{reference}" causality="{causality}" variability="{variability}"'
    return f"<ScalarVariable {common}>{kind}</ScalarVariable>"


def _mood(tag: str) -> str:
    items = "".join(f'<Item name="{name}" value="{value}"/>' for name, value in (("calm", 10), ("angry", 30)))
    return f'<{tag} name="Mood">{items}</{tag}>'


@pytest.fixture(scope="session")
def mirror(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """The mirror FMU for FMI 2 and 3."""
    folder = tmp_path_factory.mktemp("mirror")
    made = "".join(f"fmi3{access}{kind}(" for access in ("Set", "Get") for kind in KINDS)
    made += "".join(f"fmi2{access}{kind}(" for access in ("Set", "Get") for kind in ("Real", "Integer", "Boolean"))
    library = compiled("mirror", with_stubs(SOURCE, made))
    return {
        version: packed(folder / f"mirror{version}.fmu", version, description(version), library) for version in (2, 3)
    }

"""FMUs that change the process they run in: what (DEEDS), and in which call (STAGES), their parameters and GUID say.

The output `third` is always 1/3 and the state's rate `rate` too, so that what another component makes of them shows
whether its arithmetic was left alone.
"""

from pathlib import Path

from compiling import compiled, packed, with_stubs

DEEDS = (
    *("nothing", "directory", "umask", "locale", "environment", "ignore", "handle", "alarm", "block", "close"),
    *("redirect", "limit", "cores", "upward", "flush", "traps", "precision", "thread", "hang", "exit", "crash", "read"),
    "fail",
)
STAGES = ("load", "instantiate", "setup", "initialise", "set", "get", "step", "save", "terminate", "free", "rates")
SOURCE = r"""
#include <fenv.h>
#include <fcntl.h>
#include <locale.h>
#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/stat.h>
enum { NOTHING, DIRECTORY, UMASK, LOCALE, ENVIRONMENT, IGNORE, HANDLE, ALARM, BLOCK, CLOSE, REDIRECT, LIMIT, CORES,
  UPWARD, FLUSH, TRAPS, PRECISION, THREAD, HANG, EXIT, CRASH, READ, FAIL };
enum { LOAD, INSTANTIATE, SETUP, INITIALISE, SET, GET, STEP, SAVE, TERMINATE, FREE, RATES };
enum { A, DEED, STAGE, THIRD, X, RATE, COUNT };
typedef struct { double v[COUNT]; int flag, deed, stage; } M;
static void nothing(int number) { (void)number; }
static void *run(void *none) { for (;;) usleep(1000); return none; }
static int act(int deed) {
  sigset_t set; pthread_t thread; struct rlimit limit; cpu_set_t one;
  switch (deed) {
  case DIRECTORY: return chdir("/") > 9;
  case UMASK: return umask(077), 0;
  case LOCALE: return setlocale(LC_ALL, "POSIX") == NULL;
  case ENVIRONMENT: return setenv("RUDE", "1", 1) + unsetenv("KIND");
  case IGNORE: return signal(SIGTERM, SIG_IGN), signal(SIGPIPE, SIG_DFL), 0;
  case HANDLE: return signal(SIGUSR1, nothing), 0;
  case ALARM: return alarm(1000), 0;
  case BLOCK: return sigemptyset(&set), sigaddset(&set, SIGTERM), pthread_sigmask(SIG_BLOCK, &set, NULL);
  case CLOSE: return close(1), close(2), 0;
  case REDIRECT: return dup2(open("/dev/null", O_WRONLY), 1) > 9;
  case LIMIT: return getrlimit(RLIMIT_NOFILE, &limit), limit.rlim_cur = 100, setrlimit(RLIMIT_NOFILE, &limit);
  case CORES: CPU_ZERO(&one); CPU_SET(sched_getcpu(), &one); return sched_setaffinity(0, sizeof one, &one);
  case UPWARD: return fesetround(FE_UPWARD);
#if defined(__x86_64__)
  case FLUSH: { unsigned word; __asm__ volatile("stmxcsr %0" : "=m"(word)); word |= 0x8040;
    __asm__ volatile("ldmxcsr %0" : : "m"(word)); return 0; }
  case TRAPS: { unsigned word; __asm__ volatile("stmxcsr %0" : "=m"(word)); word &= ~0x0280;
    __asm__ volatile("ldmxcsr %0" : : "m"(word)); return 0; }
  case PRECISION: { unsigned short word = 0x27f; __asm__ volatile("fldcw %0" : : "m"(word)); return 0; }
#endif
  case THREAD: return pthread_create(&thread, NULL, run, NULL);
  case HANG: for (;;) sleep(1);
  case EXIT: exit(0);
  case CRASH: return raise(SIGSEGV);
  case READ: return getchar() != EOF;
  case FAIL: return 3;
  }
  return 0;
}
static int at(M *m, int stage) {
  if (m->stage == stage || (int)m->v[STAGE] == stage) return act(m->stage == stage ? m->deed : (int)m->v[DEED]) ? 3 : 0;
  return 0;
}
__attribute__((constructor)) static void loaded(void) { act(LOADED); }
static M *make(const char *guid) {
  M *m = calloc(1, sizeof(M));
  m->v[STAGE] = m->stage = -1;
  sscanf(guid, "%d:%d", &m->deed, &m->stage);
  at(m, INSTANTIATE);
  return m;
}
static int set(M *m, const unsigned *r, size_t n, const double *x) { while (n--) m->v[r[n]] = x[n]; return at(m, SET); }
static int get(M *m, const unsigned *r, size_t n, double *x) {
  m->v[THIRD] = 0x1.5555555555555p-2; m->v[RATE] = 0x1.5555555555555p-2;
  while (n--) x[n] = m->v[r[n]];
  return at(m, GET);
}
typedef struct { int newly, terminate, nominals, values, next; double time; } Event;
API void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, void *c, int v, int l) { return make(g); }
API int fmi2SetupExperiment(M *m, int a, double b, double c, int d, double e) { return at(m, SETUP); }
API int fmi2ExitInitializationMode(M *m) { return at(m, INITIALISE); }
API int fmi2Terminate(M *m) { return at(m, TERMINATE); }
API void fmi2FreeInstance(M *m) { at(m, FREE); }
API int fmi2SetReal(M *m, const unsigned *r, size_t n, const double *x) { return set(m, r, n, x); }
API int fmi2GetReal(M *m, const unsigned *r, size_t n, double *x) { return get(m, r, n, x); }
API int fmi2SetInteger(M *m, const unsigned *r, size_t n, const int *x) { m->flag = *x; return at(m, SET); }
API int fmi2GetInteger(M *m, const unsigned *r, size_t n, int *x) { *x = m->flag; return at(m, GET); }
API int fmi2DoStep(M *m, double t, double h, int p) { return at(m, STEP); }
API int fmi2GetFMUstate(M *m, M **s) { if (!*s) *s = malloc(sizeof(M)); **s = *m; return at(m, SAVE); }
API int fmi2SetFMUstate(M *m, M *s) { *m = *s; return at(m, SAVE); }
API int fmi2FreeFMUstate(M *m, M **s) { free(*s); *s = NULL; return 0; }
API int fmi2SetContinuousStates(M *m, const double *x, size_t n) { m->v[X] = *x; return 0; }
API int fmi2GetContinuousStates(M *m, double *x, size_t n) { *x = m->v[X]; return 0; }
API int fmi2GetNominalsOfContinuousStates(M *m, double *x, size_t n) { *x = 1; return 0; }
API int fmi2GetDerivatives(M *m, double *x, size_t n) { *x = -0x1.5555555555555p-2 * m->v[X]; return at(m, RATES); }
API int fmi2CompletedIntegratorStep(M *m, int a, int *e, int *t) { return *e = *t = 0; }
API int fmi2NewDiscreteStates(M *m, Event *e) { memset(e, 0, sizeof *e); return 0; }
API void *fmi3InstantiateCoSimulation(const char *n, const char *g, const char *r, bool a, bool b, bool c, bool d,
  const unsigned *q, size_t w, void *environment, void *log, void *i) { return make(g); }
API int fmi3EnterInitializationMode(M *m, bool a, double b, double c, bool d, double e) { return at(m, SETUP); }
API int fmi3ExitInitializationMode(M *m) { return at(m, INITIALISE); }
API int fmi3Terminate(M *m) { return at(m, TERMINATE); }
API void fmi3FreeInstance(M *m) { at(m, FREE); }
API int fmi3SetFloat64(M *m, const unsigned *r, size_t n, const double *x, size_t k) { return set(m, r, n, x); }
API int fmi3GetFloat64(M *m, const unsigned *r, size_t n, double *x, size_t k) { return get(m, r, n, x); }
API int fmi3DoStep(M *m, double t, double h, bool p, bool *e, bool *x, bool *y, double *l) { return at(m, STEP); }
"""
VARIABLES = (("a", "input", "0"), ("deed", "parameter", "0"), ("stage", "parameter", "-1"), ("third", "output", ""))
VARIABLES += (("x", "output", "1"), ("rate", "local", ""))


def rude_fmu(
    folder: Path, version: int, deed: str = "nothing", stage: str = "load", kind: str = "CoSimulation"
) -> Path:
    """Write an FMU that does a deed in a stage by itself; with its parameters it can be told to do more."""
    path = folder / f"rude_{version}_{kind}_{deed}_{stage}.fmu"
    loaded = deed if stage == "load" else "nothing"
    library = compiled("rude", f"#define LOADED {loaded.upper()}\n{with_stubs(SOURCE)}", "-lm", "-lpthread")
    guid = f"{DEEDS.index(deed)}:{STAGES.index(stage)}"
    return packed(path, version, _description(version, guid, kind), library)


def _description(version: int, guid: str, kind: str) -> str:
    rows = "".join(_variable(version, number, *row) for number, row in enumerate(VARIABLES))
    if version == 3:
        return (
            f'<fmiModelDescription fmiVersion="3.0" modelName="rude" instantiationToken="{guid}"><CoSimulation '
            f'modelIdentifier="rude"/><ModelVariables>{rows}</ModelVariables><ModelStructure>'
            '<Output valueReference="3"/><Output valueReference="4"/></ModelStructure></fmiModelDescription>'
        )
    more = ' canGetAndSetFMUstate="true"' if kind == "CoSimulation" else ""
    rows += _typed("flag", "input", 'start="0"') + _typed("shown", "output", "")
    derivatives = '<Derivatives><Unknown index="6"/></Derivatives>' if kind == "ModelExchange" else ""
    outputs = "".join(f'<Unknown index="{index}" dependencies=""/>' for index in (4, 5, 8))
    return (
        f'<fmiModelDescription fmiVersion="2.0" modelName="rude" guid="{guid}" numberOfEventIndicators="0"><{kind} '
        f'modelIdentifier="rude"{more}/><ModelVariables>{rows}</ModelVariables><ModelStructure>'
        f"<Outputs>{outputs}</Outputs>{derivatives}</ModelStructure></fmiModelDescription>"
    )


def _variable(version: int, number: int, name: str, causality: str, start: str) -> str:
    variability = "fixed" if causality == "parameter" else "continuous"
    initial = ' initial="exact"' if name == "x" else ""
    common = f'name="{name}" valueReference="{number}" causality="{causality}" variability="{variability}"{initial}'
    value = (f'start="{start}" ' if start else "") + ('derivative="5"' if name == "rate" and version == 2 else "")
    return (
        f"<Float64 {common} {value}/>" if version == 3 else f"<ScalarVariable {common}><Real {value}/></ScalarVariable>"
    )


def _typed(name: str, causality: str, start: str) -> str:
    common = f'name="{name}" valueReference="9" causality="{causality}" variability="discrete"'
    return f"<ScalarVariable {common}><Integer {start}/></ScalarVariable>"

/* A model-exchange FMU behind the three functions of co-simulation, so that the loop steps it like any other.
 *
 * Over a step inputs are held, so every step begins with an event at which they jump. Between events the states are
 * integrated by RODAS4 (rodas4.c, the method inside our own FMUs) with a Jacobian by differences. Time events inside the
 * step are met exactly; one at its end belongs to the next step, whose inputs it sees. A state event is where an indicator
 * changes sign within a stretch of integration; its time is bisected. Steps that end with a discontinuity of outputs
 * leave the FMU in continuous-time mode. Nothing is allocated here. */
#include "foreign.h"
#include "rodas4.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { OK, WARNING, DISCARD, FAILED, TERMINATED = 101 };
enum { MOST_EVENTS = 10000, MOST_UPDATES = 100 };

typedef struct {
    int newly, terminate, nominals_changed, values_changed, has_next;
    double next;
} Event2;

typedef int Plain(void *);
typedef int Time(void *, double);
typedef int Put(void *, const double *, size_t);
typedef int Take(void *, double *, size_t);
typedef int Update2(void *, Event2 *);
typedef int Update3(void *, bool *, bool *, bool *, bool *, bool *, double *);
typedef int Completed2(void *, int, int *, int *);
typedef int Completed3(void *, bool, bool *, bool *);
typedef int Set2(void *, const uint32_t *, size_t, const double *);
typedef int Get2(void *, const uint32_t *, size_t, double *);
typedef int Set3(void *, const uint32_t *, size_t, const double *, size_t);
typedef int Get3(void *, const uint32_t *, size_t, double *, size_t);

typedef struct {
    int64_t version;
    void *instance;
    void (*set)(void), (*get)(void);
    Time *set_time;
    Take *get_states;
    Put *set_states;
    Take *rates, *indicators;
    Plain *enter_event, *enter_continuous;
    void (*update)(void), (*completed)(void); /* completed: NULL where the FMU does not want to hear of it */
    int64_t states, indicated;
    double tolerance;
    double *nominals, *x, *kept, *slope, *shifted; /* each of length states */
    double *before, *after;                        /* indicators */
    double *work;
    int *pivots;
    double next, proposed; /* time of the next time event; step size of the solver */
    int64_t has_next, in_event;
    int64_t result, culprit; /* of the solver, when it failed */
    int64_t *altered;        /* what calls of the FMU changed that they must not, see foreign.h */
} Exchange;

static int worse(int one, int other) { return one > other ? one : other; }

/* Calls of the FMU: the solver computes between them, and in the standard environment. */
static int set_time(const Exchange *e, double time) { return after(e->altered, e->set_time(e->instance, time)); }
static int set_states(const Exchange *e, const double *x) {
    return after(e->altered, e->set_states(e->instance, x, (size_t)e->states));
}
static int get_states(const Exchange *e) {
    return after(e->altered, e->get_states(e->instance, e->x, (size_t)e->states));
}
static int get_rates(const Exchange *e, double *found) {
    return after(e->altered, e->rates(e->instance, found, (size_t)e->states));
}
static int indicators(const Exchange *e, double *found) {
    return after(e->altered, e->indicators(e->instance, found, (size_t)e->indicated));
}
static int enter_event(const Exchange *e) { return after(e->altered, e->enter_event(e->instance)); }
static int enter_continuous(const Exchange *e) { return after(e->altered, e->enter_continuous(e->instance)); }

static int rates(void *context, double time, const double *x, double *found) {
    Exchange *e = context;
    int status = worse(set_time(e, time), set_states(e, x));
    return status > WARNING || get_rates(e, found) > WARNING;
}

static double shift(double value, double nominal) { return 1.5e-8 * fmax(fabs(value), 0.01 * nominal); }

/* Differences one way; in time too, over a stretch that is short for the step. */
static int jacobian(void *context, double time, const double *x, double *matrix, double *by_time) {
    Exchange *e = context;
    size_t n = (size_t)e->states;
    if (rates(e, time, x, e->slope)) return 1;
    memcpy(e->shifted, x, n * sizeof(double));
    for (size_t j = 0; j < n; j++) {
        e->shifted[j] = x[j] + shift(x[j], e->nominals[j]);
        if (rates(e, time, e->shifted, matrix + j * n)) return 1;
        for (size_t i = 0; i < n; i++)
            matrix[i + j * n] = (matrix[i + j * n] - e->slope[i]) / (e->shifted[j] - x[j]);
        e->shifted[j] = x[j];
    }
    double later = time + shift(time, 1.0);
    if (rates(e, later, x, by_time)) return 1;
    for (size_t i = 0; i < n; i++) by_time[i] = (by_time[i] - e->slope[i]) / (later - time);
    return 0;
}

static int update(Exchange *e, bool *again, bool *terminate) {
    bool nominals, values, has_next;
    if (e->version == 2) {
        Event2 event = {0};
        int status = after(e->altered, ((Update2 *)e->update)(e->instance, &event));
        *again = event.newly;
        *terminate = event.terminate;
        e->has_next = event.has_next;
        e->next = event.next;
        return status;
    }
    int status = after(e->altered, ((Update3 *)e->update)(e->instance, again, terminate, &nominals, &values, &has_next,
                                                          &e->next));
    e->has_next = has_next;
    return status;
}

/* Handles what is due now, and goes on in continuous-time mode with the states that it left. */
static int handle_event(Exchange *e) {
    bool again = true, terminate = false;
    int status = e->in_event ? OK : enter_event(e);
    for (int i = 0; i < MOST_UPDATES && again && status <= WARNING; i++)
        status = worse(status, update(e, &again, &terminate));
    if (status <= WARNING && terminate) return TERMINATED;
    if (status <= WARNING && again) return FAILED;
    if (status <= WARNING) status = worse(status, enter_continuous(e));
    if (status <= WARNING) e->in_event = 0;
    if (status <= WARNING && e->states) status = worse(status, get_states(e));
    if (status <= WARNING && e->indicated) status = worse(status, indicators(e, e->before));
    return status;
}

static bool crossed(const Exchange *e) {
    for (int64_t i = 0; i < e->indicated; i++)
        if ((e->before[i] > 0) != (e->after[i] > 0)) return true;
    return false;
}

/* Takes the states from `start`, where they are in `kept`, to `end`. */
static int integrate(Exchange *e, double start, double end, double proposed) {
    int status = OK, culprit = 0;
    if (e->states) {
        Solver solver = {.size = (int)e->states, .context = e, .rates = rates, .jacobian = jacobian,
                         .nominals = e->nominals, .tolerance = e->tolerance, .work = e->work, .pivots = e->pivots};
        memcpy(e->x, e->kept, (size_t)e->states * sizeof(double));
        e->proposed = proposed;
        e->result = solver_advance(&solver, start, end, e->x, &e->proposed, &culprit);
        e->culprit = culprit;
        if (e->result != SOLVED) return FAILED;
    }
    status = set_time(e, end);
    if (e->states) status = worse(status, set_states(e, e->x));
    if (e->indicated) status = worse(status, indicators(e, e->after));
    return status;
}

static int completed(Exchange *e, bool *event) {
    if (!e->completed) return OK;
    bool wanted = false, terminate = false;
    int wanted2 = 0, terminate2 = 0, status;
    if (e->version == 2)
        status = ((Completed2 *)e->completed)(e->instance, 1, &wanted2, &terminate2);
    else
        status = ((Completed3 *)e->completed)(e->instance, true, &wanted, &terminate);
    after(e->altered, status);
    *event = *event || wanted || wanted2;
    return status <= WARNING && (terminate || terminate2) ? TERMINATED : status;
}

/* Goes from *time towards `stop` and ends there, or just after the first state event. */
static int stretch(Exchange *e, double *time, double stop, bool *event) {
    double low = *time, high = stop, proposed = e->proposed;
    if (e->states) memcpy(e->kept, e->x, (size_t)e->states * sizeof(double));
    int status = integrate(e, *time, stop, proposed);
    *event = status <= WARNING && crossed(e);
    while (*event && status <= WARNING && high - low > 1e-9 * (stop - *time)) {
        double middle = low + (high - low) / 2;
        status = worse(status, integrate(e, *time, middle, proposed));
        if (crossed(e))
            high = middle;
        else
            low = middle;
    }
    if (*event && status <= WARNING) status = worse(status, integrate(e, *time, high, proposed));
    if (status <= WARNING) status = worse(status, completed(e, event));
    *time = high;
    return status;
}

EXPORT int exchange_set(Exchange *e, const uint32_t *references, size_t count, const double *values) {
    int status = e->in_event ? OK : enter_event(e);
    if (status > WARNING) return status;
    e->in_event = 1;
    int set = e->version == 2 ? ((Set2 *)e->set)(e->instance, references, count, values)
                              : ((Set3 *)e->set)(e->instance, references, count, values, count);
    return worse(status, after(e->altered, set));
}

EXPORT int exchange_get(Exchange *e, const uint32_t *references, size_t count, double *values) {
    int status = e->version == 2 ? ((Get2 *)e->get)(e->instance, references, count, values)
                                 : ((Get3 *)e->get)(e->instance, references, count, values, count);
    return after(e->altered, status);
}

EXPORT int exchange_step(Exchange *e, double time, double size, int final) {
    (void)final;
    double end = time + size, margin = 1e-6 * size;
    int status = e->in_event ? OK : set_time(e, time); /* in event mode some refuse it; time stands there */
    bool event = e->in_event || (e->has_next && e->next <= time + margin);
    for (int events = 0; status <= WARNING; events++) {
        if (event) status = worse(status, handle_event(e));
        if (status > WARNING || end - time <= margin) break;
        if (events == MOST_EVENTS) return FAILED;
        bool timed = e->has_next && e->next < end - margin && e->next > time;
        status = worse(status, stretch(e, &time, timed ? e->next : end, &event));
        event = event || (timed && time >= e->next);
    }
    return status;
}

EXPORT int64_t exchange_layout(void) { return (int64_t)sizeof(Exchange); }

/* Ticks of independent FMI 3 FMUs by one thread or by two, which meet before and after each tick. Used by
 * parallel_step.py. In the place where they meet, threads either spin or sleep (a barrier of the system). */
#define _POSIX_C_SOURCE 200112L /* barriers, clocks */
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <time.h>

#define EXPORT __attribute__((visibility("default")))

typedef int Values3(void *, const uint32_t *, size_t, double *, size_t);
typedef int Step3(void *, double, double, bool, bool *, bool *, bool *, double *);

/* An FMU with one input, which keeps its value, and one output. */
typedef struct {
    void *instance;
    void (*set)(void), (*get)(void), (*step)(void);
    uint32_t input, output;
    double value, found;
} Side;

enum { ALONE, SPIN, SLEEP };

typedef struct {
    Side *side;
    int64_t sides, first, ticks, how;
    double step;
    atomic_llong met; /* how often a thread came to where they meet */
    pthread_barrier_t barrier;
    atomic_int status;
} Team;

static void meet(Team *team, long long *met)
{
    if (team->how == SLEEP) {
        pthread_barrier_wait(&team->barrier);
        return;
    }
    *met += 2;
    atomic_fetch_add_explicit(&team->met, 1, memory_order_acq_rel);
    while (atomic_load_explicit(&team->met, memory_order_acquire) < *met) {
    }
}

static int tick(Side *side, double time, double step)
{
    bool event, terminate, early;
    double last;
    int status = ((Values3 *)side->set)(side->instance, &side->input, 1, &side->value, 1);
    status |= ((Step3 *)side->step)(side->instance, time, step, true, &event, &terminate, &early, &last);
    return status | ((Values3 *)side->get)(side->instance, &side->output, 1, &side->found, 1);
}

static void work(Team *team, int64_t begin, int64_t stride, long long met)
{
    for (int64_t k = team->first; k < team->first + team->ticks; k++) {
        if (team->how != ALONE) {
            meet(team, &met);
        }
        for (int64_t i = begin; i < team->sides; i += stride) {
            int status = tick(&team->side[i], (double)k * team->step, team->step);
            if (status > 1) {
                atomic_store(&team->status, status);
            }
        }
        if (team->how != ALONE) {
            meet(team, &met);
        }
    }
}

static void *second(void *team)
{
    long long met = 0;
    meet(team, &met);
    work(team, 1, 2, met);
    return NULL;
}

static int64_t now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec * 1000000000LL + time.tv_nsec;
}

/* Steps all FMUs `ticks` times from tick `first` on and writes the ns that it took, without those of starting a thread;
 * returns the worst status. */
EXPORT int parallel(Side *side, int64_t sides, int64_t first, int64_t ticks, double step, int64_t how, int64_t *ns)
{
    Team team = {.side = side, .sides = sides, .first = first, .ticks = ticks, .how = how, .step = step};
    if (how == ALONE) {
        int64_t begun = now();
        work(&team, 0, 1, 0);
        *ns = now() - begun;
        return atomic_load(&team.status);
    }
    pthread_t thread;
    pthread_barrier_init(&team.barrier, NULL, 2);
    if (pthread_create(&thread, NULL, second, &team)) {
        return 3;
    }
    long long met = 0;
    meet(&team, &met);
    int64_t begun = now();
    work(&team, 0, 2, met);
    *ns = now() - begun;
    pthread_join(thread, NULL);
    pthread_barrier_destroy(&team.barrier);
    return atomic_load(&team.status);
}

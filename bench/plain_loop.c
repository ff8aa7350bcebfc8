/* The yardstick: what a C programmer would write to step two FMUs, with nothing around it, and the same where each tick
 * leaves a row in memory: time, what is recorded of one side, of the other, and the input of that one. Used by
 * master_step.py. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef int Values2(void *, const uint32_t *, size_t, double *);
typedef int Step2(void *, double, double, int);
typedef int Values3(void *, const uint32_t *, size_t, double *, size_t);
typedef int Step3(void *, double, double, bool, bool *, bool *, bool *, double *);

/* One FMU with one output that the other one's input takes. */
typedef struct {
    void *instance;
    void (*set)(void), (*get)(void), (*step)(void);
    uint32_t input, output;
    uint32_t recorded[4]; /* the output first */
    size_t columns;
} Side;

__attribute__((visibility("default"))) int plain2(const Side *a, const Side *b, double h, int64_t steps)
{
    double y[2];
    int status = 0;
    for (int64_t k = 0; k < steps && status <= 1; k++) {
        status |= ((Values2 *)a->get)(a->instance, &a->output, 1, &y[0]);
        status |= ((Values2 *)b->get)(b->instance, &b->output, 1, &y[1]);
        status |= ((Values2 *)a->set)(a->instance, &a->input, 1, &y[1]);
        status |= ((Values2 *)b->set)(b->instance, &b->input, 1, &y[0]);
        status |= ((Step2 *)a->step)(a->instance, (double)k * h, h, 1);
        status |= ((Step2 *)b->step)(b->instance, (double)k * h, h, 1);
    }
    return status;
}

static int step3(const Side *side, double time, double h)
{
    bool event, terminate, early;
    double last;
    return ((Step3 *)side->step)(side->instance, time, h, true, &event, &terminate, &early, &last);
}

__attribute__((visibility("default"))) int plain3(const Side *a, const Side *b, double h, int64_t steps)
{
    double y[2];
    int status = 0;
    for (int64_t k = 0; k < steps && status <= 1; k++) {
        status |= ((Values3 *)a->get)(a->instance, &a->output, 1, &y[0], 1);
        status |= ((Values3 *)b->get)(b->instance, &b->output, 1, &y[1], 1);
        status |= ((Values3 *)a->set)(a->instance, &a->input, 1, &y[1], 1);
        status |= ((Values3 *)b->set)(b->instance, &b->input, 1, &y[0], 1);
        status |= step3(a, (double)k * h, h);
        status |= step3(b, (double)k * h, h);
    }
    return status;
}

__attribute__((visibility("default"))) int recording2(const Side *a, const Side *b, double h, int64_t steps, double *rows)
{
    int status = 0;
    for (int64_t k = 0; k < steps && status <= 1; k++) {
        double *y = rows + 1, *z = y + a->columns;
        rows[0] = (double)k * h;
        status |= ((Values2 *)a->get)(a->instance, a->recorded, a->columns, y);
        status |= ((Values2 *)b->get)(b->instance, b->recorded, b->columns, z);
        z[b->columns] = y[0];
        status |= ((Values2 *)a->set)(a->instance, &a->input, 1, z);
        status |= ((Values2 *)b->set)(b->instance, &b->input, 1, y);
        status |= ((Step2 *)a->step)(a->instance, rows[0], h, 1);
        status |= ((Step2 *)b->step)(b->instance, rows[0], h, 1);
        rows = z + b->columns + 1;
    }
    return status;
}

__attribute__((visibility("default"))) int recording3(const Side *a, const Side *b, double h, int64_t steps, double *rows)
{
    int status = 0;
    for (int64_t k = 0; k < steps && status <= 1; k++) {
        double *y = rows + 1, *z = y + a->columns;
        rows[0] = (double)k * h;
        status |= ((Values3 *)a->get)(a->instance, a->recorded, a->columns, y, a->columns);
        status |= ((Values3 *)b->get)(b->instance, b->recorded, b->columns, z, b->columns);
        z[b->columns] = y[0];
        status |= ((Values3 *)a->set)(a->instance, &a->input, 1, z, 1);
        status |= ((Values3 *)b->set)(b->instance, &b->input, 1, y, 1);
        status |= step3(a, rows[0], h);
        status |= step3(b, rows[0], h);
        rows = z + b->columns + 1;
    }
    return status;
}

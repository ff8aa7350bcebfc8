/* What is behind a play, carried along recorded motion, several sets of numbers at once: `Backlash.advance`, in the
 * order of its operations, so the bits are those of the expressions (tests/estimation/test_play_kernel.py). */
#include "kernels.h"

#include <math.h>
#include <stdlib.h>

enum { LANES = 8, NUMBERS = 8 };

typedef double Lane[LANES];

/* Numbers of each set, what follows from them and from the step dt, and the states. */
struct play {
    Lane far, half, both, damped, stiff, slowed, per_bend, linear, slides, deflection, twist, rate, bristle, passed;
};

#define EACH _Pragma("clang loop vectorize(assume_safety)") for (int j = 0; j < LANES; j++)
#define SIGN(X) ((X) < 0 ? -1.0 : (X) > 0 ? 1.0 : (X))
#define ABOVE(X) ((X) > 0 ? (X) : 0.0)

static void begin(struct play *p, const double *numbers, long long sets, double dt) {
    for (int j = 0; j < LANES; j++) { /* lanes without a set repeat the last one */
        const double *own = numbers + NUMBERS * (j < sets ? j : sets - 1);
        double far = own[0], omega = 6.2831853071795862 * own[3], friction = own[5], deflection = own[7];
        p->far[j] = far;
        p->half[j] = own[1] / 2;
        p->damped[j] = 2 * own[4] * omega / dt;
        p->both[j] = omega * omega + p->damped[j];
        p->stiff[j] = 1 + p->both[j] * (dt * dt);
        p->slowed[j] = 1 + dt * own[6] / far;
        p->per_bend[j] = dt * friction / (deflection * far);
        p->linear[j] = 1 + p->per_bend[j] * dt;
        p->slides[j] = dt / deflection;
        p->deflection[j] = deflection;
        p->twist[j] = p->rate[j] = p->bristle[j] = p->passed[j] = 0;
    }
}

INLINE void step(struct play *restrict p, double before, double after, double dt) {
    EACH {
        double twist = p->twist[j], far_speed = before - p->rate[j], bristle = p->bristle[j];
        double free = twist + dt * (after - far_speed), side = SIGN(free);
        double depth = side * twist - p->half[j];
        double met = p->both[j] * (side * free - p->half[j]) - p->damped[j] * ABOVE(depth);
        double in = met / p->stiff[j], push = side * ABOVE(in);
        double pushed = (far_speed + dt * push) / p->slowed[j];
        double left = pushed - p->per_bend[j] * bristle, way = SIGN(left), size = way * left;
        double linear = p->linear[j] - way * pushed * p->slides[j];
        double root = __builtin_elementwise_sqrt(linear * linear + 4 * p->slides[j] * size);
        double large = 2 * size / (linear + root), small = (root - linear) / (2 * p->slides[j]);
        double speed = way * ((0 < linear ? large : 0) + (0 < linear ? 0 : small));
        double rate = after - speed;
        p->rate[j] = rate;
        p->twist[j] = twist + dt * rate;
        p->bristle[j] = (bristle + dt * speed) / (1 + dt * fabs(speed) / p->deflection[j]);
        p->passed[j] = p->far[j] * push;
    }
}

INLINE void walk(struct play *p, const double *speed, long long steps, double dt, Lane *passed) {
    for (long long k = 0; k < steps; k++) {
        step(p, speed[k], speed[k + 1], dt);
        for (int j = 0; j < LANES; j++) passed[k][j] = p->passed[j];
    }
}

static void walk_plain(struct play *p, const double *speed, long long steps, double dt, Lane *passed) {
    walk(p, speed, steps, dt, passed);
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) static void walk_wide(struct play *p, const double *speed, long long steps, double dt,
                                                      Lane *passed) {
    walk(p, speed, steps, dt, passed);
}
#else
#define walk_wide walk_plain
#endif

/* Torque that each of several plays passes on, (sets, steps + 1), from rest in the middle of the gap; `numbers` of a
 * set are the far inertia and the fields of `Backlash`, `speed` has steps + 1 values dt apart. */
EXPORT int play_run(const double *speed, long long steps, double dt, const double *numbers, long long sets,
                    double *passed) {
    Lane *lanes = malloc((size_t)(steps + 1) * sizeof *lanes);
    int wide = is_wide();
    if (!lanes) return 1;
    for (long long first = 0; first < sets; first += LANES) {
        struct play play;
        begin(&play, numbers + NUMBERS * first, sets - first, dt);
        (wide ? walk_wide : walk_plain)(&play, speed, steps, dt, lanes);
        for (int j = 0; j < LANES && first + j < sets; j++) {
            double *out = passed + (steps + 1) * (first + j);
            out[0] = 0;
            for (long long k = 0; k < steps; k++) out[k + 1] = lanes[k][j];
        }
    }
    free(lanes);
    return 0;
}

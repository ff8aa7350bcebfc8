/* The opponent of fmu_step.py: one step of RODAS4 for one axis with LuGre friction, written by hand for this one system.
 *
 *   q' = v,  J v' = tau - F - sigma1 s - sigma2 v,  F' = sigma0 s,  s = v - |v| F / g(v)
 *
 * Nothing rests on q, so each stage solves two equations, by the inverse of their matrix; the sums add the newest stage
 * last, because all else is ready before it; numbers that parameters alone decide are worked out beforehand. exp and pow
 * are those of the FMU. */
#include "detmath.h"

#include <stddef.h>

typedef struct {
    double per_inertia, torque_limit, sigma0, sigma1, sigma2, Fc, Fs_less_Fc, per_Vs, delta;
} Axis;

typedef struct {
    double v, F;
} Pair;

enum { STAGES = 6 };

static const double a[STAGES][5] = {
    {0},
    {1.544},
    {0.9466785280815826, 0.2557011698983284},
    {3.314825187068521, 2.896124015972201, 0.9986419139977817},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 1},
};
static const double c[STAGES][5] = {
    {0},
    {-5.6688},
    {-2.430093356833875, -0.2063599157091915},
    {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
    {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.7089089320616},
    {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054},
};

static Pair rates(const Axis *axis, double torque, double v, double F) {
    double speed = fabs(v), level = axis->Fc + axis->Fs_less_Fc * exp(-pow(speed * axis->per_Vs + 1e-12, axis->delta));
    double slip = v - speed * F / level;
    Pair rate = {(torque - axis->sigma2 * v - F - axis->sigma1 * slip) * axis->per_inertia, axis->sigma0 * slip};
    return rate;
}

/* Rates, and in slope their derivatives: of v' by v and F, of F' by v and F. */
static Pair rates_and_slopes(const Axis *axis, double torque, double v, double F, double slope[4]) {
    double speed = fabs(v), sign = v > 0 ? 1 : v < 0 ? -1 : 0, ratio = speed * axis->per_Vs + 1e-12;
    double extra = axis->Fs_less_Fc * exp(-pow(ratio, axis->delta)), per_level = 1 / (axis->Fc + extra);
    double level_by_v = -extra * axis->delta * pow(ratio, axis->delta - 1) * sign * axis->per_Vs;
    double rest = speed * per_level, slip = v - rest * F, slip_by_v = 1 - F * (sign - rest * level_by_v) * per_level;
    slope[0] = -(axis->sigma1 * slip_by_v + axis->sigma2) * axis->per_inertia;
    slope[1] = -(1 - axis->sigma1 * rest) * axis->per_inertia;
    slope[2] = axis->sigma0 * slip_by_v;
    slope[3] = -axis->sigma0 * rest;
    Pair rate = {(torque - axis->sigma2 * v - F - axis->sigma1 * slip) * axis->per_inertia, axis->sigma0 * slip};
    return rate;
}

/* A step of length h; x is q, v, F. Returns the mean square of the error in units of the tolerance. */
static double step(const Axis *axis, double tau, double h, double tolerance, const double nominals[3], double x[3]) {
    double slope[4], q[STAGES], v[STAGES], F[STAGES], q_end = 0, v_end = x[1], F_end = x[2], per_h = 1 / h;
    double torque = tau > axis->torque_limit ? axis->torque_limit : tau < -axis->torque_limit ? -axis->torque_limit : tau;
    Pair rate = rates_and_slopes(axis, torque, x[1], x[2], slope);
    double diagonal = 4 * per_h, m11 = diagonal - slope[0], m22 = diagonal - slope[3], quarter = 0.25 * h;
    double per_determinant = 1 / (m11 * m22 - slope[1] * slope[2]);
    double i11 = m22 * per_determinant, i12 = slope[1] * per_determinant, i21 = slope[2] * per_determinant,
           i22 = m11 * per_determinant;
#pragma GCC unroll 6
    for (int s = 0; s < STAGES; s++) {
        double past_q = 0, past_v = 0, past_F = 0;
        q_end = x[0], v_end = x[1], F_end = x[2];
#pragma GCC unroll 5
        for (int j = 0; j < s; j++) {
            q_end += a[s][j] * q[j], v_end += a[s][j] * v[j], F_end += a[s][j] * F[j];
            past_q += c[s][j] * q[j], past_v += c[s][j] * v[j], past_F += c[s][j] * F[j];
        }
        if (s > 0) rate = rates(axis, torque, v_end, F_end);
        double right_v = rate.v + per_h * past_v, right_F = rate.F + per_h * past_F;
        v[s] = i11 * right_v + i12 * right_F;
        F[s] = i21 * right_v + i22 * right_F;
        q[s] = (v_end + per_h * past_q + v[s]) * quarter;
    }
    double end[3] = {q_end + q[5], v_end + v[5], F_end + F[5]}, error[3] = {q[5], v[5], F[5]}, total = 0;
    for (int i = 0; i < 3; i++) {
        double part = error[i] / (0.5 * (fabs(x[i]) + fabs(end[i])) + 0.01 * nominals[i]);
        total += part * part;
        x[i] = end[i];
    }
    return total / (3 * tolerance * tolerance);
}

/* One step for each torque; returns the largest error, which is below 1 where no step was too long. */
double by_hand(const Axis *axis, const double *torques, int count, double h, double tolerance, const double nominals[3],
               double x[3]) {
    double largest = 0;
    for (int k = 0; k < count; k++) {
        double error = step(axis, torques[k], h, tolerance, nominals, x);
        if (!(error <= largest)) largest = error;
    }
    return largest;
}

/* The same through the interface of FMI 3: set the torque, step, read the position. Returns the number of steps done. */
typedef int Set(void *, const unsigned *, size_t, const double *, size_t);
typedef int Get(void *, const unsigned *, size_t, double *, size_t);
typedef int DoStep(void *, double, double, _Bool, _Bool *, _Bool *, _Bool *, double *);

int by_fmu(void *instance, Set *set, Get *get, DoStep *do_step, const double *torques, int first, int count, double h,
           unsigned torque, unsigned position, double *q) {
    _Bool event, terminate, early;
    double last;
    for (int k = 0; k < count; k++) {
        if (set && set(instance, &torque, 1, torques + k, 1)) return k;
        if (do_step(instance, (first + k) * h, h, 1, &event, &terminate, &early, &last)) return k;
        if (get && get(instance, &position, 1, q, 1)) return k;
    }
    return count;
}

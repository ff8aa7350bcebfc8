/* The paper's tracking experiment as an independent program: its equations, nothing of this project.
 *
 * Plant: J q'' = tau - tau_f, LuGre (4)-(6) with the state F = sigma0 z, RK4 at 50 us, friction by direction (Tables 2, 3)
 * or nominal. Controller at 0.1 ms: (7), (11), (13), (17) with the speed of the middle of the step; a command acts
 * one tick after its sample. Prints the ISE over 15 s [arcsec^2 s].
 * usage: paper_loop DIRECTIONAL CASE KP     CASE 1..5 = C1, C2a, C2b, C3a, C3b
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
    double sigma0, sigma1, sigma2, Fc, Fs, Vs, delta;
} Friction;

static const Friction forward = {9.7869e4, 521.4151, 28.64, 3.128, 4.32, 0.01129, 1.2914};
static const Friction backward = {8.674e4, 473, 22.5, 2.123, 3.081, 0.02126, 1.9};
static const Friction nominal = {9.23e4, 497, 32.77, 2.322, 3.322, 0.04129, 2};
static const double J = 30, h = 1e-4, pi = 3.14159265358979323846;
static int directional;

static double level(Friction f, double v) { return f.Fc + (f.Fs - f.Fc) * exp(-pow(fabs(v) / f.Vs, f.delta)); }

static double sign(double v) { return (v > 0) - (v < 0); }

static void rates(const double *x, double tau, double *dx) {
    double v = x[1];
    Friction f = !directional ? nominal : v >= 0 ? forward : backward;
    double dz = v - fabs(v) * x[2] / level(f, v);
    dx[0] = v;
    dx[1] = (tau - x[2] - f.sigma1 * dz - f.sigma2 * v) / J;
    dx[2] = f.sigma0 * dz;
}

static void advance(double *x, double tau, double dt) {
    double k[4][3], at[3], part[3] = {0.5, 0.5, 1};
    rates(x, tau, k[0]);
    for (int s = 0; s < 3; s++) {
        for (int i = 0; i < 3; i++) at[i] = x[i] + part[s] * dt * k[s][i];
        rates(at, tau, k[s + 1]);
    }
    for (int i = 0; i < 3; i++) x[i] += dt / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
}

/* Reference: a sine of 0.2 Hz, five times the speed of the stars, times a quintic rise over 2.5 s. */
static void reference(double t, double *q, double *v, double *a) {
    double w = 2 * pi * 0.2, A = 5 * 7.268e-5 / w, x = fmin(t / 2.5, 1);
    double s = x * x * x * (10 - 15 * x + 6 * x * x), ds = 30 * x * x * (1 - x) * (1 - x) / 2.5;
    double dds = 60 * x * (1 - x) * (1 - 2 * x) / (2.5 * 2.5);
    *q = s * A * sin(w * t);
    *v = ds * A * sin(w * t) + s * A * w * cos(w * t);
    *a = dds * A * sin(w * t) + 2 * ds * A * w * cos(w * t) - s * A * w * w * sin(w * t);
}

/* Equation (6) with z by (17); *z is kept in rad. */
static double lugre(double *z, double before, double now) {
    Friction f = nominal;
    double middle = (before + now) / 2, g = level(f, middle), decay = exp(-fabs(middle) * f.sigma0 * h / g);
    *z = g / f.sigma0 * sign(middle) * (1 - decay) + decay * *z;
    return f.sigma0 * *z + f.sigma1 * (now - f.sigma0 * fabs(now) * *z / level(f, now)) + f.sigma2 * now;
}

int main(int count, char **word) {
    if (count != 4) return 2;
    directional = atoi(word[1]);
    int kind = atoi(word[2]);
    double kp = atof(word[3]), kd = 30, pole = exp(-220 * h), arcsec = pi / 180 / 3600;
    double x[3] = {0}, zeta[3] = {0}, z = 0, before = 0, tau = 0, acted = 0, friction = 0, ise = 0;
    for (int k = 0; k < 175000; k++) {
        double q_d, v_d, a_d;
        reference(k * h, &q_d, &v_d, &a_d);
        double push = zeta[2] + (acted - friction) / J, guess = zeta[0] + h * zeta[1] + h * h / 2 * push;
        double off = x[0] - guess, a = 1 - pole;
        zeta[0] = guess + (1 - pole * pole * pole) * off;
        zeta[1] += h * push + 1.5 * a * a * (1 + pole) / h * off;
        zeta[2] += a * a * a / (h * h) * off;
        double v = kind >= 4 ? v_d : zeta[1];
        friction = 0;
        if (kind == 2 || kind == 4) friction = lugre(&z, before, v);
        if (kind == 3 || kind == 5) friction = level(nominal, v) * sign(v) + nominal.sigma2 * v;
        before = v;
        double e = q_d - x[0];
        if (k >= 25000) ise += e * e * h;
        acted = tau;
        tau = J * (a_d + kp * e + kd * (v_d - zeta[1])) + friction - J * zeta[2];
        for (int i = 0; i < 2; i++) advance(x, acted, h / 2);
    }
    printf("%.8g\n", ise / (arcsec * arcsec));
    return 0;
}

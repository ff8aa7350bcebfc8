/* One axis of a machine under a sampled controller, integrated in short steps.
 *
 * The names P_... (parameters), C_... (channels) are put before this text by plant.py. All torques in N m (N on a linear
 * axis), positions in rad (m). A channel holds the torque that a plain model `J a = command - friction - payload` lacks
 * because of one effect, averaged over a controller tick; a parameter that switches an effect off is 0.
 */
#include <math.h>
#include <string.h>

#define RING 65536
#define SLIPS 12

typedef struct { double z, force[SLIPS]; int slips[SLIPS]; double last; } Bristle;

static double sgn(double x) { return (x > 0) - (x < 0); }
static double clip(double x, double a) { return x > a ? a : x < -a ? -a : x; }

/* Friction force for the level g and viscous torque s2 v; `d` gets a bound of its slope in v. */
static double rub(int law, const double *P, Bristle *b, double v, double g, double s2, double dt,
                  const double *stiff, const double *share, int n, double *d)
{
    double s0 = P[P_s0], s1 = P[P_s1], f = 0, zn, rate;
    if (law == 0) {                                   /* LuGre, implicit in z */
        zn = (b->z + dt * v) / (1 + dt * s0 * fabs(v) / g);
        rate = (zn - b->z) / dt;
        b->z = zn;
        *d = s1 + s2 + s0 * dt;
        return s0 * zn + s1 * rate + s2 * v;
    }
    if (law == 1) {                                   /* generalised Maxwell slip */
        double k = 0;
        for (int i = 0; i < n; i++) {
            double top = share[i] * g;
            if (b->slips[i] && v * b->last <= 0) b->slips[i] = 0;
            if (!b->slips[i]) {
                b->force[i] += stiff[i] * v * dt;
                k += stiff[i];
                if (fabs(b->force[i]) >= top) b->slips[i] = 1;
            } else {
                double w = dt * P[P_gms_rate];
                b->force[i] = (b->force[i] + w * sgn(v) * top) / (1 + w);
            }
            f += b->force[i];
        }
        b->last = v;
        *d = s1 + s2 + k * dt;
        return f + (s1 + s2) * v;
    }
    if (law == 2) {                                   /* regularised static */
        double t = tanh(v / P[P_vt]);
        *d = s2 + g / P[P_vt] * (1 - t * t);
        return g * t + s2 * v;
    }
    if (law == 3) {                                   /* elasto-plastic: purely elastic up to a share of break-away */
        double full = g / s0, ba = P[P_ep_ba] * full, a = 0, x = fabs(b->z);
        if (v * b->z > 0) a = x <= ba ? 0 : x >= full ? 1 : 0.5 - 0.5 * cos(M_PI * (x - ba) / (full - ba));
        rate = v * (1 - a * x / full);
        if (fabs(v) * dt > 0.5 * full) { b->z = sgn(v) * full; rate = 0; }      /* slides: a step is longer than the bristle */
        else b->z = clip(b->z + dt * rate, 1.2 * full);
        *d = s1 + s2 + s0 * dt;
        return s0 * b->z + s1 * rate + s2 * v;
    }
    {                                                 /* Dahl with an exponent */
        double y = 1 - s0 * b->z / g * sgn(v);
        rate = v * sgn(y) * pow(fabs(y), P[P_dahl_n]);
        if (fabs(v) * dt > 0.5 * g / s0) b->z = sgn(v) * g / s0;
        else b->z = clip(b->z + dt * rate, 1.02 * g / s0);
        *d = s2 + s0 * dt;
        return s0 * b->z + s2 * v;
    }
}

static double wave(const double *P, double a)
{
    return (sin(a + P[P_cg_p1]) + P[P_cg_h2] * sin(2 * a + P[P_cg_p2]) + P[P_cg_h3] * sin(3 * a + P[P_cg_p3])) / P[P_cg_half];
}

static double spot(const double *P, double q, double angle)
{
    if (P[P_pf_kind] == 1) {
        double c = cos(P[P_pf_N] * angle + P[P_pf_p]);
        return c + P[P_pf_h] * (c * c - 0.5);
    }
    double x = fabs((q - P[P_pf_q0]) / P[P_pf_w]);
    if (P[P_pf_kind] == 2) return exp(-0.5 * x * x);
    return x > 2 ? 0 : 0.5 + 0.5 * cos(M_PI * x / 2);      /* raised cosine */
}

static double mass(const double *P, double q, double angle, double *slope)
{
    if (P[P_in_kind] == 2) {
        double t = tanh((q - P[P_in_q0]) / P[P_in_w]);
        *slope = P[P_in_A] * (1 - t * t) / P[P_in_w];
        return 1 + P[P_in_A] * t;
    }
    double a = P[P_in_N] * angle + P[P_in_p];
    *slope = -P[P_in_A] * P[P_in_N] * P[P_turn] * sin(a);
    return 1 + P[P_in_A] * cos(a);
}

/* n ticks of length T, m steps each. Returns 0, or 1 when the axis ran away. */
int simulate(int n, int m, double T, const double *P, const double *qd, const double *vd, const double *ad,
             const double *noise, const double *shake, const double *tone, const double *level, const double *temp,
             const double *stiff, const double *share, int ng, const int *channels, int nch,
             double *o_u, double *o_q, double *o_r, double *o_c)
{
    static _Thread_local double ring[RING];
    double dt = T / m, q1 = P[P_start], q2 = q1, v1 = 0, v2 = 0, vh = 0, rp = q1, I = P[P_hold], applied_lag = 0, drive = 0;
    double f1 = 0, f2 = 0, heat = 0, rest = 0, bonus = 0, went = 0, lastdir = 0, mag = 0, worn = 0, drive2 = 0;
    int law = (int)P[P_law], two = P[P_two] != 0, at = 0, hold = (int)(P[P_delay] / dt + 0.5);
    Bristle b;
    memset(&b, 0, sizeof b);
    memset(ring, 0, sizeof ring);
    if (hold >= RING) return 1;
    double J = P[P_J], J2 = two ? J * P[P_far] : 0, J1 = J - J2, vs = P[P_vsmall];
    for (int i = 0; i < n; i++) {
        double tk = i * T, y = (two && P[P_encoder_far]) ? q2 : q1, C[NC];
        memset(C, 0, sizeof C);
        o_q[i] = y;
        double ring_angle = P[P_ec_N] * y * P[P_turn];
        y += P[P_ec_A] * (sin(ring_angle + P[P_ec_p]) + P[P_ec_2] * sin(2 * ring_angle + P[P_ec_p2]));
        double r = y + noise[i];
        if (P[P_quant] > 0) r = floor(r / P[P_quant] + 0.5) * P[P_quant];
        o_r[i] = r;
        if (i == 0) rp = r;
        vh += P[P_vfilter] * ((r - rp) / T - vh);
        rp = r;
        double e = qd[i] - r, ff = P[P_ffc] * tanh(vd[i] / P[P_ffv]) + P[P_ffs2] * vd[i] + P[P_ffj] * ad[i]
                   + P[P_ffk] * sin(r + P[P_kn_p]), u, s;
        s = P[P_cascade] ? P[P_kp] * e + vd[i] - vh : e;
        u = P[P_cascade] ? P[P_kd] * s + I + ff : P[P_kp] * e + P[P_kd] * (P[P_ffd] * vd[i] - vh) + I + ff;
        if (fabs(u) < P[P_limit] || u * s < 0) I = clip(I + P[P_ki] * s * T, P[P_limit]);
        u = clip(u, P[P_limit]);
        o_u[i] = u;
        for (int j = 0; j < m; j++) {
            double t = tk + j * dt, x = u, w, D, mod, slope;
            /* ---- from command to torque ---- */
            if (P[P_db] > 0) { w = fabs(x) <= P[P_db] ? 0 : x - sgn(x) * P[P_db]; C[C_deadband] += x - w; x = w; }
            if (P[P_ts_T] > 0) {
                double k = P[P_ts_T], over = fabs(x) - k;
                if (P[P_ts_n] > 0) w = x / pow(1 + pow(fabs(x) / k, P[P_ts_n]), 1 / P[P_ts_n]);
                else w = over > 0 ? sgn(x) * (k + P[P_ts_slope] * over) : x;
                C[C_saturation] += x - w; x = w;
            }
            if (P[P_dr_c] > 0) {
                heat += dt * (x * x / (P[P_dr_u] * P[P_dr_u]) - heat) / P[P_dr_tau];
                w = x * (1 - P[P_dr_c] * heat / (1 + P[P_dr_c] * heat)); C[C_droop] += x - w; x = w;
            }
            if (P[P_rt_A] > 0) { w = x * (1 + P[P_rt_A] * sin(P[P_rt_N] * P[P_turn] * q1 + P[P_rt_p])); C[C_ripple] += x - w; x = w; }
            if (hold > 0) { ring[at] = x; w = ring[(at + RING - hold) % RING]; at = (at + 1) % RING; C[C_delay] += x - w; x = w; }
            if (P[P_fs_w] > 0) {
                double wc = t < P[P_fs_t] ? P[P_fs_w0] : P[P_fs_w];
                f2 = (f2 + dt * wc * wc * (x - f1)) / (1 + dt * 1.4 * wc + dt * dt * wc * wc);
                f1 += dt * f2; C[C_filter] += x - f1; x = f1;
            }
            if (P[P_lag] > 0) { applied_lag += (x - applied_lag) * dt / (P[P_lag] + dt); C[C_lag] += x - applied_lag; x = applied_lag; }
            drive += (x - drive) * dt / (P[P_loop] + dt);      /* current loop: always there */
            C[C_parasite] += x - drive; x = drive;
            /* ---- loads on the far side ---- */
            double qL = two ? q2 : q1, vL = two ? v2 : v1, aL = P[P_turn] * qL, angle = P[P_turn] * q1, load = 0;
            double payload = P[P_kn] != 0 ? P[P_kn] * sin(qL + P[P_kn_p]) : 0;
            load += payload;
            if (P[P_dp_f] != 0 && t > P[P_dp_t]) { w = -P[P_dp_f] * payload; C[C_dropped] += w; load += w; }
            if (P[P_gv] != 0) { w = P[P_gv] * sin(qL + P[P_gv_p]); C[C_gravity] += w; load += w; payload += w; }
            if (P[P_of] != 0) { C[C_offset] += P[P_of]; load += P[P_of]; }
            if (P[P_cg_A] != 0) { w = P[P_cg_A] * wave(P, P[P_cg_N] * angle); C[C_cogging] += w; load += w; }
            if (P[P_cw_k] != 0) { double h = qL - P[P_cw_q0]; w = P[P_cw_k] * h * (1 + P[P_cw_h] * h * h); C[C_cable] += w; load += w; }
            if (P[P_qd] != 0) { w = P[P_qd] * vL * fabs(vL); C[C_drag] += w; load += w; }
            if (P[P_lc_A] != 0 && t > P[P_lc_t]) { w = P[P_lc_A] * (1 + P[P_lc_s] * sin(aL * P[P_lc_N] + P[P_lc_p])); C[C_load_change] += w; load += w; }
            if (P[P_mh_A] != 0) { mag += dt * fabs(v1) * (P[P_mh_A] * sgn(v1) - mag) / P[P_mh_L]; C[C_magnetic] += mag; load += mag; }
            if (P[P_gm_A] != 0) { w = P[P_gm_A] * v1 * sin(P[P_gm_N] * angle + P[P_gm_p]); C[C_mesh] += w; load += w; }
            C[C_tone] += tone[i]; load += tone[i] + shake[i];
            /* ---- friction level ---- */
            double dir = clip(v1 / vs, 1), av = fabs(v1), ratio = P[P_Fs] > P[P_Fc] ? exp(-pow(av / P[P_Vs], P[P_delta])) : 0;
            double coulomb = P[P_Fc], g = coulomb + (P[P_Fs] - coulomb) * ratio, s2 = P[P_s2], L = level[i];
            double k_asym = 1, k_pos = 1, k_temp = 1, k_unk = 1, plus_load = 0, k2_asym = 1, k2_temp = 1, warm = temp[i] - 20;
            if (P[P_as_g] != 0 || P[P_as_v] != 0) { k_asym = 1 + P[P_as_g] * dir; k2_asym = 1 + P[P_as_v] * dir; }
            if (P[P_pf_A] != 0) { k_pos = 1 + P[P_pf_A] * spot(P, q1, angle); if (k_pos < 0.05) k_pos = 0.05; }
            if (P[P_th_v] != 0 || P[P_th_c] != 0) { k_temp = exp(P[P_th_c] * warm); k2_temp = exp(P[P_th_v] * warm); }
            if (P[P_ld] != 0) plus_load = P[P_ld] * fabs(payload);
            if (P[P_pt_A] != 0) { k_unk = 1 + P[P_pt_A] * tanh((q1 - P[P_pt_q0]) / P[P_pt_w]) * (warm - P[P_pt_T]) / 10; if (k_unk < 0.05) k_unk = 0.05; }
            if (P[P_dm_A] != 0) {
                if (dir * lastdir < 0) went = 0;
                if (fabs(dir) > 0.5) lastdir = dir;
                went += av * dt;
                k_unk *= 1 + P[P_dm_A] * (1 - exp(-went / P[P_dm_L]));
            }
            if (P[P_wr_A] != 0) { worn += av * dt; k_unk *= 1 + P[P_wr_A] * exp(-worn / P[P_wr_L]); }
            if (P[P_dw_b] != 0) {
                if (av < vs) { rest += dt; bonus = P[P_dw_b] * log(1 + rest / P[P_dw_t]); }
                else { rest = 0; bonus *= exp(-av * dt / P[P_dw_D]); }
            }
            mod = L * k_asym * k_pos * k_temp * k_unk;
            double gt = g * mod + plus_load + bonus;
            /* ---- motion ---- */
            double f, sv = s2 * k2_asym * k2_temp, far_rub = 0, twist = 0;
            f = rub(law, P, &b, v1, gt * (1 - P[P_far_rub]), sv, dt, stiff, share, ng, &D);
            double dry = f - sv * v1, vis = sv * v1;
            C[C_asymmetry] += dry * (1 - 1 / k_asym) ; C[C_asymmetry_v] += vis * (1 - 1 / k2_asym);
            C[C_position] += dry * (1 - 1 / k_pos);
            C[C_thermal] += dry * (1 - 1 / k_temp); C[C_thermal_v] += vis * (1 - 1 / k2_temp);
            C[C_unknown_level] += dry * (1 - 1 / k_unk);
            C[C_load] += dry * plus_load / gt; C[C_dwell] += dry * bonus / gt;
            C[C_stribeck] += dry * (g - coulomb) * mod / gt;
            C[C_dry] += dry;
            C[C_bristles] += dry - gt * clip(v1 / vs, 1);
            if (two) {
                double d = q1 - q2, gap = P[P_gap] / 2, k = P[P_k], c = P[P_c];
                if (fabs(d) > gap) {
                    double h = d - sgn(d) * gap;
                    twist = k * h + c * (v1 - v2);
                    if (gap > 0 && twist * h < 0) twist = 0;
                }
                if (P[P_far_rub] > 0) far_rub = P[P_far_rub] * gt * tanh(v2 / (3 * vs));
                double a2 = (twist - load - far_rub) / (J2 + dt * P[P_far_rub] * gt / (3 * vs));
                double a1 = (x - f - twist) / (J1 + dt * D);
                v1 += dt * a1; v2 += dt * a2;
                q1 += dt * v1; q2 += dt * v2;
                if (P[P_encoder_far]) C[C_two] += J1 * (a1 - a2);
                else C[C_two] += J2 * (a2 - a1) + far_rub - P[P_far_rub] * gt * tanh(v1 / (3 * vs));
            } else {
                double a;
                if (P[P_in_A] != 0) {
                    double M = mass(P, q1, angle, &slope);
                    a = (x - f - load - 0.5 * J * slope * v1 * v1) / (J * M + dt * D);
                    C[C_inertia] += J * (M - 1) * a + 0.5 * J * slope * v1 * v1;
                } else a = (x - f - load) / (J + dt * D);
                v1 += dt * a; q1 += dt * v1;
            }
        }
        for (int c = 0; c < nch; c++) o_c[(long)i * nch + c] = C[channels[c]] / m;
        if (!(fabs(q1 - qd[i]) < P[P_runaway])) return 1;
    }
    return 0;
}

/* Bristle state of LuGre over samples of a speed: phi = s0 z / Fc, psi = dz/dt; kappa = s0/Fc, rho = Fs/Fc. */
void bristle(int n, double dt, const double *v, double kappa, double rho, double Vs, double *phi, double *psi)
{
    double z = 0;
    for (int i = 0; i < n; i++) {
        double g = 1 + (rho - 1) * exp(-(v[i] / Vs) * (v[i] / Vs)), a = kappa * fabs(v[i]) / g, w = a * dt;
        double end = v[i] > 0 ? g / kappa : -g / kappa, zn = w > 1e-9 ? end + (z - end) * exp(-w) : z + v[i] * dt;
        z = zn;
        phi[i] = kappa * z;
        psi[i] = v[i] - a * z;
    }
}

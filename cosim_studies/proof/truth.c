/* A mount that nobody described: the concealed truth behind `cosim prove`.

   Written from scratch: it shares no code and no integrator with the models under test. Most concealed effects are the
   same formulas, since they are the same physics (mgl sin(q + phase) is written once in every textbook); what differs is
   the friction below them, the integration, the loop and all that disturbs it. Effects that the tool has no formula for
   are in `outside.py`.
   - leapfrog (staggered velocity) with fixed substeps of 10 us, velocities at half steps, angles at full steps;
   - friction is a blend of a bristle advanced by displacement and a row of elastic blocks that slip one by one
     (generalised Maxwell slip); memory advances with the distance travelled, not with time;
   - a sampled 10 kHz controller reads a noisy, quantised encoder and acts one tick later.

   Signs: J dv/dt = drive torque - everything else; every other torque resists.  SI units, degC.
   No globals, no allocation; the caller owns all arrays of one value a tick. */

#include <math.h>
#include <stddef.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { BLOCKS = 10, SUBSTEPS = 10 };

/* Order and types are mirrored in truth.py; `truth_size` guards it. */
struct mount {
    double tick;                                                    /* s, period of the loop */
    double inertia, inertia_swing, inertia_cycles, inertia_phase;   /* J (1 + swing cos(cycles q + phase)) */
    double load_inertia, drive_stiffness, drive_damping, gap;       /* second mass behind spring or play */
    double load_friction, load_viscous, load_stiffness;
    double coulomb, breakaway, stribeck_speed, stribeck_power;      /* level of sliding friction */
    double stiffness, damping, viscous, blend;                      /* blend 0: bristle only, 1: slip blocks only */
    double level_asymmetry, viscous_asymmetry;
    double rough_relative, rough_cycles, rough_phase;               /* level over position: waves */
    double spot_relative, spot_center, spot_width;                  /* ... and one rough spot */
    double dwell_torque, dwell_time, dwell_length;                  /* ageing contact */
    double load_sensitivity;                                        /* level per N m of payload torque */
    double thermal_level, thermal_viscous, thermal_tilt;            /* 1/K, exponents; tilt 1/(K rad) */
    double heating, warm_up_time;                                   /* K/W, s */
    double payload, payload_phase;                                  /* a known load */
    double unbalance, unbalance_phase, offset;
    double cogging_1, cogging_2, cogging_3, cogging_cycles, cogging_phase;
    double quadratic, cable, cable_home, cable_hardening;
    double swerve;                                                  /* N m per (rad/s^2)(rad/s) */
    double remanence, remanence_length, home;            /* hysteretic spring; `home` also of the tilt */
    double kick, kick_time;                                         /* fades with time since reversal */
    double delay, lag, knee, knee_slope;                            /* torque path */
    double ripple_1, ripple_2, ripple_cycles, ripple_phase;         /* encoder reading error */
    double quantum;
    double kp, kd, observer, loop_inertia;                          /* controller */
    double controller, ki, speed_filter, loop_every;                /* 0 ADRC, 1 PID, 2 P-PI cascade; 1/s; ticks */
    double regular, lorentz, friction_lag;                          /* rad/s, 1: that Stribeck curve, s */
    double run_in, run_in_length;                                   /* level over the way travelled */
    double viscous_swing, viscous_cycles, viscous_phase;            /* viscous friction over position */
    double dead_band, gain_swing, gain_cycles, gain_phase, gain_fade; /* what the drive makes of the command */
    double shift, shift_phase, shift_time;                          /* a payload that comes at a moment */
    double warp_place, warp_place_cycles, warp_place_phase;         /* what is concealed is not quite its equation: ... */
    double warp_speed, warp_speed_scale, warp_time, warp_time_rate, warp_time_phase, warp_way; /* ... times 1 + warp */
    double edge;                                                    /* N m, rounds the corner of load friction */
    double bend, bend_rate, bend_phase;                             /* level over speed: another curve, rad s/rad */
    double mottle, mottle_cycles, mottle_phase;                     /* level over position, as on any machine */
    double block_weight[BLOCKS], block_reach[BLOCKS];               /* share of level, rad to break away */
};

struct inputs {
    const double *target, *target_speed, *target_acceleration;
    const double *push;     /* N m, external torque and torque noise, resists */
    const double *level;    /* factor on the friction level: wander */
    const double *noise;    /* rad, on the encoder reading */
    const double *ambient;  /* degC */
};

struct outputs {
    double *command, *reading, *clean_reading, *angle, *speed, *temperature, *friction, *extra;
};

struct contact {
    double bristle, block[BLOCKS], age, load_block, lagged_speed, way;
    double force, viscous;  /* elastic-plastic torque; viscous coefficient now in force */
    double clock;           /* s */
};

struct motion {
    double q, v, load_q, load_v, lagged, temperature, slow_acceleration;
    double magnet, extreme, direction, since_reversal, clock;
};

struct observer {
    double position, speed, disturbance, before, sum;
};

EXPORT size_t truth_size(void) { return sizeof(struct mount); }

static double sign(double x) { return (x > 0) - (x < 0); }

static double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static double payload_torque(const struct mount *m, double q) {
    return m->payload != 0 ? m->payload * sin(q + m->payload_phase) : 0;
}

/* By what a concealed torque is more than its equation says, at this place, speed, time and direction. */
static double warp(const struct mount *m, double q, double v, double clock) {
    double more = m->warp_way * sign(v);
    if (m->warp_place != 0) more += m->warp_place * sin(m->warp_place_cycles * q + m->warp_place_phase);
    if (m->warp_speed != 0) more += m->warp_speed * (1 - 2 / (1 + fabs(v) / m->warp_speed_scale));
    if (m->warp_time != 0) more += m->warp_time * sin(m->warp_time_rate * clock + m->warp_time_phase);
    return more;
}

static double load_friction_of(const struct mount *m, double q) {
    double load = payload_torque(m, q);
    return m->load_sensitivity * (m->edge > 0 ? sqrt(load * load + m->edge * m->edge) - m->edge : fabs(load));
}

/* Sliding level at this speed, place, temperature, load and contact age. */
static double sliding_level(const struct mount *m, const struct contact *c, double q, double v, double degrees) {
    double ratio = (m->friction_lag > 0 ? c->lagged_speed : fabs(v)) / m->stribeck_speed, level = m->coulomb;
    if (m->lorentz != 0)
        level += (m->breakaway - m->coulomb) / (1 + ratio * ratio);
    else if (m->breakaway != m->coulomb && ratio < 40)
        level += (m->breakaway - m->coulomb) *
                 exp(-(m->stribeck_power == 1 ? ratio : m->stribeck_power == 2 ? ratio * ratio : pow(ratio, m->stribeck_power)));
    if (m->bend != 0) level *= 1 + m->bend * sin(m->bend_rate * fabs(v) + m->bend_phase);
    if (m->mottle != 0) level *= 1 + m->mottle * sin(m->mottle_cycles * q + m->mottle_phase);
    double plain = level;
    level *= 1 + m->level_asymmetry * sign(v);
    if (m->rough_relative != 0) level *= 1 + m->rough_relative * sin(m->rough_cycles * q + m->rough_phase);
    if (m->spot_relative != 0) {
        double x = (q - m->spot_center) / m->spot_width;
        if (fabs(x) < 6) level *= 1 + m->spot_relative * exp(-x * x / 2);
    }
    if (m->thermal_level != 0) level *= exp(m->thermal_level * (degrees - 20));
    if (m->thermal_tilt != 0) level *= fmax(0.2, 1 + m->thermal_tilt * (degrees - 20) * (q - m->home));
    if (m->load_sensitivity != 0) level += load_friction_of(m, q);
    if (m->dwell_torque != 0) level += m->dwell_torque * log1p(c->age / m->dwell_time);
    if (m->run_in != 0) level *= 1 + m->run_in * exp(-c->way / m->run_in_length);
    double more = warp(m, q, v, c->clock);
    return more == 0 ? level : plain + (level - plain) * (1 + more);
}

/* Advance the friction memory by the path `dq` travelled in `h` seconds under sliding level `level`. */
static void rub(const struct mount *m, struct contact *c, double dq, double h, double level) {
    double give = 0, bristle_force = 0, block_force = 0;
    if (m->regular > 0) { /* no memory: a steep, smooth sign of the speed */
        if (m->dwell_torque != 0) c->age = (c->age + h) / (1 + fabs(dq) / m->dwell_length);
        c->force = level * tanh(dq / h / m->regular);
        return;
    }
    if (m->blend < 1) {
        double reach = level / m->stiffness;
        double step = (copysign(reach, dq) - c->bristle) * -expm1(-fabs(dq) / reach);
        c->bristle += step;
        bristle_force = m->stiffness * c->bristle;
        give += (1 - m->blend) * step;
    }
    if (m->blend > 0)
        for (int i = 0; i < BLOCKS; i++) {
            double stiffness = m->block_weight[i] * m->breakaway / m->block_reach[i];
            double limit = m->block_weight[i] * level / stiffness, before = c->block[i];
            c->block[i] = clamp(before + dq, -limit, limit);
            block_force += stiffness * c->block[i];
            give += m->blend * m->block_weight[i] * (c->block[i] - before);
        }
    if (m->dwell_torque != 0) { /* contacts age at rest and are renewed by true slip */
        double slip = fabs(dq - give);
        c->age = (c->age + h) / (1 + slip / m->dwell_length);
    }
    c->force = (1 - m->blend) * bristle_force + m->blend * block_force + m->damping * give / h;
}

static void friction_step(const struct mount *m, struct contact *c, double q, double v, double dq, double h,
                          double wander, double degrees) {
    rub(m, c, dq, h, fmax(1e-9, wander * sliding_level(m, c, q, v, degrees)));
    if (m->friction_lag > 0) c->lagged_speed += -expm1(-h / m->friction_lag) * (fabs(v) - c->lagged_speed);
    c->way += fabs(dq);
    c->clock += h;
    c->viscous = m->viscous * (1 + m->viscous_asymmetry * sign(v));
    if (m->viscous_swing != 0) c->viscous *= 1 + m->viscous_swing * sin(m->viscous_cycles * q + m->viscous_phase);
    if (m->thermal_viscous != 0) c->viscous *= exp(m->thermal_viscous * (degrees - 20));
}

/* Torques that depend on where the axis is and how it moves, other than friction. */
static double extra_torque(const struct mount *m, const struct motion *s) {
    double q = s->q, v = s->v, torque = m->offset;
    if (m->unbalance != 0) torque += m->unbalance * sin(q + m->unbalance_phase);
    if (m->cogging_1 != 0) {
        double a = m->cogging_cycles * q + m->cogging_phase;
        torque += m->cogging_1 * sin(a);
        if (m->cogging_2 != 0) torque += m->cogging_2 * sin(2 * a) + m->cogging_3 * sin(3 * a);
    }
    torque += m->quadratic * v * fabs(v);
    double x = q - m->cable_home;
    torque += m->cable * x * (1 + m->cable_hardening * x * x);
    torque += m->swerve * fabs(s->slow_acceleration) * v;
    torque += m->remanence * s->magnet;
    if (m->shift != 0 && s->clock >= m->shift_time) torque += m->shift * sin(q + m->shift_phase);
    if (m->kick != 0) torque += m->kick * s->direction * exp(-s->since_reversal / m->kick_time);
    double more = warp(m, q, v, s->clock);
    return more == 0 ? torque : m->offset + (torque - m->offset) * (1 + more);
}

/* Slow memories of the outside effects: magnet, reversal clock. */
static void remember(const struct mount *m, struct motion *s, double dq, double h) {
    if (m->remanence != 0) {
        double room = 1 - sign(dq) * s->magnet;
        s->magnet += dq / m->remanence_length * room * room;
    }
    if (m->kick != 0) {
        s->since_reversal += h;
        if (s->direction * (s->q - s->extreme) > 0) s->extreme = s->q;
        if (s->direction * (s->extreme - s->q) > 2e-4) {
            s->direction = -s->direction;
            s->extreme = s->q;
            s->since_reversal = 0;
        }
    }
}

/* Torque from motor side to load side: a damped spring, or a stiff contact with play that cannot pull. */
static double drive_torque(const struct mount *m, double twist, double rate) {
    if (m->gap == 0) return m->drive_stiffness * twist + m->drive_damping * rate;
    double side = sign(twist), depth = fabs(twist) - m->gap / 2;
    if (depth <= 0) return 0;
    return side * fmax(0, m->drive_stiffness * depth + m->drive_damping * side * rate);
}

/* Second mass, with a little dry friction of its own. Returns the torque on the first mass. */
static double move_load(const struct mount *m, struct motion *s, struct contact *c, double h) {
    double torque = drive_torque(m, s->q - s->load_q, s->v - s->load_v);
    double dry = m->load_stiffness * c->load_block;
    s->load_v += h * (torque - dry - m->load_viscous * s->load_v) / m->load_inertia;
    s->load_q += h * s->load_v;
    if (m->load_stiffness > 0) {
        double limit = m->load_friction / m->load_stiffness;
        c->load_block = clamp(c->load_block + h * s->load_v, -limit, limit);
    }
    return torque;
}

/* What the drive makes of the command: dead time was taken by the caller; a dead band, lag and a soft knee follow. */
static double applied_torque(const struct mount *m, struct motion *s, double command, double h) {
    if (m->dead_band > 0) command = copysign(fmax(0, fabs(command) - m->dead_band), command);
    if (m->gain_swing != 0) command *= 1 + m->gain_swing * sin(m->gain_cycles * s->q + m->gain_phase);
    if (m->gain_fade != 0) command *= fmax(0.2, 1 + m->gain_fade * (s->temperature - 20));
    s->lagged = m->lag > 0 ? command + (s->lagged - command) * exp(-h / m->lag) : command;
    if (m->knee > 0 && fabs(s->lagged) > m->knee)
        return copysign(m->knee + m->knee_slope * (fabs(s->lagged) - m->knee), s->lagged);
    return s->lagged;
}

/* One leapfrog step; `torque` is the net non-viscous torque but friction. */
static void leap(const struct mount *m, struct motion *s, struct contact *c, double torque, double h) {
    double inertia = m->inertia, push = torque - c->force;
    if (m->inertia_swing != 0) {
        double a = m->inertia_cycles * s->q + m->inertia_phase;
        inertia *= 1 + m->inertia_swing * cos(a);
        push += 0.5 * m->inertia * m->inertia_swing * m->inertia_cycles * sin(a) * s->v * s->v;
    }
    double half = 0.5 * h * c->viscous / inertia, before = s->v;
    s->v = (before * (1 - half) + h * push / inertia) / (1 + half);
    if (m->swerve != 0) s->slow_acceleration += (h / 0.01) * ((s->v - before) / h - s->slow_acceleration);
    s->q += h * s->v;
}

static double read_angle(const struct mount *m, double q) {
    if (m->ripple_1 == 0) return q;
    double a = m->ripple_cycles * q + m->ripple_phase;
    return q + m->ripple_1 * sin(a) + m->ripple_2 * sin(2 * a);
}

static double quantised(const struct mount *m, double q) {
    return m->quantum > 0 ? m->quantum * floor(q / m->quantum + 0.5) : q;
}

/* PID, or a position loop around a PI speed loop; the speed is a filtered difference of readings. Loop period T. */
static double classic(const struct mount *m, struct observer *o, double T, double reading, double target,
                      double target_speed, double target_acceleration) {
    o->speed += -expm1(-m->speed_filter * T) * ((reading - o->before) / T - o->speed);
    o->before = reading;
    double late = target - reading, slow = target_speed - o->speed;
    double wrong = m->controller == 1 ? m->kp * late : m->kp * late + m->kd * slow;
    o->sum += m->ki * T * wrong;
    return m->loop_inertia * (target_acceleration + m->kp * late + m->kd * slow + o->sum);
}

/* Current-estimate observer with all poles at exp(-bandwidth tick); returns the new command. */
static double control(const struct mount *m, struct observer *o, double reading, double applied, double target,
                      double target_speed, double target_acceleration) {
    double T = m->tick * fmax(1, m->loop_every);
    if (m->controller > 0) return classic(m, o, T, reading, target, target_speed, target_acceleration);
    double b = exp(-m->observer * T), surprise = reading - o->position;
    o->position += (1 - b * b * b) * surprise;
    o->speed += 1.5 * (1 - b) * (1 - b) * (1 + b) / T * surprise;
    o->disturbance += (1 - b) * (1 - b) * (1 - b) / (T * T) * surprise;
    double want = target_acceleration + m->kp * (target - reading) + m->kd * (target_speed - o->speed);
    double command = m->loop_inertia * (want - o->disturbance);
    double a = o->disturbance + (m->loop_inertia > 0 ? applied / m->loop_inertia : 0);
    o->position += T * o->speed + 0.5 * T * T * a;
    o->speed += T * a;
    return command;
}

/* One tick of physics: SUBSTEPS leaps under the delayed command. */
static void physics(const struct mount *m, struct motion *s, struct contact *c, const struct inputs *in, long i,
                    const double *command) {
    double h = m->tick / SUBSTEPS;
    long late = (long)(m->delay / h + 0.5);
    for (int k = 0; k < SUBSTEPS; k++) {
        long then = i * SUBSTEPS + k - late;
        double torque = applied_torque(m, s, then >= 0 ? command[then / SUBSTEPS] : 0, h);
        torque -= in->push[i] + payload_torque(m, s->q) + extra_torque(m, s);
        if (m->load_inertia > 0) torque -= move_load(m, s, c, h);
        double before = s->q;
        leap(m, s, c, torque, h);
        remember(m, s, s->q - before, h);
        friction_step(m, c, s->q, s->v, s->q - before, h, in->level[i], s->temperature);
    }
    double heat = (c->force + c->viscous * s->v) * s->v;
    s->clock += m->tick;
    s->temperature += m->tick / m->warm_up_time * (m->heating * fmax(0, heat) - (s->temperature - in->ambient[i]));
}

/* Simulate n ticks of the closed loop from rest at target[0]; temperature starts at `temperature`. */
EXPORT void truth_run(const struct mount *m, long n, double temperature, const struct inputs *in, struct outputs *out) {
    struct motion s = {.q = in->target[0], .load_q = in->target[0], .temperature = temperature,
                       .extreme = in->target[0], .direction = 1, .since_reversal = 1e3};
    struct contact c = {.age = m->dwell_time};
    struct observer o = {.position = in->target[0], .before = in->target[0]};
    double next = 0;
    long every = (long)fmax(1, m->loop_every);
    for (long i = 0; i < n; i++) {
        out->command[i] = next;
        out->clean_reading[i] = read_angle(m, s.q);
        out->reading[i] = quantised(m, out->clean_reading[i] + in->noise[i]);
        out->angle[i] = s.q;
        out->speed[i] = s.v;
        out->temperature[i] = s.temperature;
        out->friction[i] = c.force + c.viscous * s.v;
        out->extra[i] = extra_torque(m, &s);
        if (i % every == 0)
            next = control(m, &o, out->reading[i], out->command[i], in->target[i], in->target_speed[i],
                           in->target_acceleration[i]);
        physics(m, &s, &c, in, i, out->command);
    }
}

/* Friction alone under a prescribed path: angle[n] at steps of h, friction torque out. */
EXPORT void truth_rub(const struct mount *m, long n, double h, double degrees, const double *angle, double *torque) {
    struct contact c = {.age = m->dwell_time};
    torque[0] = 0;
    for (long i = 1; i < n; i++) {
        double dq = angle[i] - angle[i - 1];
        friction_step(m, &c, angle[i], dq / h, dq, h, 1, degrees);
        torque[i] = c.force + c.viscous * dq / h;
    }
}

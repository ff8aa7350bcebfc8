/* The simulated drive, see drive.c. */
#ifndef DRIVE_H
#define DRIVE_H

#include "hardware.h"

/* What can be injected: the first six into any drive, the others into the answers of one behind a network (virtual.c). */
enum { LOST, STALE, JUMP, SATURATED, DEAD, TRIPPED, LATE, DUPLICATED, REORDERED, CORRUPTED, SILENT_HEAD,
       FROZEN_HEAD, STRAY_HEAD };

/* In the ticks of a session from `first` to before `last`; `size` in rad (jump, stray head), N m (saturated) or ticks (late). */
typedef struct {
    int64_t kind, first, last;
    double size;
    int64_t head; /* of the encoder, where it is about one */
} Injection;

typedef struct {
    Part plant; /* its first output is the position in rad */
    int64_t torque_input, watchdog, injections;
    const Injection *injection;
    double step, quantum;
    double torque, slew, speed; /* its own limits: N m, N m/s, rad/s */
    /* what is remembered */
    int64_t tick, state, failed, epoch, silent; /* `epoch`: tick at which the session began; ticks without an order */
    uint32_t control, counts, encoder, reserved;
    double held;
    int64_t limited, overspeeds; /* orders beyond its limits; how often it was too fast under power */
    int64_t heads; /* read heads of the encoder; 0: it is without error */
    double eccentricity; /* rad; that of its disc */
    uint32_t shown[HEADS];
} Drive;

/* drive.c */
const Injection *injected(const Drive *drive, int64_t kind);
void drive_coast(Drive *drive, int64_t tick);
void drive_let_go(Drive *drive);

#endif

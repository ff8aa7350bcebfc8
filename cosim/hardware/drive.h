/* The simulated drive, see drive.c. */
#ifndef DRIVE_H
#define DRIVE_H

#include "hardware.h"

enum { LOST, STALE, JUMP, SATURATED, DEAD, TRIPPED };

/* In the ticks from `first` to before `last`; `size` in rad (jump) or N m (saturated). */
typedef struct {
    int64_t kind, first, last;
    double size;
} Injection;

typedef struct {
    Part plant; /* its first output is the position in rad */
    int64_t torque_input, watchdog, injections;
    const Injection *injection;
    double step, quantum;
    /* what is remembered */
    int64_t tick, state, failed;
    uint32_t control, counts, encoder, reserved;
    double held;
} Drive;

#endif

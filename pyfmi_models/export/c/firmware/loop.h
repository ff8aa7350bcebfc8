/* The loop around the controller: at each edge the order of the cycle before is written, the encoder is read, the
 * controller is stepped. So a command acts one tick after its sample, as between FMUs. */
#ifndef LOOP_H
#define LOOP_H

#include "controller.h"

#include <stdint.h>

/* Torque is zero in every state but ON. The loop starts in FAULT. */
typedef enum { FAULT, OFF, ON } LoopState;

/* Requests act on their rising edge: RESET leaves FAULT, ENABLE leaves OFF. ON lasts while ENABLE does. */
enum { ENABLE = 1, RESET = 2 };

/* Faults, by bit; latched. */
enum { POWER_UP = 1, READ_FAILED = 2, WRITE_FAILED = 4, EDGE_MISSED = 8, NOT_FINITE = 16 };

typedef struct {
    uint32_t counts; /* of the encoder; wraps modulo 2^32 */
    uint32_t request;
    uint32_t missed; /* edges since the last cycle that had no cycle */
    double input[INPUTS];
} Sample;

typedef struct {
    Controller controller;
    LoopState state;
    uint32_t faults, last_counts, last_request;
    int64_t position; /* counts since the start, without wraps */
    double torque;    /* ordered for the next cycle */
} Loop;

void loop_start(Loop *loop);

/* One cycle; `failed` is the sum of READ_FAILED and WRITE_FAILED as the HAL answered. */
void loop_cycle(Loop *loop, const Sample *sample, uint32_t failed);

#endif

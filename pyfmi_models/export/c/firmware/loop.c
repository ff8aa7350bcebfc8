#include "loop.h"

static int rises(const Loop *loop, const Sample *sample, uint32_t what) {
    return (sample->request & what) && !(loop->last_request & what);
}

void loop_start(Loop *loop) {
    static const Loop nothing;
    *loop = nothing;
    loop->faults = POWER_UP;
    loop->last_request = ENABLE | RESET; /* a request that is there already is no edge */
    controller_start(&loop->controller);
}

/* Differences modulo 2^32 add up to a position that does not wrap; it begins where the encoder is. */
static void follow(Loop *loop, uint32_t counts) {
    if (loop->faults & POWER_UP)
        loop->position = (int32_t)counts;
    else
        loop->position += (int32_t)(counts - loop->last_counts);
    loop->last_counts = counts;
}

/* Entering, the controller starts anew, so that its observer begins at the measured position. */
static void move(Loop *loop, const Sample *sample, uint32_t found) {
    if (found) {
        loop->faults |= found;
        loop->state = FAULT;
    } else if (loop->state == FAULT && rises(loop, sample, RESET)) {
        loop->faults = 0;
        loop->state = OFF;
    } else if (loop->state == OFF && rises(loop, sample, ENABLE)) {
        controller_restart(&loop->controller);
        loop->state = ON;
    } else if (loop->state == ON && !(sample->request & ENABLE)) {
        loop->state = OFF;
    }
}

static void control(Loop *loop, const Sample *sample) {
    Controller *controller = &loop->controller;
    for (int i = 0; i < INPUTS; i++) controller->input[i] = sample->input[i];
    controller->input[ENCODER_INPUT] = ENCODER_QUANTUM * (double)loop->position;
    if (controller_step(controller))
        move(loop, sample, NOT_FINITE);
    else
        loop->torque = controller->output[TORQUE_OUTPUT];
}

void loop_cycle(Loop *loop, const Sample *sample, uint32_t failed) {
    if (!(failed & READ_FAILED)) follow(loop, sample->counts);
    move(loop, sample, failed | (sample->missed && loop->state == ON ? EDGE_MISSED : 0));
    loop->torque = 0;
    if (loop->state == ON) control(loop, sample);
    loop->last_request = sample->request;
}

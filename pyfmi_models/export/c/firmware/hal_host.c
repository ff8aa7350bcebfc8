/* HAL of a computer, for tests: samples from standard input, orders to standard output, no clock.
 *
 * A sample is 3 + INPUTS numbers (double): counts, request, missed, inputs; an order is 2 + OUTPUTS numbers: state,
 * torque, outputs of the controller. Order k is that written at edge k: it answers sample k - 1. Counts that are no
 * number play an encoder that does not answer. */
#include "hal.h"

#include <stdio.h>

enum { HEAD = 3, TAIL = 2 };

static double entered[HEAD + INPUTS];

int hal_wait(void) {
    return fread(entered, sizeof entered, 1, stdin) == 1 ? 0 : 1;
}

int hal_write(const Loop *loop) {
    double left[TAIL + OUTPUTS] = {(double)loop->state, loop->torque};
    for (int i = 0; i < OUTPUTS; i++) left[TAIL + i] = loop->controller.output[i];
    return fwrite(left, sizeof left, 1, stdout) == 1 ? 0 : 1;
}

int hal_read(Sample *sample) {
    if (entered[0] != entered[0]) return 1;
    sample->counts = (uint32_t)entered[0];
    sample->request = (uint32_t)entered[1];
    sample->missed = (uint32_t)entered[2];
    for (int i = 0; i < INPUTS; i++) sample->input[i] = entered[HEAD + i];
    return 0;
}

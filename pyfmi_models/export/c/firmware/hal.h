/* What a board gives. Write these three functions for yours; hal_host.c is an example for a computer.
 * Each returns 0 while all is well. Any other answer of `hal_read` or `hal_write` is a fault: torque zero until a reset. */
#ifndef HAL_H
#define HAL_H

#include "loop.h"

/* Sleep until the next edge, CONTROLLER_PERIOD after the last. Not 0: the program ends. */
int hal_wait(void);

/* Give loop->torque to the drive; in any state but ON it is zero, and the drive's power stage should be off. */
int hal_write(const Loop *loop);

/* Fill in the sample: encoder, requests, edges missed since the last cycle, and the set points in the places of the
 * controller's inputs (INPUT_...; that of the encoder is overwritten). */
int hal_read(Sample *sample);

#endif

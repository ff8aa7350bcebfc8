/* The whole program. All memory is this one Loop and the stack. */
#include "hal.h"

static Loop loop;

int main(void) {
    Sample sample = {0};
    loop_start(&loop);
    while (hal_wait() == 0) {
        uint32_t failed = hal_write(&loop) ? WRITE_FAILED : 0;
        failed |= hal_read(&sample) ? READ_FAILED : 0;
        loop_cycle(&loop, &sample, failed);
    }
    return 0;
}

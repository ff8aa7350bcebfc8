/* What is checked in each cycle before the controller is asked; each check that fails is a fault's bit. */
#include "hardware.h"

#include <math.h>

static uint32_t bit(bool failed, int fault)
{
    return failed ? 1u << fault : 0u;
}

static uint32_t check_time(Axis *axis, const Sample *sample)
{
    axis->late_row = sample->late ? axis->late_row + sample->late : 0;
    uint32_t found = bit(sample->request & NO_HEARTBEAT, HEARTBEAT_LOST);
    for (uint32_t i = 0; i < sample->late && i < MISSES; i++) {
        axis->miss[axis->misses++ % axis->late_limit] = sample->tick;
        int64_t oldest = axis->miss[axis->misses % axis->late_limit];
        found |= bit(axis->misses >= axis->late_limit && sample->tick - oldest < axis->late_window, DEADLINE);
    }
    return found | bit(sample->late >= MISSES, DEADLINE);
}

/* The position is that of the last good sample plus the difference modulo 2^32; a jump is one that the speed of the
 * axis does not explain. */
static uint32_t check_encoder(Axis *axis, const Sample *sample)
{
    const Feedback *feedback = &sample->feedback;
    if (!axis->known) {
        axis->position = (int32_t)feedback->counts;
        axis->rate = 0;
    } else if (feedback->encoder == axis->last_encoder) {
        return bit(++axis->stale > axis->stale_limit, ENCODER_STALE);
    }
    int64_t ticks = axis->known ? sample->tick - axis->fresh : 1;
    int32_t way = axis->known ? (int32_t)(feedback->counts - axis->last_counts) : 0;
    int32_t surprise = (int32_t)((uint32_t)way - (uint32_t)(axis->rate * ticks));
    axis->position += way;
    axis->rate = way / ticks;
    axis->last_counts = feedback->counts;
    axis->last_encoder = feedback->encoder;
    axis->fresh = sample->tick;
    axis->known = 1;
    axis->stale = 0;
    double speed = fabs((double)way) * axis->quantum / ((double)ticks * axis->step);
    return bit(fabs((double)surprise) * axis->quantum > axis->limit[LIMIT_JUMP], ENCODER_JUMP) |
           bit(speed > axis->limit[LIMIT_SPEED], OVERSPEED);
}

static uint32_t check_drive(Axis *axis, const Sample *sample)
{
    const Feedback *feedback = &sample->feedback;
    int64_t drive = cia402_state(feedback->statusword);
    bool up = axis->state >= READY_TO_SWITCH_ON && axis->state <= QUICK_STOP_ACTIVE;
    bool shown = axis->state == QUICK_STOP_ACTIVE ? drive == OPERATION_ENABLED : drive == axis->state;
    axis->waiting = up && !shown ? axis->waiting + 1 : 0;
    bool wrong = !(fabs(feedback->torque - axis->torque) <= axis->limit[LIMIT_MISMATCH]);
    axis->mismatched = axis->running && wrong ? axis->mismatched + 1 : 0;
    return bit(up && drive >= FAULT_REACTION_ACTIVE, DRIVE_FAULT) |
           bit(axis->waiting > (axis->running ? 0 : axis->patience), DRIVE_STATE) |
           bit(axis->mismatched > axis->mismatch_limit, TORQUE_MISMATCH);
}

uint32_t check(Axis *axis, Sample *sample)
{
    uint32_t found = check_time(axis, sample) | bit(axis->state == NOT_READY, POWER_UP) |
                     bit(sample->request & ASK_ESTOP, ESTOP) |
                     bit(sample->read == READ_ERROR || sample->status != 0, ADAPTER_FAILED);
    axis->lost = sample->read == READ_OK ? 0 : axis->lost + 1;
    if (axis->lost > 0) {
        return found | bit(axis->lost > axis->lost_limit, FRAME_LOST);
    }
    if (heads_combine(&axis->heads, &sample->feedback)) { /* there is no position to check */
        return found | bit(true, ENCODER_HEADS) | check_drive(axis, sample);
    }
    return found | check_encoder(axis, sample) | check_drive(axis, sample);
}

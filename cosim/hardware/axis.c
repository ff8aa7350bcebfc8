/* One axis: from a sample to an order. Torque is zero in every state but two: operation enabled (the controller's, within
 * limits that grow from zero) and quick stop (what it was, on its way to zero). */
#include "hardware.h"

#include <math.h>
#include <string.h>

typedef int Restore(void *, void *);

static double within(double value, double limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

static bool rises(const Axis *axis, const Sample *sample, uint32_t what)
{
    return (sample->request & what) && !(axis->last_request & what);
}

/* A limit may become anything while no torque is enabled, and only smaller while it is. */
static void change_limit(Axis *axis, const Sample *sample)
{
    if (sample->change == 0 || sample->change > LIMITS) {
        return;
    }
    double *limit = &axis->limit[sample->change - 1];
    bool enabled = axis->state == OPERATION_ENABLED || axis->state == QUICK_STOP_ACTIVE;
    if (sample->value >= 0.0 && (!enabled || sample->value <= *limit)) {
        *limit = sample->value;
    } else {
        axis->refused++;
    }
}

/* The controlword that the axis gives itself: up by one state when the drive has come as far as the axis has. */
static uint32_t wish(Axis *axis, const Sample *sample)
{
    bool late = axis->late_row >= axis->late_row_limit;
    if (axis->state == FAULT && rises(axis, sample, ASK_RESET)) {
        return FAULT_RESET;
    }
    axis->wanted = (axis->wanted || rises(axis, sample, ASK_ENABLE)) && (sample->request & ASK_ENABLE);
    if (late || (sample->request & ASK_QUICK_STOP)) {
        axis->wanted = 0;
        return STOP_QUICKLY;
    }
    if (!axis->wanted) {
        return axis->state == OPERATION_ENABLED || axis->state == QUICK_STOP_ACTIVE ? STOP_QUICKLY : DISABLE_VOLTAGE;
    }
    bool there = sample->read == READ_OK && cia402_state(sample->feedback.statusword) == axis->state;
    static const uint32_t up[] = {SHUTDOWN, SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, ENABLE_OPERATION};
    static const uint32_t stay[] = {SHUTDOWN, SHUTDOWN, SHUTDOWN, SWITCH_ON, ENABLE_OPERATION};
    if (axis->state > OPERATION_ENABLED) {
        return SHUTDOWN;
    }
    return there ? up[axis->state] : stay[axis->state];
}

/* The controlword for the drive: what brings it to the state of the axis. A quick stop's ramp is ours, the drive stays on. */
static uint32_t order_word(const Axis *axis, uint32_t wished)
{
    static const uint32_t word[] = {DISABLE_VOLTAGE, DISABLE_VOLTAGE, SHUTDOWN, SWITCH_ON, ENABLE_OPERATION,
                                    ENABLE_OPERATION, DISABLE_VOLTAGE, DISABLE_VOLTAGE};
    return axis->state == SWITCH_ON_DISABLED && wished == FAULT_RESET ? FAULT_RESET : word[axis->state];
}

/* Steps the controller; entering, from the state it had before its first tick, so that its observer starts here. */
static int control(Axis *axis, Sample *sample, Record *record)
{
    const Part *part = &axis->controller;
    int status = 0;
    if (!axis->running) {
        status = ((Restore *)part->restore)(part->instance, axis->initial);
        axis->running = 1;
        axis->ran = 0;
        axis->entered = sample->tick;
        record->notes |= ENTERED;
    }
    memcpy(part->input, sample->input, (size_t)part->inputs * sizeof(double));
    part->input[axis->encoder_input] = axis->quantum * (double)axis->position;
    status = worse(status, set_inputs(part));
    if (status <= FMI_WARNING) {
        status = worse(status, do_step(part, (double)axis->ran * axis->step, axis->step, true));
    }
    if (status <= FMI_WARNING) {
        status = worse(status, get_outputs(part));
    }
    axis->ran++;
    record->notes |= STEPPED;
    record->command = part->output[0];
    return status;
}

static double limited(const Axis *axis, Record *record)
{
    double share = axis->ran < axis->ramp ? (double)axis->ran / (double)axis->ramp : 1.0;
    double torque = within(record->command, share * axis->limit[LIMIT_TORQUE]);
    record->notes |= torque != record->command ? LIMITED : 0;
    double most = axis->limit[LIMIT_SLEW] * axis->step, change = torque - axis->torque;
    if (fabs(change) > most) {
        record->notes |= SLEWED;
        torque = axis->torque + within(change, most);
    }
    return within(torque, axis->limit[LIMIT_TORQUE]);
}

/* The torque of operation, and the faults found on the way to it. */
static double operate(Axis *axis, Sample *sample, Record *record, uint32_t *found)
{
    double error = sample->input[axis->reference_input] - axis->quantum * (double)axis->position;
    if (!(fabs(error) <= axis->limit[LIMIT_FOLLOWING])) {
        *found |= 1u << FOLLOWING_ERROR;
        return 0.0;
    }
    int status = control(axis, sample, record);
    if (status > FMI_WARNING) {
        *found |= 1u << CONTROLLER_FAILED;
        return 0.0;
    }
    if (!isfinite(record->command)) {
        *found |= 1u << NOT_A_NUMBER;
        return 0.0;
    }
    return limited(axis, record);
}

static double torque_of(Axis *axis, Sample *sample, Record *record, uint32_t *found)
{
    if (axis->state == QUICK_STOP_ACTIVE) {
        axis->running = 0;
        return axis->torque - within(axis->torque, axis->stop_slew * axis->step);
    }
    bool on = cia402_state(sample->feedback.statusword) == OPERATION_ENABLED;
    if (axis->state == OPERATION_ENABLED && (axis->running || on)) {
        return operate(axis, sample, record, found);
    }
    return 0.0;
}

void axis_cycle(Axis *axis, Sample *sample, Record *record)
{
    change_limit(axis, sample);
    uint32_t found = check(axis, sample), wished = wish(axis, sample);
    int64_t before = axis->state;
    axis->state = cia402_next(before, wished, 0, found != 0, axis->torque == 0.0);
    record->notes = 0;
    record->command = 0.0;
    double torque = torque_of(axis, sample, record, &found);
    if (found && axis->state < FAULT_REACTION_ACTIVE) {
        axis->state = FAULT_REACTION_ACTIVE;
    }
    axis->wanted = found || axis->state == FAULT ? 0 : axis->wanted;
    bool left = before == FAULT && axis->state != FAULT;
    bool down = axis->state != OPERATION_ENABLED && axis->state != QUICK_STOP_ACTIVE;
    axis->faults = (left ? 0 : axis->faults) | found;
    axis->running = down ? 0 : axis->running;
    axis->torque = down ? 0.0 : torque;
    axis->controlword = order_word(axis, wished);
    axis->last_request = sample->request;
    record->sample = *sample;
    record->state = (uint32_t)axis->state;
    record->faults = (uint32_t)axis->faults;
    record->heads = axis->heads.reasons;
    record->controlword = axis->controlword;
    record->torque = axis->torque;
}

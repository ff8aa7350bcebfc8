/* A simulated drive in this process: a plant behind CiA 402 and an encoder of 32 bits, with faults on demand. It lives in
 * the loop's ticks: a write at tick k takes the plant there under the torque held since the write before. */
#include "drive.h"

#include <math.h>

const Injection *injected(const Drive *drive, int64_t kind)
{
    int64_t tick = drive->tick - drive->epoch;
    for (int64_t i = 0; i < drive->injections; i++) {
        const Injection *one = &drive->injection[i];
        if (one->kind == kind && tick >= one->first && tick < one->last) {
            return one;
        }
    }
    return NULL;
}

static void advance(Drive *drive)
{
    const Part *plant = &drive->plant;
    double before = plant->output[0];
    plant->input[drive->torque_input] = drive->held;
    int status = set_inputs(plant);
    if (status <= FMI_WARNING) {
        status = worse(status, do_step(plant, (double)drive->tick * drive->step, drive->step, true));
    }
    if (status <= FMI_WARNING) {
        status = worse(status, get_outputs(plant));
    }
    drive->failed = leave(plant, status) > FMI_WARNING;
    drive->tick++;
    if (fabs(plant->output[0] - before) > drive->speed * drive->step && drive->state > SWITCH_ON_DISABLED) {
        drive->overspeeds += drive->state != FAULT;
        drive_let_go(drive);
    }
}

void drive_let_go(Drive *drive)
{
    drive->held = 0.0;
    drive->state = drive->state > SWITCH_ON_DISABLED ? FAULT : drive->state;
}

/* Takes the plant to a tick. `ordered`: there an order has come; without one for as long as its watchdog it lets go. */
static void catch_up(Drive *drive, int64_t tick, bool ordered)
{
    while (drive->tick < tick && !drive->failed) {
        advance(drive);
        if (++drive->silent >= drive->watchdog && !(ordered && drive->tick == tick)) {
            drive_let_go(drive);
        }
    }
}

/* Takes the plant to a tick in which there is no order. */
void drive_coast(Drive *drive, int64_t tick)
{
    catch_up(drive, tick, false);
}

static double saturated(const Drive *drive, double torque)
{
    const Injection *fault = injected(drive, SATURATED);
    return fault && fabs(torque) > fault->size ? copysign(fault->size, torque) : torque;
}

static double within(double value, double limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

/* The torque of an order within the drive's own limits; towards zero it may change at once. `ticks`: since the order before. */
static double bounded(Drive *drive, double ordered, int64_t ticks)
{
    double torque = within(ordered, drive->torque);
    bool down = torque * drive->held >= 0.0 && fabs(torque) <= fabs(drive->held);
    double most = drive->slew * drive->step * (double)(ticks > 1 ? ticks : 1);
    if (!down && fabs(torque - drive->held) > most) {
        torque = drive->held + within(torque - drive->held, most);
    }
    drive->limited += torque != ordered;
    return torque;
}

static int drive_write(void *self, const Order *order)
{
    Drive *drive = self;
    int64_t tick = drive->epoch + order->tick, ticks = tick - drive->tick;
    catch_up(drive, tick, true);
    drive->silent = 0;
    if (injected(drive, DEAD)) {
        drive->state = NOT_READY;
        drive->held = 0.0;
        return 0;
    }
    if (injected(drive, TRIPPED) || !isfinite(order->torque)) {
        drive->state = FAULT;
    }
    drive->state = cia402_next(drive->state, order->controlword, drive->control, false, true);
    drive->control = order->controlword;
    drive->held = drive->state == OPERATION_ENABLED ? saturated(drive, bounded(drive, order->torque, ticks)) : 0.0;
    return 0;
}

/* What four heads around an eccentric, slightly oval disc read: e sin(q + k pi/2), a quarter of it twice a turn, an eighth
 * three times. */
static double misread(const Drive *drive, double q, int head)
{
    double at = q + head * 1.5707963267948966;
    return drive->eccentricity * (sin(at) + sin(2.0 * at) / 4.0 + sin(3.0 * at) / 8.0);
}

static void read_heads(Drive *drive, Feedback *feedback)
{
    const Injection *silent = injected(drive, SILENT_HEAD), *stray = injected(drive, STRAY_HEAD);
    const Injection *frozen = injected(drive, FROZEN_HEAD);
    double q = drive->plant.output[0];
    for (int k = 0; k < HEADS; k++) {
        double angle = q + misread(drive, q, k) + (stray && stray->head == k ? stray->size : 0.0);
        if (!(frozen && frozen->head == k)) {
            drive->shown[k] = (uint32_t)(int64_t)floor(angle / drive->quantum + 0.5);
        }
        feedback->head[k] = drive->shown[k];
    }
    feedback->heads = silent ? 15u & ~(1u << silent->head) : 15u;
}

static int drive_read(void *self, Feedback *feedback)
{
    Drive *drive = self;
    if (drive->failed) {
        return READ_ERROR;
    }
    if (injected(drive, LOST) || injected(drive, DEAD)) {
        return READ_STALE;
    }
    if (!injected(drive, STALE)) {
        const Injection *jump = injected(drive, JUMP);
        double counts = floor(drive->plant.output[0] / drive->quantum + 0.5);
        drive->counts = (uint32_t)(int64_t)(counts + (jump ? floor(jump->size / drive->quantum + 0.5) : 0.0));
        drive->encoder++;
    }
    if (drive->heads) {
        read_heads(drive, feedback);
    }
    feedback->counts = drive->counts;
    feedback->encoder = drive->encoder;
    feedback->statusword = cia402_statusword(drive->state);
    feedback->link = 0;
    feedback->torque = drive->held;
    return READ_OK;
}

static int drive_status(void *self)
{
    return (int)((Drive *)self)->failed;
}

/* Fills the adapter's table for a drive; reads where the plant is before its first step. */
EXPORT int64_t drive_open(Drive *drive, Adapter *adapter)
{
    *adapter = (Adapter){drive, drive_read, drive_write, drive_status};
    drive->failed = get_outputs(&drive->plant) > FMI_WARNING;
    return !drive->failed;
}

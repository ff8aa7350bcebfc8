/* The cycles of a session: against an absolute clock (period > 0) or as fast as possible (period 0), with the same
 * order of things in each. An edge that was missed is counted and skipped: cycles are never made up for in bursts. */
#define _GNU_SOURCE
#include "udp.h"

#include <pthread.h>
#include <sched.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#ifndef MCL_ONFAULT /* older headers; the system has it since Linux 4.4 */
#define MCL_ONFAULT 4
#endif

int64_t now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void sleep_until(int64_t edge, int64_t spin)
{
    int64_t wake = edge - spin;
    struct timespec t = {.tv_sec = wake / 1000000000, .tv_nsec = wake % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) != 0) {
    }
    while (now() < edge) {
    }
}

/* Waits for the next edge; returns how many edges have gone by unused. A machine that lives in this process has not moved
 * meanwhile: for it they are late, not lost. */
static uint32_t wait(Session *session)
{
    if (session->period == 0) {
        return (uint32_t)atomic_exchange(&session->lose, 0);
    }
    int64_t begun = now();
    int64_t missed = session->next > begun ? 0 : (begun - session->next) / session->period + 1;
    session->next += missed * session->period;
    sleep_until(session->next, session->spin);
    int64_t delay = now() - session->next;
    session->worst = delay > session->worst ? delay : session->worst;
    session->next += session->period;
    if (session->waits) {
        session->waited += missed;
        return 0;
    }
    return (uint32_t)(missed < UINT32_MAX ? missed : UINT32_MAX);
}

static uint32_t requests(Session *session)
{
    int64_t beat = atomic_load(&session->heartbeat);
    session->beaten = beat != session->beat ? session->tick : session->beaten;
    session->beat = beat;
    bool lost = session->tick - session->beaten > session->heartbeat_limit;
    return atomic_load(&session->request) | (lost ? NO_HEARTBEAT : 0);
}

static void gather(Session *session, Sample *sample)
{
    const Axis *axis = session->axis;
    int64_t place = axis->running ? session->tick - axis->entered : 0;
    place = place < session->setpoints ? place : session->setpoints - 1;
    for (int64_t i = 0; i < axis->controller.inputs; i++) {
        sample->input[i] = session->setpoint[i * session->setpoints + place];
    }
    sample->tick = session->tick;
    sample->request = requests(session);
    sample->change = atomic_load(&session->change);
    sample->value = atomic_load(&session->value);
    atomic_store(&session->change, 0);
}

static void cycle(Session *session, Sample *sample, uint32_t late)
{
    Axis *axis = session->axis;
    const Adapter *adapter = session->adapter;
    Record record;
    session->tick += late;
    session->late += late;
    Order order = {session->tick, axis->controlword, 0, axis->torque};
    int written = adapter->write(adapter->self, &order);
    gather(session, sample);
    sample->late = late;
    sample->read = (uint32_t)adapter->read(adapter->self, &sample->feedback);
    sample->status = (uint32_t)(written ? written : adapter->status(adapter->self));
    memset(&record, 0, sizeof record);
    axis_cycle(axis, sample, &record);
    box_write(session->box, &record);
    session->tick++;
}

bool be_urgent(void)
{
    struct sched_param high = {.sched_priority = 80};
    return pthread_setschedparam(pthread_self(), SCHED_FIFO, &high) == 0;
}

/* Asks the system for what real time needs; a session runs without where it says no. Locked is what is in use, now
   and later: what is only reserved, gigabytes of a process of Python, would be made resident and stay so. */
static void prepare(Session *session)
{
    session->fifo = be_urgent();
    session->locked = mlockall(MCL_CURRENT | MCL_ONFAULT) == 0;
    session->next = now() + session->period;
}

static void unlock(const Session *session)
{
    if (session->locked) {
        munlockall();
    }
}

EXPORT int64_t hardware_layout(void)
{
    return (int64_t)(sizeof(Axis) + 3 * sizeof(Sample) + 5 * sizeof(Record) + 7 * sizeof(Session) + 11 * sizeof(Adapter) +
                     13 * sizeof(Drive) + 17 * sizeof(Udp) + 19 * sizeof(Virtual) + 23 * sizeof(Order));
}

/* Keeps the controller's state from before its first tick. */
EXPORT int64_t hardware_ready(Axis *axis)
{
    return axis->controller.save(axis->controller.instance, &axis->initial) <= FMI_WARNING;
}

/* Runs cycles until there were `cycles` of them or `stop` is set; returns how many. `sample` is kept between calls. */
EXPORT int64_t hardware_run(Session *session, Sample *sample, int64_t cycles)
{
    int64_t done = 0;
    if (session->period > 0 && session->next == 0) {
        prepare(session);
    }
    for (; done < cycles && !atomic_load(&session->stop); done++) {
        cycle(session, sample, wait(session));
    }
    return done;
}

/* The clock of a session and nothing else, for `cycles` edges: what a loop on this computer can hope for. */
EXPORT void hardware_bare(Session *session, int64_t cycles)
{
    prepare(session);
    for (session->tick = 0; session->tick < cycles; session->tick++) {
        uint32_t late = wait(session);
        session->late += late;
        session->tick += late;
    }
    unlock(session);
}

/* The last order of a session: no voltage, no torque, whatever the axis was in. */
EXPORT void hardware_release(Session *session)
{
    Order order = {session->tick, DISABLE_VOLTAGE, 0, 0.0};
    session->adapter->write(session->adapter->self, &order);
    unlock(session);
}

/* Takes recorded samples through an axis: what the black box kept of a session becomes what it would keep again. */
EXPORT void hardware_replay(Axis *axis, Record *records, int64_t count)
{
    for (int64_t i = 0; i < count; i++) {
        Sample sample = records[i].sample;
        axis_cycle(axis, &sample, &records[i]);
    }
}

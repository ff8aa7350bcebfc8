/* The loop in a process of its own, made by a fork: it shares session, axis and black box with the supervisor, lives on
 * when that is killed (its heartbeat is then lost, which is a fault), and leaves when there is no torque any more. */
#define _GNU_SOURCE
#include "hardware.h"

#include <signal.h>
#include <unistd.h>

enum { GLANCE = 100 }; /* cycles between two looks for the supervisor */

int64_t hardware_run(Session *session, Sample *sample, int64_t cycles);
void hardware_release(Session *session);

static bool abandoned(const Session *session, pid_t parent)
{
    int64_t state = session->axis->state;
    return getppid() != parent && state != OPERATION_ENABLED && state != QUICK_STOP_ACTIVE;
}

/* Returns the process's number, or -1. Ending it is the supervisor's: signals of the terminal are not for the loop. */
EXPORT int64_t hardware_spawn(Session *session, Sample *sample)
{
    pid_t parent = getpid(), child = fork();
    if (child != 0) {
        return child;
    }
    static const int ignored[] = {SIGINT, SIGTERM, SIGHUP, SIGPIPE};
    for (size_t i = 0; i < sizeof ignored / sizeof *ignored; i++) {
        signal(ignored[i], SIG_IGN);
    }
    while (!atomic_load(&session->stop) && !abandoned(session, parent)) {
        hardware_run(session, sample, GLANCE);
    }
    hardware_release(session);
    _exit(0);
}

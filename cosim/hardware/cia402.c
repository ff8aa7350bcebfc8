/* The state machine of CiA 402, IEC 61800-7-201: one for the axis in the loop, one in the simulated drive. */
#include "hardware.h"

static const uint32_t STATUSWORD[] = {0x00, 0x40, 0x21, 0x23, 0x27, 0x07, 0x0F, 0x08};

uint32_t cia402_statusword(int64_t state)
{
    return STATUSWORD[state];
}

int64_t cia402_state(uint32_t statusword)
{
    for (int64_t state = READY_TO_SWITCH_ON; state <= QUICK_STOP_ACTIVE; state++) {
        if ((statusword & 0x6F) == STATUSWORD[state]) {
            return state;
        }
    }
    switch (statusword & 0x4F) {
    case 0x40: return SWITCH_ON_DISABLED;
    case 0x0F: return FAULT_REACTION_ACTIVE;
    case 0x08: return FAULT;
    default: return NOT_READY;
    }
}

static int64_t obey(int64_t state, uint32_t control, bool stopped)
{
    uint32_t low = control & 0x07;
    bool enable = (control & 0x0F) == ENABLE_OPERATION;
    switch (state) {
    case SWITCH_ON_DISABLED: return low == SHUTDOWN ? READY_TO_SWITCH_ON : state;
    case READY_TO_SWITCH_ON: return low == SWITCH_ON ? SWITCHED_ON : state;
    case SWITCHED_ON: return enable ? OPERATION_ENABLED : low == SHUTDOWN ? READY_TO_SWITCH_ON : state;
    case OPERATION_ENABLED: return enable ? state : low == SHUTDOWN ? READY_TO_SWITCH_ON : SWITCHED_ON;
    default: return stopped ? SWITCH_ON_DISABLED : state; /* quick stop */
    }
}

/* The state after a cycle. `before` is the last controlword: a reset is its rising edge and nothing else. */
int64_t cia402_next(int64_t state, uint32_t control, uint32_t before, bool fault, bool stopped)
{
    if (state == FAULT) {
        bool edge = (control & FAULT_RESET) && !(before & FAULT_RESET);
        return edge && !fault ? SWITCH_ON_DISABLED : FAULT;
    }
    if (state == FAULT_REACTION_ACTIVE) {
        return stopped ? FAULT : state;
    }
    if (fault) {
        return FAULT_REACTION_ACTIVE;
    }
    if (state == NOT_READY || !(control & 0x02)) { /* voltage is disabled */
        return SWITCH_ON_DISABLED;
    }
    if (!(control & 0x04)) { /* quick stop */
        return state == OPERATION_ENABLED ? QUICK_STOP_ACTIVE : obey(QUICK_STOP_ACTIVE, 0, stopped);
    }
    return obey(state, control, stopped);
}

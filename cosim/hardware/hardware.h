/* The controller on the machine. A cycle k, at its edge t = k * step:
 *   1. the order computed in cycle k-1 is written (so a command acts one tick after its sample, as between FMUs);
 *   2. the feedback of the drive is read;
 *   3. `axis_cycle` checks it, moves the state machine, steps the controller, and computes the order of cycle k+1;
 *   4. everything that entered and left the cycle goes to the black box.
 * Step 3 is a function of a `Sample`: the clock, the adapter and the supervisor enter nowhere else, so a recording of
 * samples gives the same orders again, bit for bit. Nothing is allocated here. */
#ifndef HARDWARE_H
#define HARDWARE_H

#include <stdatomic.h>

#include "part.h"

enum { READ_OK, READ_STALE, READ_ERROR };
enum { INPUTS = 8, MISSES = 64, HEADS = 4 };

/* LINK: what a transport notices. UNANSWERED: no whole answer to the last order in time; the others name what came instead. */
enum { UNANSWERED = 1, LATE_FRAME = 2, DUPLICATE_FRAME = 4, REORDERED_FRAME = 8, CORRUPT_FRAME = 16, FOREIGN_FRAME = 32 };

/* States of CiA 402, in the order of the way up. */
enum { NOT_READY, SWITCH_ON_DISABLED, READY_TO_SWITCH_ON, SWITCHED_ON, OPERATION_ENABLED, QUICK_STOP_ACTIVE,
       FAULT_REACTION_ACTIVE, FAULT };

/* Controlword (0x6040) and what it asks for. */
enum { DISABLE_VOLTAGE = 0x00, SHUTDOWN = 0x06, SWITCH_ON = 0x07, ENABLE_OPERATION = 0x0F, STOP_QUICKLY = 0x02,
       FAULT_RESET = 0x80 };

/* Faults, by bit; docs/hardware.md numbers them from 1. */
enum { POWER_UP, ESTOP, FRAME_LOST, ENCODER_STALE, ENCODER_JUMP, OVERSPEED, FOLLOWING_ERROR, NOT_A_NUMBER,
       TORQUE_MISMATCH, DRIVE_FAULT, DRIVE_STATE, HEARTBEAT_LOST, DEADLINE, CONTROLLER_FAILED, ADAPTER_FAILED, ENCODER_HEADS };

/* Why a read head is left out; of head k in the bits from 4 k on. */
enum { HEAD_SILENT = 1, HEAD_FROZEN, HEAD_ASTRAY };

/* What the supervisor asks for. RESET and ENABLE act on their rising edge only. */
enum { ASK_ENABLE = 1, ASK_QUICK_STOP = 2, ASK_ESTOP = 4, ASK_RESET = 8, NO_HEARTBEAT = 16 };

/* Notes of a cycle. */
enum { ENTERED = 1, STEPPED = 2, LIMITED = 4, SLEWED = 8 };

/* Limits, each of which can be tightened in any cycle. */
enum { LIMIT_TORQUE, LIMIT_SLEW, LIMIT_SPEED, LIMIT_FOLLOWING, LIMIT_JUMP, LIMIT_MISMATCH, LIMITS };

typedef struct {
    uint32_t counts;     /* 0x6064, wraps modulo 2^32 */
    uint32_t encoder;    /* differs from the last one if the encoder has been sampled since */
    uint32_t statusword; /* 0x6041 */
    uint32_t link;       /* what the transport noticed since the read before, see LINK */
    double torque;       /* 0x6077, N m: what the drive says it gives */
    uint32_t head[HEADS]; /* of an encoder with read heads, all of them at one angle; `counts` is made from them */
    uint32_t heads;       /* bit k: head k has answered */
    uint32_t unused;
} Feedback;

typedef struct {
    int64_t tick;
    uint32_t controlword, reserved;
    double torque; /* 0x6071, N m */
} Order;

/* The adapter. `read` gives READ_OK, READ_STALE (nothing new) or READ_ERROR; `status` 0 while the adapter is well. */
typedef struct {
    void *self;
    int (*read)(void *self, Feedback *feedback);
    int (*write)(void *self, const Order *order);
    int (*status)(void *self);
} Adapter;

/* All that enters a cycle. */
typedef struct {
    int64_t tick;
    Feedback feedback;
    uint32_t read, status, late, request;
    uint32_t change; /* limit that is to change, from 1; 0: none */
    uint32_t reserved;
    double value;
    double input[INPUTS]; /* set points in the places of the controller's inputs; that of the encoder is overwritten */
} Sample;

/* One record of the black box: `sequence` is cleared first and written last, the CRC covers what lies between. */
typedef struct {
    _Atomic uint64_t sequence; /* number of the record from 1; 0: torn */
    Sample sample;
    uint32_t state, faults, notes, controlword;
    double command, torque; /* of the controller; ordered, to be written in the next cycle */
    uint32_t heads, unused; /* why read heads are left out */
    uint32_t crc, reserved;
} Record;

/* The read heads of an encoder, see heads.c. `apart`: counts that a well one may be from the middle of all, `jump`:
 * and may move from one cycle to the next beside it. */
typedef struct {
    int64_t used, apart, jump;
    /* what is remembered */
    int64_t known, shift; /* `shift`: quarters of a count, so that nothing jumps when a head is left out */
    uint32_t counts, in, reasons, last[HEADS], unused;
} Heads;

typedef struct {
    Part controller;
    void *initial; /* the controller's state before its first tick */
    int64_t encoder_input, reference_input;
    double step, quantum, limit[LIMITS], stop_slew; /* rad a count; limits in SI; N m/s of a quick stop */
    int64_t ramp, patience, lost_limit, stale_limit, mismatch_limit, late_row_limit, late_limit, late_window;
    /* what is remembered */
    int64_t state, faults, wanted, running, known, lost, stale, mismatched, waiting, late_row;
    int64_t position, rate, fresh, ran, entered, misses; /* counts, counts a tick, ticks */
    uint32_t last_counts, last_encoder, last_request, controlword;
    double torque; /* ordered last; it acts since the edge of this cycle */
    int64_t miss[MISSES];
    int64_t refused; /* limits that were not loosened */
    Heads heads;
} Axis;

typedef struct {
    Record *record;
    int64_t capacity, written;
} BlackBox;

typedef struct {
    Axis *axis;
    const Adapter *adapter;
    BlackBox *box;
    const double *setpoint; /* one column of `setpoints` values for each input of the controller, from its first tick */
    int64_t setpoints, tick, period, spin, heartbeat_limit; /* ns; ticks */
    int64_t next, late, worst, beat, beaten;                /* ns of the next edge; cycles; ns; of the heartbeat */
    int64_t locked, fifo;                                   /* what the system allowed */
    int64_t waits, waited; /* whether the machine stands still while no cycle runs; edges at which it did */
    _Atomic int64_t heartbeat, stop, lose; /* `lose`: edges to miss where there is no clock that could */
    _Atomic uint32_t request, change; /* `change` is taken back to 0 when a cycle has taken it */
    _Atomic double value;
} Session;

/* cia402.c */
int64_t cia402_next(int64_t state, uint32_t control, uint32_t before, bool fault, bool stopped);
uint32_t cia402_statusword(int64_t state);
int64_t cia402_state(uint32_t statusword);

/* checks.c */
uint32_t check(Axis *axis, Sample *sample);

/* heads.c */
bool heads_combine(Heads *heads, Feedback *feedback);

/* axis.c */
void axis_cycle(Axis *axis, Sample *sample, Record *record);

/* blackbox.c */
void box_write(BlackBox *box, const Record *record);
uint32_t crc32_of(const void *bytes, size_t size);

/* realtime.c */
int64_t now(void);    /* ns of the monotonic clock */
bool be_urgent(void); /* asks for a real-time priority */

#endif

/* Process data over UDP: one order, one answer, each a frame of fixed size. The loop numbers its orders; an answer bears the
 * number of its order, so each side knows a frame as new, late, doubled or out of order without a clock in common.
 * Numbers are little-endian and laid out as here, which holds on every platform this is built for. */
#ifndef UDP_H
#define UDP_H

#include "drive.h"

enum { MAGIC = 0x3143534D, SEEN = 64, DELAYED = 64 };

/* HELLO asks for a session, WELCOME grants it, BUSY does not: another one is alive. Then ORDER and ANSWER. */
enum { HELLO = 1, WELCOME, BUSY, ORDER, ANSWER };

typedef struct {
    uint32_t magic, kind, session, sequence;
    int64_t tick;             /* of the loop; in HELLO and WELCOME: ns of a cycle, 0 where there is no clock */
    uint32_t word;            /* controlword, statusword */
    uint32_t counts, encoder; /* of an answer, as in Feedback */
    uint32_t age;             /* us from the sample of the encoder to the sending, by the drive's clock; too old is late */
    double value;             /* N m, ordered or given; in HELLO and WELCOME: s of a cycle */
    uint32_t reserved, crc;   /* CRC-32 of IEEE 802.3 of all before it */
} Frame;

/* What came, by kind; see `frame_seen`. `sent` and `good` make a pair: the difference has been lost or spoilt. */
typedef struct {
    int64_t sent, good, lost, late, duplicated, reordered, corrupted, foreign, worst; /* `worst`: ns of a round trip */
    uint32_t newest, reserved; /* sequence number */
    uint64_t seen;             /* bit n: that of newest - n has come */
} Link;

/* The adapter of the loop. A read waits for the answer to the order before it, at most `patience` ns, the first `spin` awake. */
typedef struct {
    int64_t socket, patience, spin, sent_at, failed;
    uint32_t session, sequence;
    Link link;
} Udp;

typedef struct {
    Frame frame;
    int64_t due, sampled; /* tick of the drive; ns */
} Delayed;

/* A drive at the other end, in a process of its own. `period` 0: lockstep, its time is that of the orders. */
typedef struct {
    Drive *drive;
    int64_t socket, period, watchdog; /* ns */
    uint32_t address, port;           /* of the loop that it listens to, in network order; 0: none */
    uint32_t session, waiting;        /* `waiting`: frames delayed on purpose */
    int64_t begun, heard, trips;      /* ns; how often its watchdog took a torque away */
    int64_t let_go, silence;          /* the last time it did: ns of the clock, ns since the last order */
    double taken;                     /* N m */
    _Atomic int64_t stop;
    Link link;
    Delayed delayed[DELAYED];
} Virtual;

/* udp.c */
void frame_close(Frame *frame);
bool frame_whole(const Frame *frame, int64_t size);
uint32_t frame_seen(Link *link, const Frame *frame);

#endif

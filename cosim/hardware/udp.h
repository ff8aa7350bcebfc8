/* Process data over UDP: one order, one answer, each a frame of fixed size. The loop numbers its orders; an answer bears the
 * number of its order, so each side knows a frame as new, late, doubled or out of order without a clock in common.
 * Each frame bears a tag: HMAC-SHA256, cut to 16 bytes, of all before it. Those of a greeting are made with the key that
 * both ends were given (empty where none was), WELCOME and all after it with that of the session: the HMAC of both nonces.
 * So nobody else can order, answer or end a session, nor replay another's frames; who listens without the key learns all
 * there is to see, and where there is no key, all there is to forge. Numbers are little-endian and laid out as here, which
 * holds on every platform this is built for. */
#ifndef UDP_H
#define UDP_H

#include "drive.h"
#include "mac.h"

enum { MAGIC = 0x3243534D, SEEN = 64, DELAYED = 64, NONCE = 16, TAG = 16, KEY = 32 };

/* HELLO asks for a session, WELCOME grants it, BUSY does not: another one is alive; nor does DENIED: the key is another.
 * Then ORDER and ANSWER, and BYE from a loop that ends. */
enum { HELLO = 1, WELCOME, BUSY, ORDER, ANSWER, BYE, DENIED };

typedef struct {
    uint32_t magic, kind, session, sequence;
    int64_t tick;             /* of the loop; in HELLO and WELCOME: ns of a cycle, 0 where there is no clock */
    uint32_t word;            /* controlword, statusword */
    uint32_t counts, encoder; /* of an answer, as in Feedback */
    uint32_t age;             /* us from the sample of the encoder to the sending, by the drive's clock; too old is late */
    double value;             /* N m, ordered or given; in HELLO and WELCOME: s of a cycle */
    unsigned char nonce[NONCE]; /* in HELLO that of the loop, in WELCOME that of the drive */
    unsigned char tag[TAG];
    uint32_t reserved, crc; /* CRC-32 of IEEE 802.3 of all before it: what is spoilt is told from what is forged */
} Frame;

/* What came, by kind; see `frame_seen`. `sent` and `good` make a pair: the difference has been lost or spoilt. */
typedef struct {
    int64_t sent, good, lost, late, duplicated, reordered, corrupted, foreign, early;
    int64_t worst; /* ns of a round trip */
    uint32_t newest, reserved; /* sequence number */
    uint64_t seen;             /* bit n: that of newest - n has come */
} Link;

/* The adapter of the loop. A read waits for the answer to the order before it, at most `patience` ns, the first `spin` awake. */
typedef struct {
    int64_t socket, patience, spin, sent_at, failed;
    uint32_t session, sequence;
    Link link;
    Mac mac; /* of the session */
} Udp;

typedef struct {
    Frame frame;
    int64_t due, sampled; /* tick of the drive; ns */
} Delayed;

/* A drive at the other end, in a process of its own. `period` 0: lockstep, its time is that of the orders. */
typedef struct {
    Drive *drive;
    int64_t socket, period, watchdog; /* ns */
    int64_t lease, ahead;             /* ns that a session without orders stays alive; ticks that an order may be ahead */
    uint32_t address, port;           /* of the loop that it listens to, in network order; 0: none */
    uint32_t session, waiting;        /* `waiting`: frames delayed on purpose */
    int64_t begun, heard, alive, trips; /* ns: of the clock, the last order, the last sign of life; torques taken away */
    int64_t let_go, silence;          /* the last time it did: ns of the clock, ns since the last order */
    double taken;                     /* N m */
    _Atomic int64_t stop;
    Link link;
    int64_t greetings;         /* how many have been granted, for nonces that never come again */
    unsigned char secret[KEY]; /* random; nonces are made from it */
    unsigned char hello[NONCE], welcome[NONCE];
    Mac given, mac; /* of the key that both ends were given; of the session */
    Delayed delayed[DELAYED];
} Virtual;

/* udp.c */
void frame_close(Frame *frame, const Mac *mac);
bool frame_whole(const Frame *frame, int64_t size);
bool frame_true(const Frame *frame, const Mac *mac);
void session_key(Mac *session, const Mac *given, const unsigned char *hello, const unsigned char *welcome);
uint32_t frame_seen(Link *link, const Frame *frame);

#endif

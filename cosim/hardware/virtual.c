/* A virtual drive: the simulated drive at the other end of a network, in a process of its own. Each order takes its plant to
 * the order's tick and is answered at once. In real time its own clock goes on where orders stop: after `watchdog` without one
 * it lets go, and its plant coasts. In lockstep there is no clock, and its watchdog counts the ticks of the orders. */
#define _GNU_SOURCE
#include "udp.h"

#include <netinet/in.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

enum { IDLE = 1000000 };                 /* ns between two looks at the clock while nobody orders */
enum { AT_ONCE = 64, COAST = 1000 };     /* frames, and ticks without orders, between two looks at `stop` */
static const int64_t LAST = 1LL << 53;   /* tick that an order may name: beyond it nothing is counted exactly */

static int64_t due(const Virtual *virtual)
{
    return virtual->period > 0 ? (now() - virtual->begun) / virtual->period : virtual->drive->tick;
}

/* Whether nobody has a session, or its loop has not been heard for long. */
static bool is_free(const Virtual *virtual)
{
    return virtual->session == 0 || now() - virtual->alive >= virtual->lease;
}

static bool silent(const Virtual *virtual)
{
    return virtual->period > 0 && now() - virtual->heard >= virtual->watchdog;
}

static void send_frame(Virtual *virtual, Frame *frame, const struct sockaddr_in *to, const Mac *mac)
{
    frame_close(frame, mac);
    (void)sendto((int)virtual->socket, frame, sizeof *frame, MSG_DONTWAIT | MSG_NOSIGNAL, (const struct sockaddr *)to,
                 sizeof *to);
}

/* A nonce that nobody foresees and that does not come again. */
static void draw(Virtual *virtual, unsigned char nonce[NONCE])
{
    Mac secret;
    unsigned char drawn[MAC_SIZE];
    virtual->greetings++;
    mac_key(&secret, virtual->secret, KEY);
    mac_of(&secret, &virtual->greetings, sizeof virtual->greetings, drawn);
    memcpy(nonce, drawn, NONCE);
}

static void begin(Virtual *virtual, const Frame *hello, const struct sockaddr_in *from)
{
    drive_let_go(virtual->drive);
    virtual->session = hello->session;
    virtual->address = from->sin_addr.s_addr;
    virtual->port = from->sin_port;
    virtual->waiting = 0;
    virtual->link = (Link){0};
    virtual->alive = now();
    memcpy(virtual->hello, hello->nonce, NONCE);
    draw(virtual, virtual->welcome);
    session_key(&virtual->mac, &virtual->given, virtual->hello, virtual->welcome);
}

/* Grants a session to whoever has the key and asks while nobody else is alive. */
static void greet(Virtual *virtual, const Frame *hello, const struct sockaddr_in *from)
{
    Frame reply = {.kind = WELCOME, .session = hello->session, .sequence = hello->sequence, .tick = virtual->period,
                   .value = virtual->drive->step};
    bool same = hello->session == virtual->session && from->sin_port == (in_port_t)virtual->port &&
                from->sin_addr.s_addr == virtual->address && mac_same(hello->nonce, virtual->hello, NONCE);
    if (!frame_true(hello, &virtual->given)) {
        reply.kind = DENIED;
        send_frame(virtual, &reply, from, NULL);
    } else if (same || (hello->session != 0 && is_free(virtual))) {
        if (!same) {
            begin(virtual, hello, from);
        }
        memcpy(reply.nonce, virtual->welcome, NONCE);
        send_frame(virtual, &reply, from, &virtual->mac);
    } else {
        reply.kind = BUSY;
        send_frame(virtual, &reply, from, &virtual->given);
    }
}

/* Sends a frame, with what is injected into it. */
static void answer(Virtual *virtual, Frame *frame, int64_t sampled)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = (in_port_t)virtual->port};
    to.sin_addr.s_addr = virtual->address;
    frame->age = (uint32_t)((now() - sampled) / 1000);
    send_frame(virtual, frame, &to, &virtual->mac);
    virtual->link.good++;
    if (injected(virtual->drive, DUPLICATED)) {
        send_frame(virtual, frame, &to, &virtual->mac);
    }
}

static void spoil(const Virtual *virtual, Frame *frame)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = (in_port_t)virtual->port};
    to.sin_addr.s_addr = virtual->address;
    frame_close(frame, &virtual->mac);
    uint32_t bit = frame->sequence * 37 % (8 * sizeof *frame);
    ((unsigned char *)frame)[bit / 8] ^= (unsigned char)(1u << bit % 8);
    (void)sendto((int)virtual->socket, frame, sizeof *frame, MSG_DONTWAIT | MSG_NOSIGNAL, (struct sockaddr *)&to, sizeof to);
}

/* Sends the frames whose time has come. */
static void flush(Virtual *virtual)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < virtual->waiting; i++) {
        Delayed *one = &virtual->delayed[i];
        if (one->due <= virtual->drive->tick) {
            answer(virtual, &one->frame, one->sampled);
        } else {
            virtual->delayed[kept++] = *one;
        }
    }
    virtual->waiting = kept;
}

/* Ticks by which an answer is held back: those injected; every other one by a tick is out of order. */
static int64_t delay(const Virtual *virtual)
{
    const Injection *late = injected(virtual->drive, LATE);
    if (late) {
        return late->size < 1.0 ? 1 : (int64_t)late->size;
    }
    return injected(virtual->drive, REORDERED) ? virtual->drive->tick & 1 : 0;
}

static void reply(Virtual *virtual, Frame *frame, int64_t sampled)
{
    int64_t ticks = delay(virtual);
    if (injected(virtual->drive, CORRUPTED)) {
        spoil(virtual, frame);
    } else if (ticks > 0 && virtual->waiting < DELAYED) {
        virtual->delayed[virtual->waiting++] = (Delayed){*frame, virtual->drive->tick + ticks, sampled};
    } else {
        answer(virtual, frame, sampled);
    }
    flush(virtual);
}

/* Whether an order is of now: not older than the watchdog, and not so far ahead that the plant would run to it for long. */
static bool timely(Virtual *virtual, const Frame *frame)
{
    const Drive *drive = virtual->drive;
    int64_t here = virtual->period > 0 ? due(virtual) : drive->tick;
    int64_t ahead = drive->epoch + frame->tick - here;
    bool late = virtual->period > 0 && -ahead > drive->watchdog, early = ahead > virtual->ahead;
    virtual->link.late += late;
    virtual->link.early += early;
    return !late && !early;
}

/* Obeys an order that is newer than all before it and of now; anything else is noted and dropped. */
static void obey_frame(Virtual *virtual, const Adapter *adapter, const Frame *frame)
{
    uint32_t before = virtual->link.newest;
    if (frame->tick < 0 || frame->tick > LAST) {
        virtual->link.foreign++;
        return;
    }
    if (frame_seen(&virtual->link, frame)) {
        return;
    }
    virtual->link.lost += (int64_t)(frame->sequence - before) - 1;
    Drive *drive = virtual->drive;
    if (before == 0) { /* the first order of a session: its tick is now */
        drive->epoch = due(virtual) - frame->tick;
    }
    if (!timely(virtual, frame)) {
        return;
    }
    virtual->heard = virtual->alive = now();
    Order order = {frame->tick, frame->word, 0, frame->value};
    Feedback feedback = {0};
    adapter->write(drive, &order);
    int64_t sampled = now();
    int found = adapter->read(drive, &feedback);
    Frame made = {.kind = ANSWER, .session = frame->session, .sequence = frame->sequence, .tick = frame->tick,
                  .word = found == READ_ERROR ? cia402_statusword(FAULT) : feedback.statusword,
                  .counts = feedback.counts, .encoder = feedback.encoder, .value = feedback.torque};
    if (found != READ_STALE) {
        reply(virtual, &made, sampled);
    }
}

/* Ends a session: the torque goes, and the drive is free. */
static void part_from(Virtual *virtual, const Frame *frame)
{
    if (frame_seen(&virtual->link, frame) == 0) {
        drive_let_go(virtual->drive);
        virtual->session = 0;
    }
}

/* Takes some of the frames that are there: whoever floods the socket does not keep the drive from its clock. */
static void receive(Virtual *virtual, const Adapter *adapter)
{
    Frame frame;
    struct sockaddr_in from = {0};
    socklen_t length = sizeof from;
    ssize_t size;
    for (int i = 0; i < AT_ONCE; i++) {
        size = recvfrom((int)virtual->socket, &frame, sizeof frame, MSG_DONTWAIT | MSG_TRUNC, (struct sockaddr *)&from,
                        &length);
        if (size < 0) {
            return;
        }
        bool whole = frame_whole(&frame, size);
        bool ours = whole && frame.session == virtual->session && virtual->session != 0 &&
                    from.sin_port == (in_port_t)virtual->port && from.sin_addr.s_addr == virtual->address &&
                    (frame.kind == ORDER || frame.kind == BYE) && frame_true(&frame, &virtual->mac);
        virtual->link.corrupted += !whole;
        if (whole && frame.kind == HELLO) {
            greet(virtual, &frame, &from);
        } else if (ours && frame.kind == ORDER) {
            obey_frame(virtual, adapter, &frame);
        } else if (ours) {
            part_from(virtual, &frame);
        } else {
            virtual->link.foreign += whole;
        }
    }
}

/* What the drive does by its own clock: nothing while it is ordered. */
static void tick_alone(Virtual *virtual)
{
    Drive *drive = virtual->drive;
    if (!silent(virtual)) {
        return;
    }
    double held = drive->held;
    int64_t tick = due(virtual), most = drive->tick + COAST;
    drive_coast(drive, tick < most ? tick : most);
    drive_let_go(drive);
    if (held != 0.0) {
        virtual->taken = held;
        virtual->let_go = now();
        virtual->silence = virtual->let_go - virtual->heard;
        virtual->trips++;
    }
}

/* Serves until `stop` is set; `key` is the one that both ends were given. */
EXPORT void virtual_run(Virtual *virtual, const Adapter *adapter, const void *key)
{
    mac_key(&virtual->given, key, KEY);
    struct pollfd ready = {.fd = (int)virtual->socket, .events = POLLIN};
    if (virtual->period > 0) {
        (void)be_urgent();
    }
    virtual->begun = now() - virtual->drive->tick * virtual->period;
    virtual->heard = now() - virtual->watchdog;
    while (!atomic_load(&virtual->stop)) {
        int64_t left = virtual->heard + virtual->watchdog - now();
        struct timespec time = {.tv_sec = 0, .tv_nsec = virtual->period > 0 && left > 0 && left < IDLE ? left : IDLE};
        if (ppoll(&ready, 1, &time, NULL) > 0) {
            receive(virtual, adapter);
        }
        tick_alone(virtual);
    }
    drive_let_go(virtual->drive);
}

/* The loop's end of the process data: an adapter that sends an order, waits for its answer, and counts what else comes. */
#define _GNU_SOURCE
#include "udp.h"

#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

enum { COVERED = offsetof(Frame, crc), TAGGED = offsetof(Frame, tag), AT_ONCE = 64 };

static void tag_of(const Frame *frame, const Mac *mac, unsigned char tag[MAC_SIZE])
{
    mac_of(mac, frame, TAGGED, tag);
}

/* Makes a frame ready to be sent; without a key it bears no tag. */
void frame_close(Frame *frame, const Mac *mac)
{
    unsigned char tag[MAC_SIZE] = {0};
    frame->magic = MAGIC;
    frame->reserved = 0;
    if (mac) {
        tag_of(frame, mac, tag);
    }
    memcpy(frame->tag, tag, TAG);
    frame->crc = crc32_of(frame, COVERED);
}

bool frame_whole(const Frame *frame, int64_t size)
{
    return size == (int64_t)sizeof *frame && frame->magic == MAGIC && frame->crc == crc32_of(frame, COVERED);
}

/* Whether a whole frame comes from who holds the key. */
bool frame_true(const Frame *frame, const Mac *mac)
{
    unsigned char tag[MAC_SIZE];
    tag_of(frame, mac, tag);
    return mac_same(frame->tag, tag, TAG);
}

void session_key(Mac *session, const Mac *given, const unsigned char *hello, const unsigned char *welcome)
{
    unsigned char nonces[2 * NONCE], key[MAC_SIZE];
    memcpy(nonces, hello, NONCE);
    memcpy(nonces + NONCE, welcome, NONCE);
    mac_of(given, nonces, sizeof nonces, key);
    mac_key(session, key, sizeof key);
}

/* Notes a frame by its sequence number: 0 if it is newer than all before it, else how it comes. */
uint32_t frame_seen(Link *link, const Frame *frame)
{
    int32_t ahead = (int32_t)(frame->sequence - link->newest);
    if (ahead > 0) {
        link->seen = (ahead < SEEN ? link->seen << ahead : 0) | 1;
        link->newest = frame->sequence;
        return 0;
    }
    uint64_t bit = -ahead < SEEN ? (uint64_t)1 << -ahead : 0;
    if (bit == 0 || (link->seen & bit)) {
        link->duplicated++;
        return DUPLICATE_FRAME;
    }
    link->seen |= bit;
    link->reordered++;
    return REORDERED_FRAME;
}

static int udp_write(void *self, const Order *order)
{
    Udp *udp = self;
    Frame frame = {.kind = ORDER, .session = udp->session, .sequence = ++udp->sequence, .tick = order->tick,
                   .word = order->controlword, .value = order->torque};
    frame_close(&frame, &udp->mac);
    udp->sent_at = now();
    udp->link.sent++;
    /* A refusal (nobody listens any more) is as good as a lost frame: the read will find no answer. */
    (void)send((int)udp->socket, &frame, sizeof frame, MSG_DONTWAIT | MSG_NOSIGNAL);
    return 0;
}

/* Whether an answer is that to the order just written; `feedback` is filled only then. */
static bool accept_answer(Udp *udp, const Frame *frame, Feedback *feedback)
{
    Link *link = &udp->link;
    if (frame->kind != ANSWER || frame->session != udp->session || (int32_t)(frame->sequence - udp->sequence) > 0 ||
        !frame_true(frame, &udp->mac)) {
        link->foreign++;
        feedback->link |= FOREIGN_FRAME;
        return false;
    }
    uint32_t seen = frame_seen(link, frame);
    if (seen) {
        feedback->link |= seen;
        return false;
    }
    if (frame->sequence != udp->sequence || (int64_t)frame->age * 1000 > udp->patience) {
        link->late++;
        feedback->link |= LATE_FRAME;
        return false;
    }
    int64_t trip = now() - udp->sent_at;
    link->worst = trip > link->worst ? trip : link->worst;
    link->good++;
    feedback->counts = frame->counts;
    feedback->encoder = frame->encoder;
    feedback->statusword = frame->word;
    feedback->torque = frame->value;
    return true;
}

/* Takes frames that are there, up to the awaited one. */
static bool take(Udp *udp, Feedback *feedback)
{
    Frame frame;
    for (int i = 0; i < AT_ONCE; i++) { /* whoever floods the socket does not keep the loop from its clock */
        ssize_t size = recv((int)udp->socket, &frame, sizeof frame, MSG_DONTWAIT | MSG_TRUNC);
        if (size < 0) {
            return false;
        }
        if (!frame_whole(&frame, size)) {
            udp->link.corrupted++;
            feedback->link |= CORRUPT_FRAME;
        } else if (accept_answer(udp, &frame, feedback)) {
            return true;
        }
    }
    return false;
}

static int udp_read(void *self, Feedback *feedback)
{
    Udp *udp = self;
    feedback->link = 0;
    struct pollfd ready = {.fd = (int)udp->socket, .events = POLLIN};
    while (!take(udp, feedback)) {
        int64_t waited = now() - udp->sent_at, left = udp->patience - waited;
        if (waited < udp->spin) { /* sleeping and waking costs tens of microseconds */
            continue;
        }
        struct timespec time = {.tv_sec = left / 1000000000, .tv_nsec = left % 1000000000};
        if (left <= 0 || ppoll(&ready, 1, &time, NULL) <= 0 || (ready.revents & (POLLERR | POLLNVAL))) {
            feedback->link |= UNANSWERED;
            return READ_STALE;
        }
    }
    return READ_OK;
}

static int udp_status(void *self)
{
    return (int)((Udp *)self)->failed;
}

/* `key` is that of the session. */
EXPORT void udp_open(Udp *udp, Adapter *adapter, const void *key)
{
    mac_key(&udp->mac, key, KEY);
    *adapter = (Adapter){udp, udp_read, udp_write, udp_status};
}

/* Ends the session: the drive lets go and is free. */
EXPORT void udp_bye(Udp *udp)
{
    Frame frame = {.kind = BYE, .session = udp->session, .sequence = ++udp->sequence};
    frame_close(&frame, &udp->mac);
    (void)send((int)udp->socket, &frame, sizeof frame, MSG_DONTWAIT | MSG_NOSIGNAL);
}

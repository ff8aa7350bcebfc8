/* Four read heads around one encoder disc become one position.
 *
 * Head k reads the angle plus an error of the disc's once, twice, three times ... a turn, each a quarter turn after the
 * head before. The mean of all four is free of every harmonic but the fourth, eighth, ...; that of two opposite heads is
 * free of the odd ones. A head that fails is left out from then on, and the mean goes on without a step: with the pair
 * that is left, the one head more being a witness. Readings are differences modulo 2^32, so nothing wraps.
 */
#include "hardware.h"

enum { ALL = 15 };

/* Four times the mean of all heads, or of a pair. */
static int64_t fourfold(const int64_t *x, uint32_t set)
{
    int64_t sum = 0;
    for (int k = 0; k < HEADS; k++) {
        sum += set >> k & 1 ? x[k] : 0;
    }
    return set == ALL ? sum : 2 * sum;
}

/* The heads that are averaged: all, or the two beside the one that failed. */
static uint32_t averaged(uint32_t in)
{
    for (int k = 0; k < HEADS; k++) {
        if (!(in >> k & 1)) {
            return 1u << ((k + 1) & 3) | 1u << ((k + 3) & 3);
        }
    }
    return ALL;
}

static int count(uint32_t set)
{
    int found = 0;
    for (int k = 0; k < HEADS; k++) {
        found += set >> k & 1;
    }
    return found;
}

static int64_t median(const int64_t *x, uint32_t in)
{
    int64_t sorted[HEADS];
    int n = 0;
    for (int k = 0; k < HEADS; k++) {
        if (in >> k & 1) {
            int place = n++;
            for (; place > 0 && sorted[place - 1] > x[k]; place--) {
                sorted[place] = sorted[place - 1];
            }
            sorted[place] = x[k];
        }
    }
    return n == HEADS ? (sorted[1] + sorted[2]) / 2 : n > 0 ? sorted[n / 2] : 0;
}

static int64_t distance(int64_t a, int64_t b)
{
    return a > b ? a - b : b - a;
}

/* The head that is farthest from the middle of all, where that is farther than a well one can be; else -1. */
static int farthest(const int64_t *x, uint32_t in, int64_t most)
{
    int64_t middle = median(x, in);
    int found = -1;
    for (int k = 0; k < HEADS; k++) {
        if (in >> k & 1 && distance(x[k], middle) > most) {
            most = distance(x[k], middle);
            found = k;
        }
    }
    return found;
}

static void leave_out(Heads *heads, int head, uint32_t reason)
{
    heads->in &= ~(1u << head);
    heads->reasons |= reason << 4 * head;
}

/* Leaves out what does not answer, what moved since the cycle before as the others did not, and what has gone astray. */
static void judge(Heads *heads, const Feedback *feedback, const int64_t *x, const int64_t *before)
{
    int64_t way[HEADS];
    for (int k = 0; k < HEADS; k++) {
        way[k] = heads->known ? x[k] - before[k] : 0;
        if (heads->in >> k & 1 && !(feedback->heads >> k & 1)) {
            leave_out(heads, k, HEAD_SILENT);
        }
    }
    int head = farthest(way, heads->in, heads->jump);
    head = head < 0 ? farthest(x, heads->in, heads->apart) : head;
    if (head >= 0) {
        leave_out(heads, head, heads->known && way[head] == 0 ? HEAD_FROZEN : HEAD_ASTRAY);
    }
}

static void shown(const Heads *heads, const uint32_t *head, int64_t *x)
{
    for (int k = 0; k < HEADS; k++) {
        x[k] = (int32_t)(head[k] - heads->counts);
    }
}

/* Puts the position into feedback->counts. True: fewer than three heads are left, so the next failure could not be seen;
 * the position then stays what it was. */
EXPORT bool heads_combine(Heads *heads, Feedback *feedback)
{
    int64_t x[HEADS], before[HEADS];
    if (!heads->used) {
        return false;
    }
    if (!heads->known) {
        heads->in = ALL;
        heads->counts = feedback->head[feedback->heads & 1 ? 0 : 1];
    }
    shown(heads, feedback->head, x);
    shown(heads, heads->last, before);
    uint32_t old = averaged(heads->in);
    judge(heads, feedback, x, before);
    uint32_t set = averaged(heads->in);
    heads->shift += heads->known && set != old ? fourfold(before, old) - fourfold(before, set) : 0;
    bool lost = count(heads->in) < HEADS - 1;
    if (!lost) {
        heads->counts += (uint32_t)(int32_t)((fourfold(x, set) + heads->shift + 2) >> 2);
    }
    for (int k = 0; k < HEADS; k++) {
        heads->last[k] = feedback->head[k];
    }
    heads->known = 1;
    feedback->counts = heads->counts;
    return lost;
}

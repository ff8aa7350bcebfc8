/* Foreign code leaves the floating-point environment as it found it.
 *
 * The environment belongs to the thread: a rounding mode, a flush of subnormal numbers to zero or a trap that an FMU
 * leaves behind would change the last bits of all other components, and end the process where a trap is met. The control
 * registers are read behind the calls of an FMU before anything else is computed, and where they are not as IEEE 754 has
 * it (round to nearest, subnormal numbers kept, no traps) what was changed is noted and put right: by `after_all` when
 * a component has had all its calls of a tick, by `after` where we compute between two calls. */
#ifndef FOREIGN_H
#define FOREIGN_H

#include <stdbool.h>
#include <stdint.h>

/* What was changed; cosim/fmi/guard.py has the words for them. */
enum { ROUNDING = 1, FLUSHING = 2, TRAPS = 4, PRECISION = 8 };

#if defined(__x86_64__)

#include <xmmintrin.h>

enum { SSE_FLAGS = 0x3f, SSE_FLUSH = 0x8040, SSE_ROUND = 0x6000, SSE_MASKS = 0x1f80, SSE_STANDARD = 0x1f80 };
#ifdef _WIN32
enum { X87_STANDARD = 0x027f }; /* Windows gives x87 the precision of a double */
#else
enum { X87_STANDARD = 0x037f };
#endif
enum { X87_ROUND = 0x0c00, X87_PRECISION = 0x0300, X87_MASKS = 0x003f, X87_ALL = 0x0f3f };

typedef struct {
    uint32_t sse;
    uint16_t x87;
} Environment;

static inline Environment environment(void)
{
    Environment found = {.sse = _mm_getcsr() & ~(uint32_t)SSE_FLAGS};
    __asm__ __volatile__("fnstcw %0" : "=m"(found.x87));
    return found;
}

static inline void set_environment(Environment wanted)
{
    __asm__ __volatile__("fnclex\n\tfldcw %0" : : "m"(wanted.x87)); /* a trap that is due would be met by fldcw */
    _mm_setcsr(wanted.sse);
}

static inline Environment standard_environment(void)
{
    return (Environment){.sse = SSE_STANDARD, .x87 = X87_STANDARD};
}

/* Which of the settings differ from the standard, as a sum. */
static inline int64_t deviation(Environment found)
{
    uint32_t sse = found.sse ^ SSE_STANDARD, x87 = (uint32_t)(found.x87 ^ X87_STANDARD) & X87_ALL;
    if ((sse | x87) == 0) {
        return 0;
    }
    return ((sse & SSE_ROUND) || (x87 & X87_ROUND) ? ROUNDING : 0) | (sse & SSE_FLUSH ? FLUSHING : 0) |
           ((sse & SSE_MASKS) || (x87 & X87_MASKS) ? TRAPS : 0) | (x87 & X87_PRECISION ? PRECISION : 0);
}

/* Whether what this code computes with is other than the standard. */
static inline bool is_altered(void)
{
    return (_mm_getcsr() & ~(uint32_t)SSE_FLAGS) != SSE_STANDARD;
}

#elif defined(__aarch64__)

enum { FPCR_ROUND = 0x00c00000, FPCR_FLUSH = 0x01080003, FPCR_TRAPS = 0x9f00 };

typedef struct {
    uint64_t fpcr;
} Environment;

static inline Environment environment(void)
{
    Environment found;
    __asm__ __volatile__("mrs %0, fpcr" : "=r"(found.fpcr));
    return found;
}

static inline void set_environment(Environment wanted)
{
    __asm__ __volatile__("msr fpcr, %0" : : "r"(wanted.fpcr));
}

static inline Environment standard_environment(void)
{
    return (Environment){.fpcr = 0};
}

static inline int64_t deviation(Environment found)
{
    if (found.fpcr == 0) {
        return 0;
    }
    int64_t known = (found.fpcr & FPCR_ROUND ? ROUNDING : 0) | (found.fpcr & FPCR_FLUSH ? FLUSHING : 0) |
                    (found.fpcr & FPCR_TRAPS ? TRAPS : 0);
    return known ? known : PRECISION;
}

static inline bool is_altered(void) { return environment().fpcr != 0; }

#else /* a processor whose registers are not known here: nothing is looked at */

typedef struct {
    int unused;
} Environment;

static inline Environment environment(void) { return (Environment){0}; }
static inline void set_environment(Environment wanted) { (void)wanted; }
static inline Environment standard_environment(void) { return (Environment){0}; }
static inline int64_t deviation(Environment found) { return (void)found, 0; }
static inline bool is_altered(void) { return false; }

#endif

static inline void put_right(int64_t *altered, int64_t changed)
{
    set_environment(standard_environment());
    if (altered) {
        *altered |= changed;
    }
}

/* Stands behind a call of an FMU, whose status it returns; `altered` keeps what was changed (NULL: nobody asks). */
static inline int after(int64_t *altered, int status)
{
    if (__builtin_expect(is_altered(), 0)) {
        put_right(altered, deviation(environment()));
    }
    __asm__ __volatile__("" : : : "memory"); /* what the FMU wrote is read, and computed with, from here on */
    return status;
}

/* Stands behind all calls of a component in a tick: looks at x87 too, which takes three times as long as the rest, and
 * which nothing here computes with. */
static inline void after_all(int64_t *altered)
{
    int64_t changed = deviation(environment());
    if (__builtin_expect(changed != 0, 0)) {
        put_right(altered, changed);
    }
}

/* A loop computes in the standard environment whatever that of its caller is, who gets his own back. */
static inline Environment begin_standard(void)
{
    Environment before = environment();
    if (deviation(before)) {
        set_environment(standard_environment());
    }
    return before;
}

static inline void end_standard(Environment before) { set_environment(before); }

#endif

/* What a diagnosis computes most: rows of expressions, filters, recurrences, marginal likelihoods. */
#ifndef KERNELS_H
#define KERNELS_H

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* Whether the processor works on four numbers at once (AVX2): the same IEEE operations, so the same bits. */
int is_wide(void);

#define INLINE static inline __attribute__((always_inline)) /* into the version for each processor */

/* One operation; operands and targets as registers, below zero as shared numbers (~index). */
struct operation {
    int code, target, a, b;
};

/* Registers are the inputs, the work slots, the outputs, in this order. */
struct tape {
    const struct operation *shared, *rowwise;
    long long shared_count, rowwise_count, inputs, slots, outputs, registers;
};

#endif

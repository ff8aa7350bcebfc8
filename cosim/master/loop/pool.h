/* Texts and binaries by number, so that a bus of doubles can carry them: equal contents have equal numbers.
 * Number 0 is the empty content. `sweep` frees what no number that is still in use names. */
#ifndef POOL_H
#define POOL_H

#include <stddef.h>
#include <stdint.h>

typedef struct Pool Pool;

int64_t pool_put(Pool *pool, const void *content, size_t size); /* its number; -1: there is no room for it */
const void *pool_content(const Pool *pool, int64_t number, size_t *size);

#endif

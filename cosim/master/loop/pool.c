/* See pool.h. Numbers index `entry`; `bucket` is an open hash table over the contents, -1 where it is free. */
#include "pool.h"

#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#define MOST_BYTES ((size_t)1 << 30) /* alive at once: a run that needs more is a mistake */

typedef struct {
    uint64_t hash;
    size_t size;
    char *content; /* NULL: free; one byte longer than its size, and that byte is 0 */
    int used;
} Entry;

struct Pool {
    Entry *entry;
    int64_t *bucket;
    int64_t entries, buckets, alive, free; /* `free`: where a free entry may be looked for */
    size_t bytes;
};

/* FNV-1a, http://www.isthe.com/chongo/tech/comp/fnv/ */
static uint64_t hashed(const unsigned char *content, size_t size)
{
    uint64_t hash = 14695981039346656037u;
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ content[i]) * 1099511628211u;
    }
    return hash;
}

static int64_t place(const Pool *pool, uint64_t hash, const void *content, size_t size)
{
    int64_t at = (int64_t)(hash & (uint64_t)(pool->buckets - 1));
    while (pool->bucket[at] >= 0) {
        const Entry *entry = &pool->entry[pool->bucket[at]];
        if (entry->hash == hash && entry->size == size && memcmp(entry->content, content, size) == 0) {
            break;
        }
        at = (at + 1) & (pool->buckets - 1);
    }
    return at;
}

static void fill(Pool *pool)
{
    memset(pool->bucket, -1, (size_t)pool->buckets * sizeof(int64_t));
    for (int64_t i = 0; i < pool->entries; i++) {
        const Entry *entry = &pool->entry[i];
        if (entry->content) {
            pool->bucket[place(pool, entry->hash, entry->content, entry->size)] = i;
        }
    }
}

static int grow(Pool *pool)
{
    int64_t entries = pool->entries ? 2 * pool->entries : 64;
    Entry *entry = realloc(pool->entry, (size_t)entries * sizeof(Entry));
    int64_t *bucket = entry ? realloc(pool->bucket, (size_t)entries * 2 * sizeof(int64_t)) : NULL;
    pool->entry = entry ? entry : pool->entry;
    if (!bucket) {
        return 0;
    }
    memset(entry + pool->entries, 0, (size_t)(entries - pool->entries) * sizeof(Entry));
    pool->free = pool->entries;
    pool->entries = entries;
    pool->bucket = bucket;
    pool->buckets = 2 * entries;
    fill(pool);
    return 1;
}

int64_t pool_put(Pool *pool, const void *content, size_t size)
{
    uint64_t hash = hashed(content, size);
    int64_t at = place(pool, hash, content, size);
    if (pool->bucket[at] >= 0) {
        return pool->bucket[at];
    }
    char *copy = pool->bytes + size < MOST_BYTES ? malloc(size + 1) : NULL;
    if (!copy || (pool->alive == pool->entries && !grow(pool))) {
        free(copy);
        return -1;
    }
    while (pool->entry[pool->free].content) {
        pool->free = (pool->free + 1) % pool->entries;
    }
    if (size) {
        memcpy(copy, content, size);
    }
    copy[size] = 0;
    pool->entry[pool->free] = (Entry){hash, size, copy, 1};
    pool->bucket[place(pool, hash, copy, size)] = pool->free;
    pool->alive++;
    pool->bytes += size;
    return pool->free;
}

const void *pool_content(const Pool *pool, int64_t number, size_t *size)
{
    const Entry *entry = number >= 0 && number < pool->entries ? &pool->entry[number] : pool->entry;
    entry = entry->content ? entry : pool->entry;
    *size = entry->size;
    return entry->content;
}

EXPORT void pool_free(Pool *pool)
{
    for (int64_t i = 0; pool && i < pool->entries; i++) {
        free(pool->entry[i].content);
    }
    if (pool) {
        free(pool->entry);
        free(pool->bucket);
    }
    free(pool);
}

EXPORT Pool *pool_new(void)
{
    Pool *pool = calloc(1, sizeof(Pool));
    if (pool && grow(pool) && pool_put(pool, "", 0) == 0) {
        return pool;
    }
    pool_free(pool);
    return NULL;
}

EXPORT int64_t pool_number(Pool *pool, const void *content, int64_t size)
{
    return pool_put(pool, content, (size_t)size);
}

EXPORT const void *pool_read(const Pool *pool, int64_t number, int64_t *size)
{
    size_t found;
    const void *content = pool_content(pool, number, &found);
    *size = (int64_t)found;
    return content;
}

/* Frees all contents but the empty one and those of these numbers; returns how many are left. */
EXPORT int64_t pool_sweep(Pool *pool, const double *numbers, int64_t count)
{
    for (int64_t i = 1; i < pool->entries; i++) {
        pool->entry[i].used = 0;
    }
    for (int64_t i = 0; i < count; i++) {
        if (numbers[i] >= 0 && numbers[i] < (double)pool->entries) {
            pool->entry[(int64_t)numbers[i]].used = 1;
        }
    }
    for (int64_t i = 1; i < pool->entries; i++) {
        Entry *entry = &pool->entry[i];
        if (entry->content && !entry->used) {
            pool->bytes -= entry->size;
            pool->alive--;
            free(entry->content);
            *entry = (Entry){0};
        }
    }
    fill(pool);
    return pool->alive;
}

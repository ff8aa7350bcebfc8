/* HMAC-SHA256 (FIPS 180-4, RFC 2104): says that a frame comes from who holds the key, and as it was sent. */
#ifndef MAC_H
#define MAC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { MAC_SIZE = 32 };

/* The states of both hashes after the block of the key, so that a frame costs no more than its own blocks. */
typedef struct {
    uint32_t inner[8], outer[8];
} Mac;

void mac_key(Mac *mac, const void *key, size_t size);
void mac_of(const Mac *mac, const void *data, size_t size, unsigned char tag[MAC_SIZE]);
bool mac_same(const unsigned char *one, const unsigned char *other, size_t size);

#endif

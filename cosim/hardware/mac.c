/* HMAC-SHA256, see mac.h. Messages are short: all blocks of one are made at once. */
#include "mac.h"

#include <string.h>

#include "hardware.h"

enum { BLOCK = 64, LONGEST = 512 };

static const uint32_t START[8] = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                  0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
static const uint32_t ROUND[64] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

static uint32_t turned(uint32_t word, int by)
{
    return word >> by | word << (32 - by);
}

static void schedule(uint32_t w[64], const unsigned char *block)
{
    for (int i = 0; i < 16; i++) {
        const unsigned char *b = block + 4 * i;
        w[i] = (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
    }
    for (int i = 16; i < 64; i++) {
        uint32_t small = turned(w[i - 15], 7) ^ turned(w[i - 15], 18) ^ w[i - 15] >> 3;
        uint32_t large = turned(w[i - 2], 17) ^ turned(w[i - 2], 19) ^ w[i - 2] >> 10;
        w[i] = w[i - 16] + small + w[i - 7] + large;
    }
}

static void compress(uint32_t state[8], const unsigned char *block)
{
    uint32_t w[64], s[8];
    schedule(w, block);
    memcpy(s, state, sizeof s);
    for (int i = 0; i < 64; i++) {
        uint32_t large = turned(s[4], 6) ^ turned(s[4], 11) ^ turned(s[4], 25);
        uint32_t one = s[7] + large + ((s[4] & s[5]) ^ (~s[4] & s[6])) + ROUND[i] + w[i];
        uint32_t small = turned(s[0], 2) ^ turned(s[0], 13) ^ turned(s[0], 22);
        uint32_t two = small + ((s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]));
        memmove(s + 1, s, 7 * sizeof *s);
        s[4] += one;
        s[0] = one + two;
    }
    for (int i = 0; i < 8; i++) {
        state[i] += s[i];
    }
}

/* Hashes what follows `before` bytes, and writes the hash. */
static void finish(uint32_t state[8], size_t before, const void *data, size_t size, unsigned char *hash)
{
    unsigned char blocks[LONGEST] = {0};
    size_t padded = (size + 9 + BLOCK - 1) / BLOCK * BLOCK;
    memcpy(blocks, data, size);
    blocks[size] = 0x80;
    for (int i = 0; i < 8; i++) {
        blocks[padded - 1 - (size_t)i] = (unsigned char)((before + size) * 8 >> 8 * i);
    }
    for (size_t at = 0; at < padded; at += BLOCK) {
        compress(state, blocks + at);
    }
    for (int i = 0; i < MAC_SIZE; i++) {
        hash[i] = (unsigned char)(state[i / 4] >> (24 - 8 * (i % 4)));
    }
}

static void absorb(uint32_t state[8], const unsigned char *key, unsigned char pad)
{
    unsigned char block[BLOCK];
    for (int i = 0; i < BLOCK; i++) {
        block[i] = key[i] ^ pad;
    }
    memcpy(state, START, sizeof START);
    compress(state, block);
}

/* A key of at most BLOCK bytes; longer ones are cut (ours have 32). */
void mac_key(Mac *mac, const void *key, size_t size)
{
    unsigned char block[BLOCK] = {0};
    memcpy(block, key, size < BLOCK ? size : BLOCK);
    absorb(mac->inner, block, 0x36);
    absorb(mac->outer, block, 0x5c);
}

/* Of at most LONGEST - 9 bytes. */
void mac_of(const Mac *mac, const void *data, size_t size, unsigned char tag[MAC_SIZE])
{
    uint32_t state[8];
    unsigned char hash[MAC_SIZE];
    memcpy(state, mac->inner, sizeof state);
    finish(state, BLOCK, data, size, hash);
    memcpy(state, mac->outer, sizeof state);
    finish(state, BLOCK, hash, sizeof hash, tag);
}

/* Takes as long whatever differs. */
bool mac_same(const unsigned char *one, const unsigned char *other, size_t size)
{
    unsigned char differs = 0;
    for (size_t i = 0; i < size; i++) {
        differs |= one[i] ^ other[i];
    }
    return differs == 0;
}

/* For tests: the tag of a message, as anybody's HMAC-SHA256 gives it. */
EXPORT void hardware_mac(const void *key, int64_t key_size, const void *data, int64_t size, unsigned char *tag)
{
    Mac mac;
    mac_key(&mac, key, (size_t)key_size);
    mac_of(&mac, data, (size_t)size, tag);
}

/* The black box: a ring of records in mapped memory. The sequence number of a record is cleared first and written last,
 * and a CRC covers what lies between, so whoever reads the file knows each record as whole or torn. */
#include "hardware.h"

#include <string.h>

enum { FIRST = sizeof(uint64_t), BODY = offsetof(Record, crc) - FIRST };

/* CRC-32 of IEEE 802.3, four bits at a time: that of zlib. */
uint32_t crc32_of(const void *data, size_t size)
{
    const unsigned char *bytes = data;
    static const uint32_t table[16] = {0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4,
                                       0x4DB26158, 0x5005713C, 0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C,
                                       0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < size; i++) {
        crc = table[(crc ^ bytes[i]) & 15] ^ (crc >> 4);
        crc = table[(crc ^ (uint32_t)(bytes[i] >> 4)) & 15] ^ (crc >> 4);
    }
    return ~crc;
}

void box_write(BlackBox *box, const Record *record)
{
    Record *place = &box->record[box->written % box->capacity];
    atomic_store_explicit(&place->sequence, 0, memory_order_relaxed);
    atomic_thread_fence(memory_order_seq_cst);
    memcpy((char *)place + FIRST, (const char *)record + FIRST, BODY);
    place->crc = crc32_of((const char *)place + FIRST, BODY);
    place->reserved = 0;
    box->written++;
    atomic_store_explicit(&place->sequence, (uint64_t)box->written, memory_order_release);
}

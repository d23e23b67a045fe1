#!/usr/bin/env bash
# ISA-L 2.30 (x86-64): deflate at level 1 does not always give the same bytes for the same input. After the first byte the code
# hashes a register that holds the address of the stream's state instead of input, so that whether the bytes behind it are found
# again depends on where the state lies in memory. The stream is valid and unpacks to the input in each case. Level 0 gives the
# same bytes everywhere.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
[ "$(uname -m)" = x86_64 ] || { echo "only for x86-64"; exit 2; }
unpack libisal2=2.30.0-5 libisal-dev=2.30.0-5

cat >places.c <<'C'
#include <isa-l/igzip_lib.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>

#define SPAN ((size_t)1 << 32) /* of address space, hardly any of it memory */
enum { PLACES = 65536 };
static unsigned char in[4096], out[2][1 << 16], buffer[ISAL_DEF_LVL1_DEFAULT];

static unsigned pack(struct isal_zstream *s, int level, unsigned char *to)
{
    memset(buffer, 0, sizeof(buffer));
    memset(s, 0, sizeof(*s));
    isal_deflate_init(s);
    s->level = level;
    s->level_buf = buffer;
    s->level_buf_size = sizeof(buffer);
    s->end_of_stream = 1;
    s->next_in = in;
    s->avail_in = sizeof(in);
    s->next_out = to;
    s->avail_out = sizeof(out[0]);
    return isal_deflate(s) == COMP_OK ? s->total_out : 0;
}

int main(void)
{
    unsigned r = 1;
    unsigned char *m = mmap(NULL, SPAN + sizeof(struct isal_zstream), PROT_READ | PROT_WRITE,
                            MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);

    if (m == MAP_FAILED)
        return 2;
    for (size_t i = 0; i < sizeof(in); i++) { /* noise; each half line begins with the second to the 33rd byte */
        r = r * 1103515245u + 12345;
        in[i] = i >= 64 && i % 64 < 32 ? in[1 + i % 64] : (unsigned char)(r >> 24);
    }
    for (int level = 0; level < 2; level++) {
        unsigned other = 0, first = 0;

        for (int i = 0; i < PLACES; i++) {
            unsigned char *place = m + ((size_t)(r = r * 1103515245u + 12345) & ~(size_t)4095);
            unsigned n = pack((void *)place, level, out[i > 0]);

            if (i == 0)
                first = n;
            else
                other += n != first || memcmp(out[0], out[1], n) != 0;
            madvise(place, sizeof(struct isal_zstream), MADV_DONTNEED);
        }
        printf("level %d: %u of %d places of the state in memory give other bytes\n", level, other, PLACES);
    }
    return 0;
}
C
compile places -lisal
./places | tee seen
holds "level 1 depends on addresses, level 0 does not" awk '{ n[$2] = $3 } END { exit !(n["0:"] == 0 && n["1:"] > 0) }' seen
# Seen: "level 0: 0 of 65536 places of the state in memory give other bytes", "level 1: 11 of 65536 ..." (5 to 11 in three runs).

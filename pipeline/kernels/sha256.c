/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/kernels/sha256.h"

#include <stdio.h>
#include <string.h>

#include "pipeline/kernels/kernels.h"

#define BLOCK 64 /* bytes */

void sst_sha256_hex(char out[SST_SHA256_HEX], const void *data, size_t size)
{
    uint32_t state[8] = {
        0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a, 0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19
    };
    const size_t whole = size / BLOCK, rest = size % BLOCK, last = rest + 9 > BLOCK ? 2 : 1;
    uint8_t end[2 * BLOCK] = { 0 };
    const uint64_t bits = (uint64_t)size * 8;

    sst_kernels_get()->sha256_blocks(state, data, whole);
    if (rest)
        memcpy(end, (const uint8_t *)data + whole * BLOCK, rest);
    end[rest] = 0x80;
    for (int i = 0; i < 8; i++)
        end[last * BLOCK - 1 - (size_t)i] = (uint8_t)(bits >> (8 * i));
    sst_kernels_get()->sha256_blocks(state, end, last);
    for (int i = 0; i < 8; i++)
        snprintf(out + 8 * i, 9, "%08x", state[i]);
}

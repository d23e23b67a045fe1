/* pipeline/kernels/sha256.h - SHA-256 of bytes in memory (FIPS 180-4). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_KERNELS_SHA256_H
#define SST_PIPELINE_KERNELS_SHA256_H

#include "base/base.h"

#define SST_SHA256_HEX 65 /* digits and the final 0 */

/** The hash of size bytes, as digits 0-9 a-f. */
void sst_sha256_hex(char out[SST_SHA256_HEX], const void *data, size_t size);

#endif

/* pipeline/image/jpeg_tables.h - Huffman tables that a camera's JPEG leaves out, as UVC allows: files that leave the
 * program have them, since many readers refuse files without. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_IMAGE_JPEG_TABLES_H
#define SST_PIPELINE_IMAGE_JPEG_TABLES_H

#include <stddef.h>
#include <stdint.h>

#include "base/base.h"

/**
 * Copy a picture; a sequential JPEG that does not define the Huffman tables of its first scan gets the ones of annex
 * K.3 of ITU-T T.81. All other bytes stay, also in other formats and damaged files.
 * @return to free with free(); NULL: no memory
 */
SST_MUST_CHECK uint8_t *sst_jpeg_complete(const uint8_t *data, size_t size, size_t *out_size);

/** Write that copy to a file. @return as sst_file_write() */
SST_MUST_CHECK int sst_jpeg_write(const char *path, const uint8_t *data, size_t size);

#endif

/* tests/deep_read.h - levels of a picture file, or its size and kind. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_DEEP_READ_H
#define SST_TESTS_DEEP_READ_H

#include <errno.h>
#include <stdlib.h>

#include "base/file.h"
#include "pipeline/image/deep.h"

static inline int deep_read(struct sst_deep *out, struct sst_deep_size *kind, const char *path)
{
    uint8_t *data;
    size_t size;
    int err = sst_file_read(path, 1 << 24, &data, &size);

    if (err)
        return err;
    err = out ? sst_deep_decode(out, data, size, path) : sst_deep_decode_size(kind, data, size, path);
    free(data);
    return err;
}

#endif

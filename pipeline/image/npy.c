/* NumPy's .npy, version 1.0: magic, 2-byte header length, a Python dict padded to 64 bytes, the data. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/image_internal.h"

#define PREFIX_BYTES 10 /* magic, version, length */

/* Bytes of an element: a letter and a number, which counts characters of four bytes for texts. */
static size_t item_bytes(const char *type)
{
    const unsigned long n = type[0] && strchr("buifU", type[0]) ? strtoul(type + 1, NULL, 10) : 0;

    return n < 65536 ? n * (type[0] == 'U' ? 4 : 1) : 0;
}

int npy_header(char out[NPY_HEADER], const char *type, const size_t *dims, int n_dims, size_t *bytes)
{
    const char order = type[1] == '1' && !type[2] && type[0] != 'U'         ? '|'
                       : __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? '<'
                                                                   : '>';
    size_t count = item_bytes(type);
    char dict[NPY_HEADER];
    int n = snprintf(dict, sizeof(dict), "{'descr': '%c%.8s', 'fortran_order': False, 'shape': (", order, type);

    if (!count || n_dims < 0 || n_dims > 4)
        return -EINVAL;
    for (int i = 0; i < n_dims; i++) {
        if (__builtin_mul_overflow(count, dims[i], &count))
            return -EINVAL;
        n += snprintf(dict + n, sizeof(dict) - (size_t)n, "%zu, ", dims[i]);
    }
    if (count > SIZE_MAX - NPY_HEADER)
        return -EINVAL;
    n += snprintf(dict + n, sizeof(dict) - (size_t)n, "), }");
    memset(out, ' ', NPY_HEADER);
    memcpy(out, "\x93NUMPY\x01\x00", 8);
    out[8] = (char)(NPY_HEADER - PREFIX_BYTES);
    out[9] = 0;
    memcpy(out + PREFIX_BYTES, dict, (size_t)n);
    out[NPY_HEADER - 1] = '\n';
    *bytes = count;
    return 0;
}

int sst_npy_write_f32(const float *data, const size_t *dims, int n_dims, const char *path)
{
    char header[NPY_HEADER], *file;
    size_t bytes;
    int err = n_dims < 1 ? -EINVAL : npy_header(header, "f4", dims, n_dims, &bytes);

    if (err)
        return err;
    file = malloc(NPY_HEADER + bytes);
    if (!file) {
        sst_log_error("out of memory writing %s (%zu bytes)", path, bytes);
        return -ENOMEM;
    }
    memcpy(file, header, NPY_HEADER);
    memcpy(file + NPY_HEADER, data, bytes);
    err = sst_file_write(path, file, NPY_HEADER + bytes);
    free(file);
    return err;
}

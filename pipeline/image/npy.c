/* NumPy's .npy, version 1.0: magic, 2-byte header length, a Python dict padded to 64 bytes, the data. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"

#define HEADER_BYTES 192 /* a multiple of 64 that holds four dimensions of 20 digits */
#define PREFIX_BYTES 10  /* magic, version, length */

static void make_header(char out[HEADER_BYTES], const size_t *dims, int n_dims)
{
    char dict[HEADER_BYTES];
    int n = snprintf(dict, sizeof(dict), "{'descr': '%cf4', 'fortran_order': False, 'shape': (",
                     __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? '<' : '>');

    for (int i = 0; i < n_dims; i++)
        n += snprintf(dict + n, sizeof(dict) - (size_t)n, "%zu, ", dims[i]);
    n += snprintf(dict + n, sizeof(dict) - (size_t)n, "), }");
    memset(out, ' ', HEADER_BYTES);
    memcpy(out, "\x93NUMPY\x01\x00", 8);
    out[8] = (char)(HEADER_BYTES - PREFIX_BYTES);
    out[9] = 0;
    memcpy(out + PREFIX_BYTES, dict, (size_t)n);
    out[HEADER_BYTES - 1] = '\n';
}

int sst_npy_write_f32(const float *data, const size_t *dims, int n_dims, const char *path)
{
    size_t count = 1, bytes;
    char *file;
    int err;

    if (n_dims < 1 || n_dims > 4)
        return -EINVAL;
    for (int i = 0; i < n_dims; i++) {
        if (__builtin_mul_overflow(count, dims[i], &count))
            return -EINVAL;
    }
    if (__builtin_mul_overflow(count, sizeof(float), &bytes) || bytes > SIZE_MAX - HEADER_BYTES)
        return -EINVAL;
    file = malloc(HEADER_BYTES + bytes);
    if (!file) {
        sst_log_error("out of memory writing %s (%zu bytes)", path, bytes);
        return -ENOMEM;
    }
    make_header(file, dims, n_dims);
    memcpy(file + HEADER_BYTES, data, bytes);
    err = sst_file_write(path, file, HEADER_BYTES + bytes);
    free(file);
    return err;
}

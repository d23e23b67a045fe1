/* NumPy's .npz: a ZIP archive (APPNOTE.TXT 6.3) of stored .npy files. All sizes stand in ZIP64 fields, so that an archive
 * of any size has one form. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/image/npz.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "base/log.h"
#include "pipeline/image/image_internal.h"

#define LOCAL_BYTES   30
#define LOCAL_EXTRA   20 /* id, length, size twice */
#define CENTRAL_BYTES 46
#define CENTRAL_EXTRA 28 /* the same and the place */
#define END_BYTES     (56 + 20 + 22)
#define CRC_AT        14 /* in a local header */
#define VERSION       45 /* 4.5: ZIP64 */
#define DATE          33 /* 1980-01-01 */

static uint8_t *put(uint8_t *p, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++, value >>= 8)
        *p++ = (uint8_t)value;
    return p;
}

static int write_bytes(struct sst_npz *npz, const void *data, size_t bytes)
{
    if (fwrite(data, 1, bytes, npz->out.stream) != bytes) {
        const int err = errno ? -errno : -EIO;

        sst_log_error("cannot write %s: %s", npz->out.path, strerror(-err));
        return err;
    }
    npz->at += bytes;
    return 0;
}

/* Members that both headers have: version needed .. length of the extra field. */
static uint8_t *put_common(uint8_t *p, const struct sst_npz_entry *e, size_t extra)
{
    p = put(p, VERSION, 2);
    p = put(p, 0, 4); /* flags, stored */
    p = put(p, 0, 2);
    p = put(p, DATE, 2);
    p = put(p, e->crc32, 4);
    p = put(p, UINT64_MAX, 8); /* sizes: in the extra field */
    p = put(p, strlen(e->file), 2);
    return put(p, extra, 2);
}

static uint8_t *put_name(uint8_t *p, const struct sst_npz_entry *e)
{
    memcpy(p, e->file, strlen(e->file));
    return p + strlen(e->file);
}

static uint8_t *put_sizes(uint8_t *p, const struct sst_npz_entry *e, size_t extra)
{
    return put(put(put(put(p, 1, 2), extra - 4, 2), e->bytes, 8), e->bytes, 8);
}

int sst_npz_open(struct sst_npz *npz, const char *path)
{
    *npz = (struct sst_npz){ .count = 0 };
    return sst_outfile_open(&npz->out, path);
}

int sst_npz_begin(struct sst_npz *npz, const struct sst_npz_array *array)
{
    struct sst_npz_entry *e = &npz->entry[npz->count];
    uint8_t head[LOCAL_BYTES + sizeof(e->file) + LOCAL_EXTRA], *p = head;
    const size_t name = strlen(array->name);
    char npy[NPY_HEADER];
    size_t bytes;
    int err;

    assert(!npz->left && npz->count < SST_NPZ_ARRAYS && name + 5 <= sizeof(e->file));
    err = npy_header(npy, array->type, array->dims, array->n_dims, &bytes);
    if (err) {
        sst_log_error("cannot write %s: the array %s is too large", npz->out.path, array->name);
        return err;
    }
    *e = (struct sst_npz_entry){ .at = npz->at, .bytes = NPY_HEADER + bytes };
    snprintf(e->file, sizeof(e->file), "%s.npy", array->name);
    p = put_name(put_common(put(p, 0x04034b50, 4), e, LOCAL_EXTRA), e);
    p = put_sizes(p, e, LOCAL_EXTRA);
    npz->count++;
    npz->left = NPY_HEADER + bytes;
    err = write_bytes(npz, head, (size_t)(p - head));
    return err ? err : sst_npz_put(npz, npy, sizeof(npy));
}

/* The checksum is known at an array's end, and stands before it. */
static int put_crc(struct sst_npz *npz)
{
    const struct sst_npz_entry *e = &npz->entry[npz->count - 1];
    FILE *f = npz->out.stream;
    uint8_t crc[4];

    put(crc, e->crc32, 4);
    if (!fseeko(f, (off_t)(e->at + CRC_AT), SEEK_SET) && fwrite(crc, 1, 4, f) == 4 && !fseeko(f, 0, SEEK_END))
        return 0;
    sst_log_error("cannot write %s: %s", npz->out.path, strerror(errno));
    return errno ? -errno : -EIO;
}

int sst_npz_put(struct sst_npz *npz, const void *data, size_t bytes)
{
    struct sst_npz_entry *e = &npz->entry[npz->count - 1];
    int err;

    assert(bytes <= npz->left);
    e->crc32 = (uint32_t)crc32_z(e->crc32, data, bytes);
    npz->left -= bytes;
    err = write_bytes(npz, data, bytes);
    return err || npz->left ? err : put_crc(npz);
}

int sst_npz_add(struct sst_npz *npz, const struct sst_npz_array *array, const void *data)
{
    const int err = sst_npz_begin(npz, array);

    return err || !npz->left ? err : sst_npz_put(npz, data, npz->left);
}

/* Code points of a text, the last one NUL; bytes that are not UTF-8 become U+FFFD. @return how many */
static size_t decode(uint32_t *out, const char *text)
{
    size_t n = 0;

    for (const uint8_t *p = (const uint8_t *)text; *p; n++) {
        const int more = *p < 0x80 ? 0 : *p >= 0xF0 && *p < 0xF8 ? 3 : *p >= 0xE0 ? 2 : *p >= 0xC0 ? 1 : -1;
        uint32_t c = more > 0 ? *p & (0x3Fu >> more) : *p;
        int i = 1;

        while (more > 0 && i <= more && (p[i] & 0xC0) == 0x80)
            c = c << 6 | (p[i++] & 0x3Fu);
        out[n] = more < 0 || i <= more ? 0xFFFD : c;
        p += i;
    }
    out[n] = 0;
    return n;
}

int sst_npz_add_texts(struct sst_npz *npz, const char *name, const char *texts, size_t stride, size_t count)
{
    uint32_t *codes = calloc(count * stride + 1, sizeof(*codes));
    size_t longest = 1;
    char type[24];
    int err = -ENOMEM;

    if (!codes) {
        sst_log_error("no memory to write %s", npz->out.path);
        return err;
    }
    for (size_t i = 0; i < count; i++) {
        const size_t n = decode(codes + i * stride, texts + i * stride);

        longest = n > longest ? n : longest;
    }
    snprintf(type, sizeof(type), "U%zu", longest);
    err = sst_npz_begin(npz, &(struct sst_npz_array){ name, type, 1, { count } });
    for (size_t i = 0; !err && i < count; i++)
        err = sst_npz_put(npz, codes + i * stride, longest * sizeof(*codes));
    free(codes);
    return err;
}

static int write_directory(struct sst_npz *npz)
{
    uint8_t data[CENTRAL_BYTES + sizeof(npz->entry[0].file) + CENTRAL_EXTRA + END_BYTES], *p;
    const uint64_t at = npz->at;
    uint64_t end;

    for (int i = 0; i < npz->count; i++) {
        const struct sst_npz_entry *e = &npz->entry[i];
        int err;

        p = put_common(put(put(data, 0x02014b50, 4), VERSION | 3 << 8, 2), e, CENTRAL_EXTRA); /* made on UNIX */
        p = put(p, 0, 6);                                                                     /* comment, disk, kind */
        p = put(put(p, (uint64_t)0100644 << 16, 4), UINT32_MAX, 4);
        p = put(put_sizes(put_name(p, e), e, CENTRAL_EXTRA), e->at, 8);
        err = write_bytes(npz, data, (size_t)(p - data));
        if (err)
            return err;
    }
    end = npz->at;
    p = put(put(put(put(put(data, 0x06064b50, 4), 44, 8), VERSION | 3 << 8, 2), VERSION, 2), 0, 8);
    p = put(put(put(put(p, (uint64_t)npz->count, 8), (uint64_t)npz->count, 8), end - at, 8), at, 8);
    p = put(put(put(put(p, 0x07064b50, 4), 0, 4), end, 8), 1, 4);
    p = put(put(put(put(p, 0x06054b50, 4), 0, 4), UINT32_MAX, 4), UINT64_MAX, 8);
    p = put(p, 0, 2);
    return write_bytes(npz, data, (size_t)(p - data));
}

int sst_npz_end(struct sst_npz *npz, int err)
{
    assert(err || !npz->left);
    err = err ? err : write_directory(npz);
    if (!err)
        return sst_outfile_commit(&npz->out);
    sst_outfile_abort(&npz->out);
    return err;
}

/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/file.h"
#include "daemon/storage/case_internal.h"

/* APPNOTE.TXT 6.3: local file headers before each file, a central directory and its end after all. */
#define LOCAL_BYTES   30
#define CENTRAL_BYTES 46
#define END_BYTES     22

static uint8_t *put(uint8_t *p, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++, value >>= 8)
        *p++ = (uint8_t)value;
    return p;
}

/* Members that both headers have: version needed .. length of the extra field. */
static uint8_t *put_common(uint8_t *p, const struct zip *z, const struct zip_file *f)
{
    p = put(p, 10, 2); /* version 1.0, stored */
    p = put(p, 0, 2);
    p = put(p, 0, 2);
    p = put(p, z->clock[0], 2);
    p = put(p, z->clock[1], 2);
    p = put(p, f->crc32, 4);
    p = put(p, (uint64_t)f->bytes, 4);
    p = put(p, (uint64_t)f->bytes, 4);
    p = put(p, strlen(f->name), 2);
    return put(p, 0, 2);
}

static size_t local_bytes(const struct zip_file *f)
{
    return LOCAL_BYTES + strlen(f->name);
}

static void local_header(uint8_t *out, const struct zip *z, const struct zip_file *f)
{
    uint8_t *p = put_common(put(out, 0x04034b50, 4), z, f);

    memcpy(p, f->name, strlen(f->name));
}

static void central_directory(struct zip *z, int64_t at)
{
    uint8_t *p = z->end;

    for (int i = 0; i < z->count; i++) {
        const struct zip_file *f = &z->file[i];

        p = put(p, 0x02014b50, 4);
        p = put(p, 10 | 3 << 8, 2); /* made on UNIX */
        p = put_common(p, z, f);
        p = put(p, 0, 6); /* comment, disk, kind */
        p = put(p, (uint64_t)0100644 << 16, 4);
        p = put(p, (uint64_t)f->at, 4);
        memcpy(p, f->name, strlen(f->name));
        p += strlen(f->name);
    }
    at = put(put(put(put(put(put(put(p, 0x06054b50, 4), 0, 4), (uint64_t)z->count, 2), (uint64_t)z->count, 2),
                     (uint64_t)(p - z->end), 4),
                 (uint64_t)at, 4),
             0, 2) -
         z->end;
    z->end_bytes = (size_t)at;
}

int zip_open(struct zip *z, const char *dir, int64_t made_ns)
{
    const time_t made = (time_t)(made_ns / 1000000000);
    size_t names = 0;
    struct tm tm;

    z->fd = -1;
    if (sst_path_join(z->dir, dir, NULL))
        return -ENAMETOOLONG;
    localtime_r(&made, &tm);
    z->clock[0] = (uint16_t)(tm.tm_hour << 11 | tm.tm_min << 5 | tm.tm_sec / 2);
    z->clock[1] = (uint16_t)((tm.tm_year - 80) << 9 | (tm.tm_mon + 1) << 5 | tm.tm_mday);
    for (int i = 0; i < z->count; i++) {
        struct zip_file *f = &z->file[i];

        f->at = z->bytes;
        z->bytes += (int64_t)local_bytes(f) + f->bytes;
        names += strlen(f->name);
        if (z->bytes > ZIP_BYTES_MOST)
            return -EFBIG;
    }
    z->end = malloc((size_t)z->count * CENTRAL_BYTES + names + END_BYTES);
    if (!z->end)
        return -ENOMEM;
    central_directory(z, z->bytes);
    z->bytes += (int64_t)z->end_bytes;
    return 0;
}

static ssize_t read_file(struct zip *z, int i, int64_t at, void *out, size_t n)
{
    char path[SST_PATH_MAX];
    ssize_t got;

    if (z->fd < 0 || z->open != i) {
        if (z->fd >= 0)
            close(z->fd);
        z->fd = sst_path_join(path, z->dir, z->file[i].name) ? -ENAMETOOLONG : open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
        z->open = i;
    }
    got = z->fd < 0 ? -1 : pread(z->fd, out, n, at);
    return got < 0 ? -errno : got ? got : -EBADMSG;
}

static size_t least(size_t n, int64_t left)
{
    return (int64_t)n < left ? n : (size_t)left;
}

ssize_t zip_read(struct zip *z, int64_t at, void *out, size_t n)
{
    uint8_t header[LOCAL_BYTES + sizeof(z->file[0].name)];

    for (int i = 0; i < z->count; i++) {
        const struct zip_file *f = &z->file[i];
        const int64_t head = (int64_t)local_bytes(f), in = at - f->at;

        if (in < head) {
            local_header(header, z, f);
            n = least(n, head - in);
            memcpy(out, header + in, n);
            return (ssize_t)n;
        }
        if (in < head + f->bytes)
            return read_file(z, i, in - head, out, least(n, head + f->bytes - in));
    }
    at -= z->bytes - (int64_t)z->end_bytes;
    n = least(n, (int64_t)z->end_bytes - at);
    memcpy(out, z->end + at, n);
    return (ssize_t)n;
}

void zip_close(struct zip *z)
{
    if (z->fd >= 0)
        close(z->fd);
    free(z->end);
    z->end = NULL;
    z->fd = -1;
}

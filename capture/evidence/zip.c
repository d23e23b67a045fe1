/* Reader of ZIP archives without compression, as daemon/storage/zip.c writes them (APPNOTE.TXT 6.3, without ZIP64). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "capture/evidence/evidence_internal.h"

#define END_BYTES     22
#define CENTRAL_BYTES 46
#define LOCAL_BYTES   30
#define LIST_MOST     ((size_t)1 << 20)

static uint32_t number(const uint8_t *p, int bytes)
{
    uint32_t n = 0;

    for (int i = bytes; i-- > 0;)
        n = n << 8 | p[i];
    return n;
}

static int read_at(int fd, void *out, size_t n, int64_t at)
{
    const ssize_t got = pread(fd, out, n, at);

    return got == (ssize_t)n ? 0 : got < 0 ? -errno : -EBADMSG;
}

/* @param list  [bytes], the central directory @param here  where the file's header must be: unpackers that read headers in
 * their order would find a file that the list does not name; out, its end @return bytes of the first entry, -EBADMSG,
 * -EDOM, -EIO */
static int read_entry(int fd, const uint8_t *list, size_t bytes, int64_t *here, struct evidence_entry *out)
{
    uint8_t local[LOCAL_BYTES + sizeof(out->name)];
    uint32_t name, all;
    int err;

    if (bytes < CENTRAL_BYTES || number(list, 4) != 0x02014b50)
        return -EBADMSG;
    name = number(list + 28, 2);
    all = CENTRAL_BYTES + name + number(list + 30, 2) + number(list + 32, 2);
    if (all > bytes || name >= sizeof(out->name))
        return -EBADMSG;
    if (number(list + 10, 2) || number(list + 20, 4) != number(list + 24, 4))
        return -EDOM;
    memcpy(out->name, list + CENTRAL_BYTES, name);
    out->name[name] = 0;
    err = number(list + 42, 4) == *here ? read_at(fd, local, LOCAL_BYTES + name, *here) : -EBADMSG;
    if (err)
        return err;
    out->at = *here + LOCAL_BYTES + name + number(local + 28, 2);
    out->bytes = number(list + 24, 4);
    *here = out->at + out->bytes;
    return number(local, 4) == 0x04034b50 && !memchr(list + CENTRAL_BYTES, 0, name) && number(local + 26, 2) == name &&
                   !memcmp(local + LOCAL_BYTES, list + CENTRAL_BYTES, name) &&
                   !memcmp(local + 8, list + 10, 2) && !memcmp(local + 18, list + 20, 8)
               ? (int)all
               : -EBADMSG;
}

int evidence_entries(int fd, struct evidence_entry **out)
{
    uint8_t end[END_BYTES], *list = NULL;
    struct evidence_entry *entry = NULL;
    size_t bytes = 0, at = 0;
    int64_t here = 0;
    struct stat st;
    int count = 0, n = 0, err = fstat(fd, &st) ? -errno : st.st_size < END_BYTES ? -EBADMSG : 0;

    err = err ? err : read_at(fd, end, sizeof(end), st.st_size - END_BYTES);
    if (!err && number(end, 4) != 0x06054b50)
        err = -EBADMSG;
    if (!err) {
        count = (int)number(end + 10, 2);
        bytes = number(end + 12, 4);
        err = bytes > LIST_MOST ? -EBADMSG : 0;
    }
    if (!err) {
        list = malloc(bytes + 1);
        entry = calloc((size_t)count + 1, sizeof(*entry));
        err = list && entry ? read_at(fd, list, bytes, number(end + 16, 4)) : -ENOMEM;
    }
    for (int i = 0; !err && i < count; i++) {
        n = read_entry(fd, list + at, bytes - at, &here, &entry[i]);
        err = n < 0 ? n : 0;
        at += n > 0 ? (size_t)n : 0;
    }
    if (!err && (at != bytes || here != number(end + 16, 4) || here + (int64_t)bytes + END_BYTES != st.st_size))
        err = -EBADMSG;
    free(list);
    if (err) {
        free(entry);
        return err;
    }
    *out = entry;
    return count;
}

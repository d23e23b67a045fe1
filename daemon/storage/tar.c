/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/storage/storage_internal.h"
#include "daemon/storage/video_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <fts.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/mem.h"

/* POSIX.1-2001, pax: ustar interchange format. */
struct header {
    char name[100], mode[8], uid[8], gid[8], size[12], mtime[12], checksum[8], type, link[100], magic[6], version[2],
        user[32], group[32], major[8], minor[8], prefix[155], pad[12];
};

int open_below(int folder, const char *path)
{
    const int flags = O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC;
    const char *slash = strchr(path, '/');
    char name[256];
    int inner, fd;

    if (!slash) {
        fd = openat(folder, path, flags);
        return fd < 0 ? -errno : fd;
    }
    if ((size_t)(slash - path) >= sizeof(name))
        return -ENAMETOOLONG;
    memcpy(name, path, (size_t)(slash - path));
    name[slash - path] = 0;
    inner = openat(folder, name, flags | O_DIRECTORY);
    if (inner < 0)
        return -errno;
    fd = open_below(inner, slash + 1);
    close(inner);
    return fd;
}

void add_to_tag(uint64_t *tag, const void *data, size_t n)
{
    const uint8_t *byte = data;

    if (!*tag)
        *tag = 14695981039346656037u;
    for (size_t i = 0; i < n; i++)
        *tag = (*tag ^ byte[i]) * 1099511628211u;
}

/* --- the list ----------------------------------------------------------------------------------------------------- */

/* Above 8 GiB as a binary number, as GNU tar and all others since read it. */
static void set_size(char out[12], int64_t size)
{
    char octal[24];

    if (size < (int64_t)8 << 30) {
        snprintf(octal, sizeof(octal), "%011llo", (unsigned long long)size);
        memcpy(out, octal, 12);
        return;
    }
    memset(out, 0, 12);
    out[0] = (char)0x80;
    for (int i = 11; size; i--, size >>= 8)
        out[i] = (char)(size & 0xff);
}

static void set_header(struct header *h, const char *name, const struct stat *st)
{
    const uint8_t *byte = (const uint8_t *)h;
    char octal[24];
    unsigned sum = 0;

    *h = (struct header){ .magic = "ustar", .version = { '0', '0' } };
    memcpy(h->name, name, strlen(name)); /* 100 characters need no end */
    memcpy(h->mode, S_ISDIR(st->st_mode) ? "0000755" : "0000644", 8);
    memcpy(h->uid, "0000000", 8);
    memcpy(h->gid, "0000000", 8);
    set_size(h->size, S_ISDIR(st->st_mode) ? 0 : st->st_size);
    snprintf(octal, sizeof(octal), "%011llo", (unsigned long long)(st->st_mtime > 0 ? st->st_mtime : 0) & 077777777777);
    memcpy(h->mtime, octal, sizeof(h->mtime));
    h->type = S_ISDIR(st->st_mode) ? '5' : '0';
    memset(h->checksum, ' ', sizeof(h->checksum));
    for (size_t i = 0; i < sizeof(*h); i++)
        sum += byte[i];
    snprintf(octal, sizeof(octal), "%06o", sum);
    memcpy(h->checksum, octal, 7);
}

static int64_t padded(int64_t size)
{
    return (size + TAR_BLOCK - 1) / TAR_BLOCK * TAR_BLOCK;
}

/* @param name  in the archive, a folder's with '/' at its end; path: below the folder */
static int add_entry(struct tar *t, const char *name, const char *path, const struct stat *st)
{
    struct header h;
    struct tar_entry *e;

    _Static_assert(sizeof(h) == TAR_BLOCK, "a header is a block");
    if (strlen(name) > sizeof(h.name))
        return -ENAMETOOLONG;
    if (!sst_mem_grow(&t->entry, t->count, &t->capacity, sizeof(*t->entry)))
        return -ENOMEM;
    set_header(&h, name, st);
    e = &t->entry[t->count];
    *e = (struct tar_entry){ .at = t->bytes, .size = S_ISDIR(st->st_mode) ? 0 : st->st_size, .path = strdup(path) };
    if (!e->path)
        return -ENOMEM;
    memcpy(e->header, &h, sizeof(h));
    t->count++;
    t->bytes += TAR_BLOCK + padded(e->size);
    add_to_tag(&t->tag, &h, sizeof(h));
    add_to_tag(&t->tag, &st->st_mtim, sizeof(st->st_mtim));
    return 0;
}

static int by_name(const FTSENT **a, const FTSENT **b)
{
    return strcmp((*a)->fts_name, (*b)->fts_name);
}

static int add_entries(struct tar *t, const char *dir)
{
    char *const roots[] = { (char *)dir, NULL };
    FTS *fts = fts_open(roots, FTS_PHYSICAL | FTS_NOCHDIR, by_name);
    const FTSENT *e;
    int err = fts ? 0 : -errno;

    while (!err && (errno = 0, e = fts_read(fts))) {
        const bool folder = e->fts_info == FTS_D;
        const char *path = e->fts_path + strlen(dir); /* "", or from '/' on */
        char name[512];

        if (e->fts_info == FTS_DNR || e->fts_info == FTS_ERR)
            err = -e->fts_errno;
        else if (!folder && e->fts_info != FTS_F)
            continue;
        else if (snprintf(name, sizeof(name), "%s%s%s", sst_path_base(dir), path, folder ? "/" : "") >=
                 (int)sizeof(name))
            err = -ENAMETOOLONG;
        else
            err = add_entry(t, name, path + (path[0] == '/'), e->fts_statp);
    }
    if (!err && errno)
        err = -errno;
    if (fts)
        fts_close(fts);
    return err;
}

int tar_open(struct tar *out, const char *dir)
{
    int err;

    *out = (struct tar){ .folder = open(dir, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC), .fd = -1 };
    err = out->folder < 0 ? -errno : add_entries(out, dir);
    out->bytes += (int64_t)2 * TAR_BLOCK; /* zeros: the end */
    return err;
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

/* Number of the entry that holds a byte of the archive. */
static int find(const struct tar *t, int64_t at)
{
    int low = 0, high = t->count;

    while (high - low > 1) {
        const int middle = low + (high - low) / 2;

        if (t->entry[middle].at <= at)
            low = middle;
        else
            high = middle;
    }
    return low;
}

static ssize_t read_file(struct tar *t, int i, int64_t at, void *out, size_t n)
{
    struct stat st;
    ssize_t got;

    if (t->fd < 0 || t->file != i) {
        if (t->fd >= 0)
            close(t->fd);
        t->fd = open_below(t->folder, t->entry[i].path);
        t->file = i;
    }
    if (t->fd < 0)
        return t->fd;
    if (fstat(t->fd, &st))
        return -errno;
    got = S_ISREG(st.st_mode) ? pread(t->fd, out, n, at) : 0;
    return got < 0 ? -errno : got ? got : -EBADMSG;
}

ssize_t tar_read(struct tar *t, int64_t at, void *out, size_t n)
{
    const int i = find(t, at);
    const struct tar_entry *e = &t->entry[i];
    const int64_t next = i + 1 < t->count ? e[1].at : t->bytes, in_file = at - e->at - TAR_BLOCK;
    const int64_t end = in_file < 0 ? e->at + TAR_BLOCK : in_file < e->size ? e->at + TAR_BLOCK + e->size : next;

    if (n > (size_t)(end - at))
        n = (size_t)(end - at);
    if (in_file >= 0 && in_file < e->size)
        return read_file(t, i, in_file, out, n);
    if (in_file < 0)
        memcpy(out, e->header + TAR_BLOCK + in_file, n);
    else
        memset(out, 0, n);
    return (ssize_t)n;
}

void tar_close(struct tar *t)
{
    for (int i = 0; i < t->count; i++)
        free(t->entry[i].path);
    free(t->entry);
    if (t->fd >= 0)
        close(t->fd);
    if (t->folder >= 0)
        close(t->folder);
    *t = (struct tar){ .folder = -1, .fd = -1 };
}

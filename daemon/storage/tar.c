#define _GNU_SOURCE /* scandirat */
#include "daemon/storage/storage_internal.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define BLOCK     512
#define DEPTH_MAX 8

/* POSIX.1-2001, pax: ustar interchange format. */
struct header {
    char name[100], mode[8], uid[8], gid[8], size[12], mtime[12], checksum[8], type, link[100], magic[6], version[2],
        user[32], group[32], major[8], minor[8], prefix[155], pad[12];
};

/* Above 8 GiB as a binary number, as GNU tar and all others since take it. */
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

static int add_header(struct spans *to, const char *name, const struct stat *st)
{
    struct header h = { .magic = "ustar", .version = { '0', '0' } };
    const int64_t size = S_ISDIR(st->st_mode) ? 0 : st->st_size;
    const uint8_t *byte = (const uint8_t *)&h;
    char octal[24];
    unsigned sum = 0;

    _Static_assert(sizeof(h) == BLOCK, "a header is a block");
    if (strlen(name) > sizeof(h.name))
        return -ENAMETOOLONG;
    memcpy(h.name, name, strlen(name)); /* 100 characters need no end */
    memcpy(h.mode, S_ISDIR(st->st_mode) ? "0000755" : "0000644", 8);
    memcpy(h.uid, "0000000", 8);
    memcpy(h.gid, "0000000", 8);
    set_size(h.size, size);
    snprintf(octal, sizeof(octal), "%011llo", (unsigned long long)(st->st_mtime > 0 ? st->st_mtime : 0) & 077777777777);
    memcpy(h.mtime, octal, sizeof(h.mtime));
    h.type = S_ISDIR(st->st_mode) ? '5' : '0';
    memset(h.checksum, ' ', sizeof(h.checksum));
    for (size_t i = 0; i < sizeof(h); i++)
        sum += byte[i];
    snprintf(octal, sizeof(octal), "%06o", sum);
    memcpy(h.checksum, octal, 7);
    spans_own(to, &h, sizeof(h));
    spans_mark(to, &st->st_mtim, sizeof(st->st_mtim));
    return 0;
}

struct walk {
    struct spans *to;
    size_t top; /* characters of the archive's name before a path in the folder */
};

static int add_folder(const struct walk *w, int fd, const char *name, int depth);

static int add_file(const struct walk *w, const char *name, const struct stat *st)
{
    static const uint8_t zeros[BLOCK];
    const int err = add_header(w->to, name, st);

    if (err || !st->st_size)
        return err;
    spans_piece(w->to, spans_file(w->to, name + w->top), 0, st->st_size);
    spans_own(w->to, zeros, (size_t)(BLOCK - st->st_size % BLOCK) % BLOCK);
    return 0;
}

static int add_entry(const struct walk *w, int folder, const char *name, const char *file, int depth)
{
    char path[512];
    struct stat st;
    int err = 0, fd;

    if (snprintf(path, sizeof(path), "%s%s", name, file) >= (int)sizeof(path) - 1)
        return -ENAMETOOLONG;
    fd = spans_open(folder, file);
    if (fd < 0)
        return fd == -ENOENT || fd == -ELOOP || fd == -ENXIO ? 0 : fd;
    if (fstat(fd, &st)) {
        err = -errno;
    } else if (S_ISDIR(st.st_mode)) {
        strcat(path, "/");
        err = depth < DEPTH_MAX ? add_folder(w, fd, path, depth + 1) : -ENAMETOOLONG;
    } else if (S_ISREG(st.st_mode)) {
        err = add_file(w, path, &st);
    }
    close(fd);
    return err;
}

/* name ends in '/'. */
static int add_folder(const struct walk *w, int fd, const char *name, int depth)
{
    struct dirent **list = NULL;
    struct stat st;
    int n, err = fstat(fd, &st) ? -errno : add_header(w->to, name, &st);

    if (err)
        return err;
    n = scandirat(fd, ".", &list, NULL, alphasort);
    if (n < 0)
        return -errno;
    for (int i = 0; i < n; i++) {
        if (!err && strcmp(list[i]->d_name, ".") && strcmp(list[i]->d_name, ".."))
            err = add_entry(w, fd, name, list[i]->d_name, depth);
        free(list[i]);
    }
    free(list);
    return err;
}

int tar_plan(struct spans *to, int fd, const char *name)
{
    static const uint8_t end[2 * BLOCK];
    const struct walk w = { .to = to, .top = strlen(name) + 1 };
    char top[256];
    int err = snprintf(top, sizeof(top), "%s/", name) < (int)sizeof(top) ? 0 : -ENAMETOOLONG;

    if (!err)
        err = add_folder(&w, fd, top, 0);
    spans_own(to, end, sizeof(end));
    return err ? err : spans_error(to);
}

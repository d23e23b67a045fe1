#include "daemon/storage/storage_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define COPY_BYTES ((size_t)256 << 10)

void spans_fini(struct spans *s)
{
    for (int i = 0; i < s->files; i++)
        free(s->path[i]);
    free(s->path);
    free(s->own);
    free(s->span);
    *s = (struct spans){ 0 };
}

/* FNV-1a. */
void spans_mark(struct spans *s, const void *data, size_t n)
{
    const uint8_t *byte = data;

    if (!s->tag)
        s->tag = 14695981039346656037u;
    for (size_t i = 0; i < n; i++)
        s->tag = (s->tag ^ byte[i]) * 1099511628211u;
}

/* Room for `more` elements behind `count`. @return false: no memory, and the plan is none any more */
static bool grow(struct spans *s, void *array, size_t size, size_t count, size_t more, size_t *capacity)
{
    void **at = array, *grown;
    size_t want = *capacity ? *capacity : 64;

    if (s->failed)
        return false;
    if (count + more <= *capacity)
        return true;
    while (want < count + more)
        want *= 2;
    grown = realloc(*at, want * size);
    if (!grown) {
        s->failed = true;
        return false;
    }
    *at = grown;
    *capacity = want;
    return true;
}

/* A span that goes on where the last one ends is part of it. */
static void add(struct spans *s, int file, int64_t offset, int64_t n)
{
    const struct file_span *last = s->count ? &s->span[s->count - 1] : NULL;

    if (n <= 0)
        return;
    if (!last || last->file != file || last->offset + (s->bytes - last->at) != offset) {
        if (!grow(s, &s->span, sizeof(*s->span), s->count, 1, &s->capacity))
            return;
        s->span[s->count++] = (struct file_span){ s->bytes, offset, file };
    }
    s->bytes += n;
}

void spans_own(struct spans *s, const void *data, size_t n)
{
    if (!n || !grow(s, &s->own, 1, s->own_bytes, n, &s->own_capacity))
        return;
    memcpy(s->own + s->own_bytes, data, n);
    s->own_bytes += n;
    spans_mark(s, data, n);
    add(s, -1, (int64_t)(s->own_bytes - n), (int64_t)n);
}

int spans_file(struct spans *s, const char *path)
{
    size_t capacity = (size_t)s->files_capacity;
    char *copy;

    if (!grow(s, &s->path, sizeof(*s->path), (size_t)s->files, 1, &capacity))
        return 0;
    s->files_capacity = (int)capacity;
    copy = strdup(path);
    if (!copy) {
        s->failed = true;
        return 0;
    }
    spans_mark(s, path, strlen(path) + 1);
    s->path[s->files] = copy;
    return s->files++;
}

void spans_piece(struct spans *s, int file, int64_t offset, int64_t n)
{
    const int64_t what[] = { file, offset, n };

    spans_mark(s, what, sizeof(what));
    add(s, file, offset, n);
}

int spans_error(const struct spans *s)
{
    return s->failed ? -ENOMEM : 0;
}

/* --- sending ------------------------------------------------------------------------------------------------------ */

struct sending {
    const struct spans *s;
    int folder, file, fd; /* the file that is open; -1: none */
    uint8_t *copy;        /* [COPY_BYTES] */
    size_t held;          /* bytes in it */
    spans_fn *fn;
    void *arg;
};

int spans_open(int folder, const char *path)
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
    fd = spans_open(inner, slash + 1);
    close(inner);
    return fd;
}

static int open_file(struct sending *t, int file)
{
    struct stat st;

    if (t->fd >= 0)
        close(t->fd);
    t->file = file;
    t->fd = spans_open(t->folder, t->s->path[file]);
    if (t->fd < 0)
        return t->fd;
    if (fstat(t->fd, &st))
        return -errno;
    return S_ISREG(st.st_mode) ? 0 : -EBADMSG;
}

static int flush(struct sending *t)
{
    const size_t n = t->held;

    t->held = 0;
    return n ? t->fn(t->arg, t->copy, n) : 0;
}

/* Small pieces go out together. */
static int send_piece(struct sending *t, const struct file_span *span, int64_t from, int64_t n)
{
    int err = span->file < 0 || (t->fd >= 0 && t->file == span->file) ? 0 : open_file(t, span->file);

    while (!err && n > 0) {
        const size_t room = COPY_BYTES - t->held, want = n < (int64_t)room ? (size_t)n : room;
        ssize_t got = (ssize_t)want;

        if (span->file < 0)
            memcpy(t->copy + t->held, t->s->own + span->offset + from, want);
        else
            got = pread(t->fd, t->copy + t->held, want, span->offset + from);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return got < 0 ? -errno : -EBADMSG;
        t->held += (size_t)got;
        if (t->held == COPY_BYTES)
            err = flush(t);
        from += got;
        n -= got;
    }
    return err;
}

/* Number of the span that holds a byte of the whole. */
static size_t find(const struct spans *s, int64_t at)
{
    size_t low = 0, high = s->count;

    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;

        if (s->span[middle].at <= at)
            low = middle;
        else
            high = middle;
    }
    return low;
}

int spans_send(const struct spans *s, int folder, int64_t first, int64_t n, spans_fn *fn, void *arg)
{
    struct sending t = { .s = s, .folder = folder, .fd = -1, .fn = fn, .arg = arg, .copy = malloc(COPY_BYTES) };
    int err = t.copy ? 0 : -ENOMEM;

    for (size_t i = n > 0 ? find(s, first) : s->count; !err && n > 0 && i < s->count; i++) {
        const struct file_span *span = &s->span[i];
        const int64_t end = i + 1 < s->count ? s->span[i + 1].at : s->bytes;
        const int64_t part = end - first < n ? end - first : n;

        err = send_piece(&t, span, first - span->at, part);
        first += part;
        n -= part;
    }
    if (!err)
        err = flush(&t);
    if (t.fd >= 0)
        close(t.fd);
    free(t.copy);
    return err;
}

/* daemon/storage/spans.h - a file that is a plan: bytes of its own and pieces of files, one after the other.
 *
 * What is downloaded (archives, videos) is never made as a file: its plan is, so that its length is known beforehand
 * and any part of it can be sent. */
#ifndef SST_DAEMON_STORAGE_SPANS_H
#define SST_DAEMON_STORAGE_SPANS_H

#include <stdbool.h>

#include "base/base.h"

struct sst_span {
    int64_t at;     /* first byte in the whole */
    int64_t offset; /* of it in the file, or in `own` */
    int file;       /* -1: of `own` */
};

/** Zeroed: empty. Growing fails silently and for good: sst_spans_error() tells. One thread while it is made; then any
 *  number may send. */
struct sst_spans {
    struct sst_span *span;
    size_t count, capacity;
    uint8_t *own;
    size_t own_bytes, own_capacity;
    char **path; /* of files, below the folder that is given to send */
    int files, files_capacity;
    int64_t bytes; /* of the whole */
    uint64_t tag;  /* of all that was planned, also sst_spans_mark(): another content has another one */
    bool failed;
};

void sst_spans_fini(struct sst_spans *s);

/** Bytes of its own, copied. */
void sst_spans_own(struct sst_spans *s, const void *data, size_t n);
/** Another file from which pieces are taken. @param path  copied @return its number */
int sst_spans_file(struct sst_spans *s, const char *path);
/** n bytes of a file from an offset. */
void sst_spans_piece(struct sst_spans *s, int file, int64_t offset, int64_t n);
/** What else tells one content from another (times, sizes). */
void sst_spans_mark(struct sst_spans *s, const void *data, size_t n);

/** @return 0, -ENOMEM: something of it is missing */
SST_MUST_CHECK int sst_spans_error(const struct sst_spans *s);

/** Open a file below a folder for reading, as sending does: no link on the way is followed, and nothing is waited for
 *  that is no file. @return descriptor or negative errno */
SST_MUST_CHECK int sst_spans_open(int folder, const char *path);

/** Takes all n bytes. @return 0, or a negative errno that ends the sending. */
typedef int sst_spans_fn(void *arg, const void *data, size_t n);

/**
 * Hand on n bytes from `first` on.
 *
 * @param folder  of the files; links below it are not followed
 * @param first   first + n is at most s->bytes
 * @return 0, what fn returned, -EBADMSG (a file is shorter than planned), -ENOENT (it is gone), -ENOMEM or -errno of
 *         reading; not logged. Waits for the disk.
 */
SST_MUST_CHECK int sst_spans_send(const struct sst_spans *s, int folder, int64_t first, int64_t n, sst_spans_fn *fn,
                                  void *arg);

#endif

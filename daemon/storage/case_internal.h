/* daemon/storage/case_internal.h - private declarations of case*.c and zip.c. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_STORAGE_CASE_INTERNAL_H
#define SST_DAEMON_STORAGE_CASE_INTERNAL_H

#include <sys/types.h>

#include "capture/evidence/evidence.h"
#include "daemon/storage/cases.h"

#define CASE_WHY 256

/* --- video: the see-through view of a recording beside a camera, with captions. --- */

struct case_video {
    struct sst_storage *storage;
    const struct sst_case_span *span;
    const char *site;
    const char *path; /* of the file that is made */
    /** Called after each frame. @param done  0..1 @return false: -ECANCELED */
    bool (*progress)(void *arg, double done);
    void *arg;
};

/**
 * Write a video, whole or not at all. Waits for the disk.
 *
 * @param facts  out, for the manifest: {from, to, seconds, width, height, rate_hz, clear, camera, recordings}; owned by the caller
 * @param why    out, with an error: a sentence
 * @return 0, -ENOENT (nothing of it was recorded), -ECANCELED, -ENOTSUP (no encoder), -ENOSPC, -EIO, -EBADMSG, -ENOMEM
 */
SST_MUST_CHECK int case_video_make(const struct case_video *v, json_t **facts, char why[CASE_WHY]);

/* --- zip: files of a folder as a virtual ZIP archive, without compression: headers in memory, contents read from the files. --- */

#define ZIP_FILES_MAX  32
#define ZIP_BYTES_MOST INT64_C(4000000000) /* of all files: readers of any age have it */

struct zip_file {
    char name[96];
    int64_t bytes;
    uint32_t crc32;
    int64_t at; /* of its header in the archive */
};

/** One thread at a time. Zeroed: none. */
struct zip {
    char dir[SST_PATH_MAX];
    struct zip_file file[ZIP_FILES_MAX];
    int count;
    int64_t bytes;  /* of the archive */
    uint16_t clock[2]; /* time and date of all files, as of DOS */
    uint8_t *end;   /* the central directory */
    size_t end_bytes;
    int open, fd; /* fd: of file `open`; -1: none is */
};

/** Lay out the archive of z->file [count], of which names, sizes and checksums are set. @param made_ns  wall time of all
 *  @return 0, -EFBIG, -ENOMEM. zip_close() follows in any case */
SST_MUST_CHECK int zip_open(struct zip *z, const char *dir, int64_t made_ns);
/** Read from any position before the end. @return bytes, at least one, or -errno */
SST_MUST_CHECK ssize_t zip_read(struct zip *z, int64_t at, void *out, size_t n);
void zip_close(struct zip *z);

/* --- page: index.html of a case. --- */

/** @param files  of the manifest @return text to free with free(), or NULL: no memory */
char *case_page(const char *title, const char *site, const json_t *files);

#endif

/* daemon/storage/cases.h - videos for others: visits or spans of recordings as MP4 files, with a signed manifest, alone or as a
 * case. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_STORAGE_CASES_H
#define SST_DAEMON_STORAGE_CASES_H

#include <jansson.h>

#include "base/file.h"
#include "daemon/storage/download.h"
#include "daemon/storage/storage.h"

/* storage.dir/videos/NAME/: NAME.mp4 (of several: NAME-1.mp4, ...), index.html, manifest.json. The newest stay. */

#define SST_CASE_SPANS_MAX  20
#define SST_CASE_S_MOST     3600 /* seconds of a span */
#define SST_CASE_NAME       48
#define SST_CASE_PREFIX     "video-" /* of names */

struct sst_cases; /* opaque; any thread */

struct sst_cases_config {
    struct sst_storage *storage; /* must outlive the cases */
    const char *dir;             /* storage.dir; copied */
    const char *key;             /* of signatures: the file of the private key, made when it is first needed; copied */
    const char *site;            /* place that is burnt in; copied */
};

/** A part of a recording. */
struct sst_case_span {
    int64_t from_ns, to_ns; /* wall times */
    char recording[64];     /* "": the one that holds from_ns */
    char title[128];
    json_t *visit; /* data of the visit that it shows, for the manifest; NULL: none. Its owner releases it */
};

/** Remove the rest of a killed process, and start the thread. @return 0, -ENOMEM, -EAGAIN */
SST_MUST_CHECK int sst_cases_open(struct sst_cases **out, const struct sst_cases_config *cfg);
void sst_cases_configure(struct sst_cases *c, const char *site);
/** Whether ages count, by sst_clock_is_steady(); at first they do not. */
void sst_cases_clock(struct sst_cases *c, bool steady);

/** Bytes below the folder, for the quota: called when they change, from the thread, until sst_cases_stop(). */
void sst_cases_report(struct sst_cases *c, void (*changed)(void *arg, int64_t bytes), void *arg);

/**
 * Queue a case; its videos are made one after the other, by a thread of low priority.
 *
 * @param span  [count], copied, with references to their visits @param name  out
 * @return 0, -EBUSY (four wait already), -ENOMEM
 */
SST_MUST_CHECK int sst_cases_add(struct sst_cases *c, const struct sst_case_span *span, int count,
                                 char name[SST_CASE_NAME]);

/** {videos: [{name, title, state, progress, left_s, videos, bytes, error}]}, the newest first. NULL: no memory */
json_t *sst_cases_list(struct sst_cases *c);

/** End a case that waits or is being made, or remove a finished one. @return 0, -ENOENT, -EBUSY (it is being downloaded) */
SST_MUST_CHECK int sst_cases_remove(struct sst_cases *c, const char *name);

/** Open NAME.mp4 (of a case of one video), NAME.json (the manifest) or NAME.zip (all of it).
 *  @return 0, -ENOENT, -EBUSY (it is not made yet), -EFBIG, -EBADMSG, -EIO, -ENOMEM */
SST_MUST_CHECK int sst_cases_download(struct sst_cases *c, const char *name, struct sst_download **out);

/** Public key of the signatures. @return as sst_evidence_key() */
SST_MUST_CHECK int sst_cases_key(struct sst_cases *c, char *pem, char *print);

/** Ask the thread to end: the case at work is discarded. NULL is fine. */
void sst_cases_stop(struct sst_cases *c);
/** @return true: it has ended, and the object is freed; false: the disk hangs. NULL is fine */
SST_MUST_CHECK bool sst_cases_close(struct sst_cases *c, int64_t until_ns);

#endif

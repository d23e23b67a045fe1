/* base/claim.h - claims on pieces of work: one process at a time, among processes of many machines that share a folder.
 *
 * A piece has a folder of its own that holds one file; the file's name is the state. States change by renaming alone,
 * which is atomic on local and on network file systems: of several processes that try, one succeeds.
 *
 *   (nothing) -> held.HOST.PID.RANDOM -> done | failed
 *
 * A holder touches its file as a sign of life. One that gives none for a lease has ended or hangs, and its piece may
 * be claimed again. Each observer measures the lease by its own clock from its own observations, so that machines need
 * no common time. A holder that only hung may still finish: work must give the same bytes by any process, and appear at
 * once.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_CLAIM_H
#define SST_BASE_CLAIM_H

#include <stdbool.h>

#include "base/log.h"

#define SST_CLAIM_JOB  4096 /* bytes of a job's text, with its NUL */
#define SST_CLAIM_NAME 160  /* bytes of a state's file name */

enum sst_claim_state {
    SST_CLAIM_FREE = 0,
    SST_CLAIM_HELD = 1,
    SST_CLAIM_DONE = 2,
    SST_CLAIM_FAILED = 3,
};

/** State of a piece, as stored in its file. */
struct sst_claim_info {
    enum sst_claim_state state;
    char file[SST_CLAIM_NAME]; /* "": there is none */
    int64_t touched_ns;        /* last sign of life, by the clock of the file system */
    char job[SST_CLAIM_JOB];   /* description of the work */
    char worker[100];          /* HOST.PID that holds it or ended it */
    int attempts;              /* that were begun one after the other, each by a worker that ended meanwhile but the last */
    double seconds;            /* that the last one took; of ended ones */
    char error[SST_LOG_MAX];   /* of failed ones */
};

/**
 * Look at a piece.
 * @param dir  folder of its state; a missing one is free
 * @return 0, or -EACCES, -EIO and the like, logged
 */
SST_MUST_CHECK int sst_claim_look(struct sst_claim_info *out, const char *dir);

/** Observation of a piece that another process holds. Zeroed: none. */
struct sst_claim_watch {
    char file[SST_CLAIM_NAME];
    int64_t touched_ns, since_ns;
};

/** Has the holder given no sign of life for lease_ms since this process first saw the last one? */
bool sst_claim_expired(struct sst_claim_watch *w, const struct sst_claim_info *info, int lease_ms);

struct sst_claim; /* a piece that this process holds */

/**
 * Claim a piece; a thread then gives signs of life, four a lease.
 *
 * @param dir   folder of its state; its parent exists
 * @param seen  of sst_claim_look(): free, ended, or held and expired
 * @param job   description of the work, one line; stored
 * @return 0, -EBUSY (another process was faster; not logged), or an error of the output, logged
 */
SST_MUST_CHECK int sst_claim_take(struct sst_claim **out, const char *dir, const struct sst_claim_info *seen,
                                  const char *job, int lease_ms);

/** As in struct sst_claim_info, this one included. */
int sst_claim_attempts(const struct sst_claim *c);

/**
 * End the work and free the claim.
 *
 * @param error  NULL: it is done; else why it failed, one line
 * @return 0, -ESTALE (another process has claimed it meanwhile, as after a hang; a warning is logged), or an error of
 *         the output, logged
 */
SST_MUST_CHECK int sst_claim_end(struct sst_claim *c, const char *error);

#endif

/* daemon/publish/hooks.h - programs that are run when something happens (hooks: in sstd.yaml). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_PUBLISH_HOOKS_H
#define SST_DAEMON_PUBLISH_HOOKS_H

#include "config/sstd.h"
#include "daemon/events/events.h"

#define SST_HOOKS_AT_ONCE 4  /* programs that run at a time */
#define SST_HOOKS_WAITING 64 /* runs that wait for a free one; further runs are dropped and counted */

struct sst_hooks; /* opaque; open, configure and close on one thread */

struct sst_hooks_config {
    struct sst_events *events; /* must outlive the hooks; events already stored are handled, too */
    const struct sst_hook *hook;
    int hooks;
    int limit_ms; /* a program is killed after this; 0: 30 s */
};

struct sst_hooks_counters {
    uint64_t run;
    uint64_t failed;  /* could not be started, or ended with another status than 0 */
    uint64_t killed;  /* did not end in time; counted as failed, too */
    uint64_t dropped; /* not run: too many were waiting, or the event was overwritten before it was read */
    int running, waiting;
};

/**
 * Follow the events on a separate thread and run the programs that are configured for each.
 *
 * No shell is involved. Each program runs in its own process group, with empty standard input, its output on our
 * standard error, all other descriptors closed and default signal handling. Its environment lacks systemd's variables
 * and has SST_EVENT, SST_LEVEL, SST_MESSAGE, SST_TIME, SST_ID, SST_DATA (JSON) and each member of data as
 * SST_<MEMBER>. When it ends, the rest of its group is killed. A status is logged if it differs from the last run's.
 *
 * @return 0, -EINVAL, -ENOMEM, -ENOSPC (too many watchers of the events)
 */
SST_MUST_CHECK int sst_hooks_open(struct sst_hooks **out, const struct sst_hooks_config *cfg);

/** Replace the programs; waiting runs of the old ones are dropped. */
void sst_hooks_configure(struct sst_hooks *h, const struct sst_hook *hook, int hooks);

void sst_hooks_counters(struct sst_hooks *h, struct sst_hooks_counters *out);

/** Start to shut down; sst_hooks_close() waits for the end. NULL is fine. */
void sst_hooks_stop(struct sst_hooks *h);

/** Kills running programs and frees; within half a second. NULL is fine. */
void sst_hooks_close(struct sst_hooks *h);

#endif

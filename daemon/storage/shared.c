/* State that the threads of storage share: waits, refusals, reserved entries and used bytes. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/thread.h"
#include "daemon/storage/storage_internal.h"

void store_wait_locked(struct sst_storage *s, int ms)
{
    (void)sst_cond_wait_until(&s->wake, &s->lock, sst_clock_now_ns() + (int64_t)ms * 1000000);
}

/* After the deadline waits a little longer, once: on a machine that stood still the time passed without running the
 * thread that is to answer. */
bool store_wait_answer_locked(struct sst_storage *s, int64_t until_ns)
{
    const int64_t now_ns = sst_clock_now_ns();

    if (now_ns >= until_ns)
        return sst_cond_wait_until(&s->answered, &s->lock, now_ns + SST_STORE_GRACE_NS);
    (void)sst_cond_wait_until(&s->answered, &s->lock, until_ns);
    return true;
}

void store_thread_ends(struct sst_storage *s)
{
    pthread_mutex_lock(&s->lock);
    s->threads--;
    pthread_cond_broadcast(&s->answered);
    pthread_mutex_unlock(&s->lock);
}

void store_busy(struct sst_storage *s, int64_t *since_ns, bool busy)
{
    pthread_mutex_lock(&s->lock);
    *since_ns = busy ? sst_clock_now_ns() : 0;
    pthread_mutex_unlock(&s->lock);
}

int store_refusal_locked(const struct sst_storage *s)
{
    const int err = s->folder_err ? s->folder_err : s->write_err;

    if (!s->blocked && !s->write_err)
        return 0;
    if (!err)
        return s->limit == SST_TROUBLE_LIMIT ? -ENOSPC : -EIO;
    return err == -ENOSPC || err == -EROFS || err == -EBUSY ? err : -EIO;
}

struct sst_recorder_track *store_tracks(struct sst_storage *s)
{
    struct sst_recorder_track *copy = malloc(SST_CAMERAS_MAX * sizeof(*copy));

    if (copy) {
        pthread_mutex_lock(&s->lock);
        memcpy(copy, s->tracks, SST_CAMERAS_MAX * sizeof(*copy));
        pthread_mutex_unlock(&s->lock);
    }
    return copy;
}

int64_t video_files_bytes_locked(const struct sst_storage *s)
{
    int64_t bytes = 0;

    for (int i = 0; i < SST_DOWNLOADS_MAX; i++)
        bytes += s->video[i].bytes;
    return bytes;
}

int64_t store_used_locked(const struct sst_storage *s)
{
    int64_t used = video_files_bytes_locked(s);

    for (int i = 0; i < SST_STORAGE_ASIDES; i++)
        used += s->aside_bytes[i];
    for (int i = 0; i < s->catalog.count; i++)
        used += s->catalog.entry[i].bytes;
    return used;
}

int store_reserve(struct sst_storage *s, int attempt, struct store_entry *entry)
{
    struct store_entry made = {
        .kind = entry->kind, .stage = SST_STORE_ACTIVE, .from_ns = entry->from_ns, .to_ns = entry->from_ns
    };
    int err;

    store_name(made.name, made.kind, made.from_ns, attempt);
    memcpy(made.why, entry->why, sizeof(made.why));
    pthread_mutex_lock(&s->lock);
    made.order = s->catalog.order + 1;
    err = catalog_find(&s->catalog, made.name) ? -EEXIST : catalog_add(&s->catalog, &made);
    pthread_mutex_unlock(&s->lock);
    if (!err)
        *entry = made;
    return err;
}

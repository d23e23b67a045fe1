/* Removal, because of the limits or by a client. Runs on sst-retention, which waits for the disk; a client that deletes
 * waits for a limited time. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/recording/trim.h"
#include "daemon/storage/storage_internal.h"

/* Renamed first, so that after a kill the rest is no recording any more. */
static int out_of_name(struct sst_storage *s, const struct store_entry *e, char gone[SST_PATH_MAX])
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, s->folder[e->kind], e->name);

    if (!err && snprintf(gone, SST_PATH_MAX, "%s.tmp-removed", path) >= SST_PATH_MAX)
        err = -ENAMETOOLONG;
    if (!err && rename(path, gone) && errno != ENOENT)
        err = -errno;
    return err;
}

/* Removing the files of an hour takes a while and does not count as a hung disk. */
static void remove_files(struct sst_storage *s, const char *gone)
{
    store_busy(s, &s->retention_busy_ns, false);
    sst_path_remove_tree(gone);
    store_busy(s, &s->retention_busy_ns, true);
}

int store_remove(struct sst_storage *s, const struct store_entry *entry)
{
    struct store_entry *e;
    char gone[SST_PATH_MAX];
    const int err = out_of_name(s, entry, gone);

    if (!err)
        remove_files(s, gone);
    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, entry->name);
    if (!err && e) {
        s->removed[entry->kind]++;
        catalog_remove(&s->catalog, entry->name);
    } else if (e) {
        e->stage = SST_STORE_KEPT;
    }
    pthread_mutex_unlock(&s->lock);
    return err;
}

/* Update the catalog. @return true: the recording has ended, so its storage.json is to be updated too */
static bool note_trimmed(struct sst_storage *s, const struct store_entry *entry, int64_t bytes,
                         const struct sst_recording_removed *now, struct store_entry *out)
{
    struct store_entry *e;
    uint64_t sets;

    pthread_mutex_lock(&s->lock);
    s->trimmed++;
    e = catalog_find(&s->catalog, entry->name);
    if (e) {
        sets = now->sets > e->gone ? now->sets - e->gone : 0;
        e->from_ns = now->wall_ns;
        e->gone = now->sets;
        e->sets -= sets < e->sets ? sets : e->sets;
        e->bytes -= bytes < e->bytes ? bytes : e->bytes;
        *out = *e;
    }
    pthread_mutex_unlock(&s->lock);
    return e && out->stage == SST_STORE_DONE;
}

int store_trim(struct sst_storage *s, const struct store_entry *entry)
{
    struct sst_recording_removed now;
    struct store_entry e;
    char path[SST_PATH_MAX];
    int64_t bytes;
    int err = sst_path_join(path, s->folder[entry->kind], entry->name);

    if (!err)
        err = sst_recording_trim(path, entry->stage == SST_STORE_ACTIVE ? SST_STORE_SEGMENTS : 1, &now, &bytes);
    if (err)
        return err;
    if (note_trimmed(s, entry, bytes, &now, &e) && store_write(path, &e))
        sst_log_debug("%s: its storage.json is out of date", path);
    return 0;
}

/* The call that deletes returns as soon as the folder has been renamed. */
static void remove_deleted(struct sst_storage *s, const struct store_entry *entry)
{
    struct store_entry *e;
    char gone[SST_PATH_MAX];
    const int err = out_of_name(s, entry, gone);

    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, entry->name);
    if (!err) {
        s->deleted++;
        catalog_remove(&s->catalog, entry->name);
        s->used_bytes = store_used_locked(s);
    } else if (e) {
        e->deleted_by_hand = false;
    }
    pthread_cond_broadcast(&s->answered);
    pthread_mutex_unlock(&s->lock);
    if (err) {
        sst_log_warning("cannot remove %s/%s, which a client deleted: %s", s->folder[entry->kind], entry->name,
                        strerror(-err));
        return;
    }
    sst_log_info("%s/%s was deleted by a client", s->folder[entry->kind], entry->name);
    remove_files(s, gone);
}

/* @return false: there is none */
static bool find_deleted(struct sst_storage *s, struct store_entry *out)
{
    bool found = false;

    pthread_mutex_lock(&s->lock);
    for (int i = 0; !found && i < s->catalog.count; i++) {
        found = s->catalog.entry[i].deleted_by_hand;
        if (found)
            *out = s->catalog.entry[i];
    }
    pthread_mutex_unlock(&s->lock);
    return found;
}

void store_remove_deleted(struct sst_storage *s)
{
    struct store_entry e;

    while (find_deleted(s, &e))
        remove_deleted(s, &e);
}

int sst_storage_delete(struct sst_storage *s, const char *name)
{
    const int64_t until_ns = sst_clock_now_ns() + SST_STORE_ANSWER_MS * INT64_C(1000000);
    struct store_entry *e;
    int err = 0;

    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, name);
    if (!e || e->deleted_by_hand)
        err = -ENOENT;
    else if (e->stage == SST_STORE_ACTIVE || s->stop)
        err = -EBUSY;
    else if (s->folder_err || !s->ready)
        err = s->folder_err == -EROFS ? -EROFS : -EIO;
    if (!err) {
        e->deleted_by_hand = true;
        pthread_cond_broadcast(&s->wake);
        while ((e = catalog_find(&s->catalog, name)) && e->deleted_by_hand && !s->stop &&
               store_wait_answer_locked(s, until_ns))
            ;
        err = e && !e->deleted_by_hand ? -EIO : 0; /* longer removals continue in the background */
    }
    pthread_mutex_unlock(&s->lock);
    return err;
}

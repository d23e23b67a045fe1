/* What goes: because the limits say so, or because somebody deleted it. On sst-keep's thread, which waits for the disk;
 * who deletes waits for a while at most. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "capture/recording/shorten.h"
#include "daemon/storage/storage_internal.h"

/* First out of its name, so that what is left of it after a kill is no recording any more. */
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

/* The files of an hour take a while to go: that is no disk that hangs. */
static void remove_files(struct sst_storage *s, const char *gone)
{
    store_busy(s, &s->keep_busy_ns, false);
    sst_path_remove_tree(gone);
    store_busy(s, &s->keep_busy_ns, true);
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

/* What the catalog says of it from now on. @return it has ended, and its storage.json is to say so, too */
static bool note_shorter(struct sst_storage *s, const struct store_entry *entry, int64_t bytes,
                         const struct sst_recording_removed *now, struct store_entry *out)
{
    struct store_entry *e;
    uint64_t sets;

    pthread_mutex_lock(&s->lock);
    s->shortened++;
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

int store_shorten(struct sst_storage *s, const struct store_entry *entry)
{
    struct sst_recording_removed now;
    struct store_entry e;
    char path[SST_PATH_MAX];
    int64_t bytes;
    int err = sst_path_join(path, s->folder[entry->kind], entry->name);

    if (!err)
        err = sst_recording_shorten(path, entry->stage == SST_STORE_ACTIVE ? SST_STORE_SEGMENTS : 1, &now, &bytes);
    if (err)
        return err;
    if (note_shorter(s, entry, bytes, &now, &e) && store_write(path, &e))
        sst_log_debug("%s: it says of itself that it begins earlier", path);
    return 0;
}

/* Who deleted it is answered as soon as it has left its name. */
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
        e->doomed = false;
    }
    pthread_cond_broadcast(&s->answered);
    pthread_mutex_unlock(&s->lock);
    if (err) {
        sst_log_warning("%s/%s was deleted by hand, but cannot be removed: %s", s->folder[entry->kind], entry->name,
                        strerror(-err));
        return;
    }
    sst_log_info("%s/%s was deleted by hand", s->folder[entry->kind], entry->name);
    remove_files(s, gone);
}

/* @return false: there is none */
static bool find_doomed(struct sst_storage *s, struct store_entry *out)
{
    bool found = false;

    pthread_mutex_lock(&s->lock);
    for (int i = 0; !found && i < s->catalog.count; i++) {
        found = s->catalog.entry[i].doomed;
        if (found)
            *out = s->catalog.entry[i];
    }
    pthread_mutex_unlock(&s->lock);
    return found;
}

void store_remove_doomed(struct sst_storage *s)
{
    struct store_entry e;

    while (find_doomed(s, &e))
        remove_deleted(s, &e);
}

int sst_storage_delete(struct sst_storage *s, const char *name)
{
    const int64_t until_ns = sst_clock_now_ns() + SST_STORE_ANSWER_MS * INT64_C(1000000);
    struct store_entry *e;
    int err = 0;

    pthread_mutex_lock(&s->lock);
    e = catalog_find(&s->catalog, name);
    if (!e || e->doomed)
        err = -ENOENT;
    else if (e->stage == SST_STORE_ACTIVE || s->stop)
        err = -EBUSY;
    else if (s->folder_err || !s->ready)
        err = s->folder_err == -EROFS ? -EROFS : -EIO;
    if (!err) {
        e->doomed = true;
        pthread_cond_broadcast(&s->wake);
        while ((e = catalog_find(&s->catalog, name)) && e->doomed && !s->stop && store_wait_answer_locked(s, until_ns))
            ;
        err = e && !e->doomed ? -EIO : 0; /* what takes longer goes on by itself */
    }
    pthread_mutex_unlock(&s->lock);
    return err;
}

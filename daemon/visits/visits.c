/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/visits/visits_internal.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "base/stats.h"
#include "base/thread.h"

#define PICTURE_MOST ((size_t)64 << 20)
#define KEEP         "-keep" /* an empty file of this ending: the visit stays when its day is removed */
#define BUSY_MS      3000
#define LOOK_NS      INT64_C(600000000000) /* between looks for days that have become too old */
#define SHARE        10 /* one part in this of the room is for visits */
#define SLACK        20 /* one part in this of the share is free after a removal */

const char *const visits_picture_files[2] = { "-camera.jpg", "-seen.jpg" };

static bool is_day(const char *text)
{
    static const char form[] = "dddd-dd-dd";

    for (int i = 0; i < DAY; i++)
        if (form[i] == 'd' ? text[i] < '0' || text[i] > '9' : text[i] != form[i])
            return false;
    return true;
}

bool visits_is_name(const char *text)
{
    return text && strlen(text) <= NAME_LENGTH && is_day(text) && strspn(text, "0123456789TZ-") == strlen(text);
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

int visits_day_path(char out[SST_PATH_MAX], const struct sst_visits *v, const char *name, const char *file)
{
    char day[SST_PATH_MAX], text[DAY + 1];
    int err;

    snprintf(text, sizeof(text), "%.*s", DAY, name);
    err = sst_path_join(day, v->dir, text);
    return err ? err : sst_path_join(out, day, file);
}

/* Path of a file of a visit. */
int visits_file_path(char out[SST_PATH_MAX], const struct sst_visits *v, const char *visit, const char *ending)
{
    char file[NAME_LENGTH + 32];

    snprintf(file, sizeof(file), "%s%s", visit, ending);
    return visits_day_path(out, v, visit, file);
}

/* @param first  of this process on that day: the last line of one that was killed may have no end */
static int append(const char *path, const void *data, size_t bytes, bool first)
{
    const int fd = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0666);
    const bool apart = fd >= 0 && first && lseek(fd, 0, SEEK_END) > 0 && write(fd, "\n", 1) != 1;
    const ssize_t n = fd < 0 || apart ? -1 : write(fd, data, bytes);
    const int err = n == (ssize_t)bytes ? 0 : n < 0 ? -errno : -ENOSPC;

    if (fd >= 0)
        close(fd);
    return err;
}

int64_t visits_file_bytes(const char *path)
{
    struct stat st;

    return stat(path, &st) ? 0 : (int64_t)st.st_size;
}

static int write_job(struct sst_visits *v, const struct job *job)
{
    char path[SST_PATH_MAX];
    int64_t before;
    int err = visits_day_path(path, v, job->name, NULL);

    err = err ? err : sst_path_make_dir(v->dir);
    err = err ? err : sst_path_make_dir(path);
    if (!err)
        err = job->picture < 0 ? visits_day_path(path, v, job->name, VISITS_LINES)
                               : visits_file_path(path, v, job->name, visits_picture_files[job->picture]);
    if (err)
        return err;
    before = visits_file_bytes(path);
    err = job->picture < 0 ? append(path, job->data, job->bytes, strncmp(v->begun, job->name, DAY) != 0)
                           : sst_file_write(path, job->data, job->bytes);
    if (job->picture < 0 && !err)
        snprintf(v->begun, sizeof(v->begun), "%.*s", DAY, job->name);
    v->bytes += visits_file_bytes(path) - before;
    return err;
}

static int is_folder_of_day(const struct dirent *e)
{
    return is_day(e->d_name) && !e->d_name[DAY];
}

static int newest_first(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*b)->d_name, (*a)->d_name);
}

int visits_days(const struct sst_visits *v, struct dirent ***out)
{
    *out = NULL;
    return sst_max_int(scandir(v->dir, out, is_folder_of_day, newest_first), 0);
}

/* --- removing ----------------------------------------------------------------------------------------------------- */

const char *visits_text(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));

    return text ? text : "";
}

bool visits_is_kept(const struct sst_visits *v, const char *visit)
{
    char path[SST_PATH_MAX];

    return !visits_file_path(path, v, visit, KEEP) && !access(path, F_OK);
}

/* @return bytes that are free now */
static int64_t remove_files(struct sst_visits *v, const char *visit)
{
    static const char *const endings[] = { "-camera.jpg", "-seen.jpg", KEEP };
    char path[SST_PATH_MAX];
    int64_t freed = 0;

    for (size_t i = 0; i < ARRAY_LEN(endings); i++) {
        if (visits_file_path(path, v, visit, endings[i]))
            continue;
        freed += visits_file_bytes(path);
        (void)unlink(path);
    }
    v->bytes -= freed;
    return freed;
}

/* Write a day's lines again without some visits, or (doomed NULL) with kept ones' only, and remove the others'
 * files.
 * @param doomed  keys are their names @param least  remove the oldest others only, until this number of bytes is free
 * @param kept  out, lines that stay @return 0, or of reading or writing; not logged */
static int thin(struct sst_visits *v, const char *day, const json_t *doomed, int64_t least, int *kept)
{
    json_t *gone = json_object();
    int64_t freed = 0;
    char path[SST_PATH_MAX], why[SST_LOG_MAX] = "", *held, *next = NULL;
    uint8_t *data = NULL;
    char *left;
    size_t size, n = 0;
    int err = visits_day_path(path, v, day, VISITS_LINES);

    *kept = 0;
    held = sst_log_hold_errors(why);
    err = err ? err : sst_file_read(path, DAY_MOST, &data, &size);
    left = err ? NULL : malloc(size + 1);
    err = err || left ? err : -ENOMEM;
    for (char *line = err ? NULL : strtok_r((char *)data, "\n", &next); line; line = strtok_r(NULL, "\n", &next)) {
        json_t *o = json_loads(line, 0, NULL);
        const char *name = visits_text(o, "visit");
        const bool stays =
            visits_is_name(name) && (doomed ? !json_object_get(doomed, name)
                                            : visits_is_kept(v, name) || (freed >= least && !json_object_get(gone, name)));

        if (stays) {
            n += (size_t)snprintf(left + n, size + 1 - n, "%s\n", line);
            ++*kept;
        } else if (visits_is_name(name)) {
            freed += remove_files(v, name) + (int64_t)strlen(line) + 1;
            json_object_set_new(gone, name, json_true());
        }
        json_decref(o);
    }
    err = err ? err : sst_file_write(path, left, n);
    v->bytes -= err ? 0 : (int64_t)size - (int64_t)n;
    visits_forget_reviews(v, day, gone);
    sst_log_hold_errors(held);
    json_decref(gone);
    free(left);
    free(data);
    return err;
}

static int count_kept(const char *day)
{
    DIR *dir = opendir(day);
    int found = 0;

    for (const struct dirent *e; dir && (e = readdir(dir));) {
        const size_t n = strlen(e->d_name), m = strlen(KEEP);

        found += n > m && !strcmp(e->d_name + n - m, KEEP);
    }
    if (dir)
        closedir(dir);
    return found;
}

static int64_t bytes_in(const char *day)
{
    DIR *dir = opendir(day);
    char path[SST_PATH_MAX];
    int64_t bytes = 0;

    for (const struct dirent *e; dir && (e = readdir(dir));)
        if (e->d_name[0] != '.' && !sst_path_join(path, day, e->d_name))
            bytes += visits_file_bytes(path);
    if (dir)
        closedir(dir);
    return bytes;
}

static void remove_day(struct sst_visits *v, const char *day)
{
    v->bytes -= bytes_in(day);
    sst_path_remove_tree(day);
}

/* Once a day, and for another number of days. */
static void remove_old(struct sst_visits *v, int days)
{
    char oldest[SST_CLOCK_TEXT], path[SST_PATH_MAX];
    struct dirent **day;
    int n;

    sst_clock_text(oldest, sst_clock_wall_ns() - (int64_t)days * 86400 * INT64_C(1000000000));
    if (!days || !strncmp(v->swept, oldest, DAY))
        return;
    snprintf(v->swept, sizeof(v->swept), "%.*s", DAY, oldest);
    n = visits_days(v, &day);
    for (int i = 0; i < n; i++) {
        int kept = 0;

        /* A day that cannot be read has nothing that can be shown. */
        if (strncmp(day[i]->d_name, oldest, DAY) < 0 && !sst_path_join(path, v->dir, day[i]->d_name) &&
            (!count_kept(path) || (!thin(v, day[i]->d_name, NULL, INT64_MAX, &kept) && !kept)))
            remove_day(v, path);
        free(day[i]);
    }
    free(day);
}

/* The share of visits; 0: no limit is known. */
static int64_t share_of(struct sst_visits *v)
{
    struct statvfs disk;
    int64_t room;
    bool limited;

    pthread_mutex_lock(&v->lock);
    room = v->room_bytes;
    limited = v->limited;
    pthread_mutex_unlock(&v->lock);
    if (limited && !room && !statvfs(v->dir, &disk))
        room = (int64_t)fmin((double)disk.f_blocks * (double)disk.f_frsize, 9e18);
    return limited ? room / SHARE : 0;
}

/* Beyond the share the oldest go. Under files. */
static void apply_share(struct sst_visits *v)
{
    const int64_t share = share_of(v), goal = share - share / SLACK;
    char path[SST_PATH_MAX];
    struct dirent **day;
    int n, marked = 0, kept;
    bool full;

    if (!share || v->bytes <= share)
        return;
    n = visits_days(v, &day);
    for (int i = n; i-- > 0;) { /* the oldest first */
        kept = 0;
        if (sst_path_join(path, v->dir, day[i]->d_name))
            path[0] = 0;
        if (v->bytes > goal && !(v->full && i) && !thin(v, day[i]->d_name, NULL, v->bytes - goal, &kept) && !kept)
            remove_day(v, path);
        marked += count_kept(path);
        free(day[i]);
    }
    free(day);
    full = v->bytes > share;
    if (full && !v->full)
        sst_log_warning("%d visits that are kept for good in %s take %.3g GB, more than the tenth of the room that "
                        "visits have: others are not stored; delete some, or raise storage.quota_gb",
                        marked, v->dir, (double)v->bytes * 1e-9);
    v->full = full;
}

/* Under files. */
static void count_all(struct sst_visits *v)
{
    char path[SST_PATH_MAX];
    struct dirent **day;
    const int n = visits_days(v, &day);

    v->bytes = 0;
    for (int i = 0; i < n; i++) {
        if (!sst_path_join(path, v->dir, day[i]->d_name))
            v->bytes += bytes_in(path);
        free(day[i]);
    }
    free(day);
}

static void report(struct sst_visits *v, int64_t bytes)
{
    pthread_mutex_lock(&v->lock); /* held: nobody is called after sst_visits_close() */
    if (v->report && !v->stop)
        v->report(v->report_arg, bytes);
    pthread_mutex_unlock(&v->lock);
}

static void *run(void *arg)
{
    struct sst_visits *v = arg;
    char why[SST_LOG_MAX];

    sst_thread_name("sst-visits");
    pthread_mutex_lock(&v->files);
    count_all(v);
    pthread_mutex_unlock(&v->files);
    pthread_mutex_lock(&v->lock);
    while (!v->stop || v->jobs) {
        struct job job;
        int64_t bytes;
        int err;

        if (v->relimited) {
            const int days = v->steady ? v->days : 0;

            v->relimited = false;
            pthread_mutex_unlock(&v->lock);
            pthread_mutex_lock(&v->files);
            remove_old(v, days);
            apply_share(v);
            bytes = v->bytes;
            pthread_mutex_unlock(&v->files);
            report(v, bytes);
            pthread_mutex_lock(&v->lock);
        }
        if (!v->jobs) {
            if (!v->stop && !v->relimited)
                v->relimited |= !sst_cond_wait_until(&v->changed, &v->lock, sst_clock_now_ns() + LOOK_NS);
            continue;
        }
        job = v->job[0];
        memmove(&v->job[0], &v->job[1], (size_t)--v->jobs * sizeof(job));
        pthread_mutex_unlock(&v->lock);
        sst_log_hold_errors(why); /* one sentence for all that fail */
        pthread_mutex_lock(&v->files);
        err = write_job(v, &job);
        sst_log_hold_errors(NULL);
        if (err && !v->failed)
            sst_log_warning("visit %s cannot be stored in %s: %s; until this changes visits are events only", job.name,
                            v->dir, strerror(-err));
        v->failed = err;
        apply_share(v);
        bytes = v->bytes;
        pthread_mutex_unlock(&v->files);
        report(v, bytes);
        free(job.data);
        pthread_mutex_lock(&v->lock);
    }
    v->ended = true;
    pthread_cond_broadcast(&v->changed);
    pthread_mutex_unlock(&v->lock);
    return NULL;
}

int sst_visits_open(struct sst_visits **out, const char *dir, int days)
{
    struct sst_visits *v = calloc(1, sizeof(*v));
    int err;

    if (!v)
        return -ENOMEM;
    snprintf(v->dir, sizeof(v->dir), "%s", dir);
    v->days = days;
    sst_clock_text(v->start, sst_clock_wall_ns());
    pthread_mutex_init(&v->files, NULL);
    pthread_mutex_init(&v->lock, NULL);
    sst_cond_init(&v->changed);
    err = -pthread_create(&v->thread, NULL, run, v);
    if (err) {
        pthread_cond_destroy(&v->changed);
        pthread_mutex_destroy(&v->lock);
        pthread_mutex_destroy(&v->files);
        free(v);
        return err;
    }
    *out = v;
    return 0;
}

void sst_visits_configure(struct sst_visits *v, int days)
{
    pthread_mutex_lock(&v->lock);
    v->days = days;
    v->relimited = true;
    pthread_cond_broadcast(&v->changed);
    pthread_mutex_unlock(&v->lock);
}

void sst_visits_clock(struct sst_visits *v, bool steady)
{
    pthread_mutex_lock(&v->lock);
    if (v->steady != steady) {
        v->steady = steady;
        v->relimited = true;
        pthread_cond_broadcast(&v->changed);
    }
    pthread_mutex_unlock(&v->lock);
}

void sst_visits_limit(struct sst_visits *v, int64_t room_bytes, void (*changed)(void *arg, int64_t bytes), void *arg)
{
    pthread_mutex_lock(&v->lock);
    v->room_bytes = room_bytes;
    v->report = changed;
    v->report_arg = arg;
    v->limited = v->relimited = true;
    pthread_cond_broadcast(&v->changed);
    pthread_mutex_unlock(&v->lock);
}

/* @param data  owned */
static void put(struct sst_visits *v, const char *name, int picture, uint8_t *data, size_t bytes)
{
    struct job *job;

    pthread_mutex_lock(&v->lock);
    if (!v->dir[0] || !v->days || !visits_is_name(name) || v->stop) {
        pthread_mutex_unlock(&v->lock);
        free(data);
        return;
    }
    if (v->jobs == WAITING) {
        free(v->job[0].data);
        memmove(&v->job[0], &v->job[1], (size_t)--v->jobs * sizeof(*job));
    }
    job = &v->job[v->jobs++];
    *job = (struct job){ .picture = picture, .data = data, .bytes = bytes };
    snprintf(job->name, sizeof(job->name), "%s", name);
    pthread_cond_broadcast(&v->changed);
    pthread_mutex_unlock(&v->lock);
}

void sst_visits_put(struct sst_visits *v, const json_t *data)
{
    char *text = json_dumps(data, JSON_COMPACT | JSON_REAL_PRECISION(9));
    const size_t n = text ? strlen(text) : 0;
    char *line = text ? realloc(text, n + 2) : NULL;

    if (!line) {
        free(text);
        return;
    }
    memcpy(line + n, "\n", 2);
    put(v, json_string_value(json_object_get(data, "visit")), -1, (uint8_t *)line, n + 1);
}

void sst_visits_put_picture(struct sst_visits *v, const char *visit, enum sst_visit_picture kind, uint8_t *jpeg,
                            size_t bytes)
{
    put(v, visit, kind, jpeg, bytes);
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

int sst_visits_read_picture(struct sst_visits *v, const char *visit, enum sst_visit_picture kind, uint8_t **data,
                            size_t *size)
{
    char path[SST_PATH_MAX], why[SST_LOG_MAX] = "", *held;
    int err;

    if (!visits_is_name(visit))
        return -EINVAL;
    err = visits_file_path(path, v, visit, visits_picture_files[kind]);
    held = sst_log_hold_errors(why);
    err = err ? err : sst_file_read(path, PICTURE_MOST, data, size);
    sst_log_hold_errors(held);
    return err;
}

static int lock_files(struct sst_visits *v)
{
    struct timespec until;

    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += BUSY_MS / 1000;
    return pthread_mutex_timedlock(&v->files, &until) ? -EBUSY : 0;
}

/* --- changing ----------------------------------------------------------------------------------------------------- */

static void fail(json_t *failed, const json_t *names, int err)
{
    const char *name;
    json_t *one;

    json_object_foreach((json_t *)(uintptr_t)names, name, one) json_object_set_new(failed, name, json_integer(err));
}

static int keep(struct sst_visits *v, const char *visit, bool on)
{
    char path[SST_PATH_MAX];
    int err = visits_file_path(path, v, visit, KEEP), fd;

    if (err || !on)
        return err ? err : unlink(path) && errno != ENOENT ? -errno : 0;
    fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    err = fd < 0 ? -errno : 0;
    if (fd >= 0)
        close(fd);
    return err;
}

/* Change visits of one day. @param names  keys */
static void change_day(struct sst_visits *v, const json_t *names, enum sst_visits_change what, const char *user,
                       json_t *failed)
{
    json_t *all = NULL, *found = json_object(), *one;
    const bool on = what == SST_VISITS_KEEP || what == SST_VISITS_REVIEWED;
    const bool kept = what == SST_VISITS_KEEP || what == SST_VISITS_RELEASE;
    char day[DAY + 1] = "";
    const char *name;
    int err, left;

    json_object_foreach((json_t *)(uintptr_t)names, name, one)
    {
        const json_t *data;

        if (!all) {
            snprintf(day, sizeof(day), "%.*s", DAY, name);
            all = v->dir[0] ? visits_read_day(v, day) : json_object();
        }
        data = json_object_get(all, name);
        err = !data ? -ENOENT
              : what == SST_VISITS_DELETE && json_is_true(json_object_get(data, "active")) &&
                      strcmp(visits_text(data, "from"), v->start) >= 0
                  ? -EINPROGRESS
                  : 0;
        err = !err && kept ? keep(v, name, on) : err;
        json_object_set_new(err ? failed : found, name, json_integer(err));
    }
    if (!kept && json_object_size(found)) {
        err = what == SST_VISITS_DELETE ? thin(v, day, found, INT64_MAX, &left) : visits_review(v, found, user, on);
        if (err)
            fail(failed, found, err);
    }
    if (!on)
        v->full = false; /* there may be something to remove again */
    json_decref(found);
    json_decref(all);
}

int sst_visits_change(struct sst_visits *v, const json_t *names, enum sst_visits_change what, const char *user,
                      json_t *failed)
{
    json_t *days = json_object(), *one;
    const char *day;
    int err = lock_files(v);
    size_t i;

    if (err || !days) {
        json_decref(days);
        return err ? err : -ENOMEM;
    }
    json_array_foreach(names, i, one)
    {
        const char *name = json_string_value(one);
        char text[DAY + 1];

        if (!visits_is_name(name)) {
            json_object_set_new(failed, name ? name : "", json_integer(-ENOENT));
            continue;
        }
        snprintf(text, sizeof(text), "%.*s", DAY, name);
        if (!json_object_get(days, text))
            json_object_set_new(days, text, json_object());
        json_object_set_new(json_object_get(days, text), name, json_true());
    }
    json_object_foreach(days, day, one) change_day(v, one, what, user, failed);
    pthread_mutex_unlock(&v->files);
    json_decref(days);
    pthread_mutex_lock(&v->lock);
    v->relimited |= v->limited; /* the bytes are reported */
    pthread_cond_broadcast(&v->changed);
    pthread_mutex_unlock(&v->lock);
    return 0;
}

void sst_visits_close(struct sst_visits *v, int wait_ms)
{
    const int64_t end_ns = sst_clock_now_ns() + (int64_t)wait_ms * 1000000;
    bool ended;

    if (!v)
        return;
    pthread_mutex_lock(&v->lock);
    v->stop = true;
    v->report = NULL;
    pthread_cond_broadcast(&v->changed);
    while (!v->ended && sst_cond_wait_until(&v->changed, &v->lock, end_ns))
        ;
    ended = v->ended;
    pthread_mutex_unlock(&v->lock);
    if (!ended)
        return; /* the disk hangs: the process ends with it */
    pthread_join(v->thread, NULL);
    for (int i = 0; i < v->jobs; i++)
        free(v->job[i].data);
    pthread_cond_destroy(&v->changed);
    pthread_mutex_destroy(&v->lock);
    pthread_mutex_destroy(&v->files);
    free(v);
}

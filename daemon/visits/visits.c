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

#define LINES        "visits.jsonl"
#define PICTURE_MOST ((size_t)64 << 20)
#define KEEP         "-keep" /* an empty file of this ending: the visit stays when its day is removed */
#define BUSY_MS      3000
#define SHARE        10 /* one part in this of the room is for visits */
#define SLACK        20 /* one part in this of the share is free after a removal */

static const char *const picture_files[] = { "-camera.jpg", "-seen.jpg" };
static const char *const picture_names[] = { "camera", "seen" };

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
static int file_path(char out[SST_PATH_MAX], const struct sst_visits *v, const char *visit, const char *ending)
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
        err = job->picture < 0 ? visits_day_path(path, v, job->name, LINES)
                               : file_path(path, v, job->name, picture_files[job->picture]);
    if (err)
        return err;
    before = visits_file_bytes(path);
    err = job->picture < 0 ? append(path, job->data, job->bytes, strncmp(v->swept, job->name, DAY) != 0)
                           : sst_file_write(path, job->data, job->bytes);
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

static const char *text_of(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));

    return text ? text : "";
}

static bool is_kept(const struct sst_visits *v, const char *visit)
{
    char path[SST_PATH_MAX];

    return !file_path(path, v, visit, KEEP) && !access(path, F_OK);
}

/* @return bytes that are free now */
static int64_t remove_files(struct sst_visits *v, const char *visit)
{
    static const char *const endings[] = { "-camera.jpg", "-seen.jpg", KEEP };
    char path[SST_PATH_MAX];
    int64_t freed = 0;

    for (size_t i = 0; i < ARRAY_LEN(endings); i++) {
        if (file_path(path, v, visit, endings[i]))
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
    int err = visits_day_path(path, v, day, LINES);

    *kept = 0;
    held = sst_log_hold_errors(why);
    err = err ? err : sst_file_read(path, DAY_MOST, &data, &size);
    left = err ? NULL : malloc(size + 1);
    err = err || left ? err : -ENOMEM;
    for (char *line = err ? NULL : strtok_r((char *)data, "\n", &next); line; line = strtok_r(NULL, "\n", &next)) {
        json_t *o = json_loads(line, 0, NULL);
        const char *name = text_of(o, "visit");
        const bool stays =
            visits_is_name(name) && (doomed ? !json_object_get(doomed, name)
                                            : is_kept(v, name) || (freed >= least && !json_object_get(gone, name)));

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

/* Once for each day that something is stored in. */
static void remove_old(struct sst_visits *v, const char *name, int days)
{
    char oldest[SST_CLOCK_TEXT], path[SST_PATH_MAX];
    struct dirent **day;
    int n;

    if (!strncmp(v->swept, name, DAY))
        return;
    snprintf(v->swept, sizeof(v->swept), "%.*s", DAY, name);
    sst_clock_text(oldest, sst_clock_wall_ns() - (int64_t)days * 86400 * INT64_C(1000000000));
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
        int days = v->days, err;
        int64_t bytes;

        if (v->relimited) {
            v->relimited = false;
            pthread_mutex_unlock(&v->lock);
            pthread_mutex_lock(&v->files);
            apply_share(v);
            bytes = v->bytes;
            pthread_mutex_unlock(&v->files);
            report(v, bytes);
            pthread_mutex_lock(&v->lock);
        }
        if (!v->jobs) {
            if (!v->stop && !v->relimited)
                pthread_cond_wait(&v->changed, &v->lock);
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
        remove_old(v, job.name, days);
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

/* --- reading ------------------------------------------------------------------------------------------------------ */

static bool has_zone(const json_t *data, const char *zone)
{
    const json_t *one;
    size_t i;

    json_array_foreach(json_object_get(data, "zones"), i, one)
    {
        if (json_is_string(one) && !strcmp(json_string_value(one), zone))
            return true;
    }
    return false;
}

/* A time, or the name of a visit: as names have it, without the Z that ends a time. */
static void key_of(char out[NAME_LENGTH + 1], const char *text)
{
    size_t n;

    snprintf(out, NAME_LENGTH + 1, "%s", text);
    n = strlen(out);
    for (size_t i = 0; i < n; i++)
        out[i] = out[i] == ':' || out[i] == '.' ? '-' : out[i];
    if (n && out[n - 1] == 'Z')
        out[n - 1] = 0;
}

/* Times are texts of one form, of which the longer one is later. */
static bool fits(const json_t *data, const struct sst_visits_query *q)
{
    return (!q->from || strcmp(text_of(data, "to"), q->from) >= 0) &&
           (!q->to || strncmp(text_of(data, "from"), q->to, strlen(q->to)) <= 0) &&
           (!q->label || !strcmp(text_of(data, "label"), q->label)) && (!q->zone || has_zone(data, q->zone));
}

/* Names that a query asks for. */
struct range {
    char before[NAME_LENGTH + 1], after[NAME_LENGTH + 1]; /* "": any */
    bool oldest;                                          /* first */
};

static struct range range_of(const struct sst_visits_query *q)
{
    struct range r = { .oldest = q->after && !q->before };

    key_of(r.before, q->before ? q->before : "");
    key_of(r.after, q->after ? q->after : "");
    return r;
}

static bool is_within(const struct range *r, const char *name)
{
    return (!r->before[0] || strcmp(name, r->before) < 0) && (!r->after[0] || strcmp(name, r->after) > 0);
}

/* The last line of each visit of a day, by name. @return object, or NULL: out of memory */
static json_t *read_day(const struct sst_visits *v, const char *day)
{
    json_t *all = json_object();
    char path[SST_PATH_MAX], why[SST_LOG_MAX] = "", *held, *next = NULL;
    uint8_t *data = NULL;
    size_t size;
    int err = visits_day_path(path, v, day, LINES);

    held = sst_log_hold_errors(why);
    err = err ? err : sst_file_read(path, DAY_MOST, &data, &size);
    sst_log_hold_errors(held);
    for (char *line = err ? NULL : strtok_r((char *)data, "\n", &next); line; line = strtok_r(NULL, "\n", &next)) {
        json_t *o = json_loads(line, 0, NULL); /* the last line may be cut off */
        const char *name = text_of(o, "visit");

        if (visits_is_name(name))
            (void)json_object_set(all, name, o);
        json_decref(o);
    }
    free(data);
    return all;
}

/* The names of a day's visits alone. @return object, or NULL: out of memory */
static json_t *read_names(const struct sst_visits *v, const char *day)
{
    static const char begin[] = "{\"visit\":\"";
    json_t *all = json_object();
    char path[SST_PATH_MAX], why[SST_LOG_MAX] = "", *held, *next = NULL, *end;
    uint8_t *data = NULL;
    size_t size;
    int err = visits_day_path(path, v, day, LINES);

    held = sst_log_hold_errors(why);
    err = err ? err : sst_file_read(path, DAY_MOST, &data, &size);
    sst_log_hold_errors(held);
    for (char *line = err ? NULL : strtok_r((char *)data, "\n", &next); line; line = strtok_r(NULL, "\n", &next)) {
        char *name = line + sizeof(begin) - 1;

        if (strncmp(line, begin, sizeof(begin) - 1) != 0 || line[strlen(line) - 1] != '}' ||
            !(end = strchr(name, '"'))) {
            json_t *o = json_loads(line, 0, NULL); /* written by another program, or cut off */

            if (visits_is_name(text_of(o, "visit")))
                (void)json_object_set_new(all, text_of(o, "visit"), json_true());
            json_decref(o);
            continue;
        }
        *end = 0;
        if (visits_is_name(name))
            (void)json_object_set_new(all, name, json_true());
    }
    free(data);
    return all;
}

static void add_facts(const struct sst_visits *v, json_t *data, const json_t *reviewed, const char *user)
{
    const char *name = text_of(data, "visit");
    json_t *list = json_array(), *by = json_object_get(reviewed, name);

    for (int i = 0; i < 2; i++) {
        char path[SST_PATH_MAX];

        if (!file_path(path, v, name, picture_files[i]) && !access(path, R_OK))
            json_array_append_new(list, json_string(picture_names[i]));
    }
    json_object_set_new(data, "pictures", list);
    json_object_set_new(data, "keep", json_boolean(is_kept(v, name)));
    json_object_set_new(data, "reviewed", json_boolean(visits_is_reviewed(reviewed, name, user)));
    json_object_set_new(data, "reviewed_by", by ? json_incref(by) : json_array());
    /* Of a service that was killed: it has no end. */
    if (strcmp(text_of(data, "from"), v->start) < 0)
        json_object_set_new(data, "active", json_false());
}

/* Add visits of a day that fit: the newest first, or the oldest. */
static void add_day(const struct sst_visits *v, const char *day, const struct sst_visits_query *q, json_t *out)
{
    const struct range range = range_of(q);
    json_t *all = read_day(v, day), *reviewed = visits_reviewed(v, day), *data;
    const size_t n = json_object_size(all);
    char **name = n ? malloc(n * sizeof(*name)) : NULL;
    const char *key;
    int count = 0;

    json_object_foreach(all, key, data)
    {
        if (name && fits(data, q) && is_within(&range, key) &&
            (!q->reviewed || visits_is_reviewed(reviewed, key, q->user) == (q->reviewed > 0)))
            name[count++] = (char *)(uintptr_t)key;
    }
    sst_stats_sort_strings(name, count);
    for (int i = 0; i < count && (int)json_array_size(out) < q->limit; i++) {
        data = json_object_get(all, name[range.oldest ? i : count - 1 - i]);
        add_facts(v, data, reviewed, q->user);
        json_array_append(out, data);
    }
    free(name);
    json_decref(reviewed);
    json_decref(all);
}

/* A visit that began the day before may still have been there. */
static bool may_have(const struct sst_visits_query *q, const char *day, const char *next_day)
{
    return !(q->to && strncmp(day, q->to, DAY) > 0) && !(q->from && next_day && strncmp(next_day, q->from, DAY) < 0) &&
           !(q->before && strncmp(day, q->before, DAY) > 0) && !(q->after && strncmp(day, q->after, DAY) < 0);
}

static json_t *reversed(json_t *list)
{
    json_t *out = json_array();

    for (size_t i = json_array_size(list); out && i-- > 0;)
        json_array_append(out, json_array_get(list, i));
    json_decref(list);
    return out;
}

json_t *sst_visits_list(struct sst_visits *v, const struct sst_visits_query *q)
{
    const bool oldest = q->after && !q->before;
    json_t *out = json_array();
    struct dirent **day = NULL;
    const int n = v->dir[0] ? visits_days(v, &day) : 0;

    for (int k = 0; k < n; k++) {
        const int i = oldest ? n - 1 - k : k;

        if (out && may_have(q, day[i]->d_name, i > 0 ? day[i - 1]->d_name : NULL) &&
            (int)json_array_size(out) < q->limit)
            add_day(v, day[i]->d_name, q, out);
    }
    for (int i = 0; i < n; i++)
        free(day[i]);
    free(day);
    return oldest ? reversed(out) : out;
}

/* --- counting by days --------------------------------------------------------------------------------------------- */

/* The day of a time zone on which a visit came. @return false: the name has no time */
static bool day_of(char out[SST_CLOCK_TEXT], const char *name, int offset_min)
{
    struct tm t = { 0 };

    if (!visits_is_name(name) ||
        sscanf(name, "%4d-%2d-%2dT%2d-%2d", &t.tm_year, &t.tm_mon, &t.tm_mday, &t.tm_hour, &t.tm_min) != 5)
        return false;
    t.tm_year -= 1900;
    t.tm_mon--;
    t.tm_min += offset_min;
    (void)timegm(&t); /* carries the minutes */
    return strftime(out, SST_CLOCK_TEXT, "%Y-%m-%d", &t) == DAY;
}

static void add_count(json_t *days, const char *day, const char *key, int more)
{
    json_t *one = json_object_get(days, day);

    if (!one) {
        one = json_pack("{s:s, s:i, s:i}", "day", day, "visits", 0, "reviewed", 0);
        json_object_set_new(days, day, one);
    }
    json_object_set_new(one, key, json_integer(json_integer_value(json_object_get(one, key)) + more));
}

/* The names are enough unless there is a filter: a month may have 100 MB of lines. */
static void count_day(const struct sst_visits *v, const char *utc_day, const struct sst_visits_query *q, int offset_min,
                      json_t *days)
{
    json_t *all = q->label || q->zone ? read_day(v, utc_day) : read_names(v, utc_day);
    json_t *reviewed = visits_reviewed(v, utc_day), *data;
    char day[SST_CLOCK_TEXT];
    const char *name;

    json_object_foreach(all, name, data)
    {
        const struct sst_visits_query kinds = { .label = q->label, .zone = q->zone };

        if (!day_of(day, name, offset_min) || (q->from && strncmp(day, q->from, DAY) < 0) ||
            (q->to && strncmp(day, q->to, DAY) > 0) || ((q->label || q->zone) && !fits(data, &kinds)))
            continue;
        add_count(days, day, "visits", 1);
        if (visits_is_reviewed(reviewed, name, q->user))
            add_count(days, day, "reviewed", 1);
    }
    json_decref(reviewed);
    json_decref(all);
}

json_t *sst_visits_days(struct sst_visits *v, const struct sst_visits_query *q, int offset_min)
{
    json_t *days = json_object(), *out = json_array();
    struct dirent **day = NULL;
    const int n = v->dir[0] ? visits_days(v, &day) : 0;
    char **name = malloc(sizeof(*name) * (size_t)(2 * n + 1)); /* a day of names is on two of a time zone */
    const char *key;
    json_t *one;
    int count = 0;

    for (int i = 0; i < n; i++) {
        /* a day of names has visits of the days before and after, too */
        const bool later = q->to && i + 1 < n && strncmp(day[i + 1]->d_name, q->to, DAY) > 0;
        const bool earlier = q->from && i > 0 && strncmp(day[i - 1]->d_name, q->from, DAY) < 0;

        if (days && !later && !earlier)
            count_day(v, day[i]->d_name, q, offset_min, days);
    }
    json_object_foreach(days, key, one)
    {
        if (name && count < 2 * n)
            name[count++] = (char *)(uintptr_t)key;
    }
    sst_stats_sort_strings(name, name ? count : 0);
    while (name && count-- > 0)
        json_array_append(out, json_object_get(days, name[count]));
    free(name);
    for (int i = 0; i < n; i++)
        free(day[i]);
    free(day);
    json_decref(days);
    return out;
}

int sst_visits_read_picture(struct sst_visits *v, const char *visit, enum sst_visit_picture kind, uint8_t **data,
                            size_t *size)
{
    char path[SST_PATH_MAX], why[SST_LOG_MAX] = "", *held;
    int err;

    if (!visits_is_name(visit))
        return -EINVAL;
    err = file_path(path, v, visit, picture_files[kind]);
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
    int err = file_path(path, v, visit, KEEP), fd;

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
            all = v->dir[0] ? read_day(v, day) : json_object();
        }
        data = json_object_get(all, name);
        err = !data ? -ENOENT
              : what == SST_VISITS_DELETE && json_is_true(json_object_get(data, "active")) &&
                      strcmp(text_of(data, "from"), v->start) >= 0
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

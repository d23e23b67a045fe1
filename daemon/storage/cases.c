/* Cases: a queue, one thread that makes them, and their folder. A case appears in its folder whole; the rest of a killed
 * process is removed at the next start. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/storage/cases.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "base/thread.h"
#include "daemon/storage/case_internal.h"
#include "daemon/storage/video_internal.h"

#define QUEUE         4  /* cases that wait or are made */
#define KEPT          20 /* finished ones; then the oldest goes */
#define JOBS          (QUEUE + KEPT)
#define KEPT_DAYS     7
#define LIMIT_NS      INT64_C(10000000000) /* between removals of old cases */
#define MEASURE_NS    INT64_C(500000000)     /* between looks at the size of the case that is made */
#define FOLDER        "videos"
#define MAKING        ".making"
#define PAGE          "index.html"
#define NICE          10 /* capture and the live picture go first */
#define MANIFEST_MOST ((size_t)4 << 20)

enum state {
    CASE_NONE = 0,
    CASE_WAITING = 1,
    CASE_RUNNING = 2,
    CASE_DONE = 3,
    CASE_FAILED = 4,
};

static const char *const state_names[] = { "", "waiting", "running", "done", "failed" };

struct job {
    enum state state;
    char name[SST_CASE_NAME], title[128], error[CASE_WHY];
    int64_t made_ns; /* wall time */
    int count;
    struct sst_case_span *span; /* [count]; NULL: of a case that is finished */
    double done;                /* 0..1 */
    int64_t begun_ns, bytes;
    bool cancel;
    int readers;
};

struct sst_cases {
    /* fixed after open */
    struct sst_storage *storage;
    char dir[SST_PATH_MAX], key[SST_PATH_MAX];
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    SST_ATOMIC(bool) steady; /* is the wall clock: ages count */
    /* under lock */
    char site[256];
    struct job job[JOBS]; /* in their order; the queue's after the finished ones */
    int jobs;
    bool stop, ended;
    void (*report)(void *arg, int64_t bytes);
    void *report_arg;
};

/* --- jobs --------------------------------------------------------------------------------------------------------- */

static void free_spans(struct job *j)
{
    for (int i = 0; j->span && i < j->count; i++)
        json_decref(j->span[i].visit);
    free(j->span);
    j->span = NULL;
}

static struct job *find_locked(struct sst_cases *c, const char *name)
{
    for (int i = 0; i < c->jobs; i++)
        if (!strcmp(c->job[i].name, name))
            return &c->job[i];
    return NULL;
}

static void drop_locked(struct sst_cases *c, struct job *j)
{
    free_spans(j);
    memmove(j, j + 1, (size_t)(&c->job[c->jobs] - (j + 1)) * sizeof(*j));
    c->jobs--;
}

static void report_locked(struct sst_cases *c)
{
    int64_t bytes = 0;

    for (int i = 0; i < c->jobs; i++)
        bytes += c->job[i].bytes;
    if (c->report && !c->stop)
        c->report(c->report_arg, bytes);
}

static int path_of(const struct sst_cases *c, char out[SST_PATH_MAX], const char *name, const char *file)
{
    char dir[SST_PATH_MAX];
    const int err = sst_path_join(dir, c->dir, name);

    return err ? err : sst_path_join(out, dir, file);
}

static void remove_files(const struct sst_cases *c, const char *name)
{
    char path[SST_PATH_MAX];

    if (!path_of(c, path, name, NULL))
        sst_path_remove_tree(path);
}

/* The oldest finished ones go beyond their number and age, but none that is read. The files are few: removed under the lock. */
static void limit_locked(struct sst_cases *c)
{
    const int64_t oldest_ns = sst_clock_wall_ns() - KEPT_DAYS * INT64_C(86400000000000);
    const int before = c->jobs;
    int finished = 0;

    for (int i = 0; i < c->jobs; i++)
        finished += c->job[i].state >= CASE_DONE;
    for (int i = 0; i < c->jobs; i++) {
        struct job *j = &c->job[i];

        if (j->state < CASE_DONE || j->readers || (finished <= KEPT && (j->made_ns > oldest_ns || !atomic_load(&c->steady))))
            continue;
        remove_files(c, j->name);
        drop_locked(c, j);
        finished--;
        i--;
    }
    if (c->jobs != before)
        report_locked(c);
}

static struct job *running_locked(struct sst_cases *c)
{
    for (int i = 0; i < c->jobs; i++)
        if (c->job[i].state == CASE_RUNNING)
            return &c->job[i];
    return NULL;
}

/* --- making ------------------------------------------------------------------------------------------------------- */

/* The case that is made; the thread's own. */
struct work {
    struct sst_cases *c;
    struct job job; /* a copy of its fixed members */
    char site[256], dir[SST_PATH_MAX], why[CASE_WHY];
    double begins, share; /* of the progress of the span at work */
    json_t *files;
    int64_t bytes, measured_ns;
};

/* Size of a case's files, unfinished ones too. */
static int64_t size_of(const char *dir)
{
    DIR *folder = opendir(dir);
    int64_t bytes = 0;
    struct stat st;

    for (const struct dirent *e; folder && (e = readdir(folder));)
        if (!fstatat(dirfd(folder), e->d_name, &st, AT_SYMLINK_NOFOLLOW) && S_ISREG(st.st_mode))
            bytes += (int64_t)st.st_size;
    if (folder)
        closedir(folder);
    return bytes;
}

/* Count a case that is made in the quota. */
static void measure(struct work *w)
{
    const int64_t bytes = size_of(w->dir);

    w->measured_ns = sst_clock_now_ns();
    pthread_mutex_lock(&w->c->lock);
    running_locked(w->c)->bytes = bytes;
    report_locked(w->c);
    pthread_mutex_unlock(&w->c->lock);
}

static bool go_on(void *arg, double done)
{
    struct work *w = arg;
    struct job *j;
    bool wanted;

    if (sst_clock_now_ns() - w->measured_ns > MEASURE_NS)
        measure(w);
    pthread_mutex_lock(&w->c->lock);
    j = running_locked(w->c);
    wanted = !w->c->stop && !j->cancel;
    j->done = w->begins + w->share * done;
    pthread_mutex_unlock(&w->c->lock);
    return wanted;
}

static bool still_wanted(void *arg)
{
    return go_on(arg, 1);
}

/* Add a file that is finished to the manifest. @param facts  taken */
static int add_file(struct work *w, const char *name, const char *title, json_t *facts)
{
    struct sst_evidence_hash hash;
    char path[SST_PATH_MAX], crc[12];
    int err = sst_path_join(path, w->dir, name);
    struct sst_evidence_part part = { .fd = -1, .bytes = -1, .wanted = still_wanted, .arg = w };

    if (!err) {
        part.fd = sst_file_open(path);
        err = part.fd < 0 ? part.fd : sst_evidence_hash(&part, &hash);
        if (part.fd >= 0)
            close(part.fd);
    }
    if (err) {
        json_decref(facts);
        return err;
    }
    snprintf(crc, sizeof(crc), "%08x", hash.crc32);
    json_object_set_new(facts, "name", json_string(name));
    json_object_set_new(facts, "title", json_string(title));
    json_object_set_new(facts, "bytes", json_integer(hash.bytes));
    json_object_set_new(facts, "sha256", json_string(hash.sha256));
    json_object_set_new(facts, "crc32", json_string(crc));
    w->bytes += hash.bytes;
    return json_array_append_new(w->files, facts) ? -ENOMEM : 0;
}

static int make_video(struct work *w, int i)
{
    const struct sst_case_span *span = &w->job.span[i];
    char name[SST_CASE_NAME + 16], path[SST_PATH_MAX];
    struct case_video v = { .storage = w->c->storage, .span = span, .site = w->site, .path = path, .progress = go_on, .arg = w };
    json_t *facts;
    int err;

    if (w->job.count == 1)
        snprintf(name, sizeof(name), "%s.mp4", w->job.name);
    else
        snprintf(name, sizeof(name), "%s-%d.mp4", w->job.name, i + 1);
    w->begins = (double)i / w->job.count;
    w->share = 1.0 / w->job.count;
    err = sst_path_join(path, w->dir, name);
    err = err ? err : case_video_make(&v, &facts, w->why);
    if (err)
        return err;
    measure(w);
    if (span->visit)
        json_object_set(facts, "visit", span->visit);
    err = add_file(w, name, span->title, facts);
    if (!err && w->bytes > ZIP_BYTES_MOST / 2) {
        snprintf(w->why, CASE_WHY, "the videos are larger than 2 GB; choose fewer or shorter ones");
        err = -EFBIG;
    }
    return err;
}

static int write_text(struct work *w, const char *name, char *text)
{
    char path[SST_PATH_MAX];
    int err = text ? sst_path_join(path, w->dir, name) : -ENOMEM;

    err = err ? err : sst_file_write(path, text, strlen(text));
    w->bytes += err ? 0 : (int64_t)strlen(text);
    free(text);
    return err;
}

static int write_manifest(struct work *w)
{
    char host[128] = "", made[SST_CLOCK_TEXT];
    json_t *signed_, *manifest;
    char *text = NULL;

    (void)gethostname(host, sizeof(host) - 1);
    sst_clock_text(made, w->job.made_ns);
    manifest = json_pack("{s:s, s:s, s:s, s:s, s:s, s:s, s:s, s:O}", "format", SST_EVIDENCE_FORMAT, "program",
                         "sst " SST_VERSION, "name", w->job.name, "title", w->job.title, "site", w->site, "host", host,
                         "made", made, "files", w->files);
    if (!manifest)
        return -ENOMEM;
    signed_ = sst_evidence_sign(w->c->key, manifest);
    if (!signed_)
        return -EKEYREJECTED; /* logged */
    text = json_dumps(signed_, JSON_INDENT(1));
    json_decref(signed_);
    return write_text(w, SST_EVIDENCE_MANIFEST, text);
}

static int make_all(struct work *w)
{
    struct sst_storage_report storage;
    int err = 0;

    sst_storage_report(w->c->storage, &storage);
    if (storage.state == SST_STORAGE_FULL) {
        snprintf(w->why, CASE_WHY, "nothing can be stored: %.200s", storage.reason);
        return -ENOSPC;
    }
    sst_path_remove_tree(w->dir);
    err = sst_path_make_dir(w->c->dir);
    err = err ? err : sst_path_make_dir(w->dir);
    for (int i = 0; !err && i < w->job.count; i++)
        err = make_video(w, i);
    w->begins = 1;
    w->share = 0;
    err = err ? err : write_text(w, PAGE, case_page(w->job.title, w->site, w->files));
    err = err ? err : add_file(w, PAGE, "Page", json_object());
    return err ? err : write_manifest(w);
}

static void make(struct work *w)
{
    char path[SST_PATH_MAX], said[SST_LOG_MAX] = "";
    char *held = sst_log_hold_errors(said);
    int err;

    w->files = json_array();
    err = path_of(w->c, w->dir, MAKING, NULL);
    err = err ? err : make_all(w);
    err = err ? err : path_of(w->c, path, w->job.name, NULL);
    if (!err && rename(w->dir, path))
        err = -errno;
    sst_log_hold_errors(held);
    if (err) {
        sst_path_remove_tree(w->dir);
        if (!w->why[0])
            snprintf(w->why, CASE_WHY, "%.250s", said[0] ? said : strerror(-err));
        if (err != -ECANCELED && err != -ENOENT)
            sst_log_warning("cannot make %s: %s", w->job.name, w->why);
    }
    json_decref(w->files);
    pthread_mutex_lock(&w->c->lock);
    struct job *j = running_locked(w->c);

    j->state = err ? CASE_FAILED : CASE_DONE;
    j->bytes = err ? 0 : w->bytes;
    j->done = 1;
    memcpy(j->error, err ? w->why : "", err ? sizeof(j->error) : 1);
    free_spans(j);
    if (err == -ECANCELED)
        drop_locked(w->c, j);
    limit_locked(w->c);
    report_locked(w->c);
    pthread_mutex_unlock(&w->c->lock);
}

static void *run(void *arg)
{
    struct sst_cases *c = arg;
    struct work *w = calloc(1, sizeof(*w));

    sst_thread_name("sst-cases");
    sst_thread_nice(NICE);
    pthread_mutex_lock(&c->lock);
    report_locked(c);
    while (!c->stop) {
        struct job *next = NULL;

        for (int i = c->jobs; i-- > 0;)
            next = c->job[i].state == CASE_WAITING ? &c->job[i] : next;
        if (!next || !w) {
            limit_locked(c);
            (void)sst_cond_wait_until(&c->changed, &c->lock, sst_clock_now_ns() + LIMIT_NS);
            continue;
        }
        next->state = CASE_RUNNING;
        next->begun_ns = sst_clock_now_ns();
        *w = (struct work){ .c = c, .job = *next };
        memcpy(w->site, c->site, sizeof(w->site));
        pthread_mutex_unlock(&c->lock);
        make(w);
        pthread_mutex_lock(&c->lock);
    }
    c->ended = true;
    pthread_cond_broadcast(&c->changed);
    pthread_mutex_unlock(&c->lock);
    free(w);
    return NULL;
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static bool is_name(const char *text)
{
    const size_t n = strlen(SST_CASE_PREFIX);

    return !strncmp(text, SST_CASE_PREFIX, n) && strlen(text) < SST_CASE_NAME && text[n] &&
           strspn(text + n, "0123456789TZ-") == strlen(text + n);
}

static int is_case(const struct dirent *e)
{
    return is_name(e->d_name);
}

/* A finished case of an earlier process. @return false: it is none */
static bool read_job(const struct sst_cases *c, const char *name, struct job *j)
{
    char path[SST_PATH_MAX];
    json_t *root = path_of(c, path, name, SST_EVIDENCE_MANIFEST) ? NULL : json_load_file(path, 0, NULL);
    const json_t *manifest = json_object_get(root, "manifest"), *files = json_object_get(manifest, "files"), *file;
    const char *title = json_string_value(json_object_get(manifest, "title"));
    struct stat st;
    size_t i;
    bool good = title && json_array_size(files) > 1 && !stat(path, &st);

    if (good) {
        *j = (struct job){ .state = CASE_DONE, .done = 1, .count = (int)json_array_size(files) - 1 };
        j->made_ns = (int64_t)st.st_mtime * 1000000000;
        j->bytes = (int64_t)st.st_size;
        snprintf(j->name, sizeof(j->name), "%s", name);
        snprintf(j->title, sizeof(j->title), "%s", title);
        json_array_foreach(files, i, file)
            j->bytes += json_integer_value(json_object_get(file, "bytes"));
    }
    json_decref(root);
    return good;
}

static void read_jobs(struct sst_cases *c)
{
    struct dirent **entry;
    const int n = scandir(c->dir, &entry, is_case, alphasort);

    remove_files(c, MAKING);
    for (int i = 0; i < n; i++) {
        if (n - i > KEPT || !read_job(c, entry[i]->d_name, &c->job[c->jobs]))
            remove_files(c, entry[i]->d_name);
        else
            c->jobs++;
        free(entry[i]);
    }
    if (n >= 0)
        free(entry);
}

int sst_cases_open(struct sst_cases **out, const struct sst_cases_config *cfg)
{
    struct sst_cases *c = calloc(1, sizeof(*c));
    int err = c ? sst_path_join(c->dir, cfg->dir, FOLDER) : -ENOMEM;

    if (err) {
        free(c);
        return err;
    }
    c->storage = cfg->storage;
    snprintf(c->key, sizeof(c->key), "%s", cfg->key);
    snprintf(c->site, sizeof(c->site), "%s", cfg->site);
    pthread_mutex_init(&c->lock, NULL);
    sst_cond_init(&c->changed);
    read_jobs(c);
    err = -pthread_create(&c->thread, NULL, run, c);
    if (err) {
        pthread_cond_destroy(&c->changed);
        pthread_mutex_destroy(&c->lock);
        free(c);
        return err;
    }
    *out = c;
    return 0;
}

void sst_cases_clock(struct sst_cases *c, bool steady)
{
    if (atomic_exchange(&c->steady, steady) != steady) /* the lock is held while files are removed */
        pthread_cond_broadcast(&c->changed);
}

void sst_cases_configure(struct sst_cases *c, const char *site)
{
    pthread_mutex_lock(&c->lock);
    snprintf(c->site, sizeof(c->site), "%s", site);
    pthread_mutex_unlock(&c->lock);
}

void sst_cases_report(struct sst_cases *c, void (*changed)(void *arg, int64_t bytes), void *arg)
{
    pthread_mutex_lock(&c->lock);
    c->report = changed;
    c->report_arg = arg;
    report_locked(c);
    pthread_mutex_unlock(&c->lock);
}

/* --- calls -------------------------------------------------------------------------------------------------------- */

/* "video-2026-11-21T18-05-00-123Z" */
static void name_locked(struct sst_cases *c, struct job *j)
{
    char when[SST_CLOCK_TEXT];

    do {
        sst_clock_text(when, j->made_ns);
        for (char *p = when; *p; p++)
            *p = *p == ':' || *p == '.' ? '-' : *p;
        snprintf(j->name, sizeof(j->name), SST_CASE_PREFIX "%s", when);
        j->made_ns += 1000000;
    } while (find_locked(c, j->name));
    j->made_ns -= 1000000;
}

int sst_cases_add(struct sst_cases *c, const struct sst_case_span *span, int count, char name[SST_CASE_NAME])
{
    struct job j = { .state = CASE_WAITING, .count = count, .made_ns = sst_clock_wall_ns() };
    int waiting = 0;

    pthread_mutex_lock(&c->lock);
    for (int i = 0; i < c->jobs; i++)
        waiting += c->job[i].state < CASE_DONE;
    j.span = waiting < QUEUE && c->jobs < JOBS && !c->stop ? malloc((size_t)count * sizeof(*span)) : NULL;
    if (!j.span) {
        pthread_mutex_unlock(&c->lock);
        return waiting < QUEUE && !c->stop ? -ENOMEM : -EBUSY;
    }
    memcpy(j.span, span, (size_t)count * sizeof(*span));
    for (int i = 0; i < count; i++)
        json_incref(j.span[i].visit);
    if (count == 1) {
        snprintf(j.title, sizeof(j.title), "%s", span->title);
    } else {
        snprintf(j.title, sizeof(j.title), "%d visits, %.100s", count, span->title);
        sst_text_end_whole(j.title);
        strcat(j.title, " ...");
    }
    name_locked(c, &j);
    memcpy(name, j.name, SST_CASE_NAME);
    c->job[c->jobs++] = j;
    pthread_cond_broadcast(&c->changed);
    pthread_mutex_unlock(&c->lock);
    return 0;
}

static json_t *job_json(const struct job *j)
{
    const double run_s = (double)(sst_clock_now_ns() - j->begun_ns) / 1e9;
    json_t *left = j->state == CASE_RUNNING && j->done > 0.02 ? json_real(run_s * (1 - j->done) / j->done) : json_null();

    return json_pack("{s:s, s:s, s:s, s:f, s:o, s:i, s:I, s:s}", "name", j->name, "title", j->title, "state",
                     state_names[j->state], "progress", j->done, "left_s", left, "videos", j->count, "bytes",
                     (json_int_t)j->bytes, "error", j->error);
}

json_t *sst_cases_list(struct sst_cases *c)
{
    json_t *list = json_array();

    pthread_mutex_lock(&c->lock);
    for (int i = c->jobs; i-- > 0;)
        json_array_append_new(list, job_json(&c->job[i]));
    pthread_mutex_unlock(&c->lock);
    return json_pack("{s:o}", "videos", list);
}

int sst_cases_remove(struct sst_cases *c, const char *name)
{
    struct job *j;
    int err = 0;

    pthread_mutex_lock(&c->lock);
    j = find_locked(c, name);
    if (!j) {
        err = -ENOENT;
    } else if (j->state == CASE_RUNNING) {
        j->cancel = true;
    } else if (j->readers) {
        err = -EBUSY;
    } else {
        if (j->state == CASE_DONE)
            remove_files(c, j->name);
        drop_locked(c, j);
        report_locked(c);
    }
    pthread_mutex_unlock(&c->lock);
    return err;
}

int sst_cases_key(struct sst_cases *c, char *pem, char *print)
{
    return sst_evidence_key(c->key, pem, print);
}

/* --- downloads ---------------------------------------------------------------------------------------------------- */

struct case_download {
    struct sst_download d;
    struct sst_cases *c;
    char name[SST_CASE_NAME];
    int fd;         /* of one file; -1: the archive */
    struct zip zip;
};

static ssize_t read_download(struct sst_download *d, int64_t at, void *out, size_t n)
{
    struct case_download *o = (struct case_download *)d;
    ssize_t got;

    if (o->fd < 0)
        return zip_read(&o->zip, at, out, n);
    got = pread(o->fd, out, n, at);
    return got < 0 ? -errno : got ? got : -EBADMSG;
}

static void end_download(struct sst_download *d)
{
    struct case_download *o = (struct case_download *)d;
    struct job *j;

    if (o->fd >= 0)
        close(o->fd);
    zip_close(&o->zip);
    pthread_mutex_lock(&o->c->lock);
    j = find_locked(o->c, o->name);
    if (j)
        j->readers--;
    pthread_mutex_unlock(&o->c->lock);
    free(o);
}

static int open_file(struct case_download *o, const char *file)
{
    char path[SST_PATH_MAX];
    struct stat st;
    int err = path_of(o->c, path, o->name, file);

    o->fd = err ? -1 : sst_file_open(path);
    if (!err && o->fd < 0)
        err = o->fd;
    if (!err && fstat(o->fd, &st))
        err = -errno;
    o->d.bytes = err ? 0 : st.st_size;
    return err;
}

/* The files of the manifest, and itself at last. */
static int list_zip(struct case_download *o, const char *path, int64_t *made_ns)
{
    struct sst_evidence_part part = { .fd = sst_file_open(path), .bytes = -1 };
    struct sst_evidence_hash hash;
    json_t *root = json_load_file(path, 0, NULL);
    const json_t *files = json_object_get(json_object_get(root, "manifest"), "files"), *file;
    struct zip *z = &o->zip;
    struct stat st = { 0 };
    size_t i;
    int err = part.fd < 0 ? part.fd : json_array_size(files) < ZIP_FILES_MAX ? sst_evidence_hash(&part, &hash) : -EBADMSG;

    json_array_foreach(files, i, file)
    {
        const char *name = json_string_value(json_object_get(file, "name"));
        const char *crc = json_string_value(json_object_get(file, "crc32"));

        if (err || !name || !crc || strchr(name, '/') || strlen(name) >= sizeof(z->file[0].name)) {
            err = err ? err : -EBADMSG;
            break;
        }
        strcpy(z->file[z->count].name, name);
        z->file[z->count].bytes = json_integer_value(json_object_get(file, "bytes"));
        z->file[z->count++].crc32 = (uint32_t)strtoul(crc, NULL, 16);
    }
    if (!err) {
        z->file[z->count++] = (struct zip_file){ SST_EVIDENCE_MANIFEST, hash.bytes, hash.crc32, 0 };
        (void)fstat(part.fd, &st);
        *made_ns = (int64_t)st.st_mtime * 1000000000;
    }
    if (part.fd >= 0)
        close(part.fd);
    json_decref(root);
    return err;
}

static int open_zip(struct case_download *o)
{
    char path[SST_PATH_MAX], dir[SST_PATH_MAX];
    int64_t made_ns = 0;
    int err = path_of(o->c, path, o->name, SST_EVIDENCE_MANIFEST);

    err = err ? err : path_of(o->c, dir, o->name, NULL);
    err = err ? err : list_zip(o, path, &made_ns);
    err = err ? err : zip_open(&o->zip, dir, made_ns);
    o->d.bytes = o->zip.bytes;
    return err;
}

/* A case that is whole, until the download ends. */
static int hold(struct case_download *o, bool video)
{
    const struct job *found;
    struct job *j;
    int err;

    pthread_mutex_lock(&o->c->lock);
    j = find_locked(o->c, o->name);
    found = j;
    err = !found                                          ? -ENOENT
          : found->state < CASE_DONE                      ? -EBUSY
          : found->state == CASE_FAILED || (video && found->count > 1) ? -ENOENT
                                                          : 0;
    if (!err)
        j->readers++;
    pthread_mutex_unlock(&o->c->lock);
    return err;
}

int sst_cases_download(struct sst_cases *c, const char *name, struct sst_download **out)
{
    static const struct {
        const char *ending, *type;
    } kinds[] = { { ".mp4", "video/mp4" }, { ".json", "application/json" }, { ".zip", "application/zip" } };
    const char *dot = strrchr(name, '.');
    struct case_download *o = dot && dot - name < SST_CASE_NAME ? calloc(1, sizeof(*o)) : NULL;
    char file[SST_CASE_NAME + 8];
    uint64_t tag = 0;
    int kind = 0, err;

    if (!o)
        return dot && dot - name < SST_CASE_NAME ? -ENOMEM : -ENOENT;
    while (kind < (int)ARRAY_LEN(kinds) && strcmp(kinds[kind].ending, dot) != 0)
        kind++;
    memcpy(o->name, name, (size_t)(dot - name));
    o->c = c;
    o->fd = o->zip.fd = -1;
    err = kind == ARRAY_LEN(kinds) || !is_name(o->name) ? -ENOENT : hold(o, kind == 0);
    if (err) {
        free(o);
        return err;
    }
    snprintf(file, sizeof(file), "%s.mp4", o->name);
    o->d.type = kinds[kind].type;
    o->d.read = read_download;
    o->d.close = end_download;
    add_to_tag(&tag, name, strlen(name)); /* files never change; names are times */
    snprintf(o->d.tag, sizeof(o->d.tag), "%016" PRIx64, tag);
    err = kind == 2 ? open_zip(o) : open_file(o, kind == 0 ? file : SST_EVIDENCE_MANIFEST);
    if (err) {
        end_download(&o->d);
        return err;
    }
    *out = &o->d;
    return 0;
}

/* --- the end ------------------------------------------------------------------------------------------------------ */

void sst_cases_stop(struct sst_cases *c)
{
    if (!c)
        return;
    pthread_mutex_lock(&c->lock);
    c->stop = true;
    pthread_cond_broadcast(&c->changed);
    pthread_mutex_unlock(&c->lock);
}

bool sst_cases_close(struct sst_cases *c, int64_t until_ns)
{
    bool ended;

    if (!c)
        return true;
    sst_cases_stop(c);
    pthread_mutex_lock(&c->lock);
    while (!c->ended && sst_cond_wait_until(&c->changed, &c->lock, until_ns))
        ;
    ended = c->ended;
    pthread_mutex_unlock(&c->lock);
    if (!ended)
        return false;
    pthread_join(c->thread, NULL);
    for (int i = 0; i < c->jobs; i++)
        free_spans(&c->job[i]);
    pthread_cond_destroy(&c->changed);
    pthread_mutex_destroy(&c->lock);
    free(c);
    return true;
}

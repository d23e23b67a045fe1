/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/claim.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/thread.h"

#define HELD "held."

static const char done_name[] = "done", failed_name[] = "failed";

struct sst_claim {
    char dir[SST_PATH_MAX], path[SST_PATH_MAX]; /* of the state; of the file while held */
    char job[SST_CLAIM_JOB], worker[100];
    int attempts, lease_ms;
    int64_t start_ns;
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t wake;
    bool ending; /* under lock */
};

static int log_error(const char *what, const char *path, int err)
{
    sst_log_error("cannot %s %s, the state of shared work: %s", what, path, strerror(err));
    return -err;
}

/* --- the file ----------------------------------------------------------------------------------------------------- */

static void read_line(struct sst_claim_info *out, const char *line)
{
    const char *value = strchr(line, ' ');
    const size_t n = value ? (size_t)(value - line) : 0;

    if (!value++)
        return;
    if (!strncmp(line, "job", n))
        snprintf(out->job, sizeof(out->job), "%s", value);
    else if (!strncmp(line, "worker", n))
        snprintf(out->worker, sizeof(out->worker), "%s", value);
    else if (!strncmp(line, "attempts", n))
        out->attempts = atoi(value);
    else if (!strncmp(line, "seconds", n))
        out->seconds = atof(value);
    else if (!strncmp(line, "error", n))
        snprintf(out->error, sizeof(out->error), "%s", value);
}

static int read_file(struct sst_claim_info *out, const char *dir)
{
    char path[SST_PATH_MAX], *line = NULL;
    size_t size = 0;
    struct stat st;
    FILE *f;
    int err = sst_path_join(path, dir, out->file);

    if (err)
        return err;
    f = fopen(path, "re");
    if (!f || fstat(fileno(f), &st)) {
        err = -errno;
        if (f)
            fclose(f);
        return err;
    }
    out->touched_ns = st.st_mtim.tv_sec * INT64_C(1000000000) + st.st_mtim.tv_nsec;
    for (ssize_t n; (n = getline(&line, &size, f)) > 0;) {
        line[strcspn(line, "\n")] = 0;
        read_line(out, line);
    }
    free(line);
    fclose(f);
    return 0;
}

/* Write to a file that exists: one that another process has renamed meanwhile must not appear again. */
static int write_file(const struct sst_claim *c, const char *error)
{
    const int fd = open(c->path, O_WRONLY | O_TRUNC | O_CLOEXEC);
    FILE *f = fd < 0 ? NULL : fdopen(fd, "w");
    int err = f ? 0 : errno;

    if (!f) {
        if (fd >= 0)
            close(fd);
        return -err;
    }
    fprintf(f, "job %s\nworker %s\nattempts %d\nseconds %.3f\n", c->job, c->worker, c->attempts,
            (double)(sst_clock_now_ns() - c->start_ns) * 1e-9);
    if (error)
        fprintf(f, "error %.*s\n", (int)strcspn(error, "\n"), error);
    err = ferror(f) ? EIO : 0;
    return fclose(f) && !err ? -errno : -err;
}

/* Name of the state's file, "" if there is none. One that is being renamed may be listed under both names: an ended
 * state stays. */
static int find_file(struct sst_claim_info *out, const char *dir)
{
    DIR *d = opendir(dir);

    out->file[0] = 0;
    out->state = SST_CLAIM_FREE;
    if (!d)
        return errno == ENOENT ? 0 : log_error("read", dir, errno);
    for (const struct dirent *e; (e = readdir(d));) {
        const enum sst_claim_state state = !strcmp(e->d_name, done_name)             ? SST_CLAIM_DONE
                                           : !strcmp(e->d_name, failed_name)         ? SST_CLAIM_FAILED
                                           : !strncmp(e->d_name, HELD, strlen(HELD)) ? SST_CLAIM_HELD
                                                                                     : SST_CLAIM_FREE;

        if (state <= out->state || strlen(e->d_name) >= sizeof(out->file))
            continue;
        out->state = state;
        snprintf(out->file, sizeof(out->file), "%.*s", (int)sizeof(out->file) - 1, e->d_name);
    }
    closedir(d);
    return 0;
}

int sst_claim_look(struct sst_claim_info *out, const char *dir)
{
    int err = -ENOENT;

    for (int i = 0; i < 100 && err == -ENOENT; i++) { /* renamed since it was listed: once more */
        *out = (struct sst_claim_info){ 0 };
        err = find_file(out, dir);
        if (!err && out->file[0])
            err = read_file(out, dir);
    }
    if (err == -ENOENT || err == -ESTALE) { /* it changes faster than it can be read: held by another process */
        out->state = SST_CLAIM_HELD;
        return 0;
    }
    return err;
}

bool sst_claim_expired(struct sst_claim_watch *w, const struct sst_claim_info *info, int lease_ms)
{
    const int64_t now_ns = sst_clock_now_ns();

    if (info->state != SST_CLAIM_HELD || !info->file[0] || strcmp(w->file, info->file) ||
        w->touched_ns != info->touched_ns) {
        snprintf(w->file, sizeof(w->file), "%s", info->file);
        w->touched_ns = info->touched_ns;
        w->since_ns = now_ns;
        return false;
    }
    return now_ns - w->since_ns > lease_ms * INT64_C(1000000);
}

/* --- holding ------------------------------------------------------------------------------------------------------ */

static void *keep_alive(void *arg)
{
    struct sst_claim *c = arg;
    const int64_t every_ns = c->lease_ms * INT64_C(1000000) / 4;

    sst_thread_name("claim");
    pthread_mutex_lock(&c->lock);
    while (!c->ending) {
        (void)sst_cond_wait_until(&c->wake, &c->lock, sst_clock_now_ns() + every_ns);
        if (!c->ending) /* a failure here is found by sst_claim_end() */
            (void)utimensat(AT_FDCWD, c->path, NULL, 0);
    }
    pthread_mutex_unlock(&c->lock);
    return NULL;
}

static void name_worker(struct sst_claim *c, char file[SST_CLAIM_NAME])
{
    char host[65] = "";
    uint32_t number = 0;

    (void)gethostname(host, sizeof(host) - 1);
    host[strcspn(host, "/ \n")] = 0;
    while (getrandom(&number, sizeof(number), 0) < 0 && errno == EINTR)
        ;
    snprintf(c->worker, sizeof(c->worker), "%s.%ld", host, (long)getpid());
    snprintf(file, SST_CLAIM_NAME, HELD "%s.%08x", c->worker, number);
}

/* The state's folder, with the file of this holder in it, appears at once. */
static int make_state(const char *dir, const char *file)
{
    char fresh[SST_PATH_MAX + SST_CLAIM_NAME + 8], path[sizeof(fresh) + SST_CLAIM_NAME];
    int fd, err;

    snprintf(fresh, sizeof(fresh), "%s.%s", dir, file);
    snprintf(path, sizeof(path), "%s/%s", fresh, file);
    if (mkdir(fresh, 0777))
        return log_error("create", fresh, errno);
    fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    err = fd < 0 ? log_error("create", path, errno) : 0;
    if (fd >= 0)
        close(fd);
    if (!err && rename(fresh, dir))
        err = errno == EEXIST || errno == ENOTEMPTY ? -EBUSY : log_error("create", dir, errno);
    if (err)
        sst_path_remove_tree(fresh);
    return err;
}

static int claim_file(const char *dir, const char *seen, const char *file, const char *path)
{
    char from[SST_PATH_MAX];
    int err;

    if (!seen[0])
        return make_state(dir, file);
    err = sst_path_join(from, dir, seen);
    if (!err && rename(from, path))
        err = errno == ENOENT ? -EBUSY : log_error("rename", from, errno);
    return err;
}

static void destroy(struct sst_claim *c)
{
    pthread_cond_destroy(&c->wake);
    pthread_mutex_destroy(&c->lock);
    free(c);
}

int sst_claim_take(struct sst_claim **out, const char *dir, const struct sst_claim_info *seen, const char *job,
                   int lease_ms)
{
    struct sst_claim *c = calloc(1, sizeof(*c));
    char file[SST_CLAIM_NAME];
    int err;

    if (!c) {
        sst_log_error("not enough memory for the state of shared work");
        return -ENOMEM;
    }
    pthread_mutex_init(&c->lock, NULL);
    sst_cond_init(&c->wake);
    name_worker(c, file);
    snprintf(c->dir, sizeof(c->dir), "%s", dir);
    snprintf(c->job, sizeof(c->job), "%s", job);
    c->lease_ms = lease_ms;
    c->start_ns = sst_clock_now_ns();
    c->attempts = (seen->state == SST_CLAIM_HELD && !strcmp(seen->job, c->job) ? seen->attempts : 0) + 1;
    err = sst_path_join(c->path, dir, file);
    if (!err) {
        sst_file_remove_on_interrupt(c->path);
        sst_file_hold_interrupt();
        err = claim_file(dir, seen->file, file, c->path);
        sst_file_allow_interrupt();
    }
    if (err) {
        sst_file_keep_on_interrupt(c->path);
        destroy(c);
        return err;
    }
    err = write_file(c, NULL);
    if (err)
        (void)log_error("write", c->path, -err);
    if (!err && pthread_create(&c->thread, NULL, keep_alive, c)) {
        sst_log_error("cannot start a thread for the state of shared work; end other programs or raise the limit");
        err = -EAGAIN;
    }
    if (err) {
        unlink(c->path);
        sst_file_keep_on_interrupt(c->path);
        destroy(c);
        return err;
    }
    *out = c;
    return 0;
}

int sst_claim_attempts(const struct sst_claim *c)
{
    return c->attempts;
}

int sst_claim_end(struct sst_claim *c, const char *error)
{
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, c->dir, error ? failed_name : done_name);

    pthread_mutex_lock(&c->lock);
    c->ending = true;
    pthread_cond_signal(&c->wake);
    pthread_mutex_unlock(&c->lock);
    pthread_join(c->thread, NULL);
    err = err ? err : write_file(c, error);
    sst_file_keep_on_interrupt(c->path);
    if (!err && rename(c->path, path))
        err = -errno;
    if (err == -ENOENT) {
        sst_log_warning("%s: %s has given no sign of life for %.1f s, and another worker has its piece now; the result "
                        "is the same",
                        c->dir, c->worker, c->lease_ms * 1e-3);
        err = -ESTALE;
    } else if (err) {
        (void)log_error("write", c->path, -err);
    }
    destroy(c);
    return err;
}

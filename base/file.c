/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "base/file.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"

/* Number of temporary files and folders that an interrupt removes. */
#define MAX_PENDING 64

static pthread_mutex_t pending_lock = PTHREAD_MUTEX_INITIALIZER;
static char pending[MAX_PENDING][SST_PATH_MAX]; /* under pending_lock */
static bool pending_synced[MAX_PENDING];        /* under pending_lock: a folder that sst_outdir_commit() syncs */
static sem_t interrupted;
static _Atomic int interrupted_by; /* the first signal */

static void pending_add_locked(const char *path, bool synced)
{
    for (int i = 0; i < MAX_PENDING; i++) {
        if (!pending[i][0]) {
            snprintf(pending[i], SST_PATH_MAX, "%s", path);
            pending_synced[i] = synced;
            break;
        }
    }
}

/* Create the file or folder of a template (XXXXXX) and register it, so that an interrupt removes it.
 * @return the file's descriptor, 0 for a folder, or -1 with errno */
static int pending_make(char *name, bool folder)
{
    int fd;

    pthread_mutex_lock(&pending_lock);
    fd = !folder ? mkostemp(name, O_CLOEXEC) : mkdtemp(name) ? 0 : -1;
    if (fd >= 0)
        pending_add_locked(name, folder);
    pthread_mutex_unlock(&pending_lock);
    return fd;
}

static void pending_drop(const char *path)
{
    pthread_mutex_lock(&pending_lock);
    for (int i = 0; i < MAX_PENDING; i++) {
        if (!strcmp(pending[i], path))
            pending[i][0] = 0;
    }
    pthread_mutex_unlock(&pending_lock);
}

/* Whether a path lies in a folder that is synced as a whole later. */
static bool pending_holds(const char *path)
{
    bool holds = false;

    pthread_mutex_lock(&pending_lock);
    for (int i = 0; i < MAX_PENDING && !holds; i++) {
        const size_t n = pending_synced[i] ? strlen(pending[i]) : 0;

        holds = n && !strncmp(path, pending[i], n) && path[n] == '/';
    }
    pthread_mutex_unlock(&pending_lock);
    return holds;
}

void sst_file_remove_on_interrupt(const char *path)
{
    pthread_mutex_lock(&pending_lock);
    pending_add_locked(path, false);
    pthread_mutex_unlock(&pending_lock);
}

void sst_file_keep_on_interrupt(const char *path)
{
    pending_drop(path);
}

void sst_file_hold_interrupt(void)
{
    pthread_mutex_lock(&pending_lock);
}

void sst_file_allow_interrupt(void)
{
    pthread_mutex_unlock(&pending_lock);
}

/* A thread whose output fails because it is being removed waits here, without a message, for the end of the process: by
 * continuing, it could end the process before everything is removed. */
static void wait_if_interrupted(void)
{
    sst_file_hold_interrupt();
    sst_file_allow_interrupt();
}

/* Runs on a thread, because a signal handler may neither allocate memory nor list a folder: the interrupted thread
 * could hold the allocator's lock. */
static void *end_when_interrupted(void *arg SST_UNUSED)
{
    char gone[SST_PATH_MAX + 8];

    while (sem_wait(&interrupted))
        ;
    sst_file_hold_interrupt();
    /* Other threads keep writing until the process exits: after the rename they cannot add further files to a folder
     * that is being removed. */
    for (int i = 0; i < MAX_PENDING; i++) {
        if (!pending[i][0])
            continue;
        snprintf(gone, sizeof(gone), "%.*s-gone", SST_PATH_MAX, pending[i]);
        if (rename(pending[i], gone))
            continue;
        for (int again = 0; again < 3 && sst_path_exists(gone); again++)
            sst_path_remove_tree(gone);
    }
    if (interrupted_by == SIGQUIT) { /* whoever sends it wants the core */
        signal(SIGQUIT, SIG_DFL);
        pthread_sigmask(SIG_SETMASK, &(sigset_t){ 0 }, NULL);
        raise(SIGQUIT);
    }
    _exit(128 + interrupted_by);
}

static void on_signal(int sig)
{
    const int saved = errno;
    int none = 0;

    if (atomic_compare_exchange_strong(&interrupted_by, &none, sig))
        (void)sem_post(&interrupted);
    errno = saved;
}

int sst_file_flush_output(void)
{
    static bool logged;

    errno = 0;
    if (!fflush(stdout) && !ferror(stdout))
        return 0;
    if (!logged && errno != EPIPE) /* `| head` has read enough */
        sst_log_error("cannot write to standard output: %s", errno ? strerror(errno) : "a part of it is lost");
    logged = true;
    return -EIO;
}

int sst_file_clean_on_interrupt(void)
{
    static const int always[] = { SIGINT, SIGTERM }, unless_ignored[] = { SIGHUP, SIGQUIT }; /* as nohup and shells do */
    const struct sigaction act = { .sa_handler = on_signal, .sa_flags = SA_RESTART };
    struct sigaction had;
    pthread_t thread;
    sigset_t all, before;
    int err = sem_init(&interrupted, 0, 0) ? errno : 0;

    /* The thread blocks all signals, so that a caller that blocks them later, to read them, gets them all. */
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    err = err ? err : pthread_create(&thread, NULL, end_when_interrupted, NULL);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (err) {
        sst_log_error("cannot start a thread: %s; end other programs or raise the limit", strerror(err));
        return -err;
    }
    pthread_detach(thread);
    for (size_t i = 0; i < ARRAY_LEN(always); i++)
        sigaction(always[i], &act, NULL);
    for (size_t i = 0; i < ARRAY_LEN(unless_ignored); i++) {
        if (!sigaction(unless_ignored[i], NULL, &had) && had.sa_handler != SIG_IGN)
            sigaction(unless_ignored[i], &act, NULL);
    }
    return 0;
}

int sst_path_join(char out[SST_PATH_MAX], const char *dir, const char *name)
{
    const int n = name ? snprintf(out, SST_PATH_MAX, "%s/%s", dir, name) : snprintf(out, SST_PATH_MAX, "%s", dir);

    if (n >= 0 && n < SST_PATH_MAX)
        return 0;
    sst_log_error("the path %.60s... is longer than %d bytes; use a shorter one", dir, SST_PATH_MAX);
    return -ENAMETOOLONG;
}

const char *sst_path_base(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash ? slash + 1 : path;
}

int sst_path_beside_program(char out[SST_PATH_MAX], const char *below)
{
    char exe[SST_PATH_MAX] = "", *slash;

    if (readlink("/proc/self/exe", exe, sizeof(exe) - 1) < 0 || !(slash = strrchr(exe, '/')))
        return -ENOENT;
    *slash = 0;
    return sst_path_join(out, exe, below);
}

bool sst_path_exists(const char *path)
{
    struct stat st;

    return !lstat(path, &st);
}

bool sst_path_is_dir(const char *path)
{
    struct stat st;

    return !stat(path, &st) && S_ISDIR(st.st_mode);
}

bool sst_path_is_denied(const char *path)
{
    return access(path, R_OK) && errno == EACCES;
}

const char *sst_file_line(char *out, size_t size, const char *path)
{
    FILE *f = fopen(path, "re");

    if (!f || !fgets(out, (int)size, f))
        out[0] = 0;
    out[strcspn(out, "\n")] = 0;
    if (f)
        fclose(f);
    return out;
}

int sst_file_open(const char *path)
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK); /* a pipe without a writer must not hang */
    struct stat st;
    int err;

    if (fd < 0)
        return -errno;
    err = fstat(fd, &st) ? -errno : S_ISDIR(st.st_mode) ? -EISDIR : S_ISREG(st.st_mode) ? 0 : -EBADMSG;
    if (err)
        close(fd);
    return err ? err : fd;
}

int sst_file_read(const char *path, size_t limit_bytes, uint8_t **data, size_t *size)
{
    const int fd = sst_file_open(path);
    FILE *f = fd < 0 ? NULL : fdopen(fd, "rb");
    struct stat st;
    uint8_t *buf = NULL;
    int err;

    if (fd == -EISDIR || fd == -EBADMSG) {
        sst_log_error("%s is not a regular file; name a file", path);
        return fd;
    }
    if (!f) {
        err = fd < 0 ? fd : -errno;
        sst_log_error("cannot open %s: %s", path, strerror(-err));
        if (fd >= 0)
            close(fd);
        return err;
    }
    if (fstat(fd, &st)) {
        err = -EIO;
        sst_log_error("cannot read %s: %s", path, strerror(errno));
        goto fail;
    }
    if ((uint64_t)st.st_size > limit_bytes) {
        err = -EBADMSG;
        sst_log_error("%s has %lld bytes, more than the limit of %zu", path, (long long)st.st_size, limit_bytes);
        goto fail;
    }
    buf = malloc((size_t)st.st_size + 1);
    if (!buf) {
        err = -ENOMEM;
        sst_log_error("no memory to read %s (%lld bytes)", path, (long long)st.st_size);
        goto fail;
    }
    *size = fread(buf, 1, (size_t)st.st_size, f);
    if (*size != (size_t)st.st_size) {
        err = ferror(f) ? -EIO : -EBADMSG;
        sst_log_error("reading %s stopped after %zu of %lld bytes: it changed or the disk failed; try again", path,
                      *size, (long long)st.st_size);
        goto fail;
    }
    fclose(f);
    buf[*size] = 0;
    *data = buf;
    return 0;

fail:
    free(buf);
    fclose(f);
    return err;
}

int sst_file_read_text(const char *path, size_t limit_bytes, uint8_t **text, size_t *size)
{
    static const char mark[] = "\xef\xbb\xbf"; /* Windows' editors begin UTF-8 with it */
    uint8_t *t;
    size_t n;
    const int err = sst_file_read(path, limit_bytes, &t, &n);

    if (err)
        return err;
    if (n >= 2 && (!memcmp(t, "\xff\xfe", 2) || !memcmp(t, "\xfe\xff", 2) || !t[0] || !t[1])) {
        sst_log_error("%s is a text in UTF-16 or UTF-32; save it as UTF-8", path);
        free(t);
        return -EBADMSG;
    }
    if (n >= 3 && !memcmp(t, mark, 3)) {
        n -= 3;
        memmove(t, t + 3, n + 1);
    }
    *text = t;
    *size = n;
    return 0;
}

/* Log a failed output and map its errno: errors that callers can act on stay, the others become -EIO. */
static int output_error(const char *what, const char *path, int err)
{
    wait_if_interrupted();
    sst_log_error("cannot %s %s: %s", what, path, strerror(err));
    switch (err) {
    case ENOSPC:
    case EDQUOT:
    case EROFS:
    case EFBIG:
    case EEXIST:
        return -err;
    default:
        return -EIO;
    }
}

int sst_path_make_dir(const char *path)
{
    if (!mkdir(path, 0777) || (errno == EEXIST && sst_path_is_dir(path)))
        return 0;
    return output_error("create the folder", path, errno);
}

static int temporary_name(char out[SST_PATH_MAX], const char *path)
{
    size_t n = strlen(path);

    while (n > 1 && path[n - 1] == '/')
        n--;
    if (snprintf(out, SST_PATH_MAX, "%.*s.tmp-XXXXXX", (int)n, path) < SST_PATH_MAX)
        return 0;
    return output_error("create", path, ENAMETOOLONG);
}

static pthread_once_t mask_once = PTHREAD_ONCE_INIT;
static mode_t mask; /* fixed after mask_once */

/* Reading the mask sets it: threads doing so at the same time could leave it at 0. */
static void read_mask(void)
{
    mask = umask(0);
    umask(mask);
}

/* The final rename would replace a device such as /dev/null by a file. */
static int check_regular(const char *path)
{
    struct stat st;

    if (stat(path, &st) || S_ISREG(st.st_mode))
        return 0;
    sst_log_error("%s is %s; name a file to write", path, S_ISDIR(st.st_mode) ? "a folder" : "not a regular file");
    return -EEXIST;
}

int sst_path_check_new(const char *path, bool file)
{
    char parent[SST_PATH_MAX];
    size_t n = strlen(path);

    while (n > 1 && path[n - 1] == '/')
        n--;
    while (n > 0 && path[n - 1] != '/')
        n--;
    snprintf(parent, sizeof(parent), "%.*s", (int)n, path);
    if (faccessat(AT_FDCWD, n ? parent : ".", W_OK | X_OK, AT_EACCESS))
        return output_error("create", path, errno);
    return file ? check_regular(path) : 0;
}

int sst_outfile_open(struct sst_outfile *out, const char *path)
{
    int err, fd;

    pthread_once(&mask_once, read_mask);
    *out = (struct sst_outfile){ 0 };
    err = check_regular(path);
    if (err)
        return err;
    err = temporary_name(out->temporary, path);
    if (err)
        return err;
    fd = pending_make(out->temporary, false);
    if (fd < 0) {
        err = output_error("create", path, errno);
        out->temporary[0] = 0;
        return err;
    }
    (void)fchmod(fd, 0666 & ~mask);
    out->stream = fdopen(fd, "wb");
    if (!out->stream) {
        close(fd);
        sst_outfile_abort(out);
        return -ENOMEM;
    }
    snprintf(out->path, sizeof(out->path), "%s", path);
    return 0;
}

int sst_outfile_open_in(struct sst_outfile *out, const char *dir, const char *name)
{
    char path[SST_PATH_MAX];
    const int err = sst_path_join(path, dir, name);

    return err ? err : sst_outfile_open(out, path);
}

static int sync_parent(const char *path)
{
    char dir[SST_PATH_MAX];
    const char *base = sst_path_base(path);
    int fd, err = 0;

    snprintf(dir, sizeof(dir), "%.*s", (int)(base - path), path);
    fd = open(dir[0] ? dir : ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0)
        return -errno;
    if (fsync(fd) && errno != EINVAL)
        err = -errno;
    close(fd);
    return err;
}

int sst_outfile_commit(struct sst_outfile *out)
{
    int err = 0;

    if (fflush(out->stream) || ferror(out->stream) || (!out->unsynced && fsync(fileno(out->stream)) && errno != EINVAL))
        err = errno ? errno : EIO;
    if (fclose(out->stream) && !err)
        err = errno;
    out->stream = NULL;
    if (!err && rename(out->temporary, out->path))
        err = errno;
    if (err) {
        err = output_error("write", out->path, err);
        sst_outfile_abort(out);
        return err;
    }
    pending_drop(out->temporary);
    out->temporary[0] = 0;
    err = out->unsynced || pending_holds(out->path) ? 0 : sync_parent(out->path);
    return err ? output_error("sync the folder of", out->path, -err) : 0;
}

void sst_outfile_abort(struct sst_outfile *out)
{
    wait_if_interrupted();
    if (out->stream)
        fclose(out->stream);
    out->stream = NULL;
    if (out->temporary[0]) {
        unlink(out->temporary);
        pending_drop(out->temporary);
    }
    out->temporary[0] = 0;
}

int sst_file_write(const char *path, const void *data, size_t size)
{
    struct sst_outfile out;
    int err = sst_outfile_open(&out, path);

    if (err)
        return err;
    if (size && fwrite(data, 1, size, out.stream) != size) {
        err = output_error("write", path, errno);
        sst_outfile_abort(&out);
        return err;
    }
    return sst_outfile_commit(&out);
}

int sst_file_write_at(int fd, const void *data, size_t size, int64_t offset)
{
    size_t done = 0;

    while (done < size) {
        const ssize_t n = pwrite(fd, (const char *)data + done, size - done, offset + (int64_t)done);

        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return n < 0 ? -errno : -EIO;
        done += (size_t)n;
    }
    return 0;
}

static int check_absent(const char *path, bool replace)
{
    if (replace || !sst_path_exists(path))
        return 0;
    sst_log_error("%s exists already; remove it, choose another name or add --force", path);
    return -EEXIST;
}

int sst_outdir_open(struct sst_outdir *out, const char *path, bool replace)
{
    int err;

    pthread_once(&mask_once, read_mask);
    *out = (struct sst_outdir){ .replace = replace };
    err = check_absent(path, replace);
    if (err)
        return err;
    err = temporary_name(out->temporary, path);
    if (err)
        return err;
    if (pending_make(out->temporary, true)) {
        err = output_error("create", path, errno);
        out->temporary[0] = 0;
        return err;
    }
    (void)chmod(out->temporary, 0777 & ~mask);
    /* The final name, without trailing slashes, is the temporary one without its suffix. */
    snprintf(out->path, sizeof(out->path), "%.*s", (int)(strlen(out->temporary) - strlen(".tmp-XXXXXX")),
             out->temporary);
    return 0;
}

static int sync_entry(const char *path, const struct stat *st SST_UNUSED, int type, struct FTW *ftw SST_UNUSED)
{
    int fd, err = 0;

    if (type != FTW_F && type != FTW_DP)
        return 0;
    fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    if (fd < 0)
        return errno;
    if (fsync(fd) && errno != EINVAL)
        err = errno;
    close(fd);
    return err;
}

static int sync_folder(const char *path, const struct stat *st, int type, struct FTW *ftw)
{
    return type == FTW_DP ? sync_entry(path, st, type, ftw) : 0;
}

int sst_outdir_sync(const struct sst_outdir *out)
{
    const int failed = nftw(out->temporary, out->synced ? sync_folder : sync_entry, 16, FTW_DEPTH | FTW_PHYS);
    const int err = failed < 0 ? -errno : -failed;

    if (err)
        wait_if_interrupted();
    return err;
}

int sst_path_swap(const char *fresh, const char *path)
{
    char aside[SST_PATH_MAX];
    int err;

    if (!renameat2(AT_FDCWD, fresh, AT_FDCWD, path, RENAME_EXCHANGE))
        return 0;
    if (errno == ENOENT)
        return rename(fresh, path) ? -errno : 0;
    if (errno != EINVAL && errno != ENOSYS)
        return -errno;
    /* The file system cannot exchange two names. */
    if (snprintf(aside, sizeof(aside), "%s-old", fresh) >= (int)sizeof(aside))
        return -ENAMETOOLONG;
    if (rename(path, aside))
        return -errno;
    if (!rename(fresh, path))
        return rename(aside, fresh) ? -errno : 0;
    err = -errno;
    if (rename(aside, path))
        sst_log_error("the previous %s is now at %s", path, aside);
    return err;
}

int sst_outdir_commit(struct sst_outdir *out)
{
    int err = sst_outdir_sync(out);

    sst_file_hold_interrupt();
    if (!err)
        err = out->replace ? sst_path_swap(out->temporary, out->path) : rename(out->temporary, out->path) ? -errno : 0;
    sst_file_allow_interrupt();
    if (err) {
        err = output_error("write", out->path, -err);
        sst_outdir_abort(out);
        return err;
    }
    sst_outdir_abort(out); /* removes the previous folder, if there was one */
    err = sync_parent(out->path);
    return err ? output_error("sync the folder of", out->path, -err) : 0;
}

void sst_outdir_abort(struct sst_outdir *out)
{
    wait_if_interrupted();
    if (out->temporary[0]) {
        sst_path_remove_tree(out->temporary);
        pending_drop(out->temporary);
    }
    out->temporary[0] = 0;
}

int sst_outdir_end(struct sst_outdir *out, int err)
{
    if (!err)
        return sst_outdir_commit(out);
    sst_outdir_abort(out);
    return err;
}

/* True if the folder `inner` is `outer` or below it. Both must exist. */
bool sst_path_is_inside(const char *inner, const char *outer)
{
    char *a = realpath(inner, NULL), *b = realpath(outer, NULL);
    const size_t n = b ? strlen(b) : 0;
    const bool inside = a && b && !strncmp(a, b, n) && (!a[n] || a[n] == '/' || !strcmp(b, "/"));

    free(a);
    free(b);
    return inside;
}

/* Name without links, of a file that may be absent. @return false: its folder does not exist, or it is too long */
static bool resolve(char out[SST_PATH_MAX], const char *path)
{
    size_t n = strlen(path);
    char *real = realpath(path, NULL), parent[SST_PATH_MAX];
    const char *slash, *name = "";

    if (!real && n < sizeof(parent)) {
        memcpy(parent, path, n + 1);
        while (n > 1 && parent[n - 1] == '/')
            parent[--n] = 0;
        slash = strrchr(parent, '/');
        name = path + (slash ? slash + 1 - parent : 0);
        n = strcspn(name, "/");
        parent[name - path] = 0;
        real = realpath(*parent ? parent : ".", NULL);
    }
    n = real ? (size_t)snprintf(out, SST_PATH_MAX, "%s%s%.*s", real, *name ? "/" : "", (int)n, name) : SST_PATH_MAX;
    free(real);
    return n < SST_PATH_MAX;
}

bool sst_path_is_same(const char *a, const char *b)
{
    char x[SST_PATH_MAX], y[SST_PATH_MAX];

    return !strcmp(a, b) || (resolve(x, a) && resolve(y, b) && !strcmp(x, y));
}

static bool is_empty(const char *dir)
{
    DIR *d = opendir(dir);
    struct dirent *e;
    int n = 0;

    while (d && n < 3 && (e = readdir(d)))
        n++;
    if (d)
        closedir(d);
    return d && n < 3; /* . and .. */
}

int sst_path_check_keeps(const char *path, const char *input)
{
    static const char *const parts[] = { "lightfield.json", "calibration.yaml", "views",       "disparity", "confidence",
                                         "labels",          "labels_initial",   "labels_hcsm", "entropy",   "truth" };
    const bool folder = sst_path_is_dir(input);
    char part[SST_PATH_MAX];
    struct stat st;
    bool read = false;

    if (stat(path, &st) || !S_ISREG(st.st_mode))
        return 0;
    for (size_t i = 0; folder && i < ARRAY_LEN(parts); i++)
        read |= snprintf(part, sizeof(part), "%s/%s", input, parts[i]) < SST_PATH_MAX && sst_path_is_inside(path, part);
    if (!read && (folder || !sst_path_is_inside(path, input)))
        return 0;
    sst_log_error("%s would be replaced, which is read from; choose another output", path);
    return -EINVAL;
}

int sst_path_check_file(const char *out, bool force)
{
    const int err = sst_path_check_new(out, true);

    return err ? err : check_absent(out, force);
}

int sst_path_check_output(const char *out, bool force, const char *marker, const char *const *inputs)
{
    char path[SST_PATH_MAX];
    int err = check_absent(out, force);

    err = err ? err : sst_path_check_new(out, false);
    if (err || !sst_path_exists(out))
        return err;
    for (; *inputs; inputs++) {
        if (sst_path_is_inside(*inputs, out)) {
            sst_log_error("%s would be replaced, and %s with it; choose another output", out, *inputs);
            return -EINVAL;
        }
    }
    if (sst_path_join(path, out, marker))
        return -EEXIST;
    if (sst_path_exists(path) || is_empty(out))
        return 0;
    sst_log_error("%s holds no %s, so --force does not replace it; remove it yourself or choose another output", out,
                  marker);
    return -EEXIST;
}

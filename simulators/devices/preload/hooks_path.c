/* Interposed libc functions that work on paths. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <glob.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include "simulators/devices/preload/preload_internal.h"

/* The path for the next function; NULL with errno set: not found. */
static const char *other_path(int dirfd, const char *path, bool follow, struct sim_path *p)
{
    sim_path_resolve(dirfd, path, follow, p);
    if (p->kind == SIM_PATH_MISSING) {
        errno = ENOENT;
        return NULL;
    }
    return p->kind == SIM_PATH_OTHER ? path : p->real;
}

static mode_t device_mode(mode_t mode)
{
    return (mode & 0777) | S_IFCHR | 0060;
}

/* --- stat --------------------------------------------------------------------------------------------------------- */

#define STAT_BODY(dirfd, follow, call)                                                                                 \
    struct sim_path p;                                                                                                 \
    int result;                                                                                                        \
    path = other_path(dirfd, path, follow, &p);                                                                        \
    if (!path)                                                                                                         \
        return -1;                                                                                                     \
    result = call;                                                                                                     \
    if (result == 0 && p.kind == SIM_PATH_NODE) {                                                                      \
        st->st_mode = device_mode(st->st_mode);                                                                        \
        st->st_rdev = makedev(p.dev_major, p.dev_minor);                                                               \
        st->st_size = 0;                                                                                               \
    }                                                                                                                  \
    return result;

#define STAT_HOOK(name, type, follow)                                                                                  \
    HOOK int name(const char *restrict path, struct type *restrict st)                                                 \
    {                                                                                                                  \
        NEXT(int, name, const char *, struct type *);                                                                  \
        STAT_BODY(AT_FDCWD, follow, next(path, st))                                                                    \
    }
#define STATAT_HOOK(name, type)                                                                                        \
    HOOK int name(int dirfd, const char *restrict path, struct type *restrict st, int flags)                           \
    {                                                                                                                  \
        NEXT(int, name, int, const char *, struct type *, int);                                                        \
        STAT_BODY(dirfd, !(flags & AT_SYMLINK_NOFOLLOW), next(dirfd, path, st, flags))                                 \
    }
/* Programs built against glibc before 2.33 */
#define XSTAT_HOOK(name, type, follow)                                                                                 \
    HOOK int name(int version, const char *path, struct type *st);                                                     \
    HOOK int name(int version, const char *path, struct type *st)                                                      \
    {                                                                                                                  \
        NEXT(int, name, int, const char *, struct type *);                                                             \
        STAT_BODY(AT_FDCWD, follow, next(version, path, st))                                                           \
    }

STAT_HOOK(stat, stat, true)
STAT_HOOK(lstat, stat, false)
STAT_HOOK(stat64, stat64, true)
STAT_HOOK(lstat64, stat64, false)
STATAT_HOOK(fstatat, stat)
STATAT_HOOK(fstatat64, stat64)
XSTAT_HOOK(__xstat, stat, true)
XSTAT_HOOK(__lxstat, stat, false)
XSTAT_HOOK(__xstat64, stat64, true)
XSTAT_HOOK(__lxstat64, stat64, false)

HOOK int statx(int dirfd, const char *restrict path, int flags, unsigned mask, struct statx *restrict st)
{
    NEXT(int, statx, int, const char *, int, unsigned, struct statx *);
    struct sim_path p;
    int result;

    path = other_path(dirfd, path, !(flags & AT_SYMLINK_NOFOLLOW), &p);
    if (!path)
        return -1;
    result = next(dirfd, path, flags, mask, st);
    if (result == 0 && p.kind == SIM_PATH_NODE) {
        st->stx_mode = (uint16_t)device_mode(st->stx_mode);
        st->stx_rdev_major = p.dev_major;
        st->stx_rdev_minor = p.dev_minor;
        st->stx_size = 0;
    }
    return result;
}

/* An open device file: it is a socket, so /proc/self/fd has no device path; ask the simulator. */
static bool fstat_ours(int fd, struct sst_sim_answer *answer)
{
    struct sim_exchange x = { .call = { .op = SST_SIM_STAT }, .send_fd = -1 };
    struct sim_id id;

    if (!sim_identify(fd, &id))
        return false;
    x.call.handle = id.handle;
    (void)sim_exchange(&x);
    *answer = x.answer;
    return true;
}

#define FSTAT_BODY(call)                                                                                               \
    const int result = call;                                                                                           \
    struct sst_sim_answer answer;                                                                                      \
    if (result == 0 && S_ISSOCK(st->st_mode) && fstat_ours(fd, &answer)) {                                             \
        st->st_mode = S_IFCHR | 0660;                                                                                  \
        st->st_rdev = answer.result < 0 ? 0 : makedev((unsigned)(answer.arg >> 32), (unsigned)answer.arg);             \
    }                                                                                                                  \
    return result;

#define FSTAT_HOOK(name, type)                                                                                         \
    HOOK int name(int fd, struct type *st)                                                                             \
    {                                                                                                                  \
        NEXT(int, name, int, struct type *);                                                                           \
        FSTAT_BODY(next(fd, st))                                                                                       \
    }
#define FXSTAT_HOOK(name, type)                                                                                        \
    HOOK int name(int version, int fd, struct type *st);                                                               \
    HOOK int name(int version, int fd, struct type *st)                                                                \
    {                                                                                                                  \
        NEXT(int, name, int, int, struct type *);                                                                      \
        FSTAT_BODY(next(version, fd, st))                                                                              \
    }

FSTAT_HOOK(fstat, stat)
FSTAT_HOOK(fstat64, stat64)
FXSTAT_HOOK(__fxstat, stat)
FXSTAT_HOOK(__fxstat64, stat64)

/* --- rights, links ------------------------------------------------------------------------------------------------ */

/* Body of a hook with a path of folder `dirfd`: -1 if it is not found, else `call`, the next function. */
#define PATH_BODY(dirfd, follow, call)                                                                                 \
    struct sim_path p;                                                                                                 \
    path = other_path(dirfd, path, follow, &p);                                                                        \
    return path ? call : -1;

#define ACCESS_HOOK(name)                                                                                              \
    HOOK int name(const char *path, int mode)                                                                          \
    {                                                                                                                  \
        NEXT(int, name, const char *, int);                                                                            \
        PATH_BODY(AT_FDCWD, true, next(path, mode))                                                                    \
    }

ACCESS_HOOK(access)
ACCESS_HOOK(euidaccess)

HOOK int faccessat(int dirfd, const char *path, int mode, int flags)
{
    NEXT(int, faccessat, int, const char *, int, int);
    PATH_BODY(dirfd, !(flags & AT_SYMLINK_NOFOLLOW), next(dirfd, path, mode, flags))
}

HOOK ssize_t readlink(const char *restrict path, char *restrict out, size_t bytes)
{
    NEXT(ssize_t, readlink, const char *, char *, size_t);
    PATH_BODY(AT_FDCWD, false, next(path, out, bytes))
}

HOOK ssize_t readlinkat(int dirfd, const char *restrict path, char *restrict out, size_t bytes)
{
    NEXT(ssize_t, readlinkat, int, const char *, char *, size_t);
    PATH_BODY(dirfd, false, next(dirfd, path, out, bytes))
}

/* libc resolves links with internal calls that cannot be interposed. A device's path resolves to the one under /dev. */
HOOK char *realpath(const char *restrict path, char *restrict out)
{
    NEXT(char *, realpath, const char *, char *);
    struct sim_path p;
    const char *other = other_path(AT_FDCWD, path, true, &p);
    char *result = other ? next(other, out) : NULL;
    const size_t dir_bytes = sim_dir() ? strlen(sim_dir()) : 0;

    if (result && p.kind != SIM_PATH_OTHER && strncmp(result, sim_dir(), dir_bytes) == 0)
        memmove(result, result + dir_bytes, strlen(result + dir_bytes) + 1);
    return result;
}

/* The one of programs built with _FORTIFY_SOURCE. */
char *__realpath_chk(const char *path, char *out, size_t room);

HOOK char *__realpath_chk(const char *path, char *out, size_t room SST_UNUSED)
{
    return realpath(path, out);
}

/* --- folders ------------------------------------------------------------------------------------------------------ */

HOOK DIR *opendir(const char *path)
{
    NEXT(DIR *, opendir, const char *);
    struct sim_path p;

    path = other_path(AT_FDCWD, path, true, &p);
    return path ? next(path) : NULL;
}

/* In the session's /dev a device is a small file: stat() reports its type. */
static bool in_session(DIR *dir)
{
    struct sim_path p;

    if (!sim_dir() || !dir)
        return false;
    sim_path_resolve(dirfd(dir), ".", true, &p);
    return p.kind == SIM_PATH_PLAIN;
}

#define READDIR_HOOK(name, type)                                                                                       \
    HOOK struct type *name(DIR *dir)                                                                                   \
    {                                                                                                                  \
        NEXT(struct type *, name, DIR *);                                                                              \
        struct type *e = next(dir);                                                                                    \
        if (e && e->d_type == DT_REG && in_session(dir))                                                               \
            e->d_type = DT_UNKNOWN;                                                                                    \
        return e;                                                                                                      \
    }
#define SCANDIR_HOOK(name, type)                                                                                       \
    HOOK int name(const char *restrict path, struct type ***restrict list, int (*choose)(const struct type *),         \
                  int (*order)(const struct type **, const struct type **))                                            \
    {                                                                                                                  \
        NEXT(int, name, const char *, struct type ***, int (*)(const struct type *),                                   \
             int (*)(const struct type **, const struct type **));                                                     \
        PATH_BODY(AT_FDCWD, true, next(path, list, choose, order))                                                     \
    }

READDIR_HOOK(readdir, dirent)
READDIR_HOOK(readdir64, dirent64)
SCANDIR_HOOK(scandir, dirent)
SCANDIR_HOOK(scandir64, dirent64)

static void glob_closedir(void *dir)
{
    (void)closedir(dir);
}

static struct dirent *glob_readdir(void *dir)
{
    return readdir(dir);
}

static void *glob_opendir(const char *path)
{
    return opendir(path);
}

/* libc's own directory walk would not see the session's /dev. */
static void glob_ours(glob_t *g)
{
    g->gl_opendir = glob_opendir;
    g->gl_closedir = glob_closedir;
    g->gl_readdir = glob_readdir;
    g->gl_stat = stat;
    g->gl_lstat = lstat;
}

HOOK int glob(const char *restrict pattern, int flags, int (*failed)(const char *, int), glob_t *restrict g)
{
    NEXT(int, glob, const char *, int, int (*)(const char *, int), glob_t *);

    if (sim_dir() && !(flags & GLOB_ALTDIRFUNC) && strncmp(pattern, "/dev/", 5) == 0) {
        glob_ours(g);
        flags |= GLOB_ALTDIRFUNC;
    }
    return next(pattern, flags, failed, g);
}

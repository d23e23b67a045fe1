/* simulators/devices/preload/hooks_sysfs.c - further functions through which programs read /sys and udev's data. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/magic.h>
#include <stdio.h>
#include <string.h>
#include <sys/inotify.h>
#include <sys/vfs.h>
#include <sys/xattr.h>
#include <unistd.h>

#include "simulators/devices/preload/preload_internal.h"

/* --- stdio: libc opens files with internal calls ------------------------------------------------------------------ */

static int open_flags(const char *mode)
{
    const bool plus = strchr(mode, '+') != NULL;
    int flags = plus ? O_RDWR : mode[0] == 'r' ? O_RDONLY : O_WRONLY;

    if (mode[0] != 'r')
        flags |= O_CREAT | (mode[0] == 'a' ? O_APPEND : O_TRUNC);
    return flags | (strchr(mode, 'e') ? O_CLOEXEC : 0);
}

static FILE *open_stream(FILE *(*next)(const char *, const char *), const char *path, const char *mode)
{
    struct sim_path p;
    FILE *stream;
    int fd;

    sim_path_resolve(AT_FDCWD, path, true, &p);
    if (p.kind == SIM_PATH_OTHER)
        return next(path, mode);
    fd = sim_open_hook(AT_FDCWD, path, open_flags(mode), 0666);
    if (fd < 0)
        return NULL;
    stream = fdopen(fd, mode);
    if (!stream)
        (void)close(fd);
    return stream;
}

#define FOPEN_HOOK(name)                                                                                               \
    HOOK FILE *name(const char *restrict path, const char *restrict mode)                                              \
    {                                                                                                                  \
        NEXT(FILE *, name, const char *, const char *);                                                                \
        return open_stream(next, path, mode);                                                                          \
    }

FOPEN_HOOK(fopen)
FOPEN_HOOK(fopen64)

HOOK int fclose(FILE *stream)
{
    NEXT(int, fclose, FILE *);

    if (sim_dir() && stream && sim_maybe(fileno(stream))) {
        const int failed = fflush(stream);

        sim_flush(fileno(stream));
        return next(stream) == 0 ? failed : EOF;
    }
    return next(stream);
}

/* --- file system type: libudev and libusb require sysfs ----------------------------------------------------------- */

static bool fd_in_sysfs(int fd)
{
    char path[SIM_PATH_MAX];
    const char *dir = sim_dir();

    return dir && sim_path_of(fd, path) && strncmp(path, dir, strlen(dir)) == 0 &&
           strncmp(path + strlen(dir), "/sys", 4) == 0;
}

#define FSTATFS_HOOK(name, type)                                                                                       \
    HOOK int name(int fd, struct type *out)                                                                            \
    {                                                                                                                  \
        NEXT(int, name, int, struct type *);                                                                           \
        const int result = next(fd, out);                                                                              \
        if (result == 0 && fd_in_sysfs(fd))                                                                            \
            out->f_type = SYSFS_MAGIC;                                                                                 \
        return result;                                                                                                 \
    }
#define STATFS_HOOK(name, type)                                                                                        \
    HOOK int name(const char *path, struct type *out)                                                                  \
    {                                                                                                                  \
        NEXT(int, name, const char *, struct type *);                                                                  \
        struct sim_path p;                                                                                             \
        int result;                                                                                                    \
        sim_path_resolve(AT_FDCWD, path, true, &p);                                                                    \
        result = next(p.kind == SIM_PATH_OTHER ? path : p.real, out);                                                  \
        if (result == 0 && sim_path_in_sysfs(&p))                                                                      \
            out->f_type = SYSFS_MAGIC;                                                                                 \
        return result;                                                                                                 \
    }

FSTATFS_HOOK(fstatfs, statfs)
FSTATFS_HOOK(fstatfs64, statfs64)
STATFS_HOOK(statfs, statfs)
STATFS_HOOK(statfs64, statfs64)

/* --- other paths -------------------------------------------------------------------------------------------------- */

HOOK int inotify_add_watch(int fd, const char *path, uint32_t mask)
{
    NEXT(int, inotify_add_watch, int, const char *, uint32_t);
    struct sim_path p;

    sim_path_resolve(AT_FDCWD, path, true, &p);
    return next(fd, p.kind == SIM_PATH_OTHER ? path : p.real, mask);
}

/* `ls -l` reads the security label of each name. */
#define GETXATTR_HOOK(name, follow)                                                                                    \
    HOOK ssize_t name(const char *path, const char *attribute, void *value, size_t bytes)                              \
    {                                                                                                                  \
        NEXT(ssize_t, name, const char *, const char *, void *, size_t);                                               \
        struct sim_path p;                                                                                             \
        sim_path_resolve(AT_FDCWD, path, follow, &p);                                                                  \
        return next(p.kind == SIM_PATH_OTHER ? path : p.real, attribute, value, bytes);                                \
    }

GETXATTR_HOOK(getxattr, true)
GETXATTR_HOOK(lgetxattr, false)

HOOK int chdir(const char *path)
{
    NEXT(int, chdir, const char *);
    struct sim_path p;

    sim_path_resolve(AT_FDCWD, path, true, &p);
    return next(p.kind == SIM_PATH_OTHER ? path : p.real);
}

const struct sim_class sim_class_attribute = {
    .letter = 's',
    .write_calls = true,
    .late_writes = true,
};

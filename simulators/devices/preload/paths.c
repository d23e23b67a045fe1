/* Path resolution in a session: /dev, /sys and udev's data are looked up in the session's folder first. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "simulators/devices/preload/preload_internal.h"

static long raw(long number, long a, const void *b, long c, long d)
{
    return sim_next()->syscall_(number, a, b, c, d, 0L, 0L);
}

bool sim_path_of(int fd, char out[SIM_PATH_MAX])
{
    char link[40];
    long n;

    (void)snprintf(link, sizeof(link), "/proc/self/fd/%d", fd);
    n = sim_next()->syscall_(SYS_readlinkat, (long)AT_FDCWD, link, out, (long)SIM_PATH_MAX);
    if (n < 0 || n >= SIM_PATH_MAX)
        return false;
    out[n] = 0;
    return true;
}

/* Trees that a session provides. */
static const char *const trees[] = { "/dev", "/sys", "/run/udev" };

/* @return index of the tree that contains a path, or -1 */
static int tree_of(const char *path)
{
    for (int i = 0; i < (int)ARRAY_LEN(trees); i++) {
        const size_t bytes = strlen(trees[i]);

        if (strncmp(path, trees[i], bytes) == 0 && (path[bytes] == '/' || !path[bytes]))
            return i;
    }
    return -1;
}

/* Normalise a path to an entry of one of the trees to "/dev/..."; false: outside the trees. */
static bool own_path(int dirfd, const char *path, char out[SIM_PATH_MAX])
{
    const char *dir = sim_dir();
    const size_t dir_bytes = strlen(dir);
    size_t n = 0;

    if (path[0] != '/') {
        char folder[SIM_PATH_MAX];

        if (dirfd == AT_FDCWD || !path[0] || !sim_path_of(dirfd, folder))
            return false;
        /* Relative to the root, as libudev walks; or to the session's folder that opendir("/dev") really opened. */
        if (strcmp(folder, "/") == 0)
            return snprintf(out, SIM_PATH_MAX, "/%s", path) < SIM_PATH_MAX && tree_of(out) >= 0;
        return strncmp(folder, dir, dir_bytes) == 0 && tree_of(folder + dir_bytes) >= 0 &&
               snprintf(out, SIM_PATH_MAX, "%s/%s", folder + dir_bytes, path) < SIM_PATH_MAX;
    }
    if (strncmp(path, dir, dir_bytes) == 0 && tree_of(path + dir_bytes) >= 0)
        path += dir_bytes; /* resolved before, by realpath() */
    for (; *path && n + 1 < SIM_PATH_MAX; path++)
        if (*path != '/' || !n || out[n - 1] != '/')
            out[n++] = *path;
    out[n] = 0;
    return !*path && tree_of(out) >= 0;
}

/* In /sys and udev's data nothing of the machine is visible, in /dev everything but these kinds. */
static bool own_kind(const char *path)
{
    static const char *const kinds[] = { SST_SIM_OWN_KINDS };

    if (tree_of(path) != 0)
        return true;
    for (size_t i = 0; i < ARRAY_LEN(kinds); i++)
        if (path[4] && strncmp(path + strlen("/dev/"), kinds[i], strlen(kinds[i])) == 0)
            return true;
    return false;
}

/* A small file with the sticky bit represents a device. */
static bool read_node(const char *real, struct sim_path *out)
{
    const long fd = raw(SYS_openat, AT_FDCWD, real, O_RDONLY | O_CLOEXEC, 0);
    char text[32] = "";
    long n;

    if (fd < 0)
        return false;
    n = sim_next()->syscall_(SYS_read, fd, text, (long)sizeof(text) - 1);
    (void)sim_next()->close_((int)fd);
    return n > 0 && sscanf(text, "%u %u", &out->dev_major, &out->dev_minor) == 2;
}

static void resolve(const char *path, bool follow, struct sim_path *out)
{
    const char *dir = sim_dir();
    const size_t dir_bytes = strlen(dir);
    const long fd = raw(SYS_openat, AT_FDCWD, out->real, O_PATH | O_CLOEXEC | (follow ? 0 : O_NOFOLLOW), 0);
    char target[SIM_PATH_MAX];
    struct stat st;
    bool known;

    if (fd < 0) {
        out->kind = own_kind(path) ? SIM_PATH_MISSING : SIM_PATH_OTHER;
        return;
    }
    known = sim_next()->syscall_(SYS_newfstatat, fd, "", &st, (long)AT_EMPTY_PATH) == 0 && sim_path_of((int)fd, target);
    (void)sim_next()->close_((int)fd);
    out->kind = SIM_PATH_OTHER;
    if (!known)
        return;
    if (strncmp(target, dir, dir_bytes) != 0 || tree_of(target + dir_bytes) < 0) {
        /* a link to a real entry, perhaps with another name: a drive's serial line */
        out->kind = own_kind(path) ? SIM_PATH_PLAIN : SIM_PATH_OTHER;
        return;
    }
    if (S_ISLNK(st.st_mode) && !own_kind(path))
        return;
    out->kind = SIM_PATH_PLAIN;
    if (!S_ISREG(st.st_mode) || !(st.st_mode & S_ISVTX))
        return;
    (void)snprintf(out->node, sizeof(out->node), "%s", target + dir_bytes);
    if (tree_of(out->node) > 0)
        out->kind = SIM_PATH_ATTRIBUTE;
    else if (read_node(target, out))
        out->kind = SIM_PATH_NODE;
}

bool sim_path_in_sysfs(const struct sim_path *path)
{
    return path->kind != SIM_PATH_OTHER && strncmp(path->real + strlen(sim_dir()), "/sys", 4) == 0;
}

void sim_path_resolve(int dirfd, const char *path, bool follow, struct sim_path *out)
{
    const int saved = errno;
    char own[SIM_PATH_MAX];

    out->kind = SIM_PATH_OTHER;
    if (sim_dir() && path && own_path(dirfd, path, own) &&
        snprintf(out->real, sizeof(out->real), "%s%s", sim_dir(), own) < SIM_PATH_MAX)
        resolve(own, follow, out);
    errno = saved;
}

/* Where paths lead in a session: /dev is looked up in the session's folder first. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "simulators/devices/preload/core.h"

static long raw(long number, long a, const void *b, long c, long d)
{
    return sim_next()->syscall_(number, a, b, c, d, 0L, 0L);
}

/* The path that a descriptor leads to; false if that is not to be had or too long. */
static bool path_of(int fd, char out[SIM_PATH_MAX])
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

/* "/dev/..." for a path that means an entry of /dev, with doubled slashes gone; else false. */
static bool dev_path(int dirfd, const char *path, char out[SIM_PATH_MAX])
{
    const char *dir = sim_dir();
    const size_t dir_bytes = strlen(dir);
    size_t n = 0;

    if (path[0] != '/') {
        char folder[SIM_PATH_MAX];

        /* Relative to a folder that is the session's own: what opendir("/dev") really opened. */
        if (dirfd == AT_FDCWD || !path[0] || !path_of(dirfd, folder) || strncmp(folder, dir, dir_bytes) != 0 ||
            strncmp(folder + dir_bytes, "/dev", 4) != 0)
            return false;
        return snprintf(out, SIM_PATH_MAX, "%s/%s", folder + dir_bytes, path) < SIM_PATH_MAX;
    }
    if (strncmp(path, dir, dir_bytes) == 0 && strncmp(path + dir_bytes, "/dev/", 5) == 0)
        path += dir_bytes; /* resolved before, by realpath() */
    for (; *path && n + 1 < SIM_PATH_MAX; path++)
        if (*path != '/' || !n || out[n - 1] != '/')
            out[n++] = *path;
    out[n] = 0;
    return !*path && strncmp(out, "/dev", 4) == 0 && (out[4] == '/' || !out[4]);
}

static bool own_kind(const char *dev)
{
    static const char *const kinds[] = { SST_SIM_OWN_KINDS };

    for (size_t i = 0; i < ARRAY_LEN(kinds); i++)
        if (strncmp(dev + strlen("/dev/"), kinds[i], strlen(kinds[i])) == 0)
            return true;
    return false;
}

/* A small file with the sticky bit stands for a device. */
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

static void look(const char *dev, bool follow, struct sim_path *out)
{
    const char *dir = sim_dir();
    const size_t dir_bytes = strlen(dir);
    const long fd = raw(SYS_openat, AT_FDCWD, out->real, O_PATH | O_CLOEXEC | (follow ? 0 : O_NOFOLLOW), 0);
    char target[SIM_PATH_MAX];
    struct stat st;
    bool known;

    if (fd < 0) {
        out->kind = dev[4] && dev[5] && own_kind(dev) ? SIM_PATH_MISSING : SIM_PATH_OTHER;
        return;
    }
    known = sim_next()->syscall_(SYS_newfstatat, fd, "", &st, (long)AT_EMPTY_PATH) == 0 && path_of((int)fd, target);
    (void)sim_next()->close_((int)fd);
    out->kind = SIM_PATH_OTHER;
    if (!known)
        return;
    if (strncmp(target, dir, dir_bytes) != 0 || strncmp(target + dir_bytes, "/dev", 4) != 0)
        return; /* by link to the real entry */
    if (S_ISLNK(st.st_mode) && !own_kind(dev))
        return;
    out->kind = SIM_PATH_PLAIN;
    if (S_ISREG(st.st_mode) && (st.st_mode & S_ISVTX) && read_node(target, out)) {
        out->kind = SIM_PATH_NODE;
        (void)snprintf(out->node, sizeof(out->node), "%s", target + dir_bytes);
    }
}

void sim_path_resolve(int dirfd, const char *path, bool follow, struct sim_path *out)
{
    const int saved = errno;
    char dev[SIM_PATH_MAX];

    out->kind = SIM_PATH_OTHER;
    if (sim_dir() && path && dev_path(dirfd, path, dev) &&
        snprintf(out->real, sizeof(out->real), "%s%s", sim_dir(), dev) < SIM_PATH_MAX)
        look(dev, follow, out);
    errno = saved;
}

/* simulators/devices/sysfs.c - files and links of a session's /sys. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _XOPEN_SOURCE 700
#include "simulators/devices/devices_internal.h"
#include "simulators/devices/sysfs_internal.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"

static void failed(struct sim_sysfs *fs, const char *path, int err)
{
    if (fs->err)
        return;
    fs->err = err;
    sst_log_error("session: cannot write '%s%s': %s; is there space, and does the folder still exist?", fs->root, path,
                  strerror(-err));
}

/** The real path of an entry. @return false: too long, logged */
static bool real_path(struct sim_sysfs *fs, const char *dir, const char *name, char out[SST_PATH_MAX])
{
    if (snprintf(out, SST_PATH_MAX, "%s%s/%s", fs->root, dir, name) < SST_PATH_MAX)
        return true;
    failed(fs, dir, -ENAMETOOLONG);
    return false;
}

static int write_file(const char *real, int flags, mode_t mode, const void *data, size_t bytes)
{
    const int fd = open(real, O_WRONLY | O_CREAT | O_CLOEXEC | flags, mode);
    int err = 0;

    if (fd < 0)
        return -errno;
    if (write(fd, data, bytes) != (ssize_t)bytes)
        err = errno ? -errno : -EIO;
    if (close(fd) < 0 && !err)
        err = -errno;
    return err;
}

/** Readers see either the old or the new contents. */
static int replace_file(const struct sim_sysfs *fs, const char *real, const void *data, size_t bytes)
{
    char temporary[SST_PATH_MAX];
    struct stat st;
    int err;

    if (snprintf(temporary, sizeof(temporary), "%s/.attribute", fs->root) >= (int)sizeof(temporary))
        return -ENAMETOOLONG;
    err = write_file(temporary, O_TRUNC, 0644, data, bytes);
    /* A writable attribute stays writable. */
    if (!err && lstat(real, &st) == 0 && (st.st_mode & S_ISVTX) && chmod(temporary, S_ISVTX | 0644) < 0)
        err = -errno;
    return !err && rename(temporary, real) < 0 ? -errno : err;
}

void sim_sysfs_bytes(struct sim_sysfs *fs, const char *dir, const char *name, const void *data, size_t bytes)
{
    char real[SST_PATH_MAX];
    int err;

    if (!real_path(fs, dir, name, real))
        return;
    err = write_file(real, O_EXCL, 0444, data, bytes);
    if (err == -ENOENT) {
        err = sim_make_parents(real, strlen(fs->root));
        err = err ? err : write_file(real, O_EXCL, 0444, data, bytes);
    }
    if (err == -EEXIST)
        err = replace_file(fs, real, data, bytes);
    if (err)
        failed(fs, real + strlen(fs->root), err);
}

void sim_sysfs_attr(struct sim_sysfs *fs, const char *dir, const char *name, const char *fmt, ...)
{
    char text[4096];
    va_list args;
    int n;

    va_start(args, fmt);
    n = vsnprintf(text, sizeof(text) - 1, fmt, args);
    va_end(args);
    if (n < 0 || n >= (int)sizeof(text) - 1)
        return failed(fs, dir, -E2BIG);
    text[n++] = '\n';
    sim_sysfs_bytes(fs, dir, name, text, (size_t)n);
}

void sim_sysfs_writable(struct sim_sysfs *fs, struct sim_node **node, const char *dir, const char *name,
                        const struct sim_device *device)
{
    char real[SST_PATH_MAX];
    const char *path = real + strlen(fs->root);
    int err;

    if (!real_path(fs, dir, name, real))
        return;
    /* The sticky bit makes the preload library send writes to the simulator. */
    err = chmod(real, S_ISVTX | 0644) < 0 ? -errno : sim_node_add(fs->server, node, path, device);
    if (err)
        failed(fs, path, err);
}

static void put_link(struct sim_sysfs *fs, char *real, const char *target)
{
    for (int attempt = 0; symlink(target, real) < 0; attempt++) {
        if (attempt == 2 || (errno != ENOENT && errno != EEXIST))
            return failed(fs, real + strlen(fs->root), -errno);
        if (errno == EEXIST)
            (void)unlink(real);
        else if (sim_make_parents(real, strlen(fs->root)))
            return failed(fs, real + strlen(fs->root), -errno);
    }
}

void sim_sysfs_link(struct sim_sysfs *fs, const char *dir, const char *name, const char *target)
{
    char real[SST_PATH_MAX], relative[SST_PATH_MAX] = "";
    const char *path = real + strlen(fs->root);
    size_t common = 0;

    if (!real_path(fs, dir, name, real))
        return;
    for (size_t i = 0; path[i] && path[i] == target[i]; i++)
        if (path[i] == '/')
            common = i + 1;
    for (const char *p = path + common; (p = strchr(p, '/')); p++)
        if (strlen(relative) + 4 < sizeof(relative))
            strcat(relative, "../");
    if (strlen(relative) + strlen(target + common) >= sizeof(relative))
        return failed(fs, path, -ENAMETOOLONG);
    strcat(relative, target + common);
    put_link(fs, real, relative);
}

void sim_sysfs_remove(struct sim_sysfs *fs, const char *dir, const char *name)
{
    char real[SST_PATH_MAX];

    if (snprintf(real, sizeof(real), "%s%s/%s", fs->root, dir, name) < (int)sizeof(real))
        sst_path_remove_tree(real);
}

/* --- entries of the machine --------------------------------------------------------------------------------------- */

/** Link a real folder's entries, except some. */
static void show_through(struct sim_sysfs *fs, const char *dir, const char *const *without)
{
    DIR *real = opendir(dir);

    if (!real)
        return; /* missing, nothing to show */
    for (struct dirent *e; (e = readdir(real));) {
        char target[SST_PATH_MAX], at[SST_PATH_MAX];
        bool own = e->d_name[0] == '.';

        for (int i = 0; without[i]; i++)
            own = own || strcmp(e->d_name, without[i]) == 0;
        if (!own && snprintf(target, sizeof(target), "%s/%s", dir, e->d_name) < (int)sizeof(target) &&
            real_path(fs, dir, e->d_name, at))
            put_link(fs, at, target);
    }
    closedir(real);
}

/** Link real devices by number, except the kinds that the session provides. */
static void show_numbers(struct sim_sysfs *fs)
{
    static const char *const none[] = { NULL };
    static const char *const own[] = { "81:", "189:", "254:" };
    char real[SST_PATH_MAX];
    DIR *dir;

    show_through(fs, "/sys/dev/char", none);
    if (!real_path(fs, "/sys/dev", "char", real) || !(dir = opendir(real)))
        return; /* the machine shows none */
    for (struct dirent *e; (e = readdir(dir));)
        for (size_t i = 0; i < ARRAY_LEN(own); i++)
            if (strncmp(e->d_name, own[i], strlen(own[i])) == 0)
                (void)unlinkat(dirfd(dir), e->d_name, 0);
    closedir(dir);
}

int sim_sysfs_open(struct sim_sysfs **out, struct sim_server *server)
{
    static const char *const top[] = { "bus", "class", "dev", "devices", NULL };
    static const char *const bus[] = { "usb", "gpio", "pci", NULL };
    static const char *const class[] = { "video4linux", "gpio", NULL };
    static const char *const devices[] = { "pci0000:00", NULL };
    static const char *const dev[] = { "char", NULL };
    struct sim_sysfs *fs = calloc(1, sizeof(*fs));
    int err;

    if (!fs)
        return -ENOMEM;
    fs->server = server;
    snprintf(fs->root, sizeof(fs->root), "%s", sim_server_dir(server));
    show_through(fs, "/sys", top);
    show_through(fs, "/sys/bus", bus);
    show_through(fs, "/sys/class", class);
    show_through(fs, "/sys/devices", devices);
    show_through(fs, "/sys/dev", dev);
    show_numbers(fs);
    /* libudev checks for this socket to detect whether udev runs. */
    sim_sysfs_bytes(fs, "/run/udev", "control", "", 0);
    err = fs->err ? fs->err : sim_events_open(fs);
    if (err)
        sim_sysfs_close(fs);
    else
        *out = fs;
    return err;
}

void sim_sysfs_close(struct sim_sysfs *fs)
{
    if (!fs)
        return;
    sim_events_close(fs);
    free(fs);
}

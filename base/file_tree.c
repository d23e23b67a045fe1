/* Trees of folders: copies, removal, temporary files that an interrupted program left. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"

#define COPY_DEPTH 16 /* folders in one another; a light field has two or three */

static int remove_entry(const char *path, const struct stat *st SST_UNUSED, int type SST_UNUSED,
                        struct FTW *ftw SST_UNUSED)
{
    (void)remove(path);
    return 0;
}

void sst_path_remove_tree(const char *path)
{
    (void)nftw(path, remove_entry, 16, FTW_DEPTH | FTW_PHYS);
}

/* Remove the temporary files and folders in `dir` of the output `name`, or of all if it is NULL. */
static void remove_temporaries(const char *dir, const char *name)
{
    static const char mark[] = ".tmp-", some[] = "XXXXXX";
    char path[SST_PATH_MAX];
    DIR *d = opendir(dir);

    for (const struct dirent *e; d && (e = readdir(d));) {
        const size_t n = strlen(e->d_name), end = strlen(mark) + strlen(some);

        if (n <= end || memcmp(e->d_name + n - end, mark, strlen(mark)) ||
            (name && (strlen(name) != n - end || memcmp(name, e->d_name, n - end))))
            continue;
        if (!sst_path_join(path, dir, e->d_name))
            sst_path_remove_tree(path);
    }
    if (d)
        closedir(d);
}

void sst_path_remove_temporaries(const char *dir)
{
    remove_temporaries(dir, NULL);
}

void sst_path_remove_temporaries_of(const char *path)
{
    char dir[SST_PATH_MAX];
    const char *base = sst_path_base(path);

    snprintf(dir, sizeof(dir), "%.*s", (int)(base - path), path);
    remove_temporaries(dir[0] ? dir : ".", base);
}

/* --- copies ------------------------------------------------------------------------------------------------------- */

static int copy_bytes(int to, int from)
{
    char buffer[65536];
    ssize_t n;

    do /* shares the blocks where the file system can */
        n = copy_file_range(from, NULL, to, NULL, 1 << 30, 0);
    while (n > 0);
    if (!n)
        return 0;
    if (errno != EXDEV && errno != EINVAL && errno != ENOSYS && errno != EOPNOTSUPP)
        return -errno;
    while ((n = read(from, buffer, sizeof(buffer))) > 0) {
        for (ssize_t done = 0, w; done < n; done += w) {
            w = write(to, buffer + done, (size_t)(n - done));
            if (w <= 0)
                return w < 0 ? -errno : -EIO;
        }
    }
    return n < 0 ? -errno : 0;
}

/* An entry of the folder `dir` that is a file or a folder itself, not the target of a link.
 * @return descriptor; -EBADMSG: it is something else, which is not opened; or a negative errno */
static int open_entry(int dir, const char *name, struct stat *st)
{
    int fd, err;

    if (fstatat(dir, name, st, AT_SYMLINK_NOFOLLOW))
        return -errno;
    if (!S_ISREG(st->st_mode) && !S_ISDIR(st->st_mode))
        return -EBADMSG;
    fd = openat(dir, name, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY);
    if (fd < 0)
        return errno == ELOOP ? -EBADMSG : -errno;
    err = fstat(fd, st)                                  ? -errno
          : S_ISREG(st->st_mode) || S_ISDIR(st->st_mode) ? 0
                                                         : -EBADMSG; /* it may have changed */
    if (err)
        close(fd);
    return err ? err : fd;
}

/* Modes stay: readable by the users that the original is readable by. */
static int copy_file(int in, const struct stat *st, const char *to)
{
    const int out = open(to, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, (st->st_mode & 0666) | 0200);
    int err = out < 0 ? -errno : copy_bytes(out, in);

    if (out >= 0 && close(out) && !err)
        err = -errno;
    return err;
}

/* @param fd  of the folder `from`; closed here. @param depth  that may lie below it */
static int copy_folder(int fd, const char *from, const char *to, int depth)
{
    char source[SST_PATH_MAX], target[SST_PATH_MAX];
    DIR *d = fdopendir(fd);
    int err = d && !mkdir(to, 0777) ? 0 : -errno;

    if (!d)
        close(fd);
    if (err)
        sst_log_error("cannot copy the folder %s to %s: %s", from, to, strerror(-err));
    for (const struct dirent *e; !err && (e = readdir(d));) {
        struct stat st;
        int in;

        if (e->d_name[0] == '.')
            continue;
        err = sst_path_join(source, from, e->d_name);
        err = err ? err : sst_path_join(target, to, e->d_name);
        if (err)
            break;
        in = open_entry(dirfd(d), e->d_name, &st);
        if (in == -EBADMSG) {
            sst_log_warning("%s is a link or no file, and is not copied; put the file itself there", source);
            continue;
        }
        if (in >= 0 && S_ISDIR(st.st_mode)) {
            err = depth ? copy_folder(in, source, target, depth - 1) : -ELOOP; /* logged */
            if (depth)
                continue;
            close(in);
            sst_log_error("%s lies deeper than %d folders, and is not copied; move it elsewhere", source, COPY_DEPTH);
            break;
        }
        err = in < 0 ? in : copy_file(in, &st, target);
        if (in >= 0)
            close(in);
        if (err)
            sst_log_error("cannot copy %s to %s: %s", source, target, strerror(-err));
    }
    if (d)
        closedir(d);
    return err;
}

int sst_path_copy_tree(const char *from, const char *to)
{
    const int fd = open(from, O_RDONLY | O_DIRECTORY | O_CLOEXEC), err = fd < 0 ? -errno : 0;

    if (!err)
        return copy_folder(fd, from, to, COPY_DEPTH);
    sst_log_error("cannot copy the folder %s to %s: %s", from, to, strerror(-err));
    return err;
}

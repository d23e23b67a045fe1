/* Audit log: a line of JSON for each action, in a file of bounded size and the one before it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "capture/access/access_internal.h"

int sst_audit_write(const char *path, const struct sst_audit *line)
{
    char time[SST_CLOCK_TEXT], before[SST_PATH_MAX + 8], *text, *whole;
    struct stat st;
    size_t n;
    json_t *o;
    int fd, err;

    sst_clock_text(time, sst_clock_wall_ns());
    o = json_pack("{s:s, s:s, s:s, s:s, s:s}", "time", time, "name", line->name, "address", line->address, "action",
                  line->action, "object", line->object);
    text = o ? json_dumps(o, JSON_COMPACT) : NULL; /* NULL, too: a word is no UTF-8 */
    json_decref(o);
    n = text ? strlen(text) : 0;
    whole = text ? realloc(text, n + 2) : NULL;
    if (!whole) {
        free(text);
        return -EINVAL;
    }
    strcpy(whole + n, "\n");
    fd = open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);
    err = fd < 0 || fstat(fd, &st) ? -errno : !st.st_size ? access_give(fd, path) : 0;
    if (!err && st.st_size > SST_AUDIT_BYTES) {
        snprintf(before, sizeof(before), "%s.1", path);
        close(fd);
        err = rename(path, before) ? -errno : 0;
        fd = open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600);
        err = err ? err : fd < 0 ? -errno : access_give(fd, before);
    }
    if (!err && write(fd, whole, n + 1) != (ssize_t)n + 1)
        err = errno ? -errno : -EIO;
    if (fd >= 0)
        close(fd);
    free(whole);
    return err;
}

char *sst_audit_text(const char *path, int limit)
{
    char file[SST_PATH_MAX + 8], *text = calloc(1, 1), *grown, *at;
    size_t bytes = 0, n;
    uint8_t *data;

    for (int old = 1; text && old >= 0; old--) {
        snprintf(file, sizeof(file), "%s%s", path, old ? ".1" : "");
        if (!sst_path_exists(file) || sst_file_read(file, 2 * SST_AUDIT_BYTES, &data, &n))
            continue;
        grown = realloc(text, bytes + n + 1);
        if (!grown)
            free(text);
        text = grown;
        if (text) {
            memcpy(text + bytes, data, n);
            bytes += n;
            text[bytes] = 0;
        }
        free(data);
    }
    if (!text)
        return NULL;
    at = text + bytes;
    for (int lines = 0; at > text; at--)
        if (!at[-1] || (at[-1] == '\n' && lines++ == limit)) /* 0: written when the power failed */
            break;
    memmove(text, at, strlen(at) + 1);
    return text;
}

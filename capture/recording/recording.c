/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/recording/recording.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <zlib.h>

#include "base/log.h"
#include "base/mem.h"
#include "capture/recording/recording_internal.h"

#define STRIDE 64 /* step of the coarse search for a moment */

/* --- the index ---------------------------------------------------------------------------------------------------- */

static struct index_line *next_line(struct sst_recording *r)
{
    return sst_mem_grow(&r->line, r->count, &r->capacity, sizeof(*r->line)) ? &r->line[r->count++] : NULL;
}

/* One line of n bytes without its end, at `at` in the file. */
static int index_line(struct sst_recording *r, const char *line, size_t n, int64_t at)
{
    struct manifest_segment s;
    struct index_line *l;
    int kind = 1;

    const bool whole = manifest_line_whole(line, n);
    if (whole)
        kind = manifest_parse(line, n, r->info.cameras, &s, NULL);
    if (kind == -ENOMEM)
        return kind;
    if (whole)
        r->good_bytes = at + (int64_t)n + 1;
    if (kind == 0) {
        r->segment = s.segment;
        r->session = s.session;
        return 0;
    }
    if (r->segment >= 0 && r->segment < r->removed.before_segment)
        return 0;
    l = next_line(r);
    if (!l)
        return -ENOMEM;
    *l = (struct index_line){ .at = at,
                              .bytes = n < UINT32_MAX ? (uint32_t)n : UINT32_MAX,
                              .segment = r->segment,
                              .session = r->session,
                              .damaged = !whole || kind < 0 };
    return 0;
}

static int index_lines(struct sst_recording *r)
{
    FILE *f = fdopen(dup(r->fd), "rb");
    char *line = NULL;
    size_t capacity = 0;
    int64_t at = 0;
    ssize_t n;
    int err = 0;

    if (!f)
        return -errno;
    while (!err && (n = getline(&line, &capacity, f)) > 0) {
        r->size = at + n;
        if (line[n - 1] == '\n') /* else the writer was killed, or is writing */
            err = index_line(r, line, (size_t)n - 1, at);
        at += n;
    }
    if (!err && ferror(f))
        err = errno == ENOMEM ? -ENOMEM : -EIO;
    /* Damaged lines with no whole one after them are a torn end, not sets. */
    while (r->count && r->line[r->count - 1].at >= r->good_bytes)
        r->count--;
    free(line);
    fclose(f);
    return err;
}

int sst_recording_open(struct sst_recording **out, const char *dir)
{
    struct sst_recording *r = calloc(1, sizeof(*r));
    char path[SST_PATH_MAX];
    int err;

    if (!r)
        return -ENOMEM;
    r->fd = -1;
    r->segment = -1;
    r->dir = strdup(dir);
    err = r->dir ? sst_path_join(path, dir, "recording.json") : -ENOMEM;
    if (!err && !sst_path_exists(path)) {
        err = -ENOENT;
        sst_log_error("%s is not a recording: %s", dir,
                      sst_path_is_dir(dir) ? "it has no recording.json" : "no such folder");
    }
    err = err ? err : manifest_read_info(path, &r->info);
    err = err ? err : sst_recording_read_removed(dir, &r->removed);
    err = err ? err : sst_path_join(path, dir, "sets.jsonl");
    if (err)
        goto fail;
    r->fd = sst_file_open(path);
    err = r->fd < 0 ? r->fd : index_lines(r);
    if (err) {
        sst_log_error("cannot read %s: %s", path, strerror(-err));
        goto fail;
    }
    *out = r;
    return 0;

fail:
    sst_recording_close(r);
    return err;
}

void sst_recording_close(struct sst_recording *r)
{
    if (!r)
        return;
    join_close(r->join);
    if (r->fd >= 0)
        close(r->fd);
    free(r->line);
    free(r->dir);
    free(r);
}

const struct sst_recording_info *sst_recording_info(const struct sst_recording *r)
{
    return &r->info;
}

const char *sst_recording_dir(const struct sst_recording *r)
{
    return r->dir;
}

int sst_recording_sets(const struct sst_recording *r)
{
    return r->count;
}

const struct sst_recording_removed *sst_recording_removed(const struct sst_recording *r)
{
    return &r->removed;
}

int64_t sst_recording_torn_bytes(const struct sst_recording *r)
{
    return r->size - r->good_bytes;
}

int sst_recording_unlisted(const struct sst_recording *r, int64_t *bytes)
{
    char path[SST_PATH_MAX];
    struct dirent *entry;
    struct stat st;
    int number, n = 0;
    DIR *dir;

    *bytes = 0;
    if (snprintf(path, sizeof(path), "%s/segments", r->dir) >= (int)sizeof(path))
        return 0;
    dir = opendir(path);
    while (dir && (entry = readdir(dir))) {
        if (sscanf(entry->d_name, "%6d.mkv", &number) != 1 || number <= r->segment ||
            number < r->removed.before_segment || fstatat(dirfd(dir), entry->d_name, &st, 0) || !st.st_size)
            continue;
        n++;
        *bytes += st.st_size;
    }
    if (dir)
        closedir(dir);
    return n;
}

int64_t sst_recording_segment_size(const struct sst_recording *r, int segment)
{
    char path[SST_PATH_MAX];
    struct stat st, lines;

    /* The index last: a recorder writes a set's line after its bytes. */
    if (segment < 0 || segment_path(path, r->dir, segment) || stat(path, &st) || fstat(r->fd, &lines) ||
        lines.st_size != r->size)
        return -1;
    return st.st_size;
}

/* --- sets --------------------------------------------------------------------------------------------------------- */

/* Read all n bytes at an offset; -EBADMSG: the file ends before. */
static int read_at(int fd, void *data, size_t n, int64_t at)
{
    size_t done = 0;

    while (done < n) {
        const ssize_t got = pread(fd, (char *)data + done, n - done, at + (int64_t)done);

        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return got < 0 ? -EIO : -EBADMSG;
        done += (size_t)got;
    }
    return 0;
}

int sst_recording_line(const struct sst_recording *r, int i, char **text)
{
    const struct index_line *l = &r->line[i];
    char *made;
    int err;

    if (r->join)
        return join_line(r, i, text);
    if (l->damaged)
        return -EBADMSG;
    made = malloc((size_t)l->bytes + 1);
    if (!made)
        return -ENOMEM;
    err = read_at(r->fd, made, l->bytes, l->at);
    if (!err && !manifest_line_whole(made, l->bytes))
        err = -EBADMSG;
    if (err) {
        free(made);
        return err;
    }
    made[l->bytes] = 0;
    *text = made;
    return 0;
}

int sst_recording_set(const struct sst_recording *r, int i, struct sst_recording_set *set)
{
    struct manifest_segment unused;
    char *text;
    int err;

    if (r->join)
        return join_set(r, i, set);
    err = sst_recording_line(r, i, &text);
    if (err)
        return err;
    err = manifest_parse(text, r->line[i].bytes, r->info.cameras, &unused, set);
    free(text);
    if (err < 0)
        return err;
    set->segment = r->line[i].segment;
    set->session = r->line[i].session;
    return 0;
}

int sst_recording_frame_of(const struct sst_recording *r, int i, int cam, struct sst_recording_one *out)
{
    struct sst_recording_set *set;
    char *text;
    int err = sst_recording_line(r, i, &text);

    if (err)
        return err;
    out->segment = r->line[i].segment;
    err = manifest_parse_frame(text, cam, &out->wall_ns, &out->frame);
    free(text);
    if (!err)
        return 0;
    set = malloc(sizeof(*set));
    err = set ? sst_recording_set(r, i, set) : -ENOMEM;
    if (!err) {
        out->wall_ns = set->wall_ns;
        out->frame = set->frame[cam];
    }
    free(set);
    return err;
}

/* The size is checked first: a damaged line must not cause a huge allocation. */
static int read_frame(int fd, const struct sst_recording_frame *f, uint8_t **data)
{
    struct stat st;
    uint8_t *made;
    int err;

    if (fstat(fd, &st))
        return -EIO;
    if (f->offset > st.st_size || (int64_t)f->bytes > st.st_size - f->offset)
        return -EBADMSG;
    made = malloc(f->bytes);
    if (!made)
        return -ENOMEM;
    err = read_at(fd, made, f->bytes, f->offset);
    if (!err && (uint32_t)crc32_z(0, made, f->bytes) != f->crc32)
        err = -EBADMSG;
    if (err)
        free(made);
    else
        *data = made;
    return err;
}

int sst_recording_frame(const struct sst_recording *r, const struct sst_recording_set *set, int cam, uint8_t **data)
{
    const struct sst_recording_frame *f = &set->frame[cam];
    char path[SST_PATH_MAX];
    int err, fd;

    if (r->join)
        return join_frame(r, set, cam, data);
    if (!f->present || !f->bytes)
        return -ENODATA;
    if (set->segment < 0)
        return -EBADMSG;
    err = segment_path(path, r->dir, set->segment);
    if (err)
        return err;
    fd = sst_file_open(path);
    if (fd < 0)
        return fd == -ENOENT || fd == -EBADMSG || fd == -EISDIR ? -EBADMSG : -EIO;
    err = read_frame(fd, f, data);
    close(fd);
    return err;
}

int sst_recording_check_size(const struct sst_recording *r, const struct sst_recording_set *set, int *cam)
{
    char path[SST_PATH_MAX];
    struct stat st = { 0 };
    int err = set->segment < 0 ? -EBADMSG : segment_path(path, r->dir, set->segment);

    *cam = -1;
    if (err)
        return err;
    if (stat(path, &st) && errno != ENOENT)
        return -EIO;
    for (int k = 0; k < r->info.cameras; k++) {
        const struct sst_recording_frame *f = &set->frame[k];

        if (f->present && (f->offset > st.st_size || (int64_t)f->bytes > st.st_size - f->offset)) {
            *cam = k;
            return -EBADMSG;
        }
    }
    return 0;
}

int sst_recording_check(const struct sst_recording *r, int i, int *cam)
{
    struct sst_recording_set set;
    uint8_t *data;
    int err = sst_recording_set(r, i, &set);

    *cam = -1;
    for (int k = 0; !err && k < r->info.cameras; k++) {
        *cam = k;
        err = sst_recording_frame(r, &set, k, &data);
        if (!err)
            free(data);
        else if (err == -ENODATA)
            err = 0;
    }
    return err;
}

/* Wall clocks are stepped: each 64th set is checked, then the ones around the best. */
int sst_recording_near(const struct sst_recording *r, int64_t wall_ns, int64_t within_ns, int *nearest)
{
    struct sst_recording_set *set = malloc(sizeof(*set));
    const int n = sst_recording_sets(r);
    int centre = -1, first = 0, last = n - 1, step = STRIDE;
    uint64_t best = UINT64_MAX;

    if (!set)
        return -ENOMEM;
    for (int round = 0; round < 2; round++) {
        for (int i = first; i <= last; i += step) {
            uint64_t away;

            if (sst_recording_set(r, i, set))
                continue;
            away = set->wall_ns > wall_ns ? (uint64_t)set->wall_ns - (uint64_t)wall_ns
                                          : (uint64_t)wall_ns - (uint64_t)set->wall_ns;
            if (away < best) {
                best = away;
                centre = i;
            }
        }
        first = centre < STRIDE ? 0 : centre - STRIDE;
        last = centre < 0 || centre + STRIDE > n - 1 ? n - 1 : centre + STRIDE;
        step = 1;
    }
    free(set);
    if (best > (uint64_t)within_ns)
        return -ENOENT;
    *nearest = centre;
    return 0;
}

/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/recording/recording_internal.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"

/* --- does it fit? ------------------------------------------------------------------------------------------------- */

/* A camera is its serial where it has one, else its port. */
static bool same_camera(const struct sst_recorder_track *a, const struct sst_recorder_track *b)
{
    return a->row == b->row && a->col == b->col && !strcmp(a->serial, b->serial) &&
           (a->serial[0] || !strcmp(a->port, b->port));
}

static int check_fit(const struct sst_recording_info *info, const struct sst_recorder_config *cfg)
{
    char was[5], is[5];

    sst_recording_format_name(info->fourcc, was);
    sst_recording_format_name(cfg->fourcc, is);
    if (info->rows != cfg->rows || info->cols != cfg->cols || info->cameras != cfg->cameras ||
        info->fourcc != cfg->fourcc || info->width != cfg->width || info->height != cfg->height) {
        sst_log_error(
            "%s was recorded with %d cameras on %dx%d, %s %dx%d, not %d on %dx%d, %s %dx%d; record into another "
            "folder",
            cfg->dir, info->cameras, info->rows, info->cols, was, info->width, info->height, cfg->cameras, cfg->rows,
            cfg->cols, is, cfg->width, cfg->height);
        return -EEXIST;
    }
    for (int k = 0; k < cfg->cameras; k++) {
        const struct sst_recorder_track *a = &info->track[k], *b = &cfg->tracks[k];

        if (same_camera(a, b))
            continue;
        sst_log_error("%s was recorded with camera %s at row %d, col %d where now %s is at row %d, col %d; record into "
                      "another folder",
                      cfg->dir, a->serial[0] ? a->serial : a->port, a->row, a->col, b->serial[0] ? b->serial : b->port,
                      b->row, b->col);
        return -EEXIST;
    }
    return 0;
}

/* --- the last segment --------------------------------------------------------------------------------------------- */

/* A finished file states its size; one that was being written does not. */
static bool is_finished(int fd, int64_t file_bytes)
{
    uint8_t head[128];
    const ssize_t n = pread(fd, head, sizeof(head), 0);
    struct ebml e;
    uint64_t at;

    if (n <= 0 || ebml_head(head, (size_t)n, &e) || e.id != SST_EBML_HEAD || e.size >= sizeof(head))
        return false;
    at = e.head + e.size;
    if (at >= (uint64_t)n || ebml_head(head + at, (size_t)n - at, &e) || e.id != SST_EBML_SEGMENT)
        return false;
    return e.size != SST_EBML_UNKNOWN && at + e.head + e.size == (uint64_t)file_bytes;
}

/* End of the bytes of a segment's last set; 0: it has none. */
static int64_t sets_end(const struct sst_recording *r, int segment)
{
    struct sst_recording_set set;
    int64_t end = 0;

    for (int i = r->count - 1; i >= 0 && !end && r->line[i].segment == segment; i--) {
        if (sst_recording_set(r, i, &set))
            continue;
        for (int k = 0; k < r->info.cameras; k++) {
            const struct sst_recording_frame *f = &set.frame[k];

            if (f->present && f->bytes && f->offset + (int64_t)f->bytes > end)
                end = f->offset + (int64_t)f->bytes;
        }
    }
    return end;
}

static int cut_segment(const struct sst_recording *r, int segment)
{
    const int64_t end = segment < 0 ? 0 : sets_end(r, segment);
    char path[SST_PATH_MAX];
    struct stat st;
    int err = end ? segment_path(path, r->dir, segment) : 0;
    int fd;

    if (err || !end)
        return err;
    fd = open(path, O_RDWR | O_CLOEXEC);
    if (fd < 0 && errno == ENOENT)
        return 0; /* the file was removed; readers report its sets */
    if (fd < 0 || fstat(fd, &st) || (st.st_size > end && !is_finished(fd, st.st_size) && ftruncate(fd, end))) {
        err = errno;
        sst_log_error("cannot resume %s: %s: %s", r->dir, path, strerror(err));
        err = err == EROFS ? -EROFS : -EIO;
    }
    if (fd >= 0)
        close(fd);
    return err;
}

/* Segments after the last one were begun, but the manifest has none of their sets. */
static int remove_segments_behind(const char *dir, int last)
{
    char folder[SST_PATH_MAX], path[SST_PATH_MAX];
    const struct dirent *e;
    DIR *d;
    int err = sst_path_join(folder, dir, "segments");

    d = err ? NULL : opendir(folder);
    if (!d) /* it is created when the recorder opens */
        return err;
    while (!err && (e = readdir(d))) {
        int number, n = 0;

        if (sscanf(e->d_name, "%6d.mkv%n", &number, &n) != 1 || n != 10 || e->d_name[n] || number <= last)
            continue;
        err = segment_path(path, dir, number);
        if (!err && unlink(path)) {
            err = errno == EROFS ? -EROFS : -EIO;
            sst_log_error("cannot remove the half-written %s: %s", path, strerror(errno));
        }
    }
    closedir(d);
    return err;
}

/* --- all of it ---------------------------------------------------------------------------------------------------- */

/* Remove sets from the end with bytes that did not reach the disk; holes before a good set stay, for readers to report.
 * Only sets of the last segment: other segments may be missing because the files were moved. */
static int drop_damaged_end(struct sst_recording *r)
{
    const int before = r->count, segment = before ? r->line[before - 1].segment : -1;
    int cam, err = 0;

    while (r->count && r->line[r->count - 1].segment == segment) {
        err = sst_recording_check(r, r->count - 1, &cam);
        if (err != -EBADMSG)
            break;
        r->count--;
        err = 0;
    }
    if (err)
        sst_log_error("cannot read the last sets of %s: %s", r->dir, strerror(-err));
    else if (r->count < before)
        sst_log_warning("%s: removed the last %d sets, which were not completely on the disk", r->dir,
                        before - r->count);
    return err;
}

int resume_prepare(struct resume_point *out, const struct sst_recorder_config *cfg, int manifest_fd)
{
    struct resume_point made = { 0 };
    const struct index_line *last;
    struct sst_recording *r;
    int segment, err = sst_recording_open(&r, cfg->dir);

    if (err)
        return err;
    err = check_fit(&r->info, cfg);
    err = err ? err : drop_damaged_end(r);
    if (err)
        goto out;
    last = r->count ? &r->line[r->count - 1] : NULL;
    segment = last ? last->segment : -1;
    made.manifest_bytes = last ? last->at + last->bytes + 1 : 0;
    made.segment = sst_max_int(segment + 1, r->removed.before_segment); /* numbers below would count as removed */
    made.session = last ? last->session + 1 : 0;
    if (made.segment > SEGMENT_NUMBER_MAX) {
        sst_log_error("%s already has the maximum of %d segments; record into another folder", cfg->dir,
                      SEGMENT_NUMBER_MAX + 1);
        err = -ENOSPC;
        goto out;
    }
    if (r->size > made.manifest_bytes)
        sst_log_info("%s: removed %lld torn bytes from the end of the manifest", cfg->dir,
                     (long long)(r->size - made.manifest_bytes));
    if (ftruncate(manifest_fd, made.manifest_bytes)) {
        err = errno == EROFS ? -EROFS : -EIO;
        sst_log_error("cannot truncate the manifest of %s after its last set: %s", cfg->dir, strerror(errno));
        goto out;
    }
    err = cut_segment(r, segment);
    err = err ? err : remove_segments_behind(cfg->dir, segment);
    if (!err)
        *out = made;

out:
    sst_recording_close(r);
    return err;
}

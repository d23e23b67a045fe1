/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/storage/storage_internal.h"
#include "daemon/storage/video_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <linux/videodev2.h>

#include "capture/recording/recording.h"
#include "pipeline/image/codec_formats.h"

#define STAMP_MAX (INT64_MAX / 4) /* differences of stamps fit */
#define VIEW_FILE (-1)            /* SST_VIDEO_PICTURES; other numbers are segments */

static int add_frame(struct video *v, struct sst_mkv_frame made, int64_t wall_ns)
{
    struct sst_mkv_frame *grown;

    if (made.t_ns < -STAMP_MAX || made.t_ns > STAMP_MAX)
        return 0; /* a damaged line */
    if (!v->count)
        v->format.wall_ns = wall_ns;
    if (v->count == v->capacity) {
        v->capacity = 2 * v->capacity + 1024;
        grown = realloc(v->frame, v->capacity * sizeof(*grown));
        if (!grown)
            return -ENOMEM;
        v->frame = grown;
    }
    /* Stamps of a camera that went backwards must not turn the video round. */
    if (v->count && made.t_ns < v->frame[v->count - 1].t_ns)
        made.t_ns = v->frame[v->count - 1].t_ns;
    v->frame[v->count++] = made;
    v->bytes += made.bytes;
    return 0;
}

static void name_of(int file, char out[40])
{
    if (file == VIEW_FILE)
        strcpy(out, SST_VIDEO_PICTURES);
    else
        snprintf(out, 40, "segments/%06d.mkv", file);
}

/* Size of a regular file of the recording; -1: there is none. */
static int64_t size_of(const char *dir, int file)
{
    char name[40], path[SST_PATH_MAX];
    struct stat st;

    name_of(file, name);
    return sst_path_join(path, dir, name) || lstat(path, &st) || !S_ISREG(st.st_mode) ? -1 : st.st_size;
}

/* --- a camera ----------------------------------------------------------------------------------------------------- */

static int add_sets(struct video *v, const struct sst_recording *r, int cam)
{
    int64_t segment_bytes = -1;
    int last = -1, err = 0;

    for (int i = 0; !err && i < sst_recording_sets(r); i++) {
        struct sst_recording_one one;
        const struct sst_recording_frame *f = &one.frame;

        err = sst_recording_frame_of(r, i, cam, &one);
        if (err == -EBADMSG) { /* a damaged line: one set less */
            err = 0;
            continue;
        }
        if (err || !f->present || !f->bytes || one.segment < 0 || f->faults & SST_FRAME_PARTS) /* no pictures */
            continue;
        if (one.segment != last)
            segment_bytes = size_of(v->dir, one.segment); /* frames of one that is missing are left out */
        last = one.segment;
        if (f->offset < 0 || f->bytes > INT32_MAX || (int64_t)f->bytes > segment_bytes - f->offset)
            continue;
        err = add_frame(v, (struct sst_mkv_frame){ f->t_ns, f->offset, (uint32_t)f->bytes, one.segment }, one.wall_ns);
    }
    return err;
}

int video_of_camera(struct video *v, const char *dir, int row, int col)
{
    const struct sst_recording_info *info;
    struct sst_recording *r;
    int cam = 0, err = sst_recording_open(&r, dir);

    if (err)
        return err;
    info = sst_recording_info(r);
    while (cam < info->cameras && (info->track[cam].row != row || info->track[cam].col != col))
        cam++;
    snprintf(v->dir, sizeof(v->dir), "%s", dir);
    snprintf(v->title, sizeof(v->title), "%s, camera r%dc%d", sst_path_base(dir), row, col);
    err = cam < info->cameras ? add_sets(v, r, cam) : -ENOENT;
    if (!err)
        snprintf(v->track, sizeof(v->track), "r%02d c%02d %s", row, col,
                 info->track[cam].serial[0] ? info->track[cam].serial : info->track[cam].port);
    v->format.fourcc = info->fourcc;
    v->format.width = info->width;
    v->format.height = info->height;
    v->format.rate_hz = info->rate_hz;
    sst_recording_close(r);
    return err ? err : v->count ? 0 : -ENODATA;
}

/* --- the see-through view ----------------------------------------------------------------------------------------- */

size_t video_write_line(char out[SST_VIDEO_LINE_MAX], const struct video_line *l)
{
    return (size_t)snprintf(out, SST_VIDEO_LINE_MAX,
                            "{\"t_ns\":%" PRId64 ",\"wall_ns\":%" PRId64 ",\"set\":%" PRIu64 ",\"offset\":%" PRId64
                            ",\"bytes\":%" PRId64 "}\n",
                            l->t_ns, l->wall_ns, l->set, l->offset, l->bytes);
}

bool video_read_line(const char *text, struct video_line *out)
{
    struct video_line l;
    int end = 0;

    if (sscanf(text,
               "{\"t_ns\":%20" SCNd64 ",\"wall_ns\":%20" SCNd64 ",\"set\":%20" SCNu64 ",\"offset\":%20" SCNd64
               ",\"bytes\":%20" SCNd64 "}%n",
               &l.t_ns, &l.wall_ns, &l.set, &l.offset, &l.bytes, &end) != 5 ||
        !end || strcmp(text + end, "\n") || l.offset < 0 || l.bytes <= 0 || l.bytes > INT32_MAX)
        return false;
    *out = l;
    return true;
}

/* Width and height of the first picture, from its header. */
static int read_size(struct video *v)
{
    uint8_t data[4096];
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, v->dir, SST_VIDEO_PICTURES);
    const int fd = err ? -1 : open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    const size_t want = v->frame[0].bytes < sizeof(data) ? v->frame[0].bytes : sizeof(data);
    const ssize_t got = fd < 0 ? -1 : pread(fd, data, want, v->frame[0].offset);

    if (fd >= 0)
        close(fd);
    if (got <= 0)
        return -EBADMSG;
    return sst_jpeg_size(&v->format.width, &v->format.height, data, (size_t)got, path);
}

/* The last picture of the removed part stays: it was visible where the rest begins. */
static int add_lines(struct video *v, FILE *f, const struct sst_recording_removed *removed)
{
    const int64_t size = size_of(v->dir, VIEW_FILE);
    char text[SST_VIDEO_LINE_MAX];
    struct video_line l;
    int err = 0;

    while (!err && fgets(text, sizeof(text), f)) {
        if (!video_read_line(text, &l) || l.bytes > size - l.offset)
            continue;
        if (removed->before_segment && l.t_ns <= removed->t_ns) {
            l.t_ns = removed->t_ns;
            l.wall_ns = removed->wall_ns;
            v->count = 0;
            v->bytes = 0;
        }
        err = add_frame(v, (struct sst_mkv_frame){ l.t_ns, l.offset, (uint32_t)l.bytes, VIEW_FILE }, l.wall_ns);
    }
    return ferror(f) ? -EIO : err;
}

int64_t video_view_from(const char *dir)
{
    char path[SST_PATH_MAX], text[SST_VIDEO_LINE_MAX];
    struct video_line l = { 0 };
    FILE *f = sst_path_join(path, dir, SST_VIDEO_INDEX) ? NULL : fopen(path, "re");
    bool found = false;

    while (f && !found && fgets(text, sizeof(text), f))
        found = video_read_line(text, &l);
    if (f)
        fclose(f);
    return l.wall_ns;
}

int sst_storage_view_picture(const char *dir, int64_t *wall_ns, uint64_t *set, uint8_t **data, size_t *bytes)
{
    int64_t away_ns, best_ns = SST_STORAGE_NEAR_NS + 1;
    struct video_line near = { .bytes = 0 }, l;
    char path[SST_PATH_MAX], text[SST_VIDEO_LINE_MAX];
    FILE *index = sst_path_join(path, dir, SST_VIDEO_INDEX) ? NULL : fopen(path, "re");
    int fd, err = 0;

    while (index && fgets(text, sizeof(text), index)) {
        if (!video_read_line(text, &l))
            continue;
        away_ns = llabs(l.wall_ns - *wall_ns);
        near = away_ns < best_ns ? l : near;
        best_ns = away_ns < best_ns ? away_ns : best_ns;
    }
    if (index)
        fclose(index);
    if (near.bytes <= 0 || near.bytes > (int64_t)VIEW_HISTORY_BYTES || sst_path_join(path, dir, SST_VIDEO_PICTURES))
        return -ENOENT;
    fd = sst_file_open(path);
    if (fd < 0)
        return fd;
    *data = malloc((size_t)near.bytes);
    if (!*data)
        err = -ENOMEM;
    else if (pread(fd, *data, (size_t)near.bytes, near.offset) != near.bytes)
        err = -EBADMSG;
    close(fd);
    if (err) {
        free(*data);
        *data = NULL;
        return err;
    }
    *bytes = (size_t)near.bytes;
    *wall_ns = near.wall_ns;
    *set = near.set;
    return 0;
}

int video_of_view(struct video *v, const char *dir)
{
    struct sst_recording_removed removed = { 0 };
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, SST_VIDEO_INDEX);
    FILE *f = err ? NULL : fopen(path, "re");

    if (!err)
        err = f ? sst_recording_read_removed(dir, &removed) : -ENOENT;
    snprintf(v->dir, sizeof(v->dir), "%s", dir);
    snprintf(v->title, sizeof(v->title), "%s, see-through", sst_path_base(dir));
    snprintf(v->track, sizeof(v->track), "see-through");
    v->format.fourcc = V4L2_PIX_FMT_MJPEG;
    err = err ? err : add_lines(v, f, &removed);
    if (f)
        fclose(f);
    return err ? err : v->count ? read_size(v) : -ENODATA;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

struct source {
    const struct video *v;
    int file, fd; /* fd -1: none is open */
    video_ended_fn *ended;
    void *arg;
};

static int open_file(struct source *s, int file)
{
    char name[40], path[SST_PATH_MAX];

    if (s->fd >= 0)
        close(s->fd);
    name_of(file, name);
    s->file = file;
    s->fd = sst_path_join(path, s->v->dir, name) ? -1 : open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    /* It was there when the frames were listed: it has just been removed. */
    return s->fd >= 0 ? 0 : errno == ENOENT ? -EAGAIN : -errno;
}

static int read_frame(void *arg, size_t i, uint8_t *data)
{
    struct source *s = arg;
    const struct sst_mkv_frame *f = &s->v->frame[i];
    size_t done = 0;
    int err = s->ended(s->arg) ? -ECANCELED : s->fd < 0 || s->file != f->file ? open_file(s, f->file) : 0;

    while (!err && done < f->bytes) {
        const ssize_t n = pread(s->fd, data + done, f->bytes - done, f->offset + (int64_t)done);

        if (n < 0 && errno == EINTR)
            continue;
        err = n < 0 ? -errno : n ? 0 : -EIO;
        done += n > 0 ? (size_t)n : 0;
    }
    return err;
}

int video_write(struct video *v, int fd, video_ended_fn *ended, void *arg)
{
    struct source s = { .v = v, .fd = -1, .ended = ended, .arg = arg };
    int err;

    v->format.title = v->title;
    v->format.track = v->track;
    err = sst_mkv_write(fd, &v->format, &(struct sst_mkv_frames){ v->frame, v->count, read_frame, &s });
    if (s.fd >= 0)
        close(s.fd);
    return err;
}

void video_fini(struct video *v)
{
    free(v->frame);
    *v = (struct video){ .frame = NULL };
}

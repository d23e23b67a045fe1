#include "daemon/storage/storage_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "capture/recording/recording.h"

#define HEAD_BYTES ((size_t)1 << 20) /* that hold the description of all tracks of a segment */
#define STAMP_MAX  (INT64_MAX / 4)   /* differences of stamps fit */

/* Frames of a video, as they are found. */
struct frames {
    struct matroska_frame *frame;
    size_t count, capacity;
};

static int add_frame(struct frames *f, struct matroska_frame made)
{
    struct matroska_frame *grown;

    if (made.t_ns < -STAMP_MAX || made.t_ns > STAMP_MAX)
        return 0; /* a damaged line */
    if (f->count == f->capacity) {
        f->capacity = 2 * f->capacity + 1024;
        grown = realloc(f->frame, f->capacity * sizeof(*grown));
        if (!grown)
            return -ENOMEM;
        f->frame = grown;
    }
    /* Stamps of a camera that went backwards must not turn the video round. */
    if (f->count && made.t_ns < f->frame[f->count - 1].t_ns)
        made.t_ns = f->frame[f->count - 1].t_ns;
    f->frame[f->count++] = made;
    return 0;
}

/* Size of a file that is one; -1: there is none. What it is now goes into the plan's tag. */
static int64_t size_of(struct spans *to, const char *dir, const char *name)
{
    char path[SST_PATH_MAX];
    struct stat st;

    if (sst_path_join(path, dir, name) || lstat(path, &st) || !S_ISREG(st.st_mode))
        return -1;
    spans_mark(to, &st.st_mtim, sizeof(st.st_mtim));
    spans_mark(to, &st.st_ino, sizeof(st.st_ino));
    return st.st_size;
}

/* --- a camera ----------------------------------------------------------------------------------------------------- */

static int read_track(const char *dir, const char *name, int number, struct matroska_track *out)
{
    uint8_t *data = malloc(HEAD_BYTES);
    char path[SST_PATH_MAX];
    ssize_t n = -1;
    int fd, err = data ? sst_path_join(path, dir, name) : -ENOMEM;

    if (!err) {
        fd = open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
        n = fd < 0 ? -1 : read(fd, data, HEAD_BYTES);
        err = n < 0 ? -errno : 0;
        if (fd >= 0)
            close(fd);
    }
    if (!err && matroska_find_track(data, (size_t)n, number, out))
        err = -EBADMSG;
    free(data);
    return err;
}

/* What a walk along the sets of a recording has met so far. */
struct walk {
    struct spans *to;
    const char *dir;
    int cam, segment, file; /* the segment of the last set; its file */
    int64_t segment_bytes;
    int64_t wall_ns;
    struct frames frames;
    struct matroska_track track;
};

static int enter_segment(struct walk *w, int segment)
{
    char name[40];
    int err = 0;

    snprintf(name, sizeof(name), "segments/%06d.mkv", segment);
    w->segment = segment;
    w->segment_bytes = size_of(w->to, w->dir, name);
    if (w->segment_bytes < 0)
        return 0; /* its frames are left out */
    if (!w->track.bytes)
        err = read_track(w->dir, name, w->cam + 1, &w->track);
    if (err == -ENOENT) { /* removed just now, to make room */
        w->segment_bytes = -1;
        return 0;
    }
    w->file = spans_file(w->to, name);
    return err;
}

static int add_set(struct walk *w, int segment, int64_t wall_ns, const struct sst_recording_frame *f)
{
    int err = 0;

    if (!f->present || !f->bytes || segment < 0)
        return 0;
    if (segment != w->segment)
        err = enter_segment(w, segment);
    if (err || f->offset < 0 || f->bytes > UINT32_MAX || (int64_t)f->bytes > w->segment_bytes - f->offset)
        return err;
    if (!w->frames.count)
        w->wall_ns = wall_ns;
    return add_frame(&w->frames, (struct matroska_frame){ f->t_ns, f->offset, (uint32_t)f->bytes, w->file });
}

static int walk_sets(struct walk *w, const struct sst_recording *r)
{
    struct sst_recording_frame f;
    int64_t wall_ns;
    int segment, err = 0;

    for (int i = 0; !err && i < sst_recording_sets(r); i++) {
        err = sst_recording_frame_of(r, i, w->cam, &segment, &wall_ns, &f);
        if (!err)
            err = add_set(w, segment, wall_ns, &f);
        else if (err == -EBADMSG)
            err = 0; /* a damaged line: one set less */
    }
    return err;
}

static int find_camera(const struct sst_recording_info *info, int row, int col)
{
    for (int k = 0; k < info->cameras; k++) {
        if (info->track[k].row == row && info->track[k].col == col)
            return k;
    }
    return -ENOENT;
}

int video_plan_camera(struct spans *to, const char *dir, int row, int col)
{
    struct walk *w = calloc(1, sizeof(*w));
    struct sst_recording *r = NULL;
    char title[128];
    int err = w ? sst_recording_open(&r, dir) : -ENOMEM;

    if (!err) {
        w->to = to;
        w->dir = dir;
        w->segment = -1;
        w->cam = find_camera(sst_recording_info(r), row, col);
        err = w->cam < 0 ? w->cam : walk_sets(w, r);
    }
    snprintf(title, sizeof(title), "%s, camera r%dc%d", sst_path_base(dir), row, col);
    if (!err)
        err = matroska_plan(to, &w->track, title, w->wall_ns, w->frames.frame, w->frames.count);
    sst_recording_close(r);
    if (w)
        free(w->frames.frame);
    free(w);
    return err;
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

/* Width and height of a JPEG file, from its frame's header. */
static int read_size(const char *dir, int64_t offset, int64_t bytes, int *width, int *height)
{
    uint8_t data[4096];
    char path[SST_PATH_MAX];
    int err = sst_path_join(path, dir, SST_VIDEO_PICTURES);
    const int fd = err ? -1 : open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    const ssize_t got =
        fd < 0 ? -1 : pread(fd, data, bytes < (int64_t)sizeof(data) ? (size_t)bytes : sizeof(data), offset);
    size_t n = got > 0 ? (size_t)got : 0, at = 2;

    if (fd >= 0)
        close(fd);
    if (n < 4 || data[0] != 0xff || data[1] != 0xd8)
        return -EBADMSG;
    while (at + 9 <= n && data[at] == 0xff) {
        const uint8_t marker = data[at + 1];

        if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {
            *height = data[at + 5] << 8 | data[at + 6];
            *width = data[at + 7] << 8 | data[at + 8];
            return 0;
        }
        at += 2 + (size_t)(data[at + 2] << 8 | data[at + 3]);
    }
    return -EBADMSG;
}

/* Of what was removed the last picture stays: it is what was seen where the rest begins. */
static int read_lines(FILE *f, int64_t size, int file, const struct sst_recording_removed *removed,
                      struct frames *frames, int64_t *wall_ns)
{
    char text[SST_VIDEO_LINE_MAX];
    struct video_line l;
    int err = 0;

    while (!err && fgets(text, sizeof(text), f)) {
        if (!video_read_line(text, &l) || l.bytes > size - l.offset)
            continue;
        if (removed->before_segment && l.t_ns <= removed->t_ns) {
            l.t_ns = removed->t_ns;
            l.wall_ns = removed->wall_ns;
            frames->count = 0;
        }
        if (!frames->count)
            *wall_ns = l.wall_ns;
        err = add_frame(frames, (struct matroska_frame){ l.t_ns, l.offset, (uint32_t)l.bytes, file });
    }
    return ferror(f) ? -EIO : err;
}

int video_plan_view(struct spans *to, const char *dir)
{
    struct frames frames = { NULL };
    struct matroska_track *track = calloc(1, sizeof(*track));
    const int64_t size = size_of(to, dir, SST_VIDEO_PICTURES);
    char path[SST_PATH_MAX], title[128];
    struct sst_recording_removed removed = { 0 };
    int64_t wall_ns = 0;
    int width = 0, height = 0, err = track ? sst_path_join(path, dir, SST_VIDEO_INDEX) : -ENOMEM;
    FILE *f = err || size < 0 ? NULL : fopen(path, "re");

    if (!err)
        err = sst_recording_read_removed(dir, &removed);
    if (!err)
        err = f ? read_lines(f, size, spans_file(to, SST_VIDEO_PICTURES), &removed, &frames, &wall_ns) : -ENOENT;
    spans_mark(to, &removed.before_segment, sizeof(removed.before_segment));
    if (f)
        fclose(f);
    if (!err)
        err = frames.count ? read_size(dir, frames.frame[0].offset, frames.frame[0].bytes, &width, &height) : -ENODATA;
    snprintf(title, sizeof(title), "%s, see-through", sst_path_base(dir));
    if (!err) {
        matroska_jpeg_track(track, width, height, "see-through");
        err = matroska_plan(to, track, title, wall_ns, frames.frame, frames.count);
    }
    free(frames.frame);
    free(track);
    return err;
}

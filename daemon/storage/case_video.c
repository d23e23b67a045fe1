/* Video of a span: each picture stays until the next one comes, at a constant rate, without losses. The caption has the
 * time of the camera's picture; a see-through picture of another time names its own. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/text.h"
#include "capture/recording/recording.h"
#include "daemon/storage/case_internal.h"
#include "daemon/storage/video_internal.h"
#include "pipeline/image/codec_formats.h"
#include "pipeline/image/font.h"
#include "pipeline/image/raw.h"
#include "pipeline/video/mp4.h"

#define RATE_LEAST   5
#define RATE_UNKNOWN 10
#define LATE_NS      INT64_C(250000000)  /* of a see-through picture: later, and its caption has a time */
#define NEXT_NS      INT64_C(2000000000) /* after the last set of a recording another one is looked for */
#define LINES        2                   /* of a caption */
#define CHARACTERS   100                 /* that fit in a line of it, about */
#define PAD_DOTS     4
#define WIDTH_LEAST  320 /* of a frame: the caption needs it */

/* A recording that is read. */
struct source {
    char name[64]; /* "": none is held */
    struct sst_recording *reader;
    struct video view;
    int view_fd;
    size_t view_next;      /* the first picture after the one shown */
    int set_next, camera;  /* the first set after the one shown; the reference camera */
    int64_t set_ns;        /* wall time of the set shown; 0: none */
    int64_t view_ns;       /* wall time of the see-through picture shown; 0: none */
    struct sst_recording_set set;
};

/* Frame of a video, from left to right: see-through, camera; below both the caption. Without a see-through view the camera has
 * the whole width: rendering the view from the sets would take several times as long as the video lasts. */
struct layout {
    bool alone;
    int width, height, cell, band, zoom;
};

struct film {
    const struct case_video *job;
    struct source source;
    struct layout layout;
    int rate_hz;
    int64_t from_ns, to_ns;
    struct sst_image band;
    char caption[LINES][2][192]; /* drawn: left, right */
    struct sst_mp4 *mp4;
    json_t *recordings;
    char camera[96];
    bool clear;
    char *why;
};

static SST_PRINTF(3, 4) int refuse(struct film *f, int err, const char *fmt, ...)
{
    va_list args;

    va_start(args, fmt);
    vsnprintf(f->why, CASE_WHY, fmt, args);
    va_end(args);
    return err;
}

/* --- recordings --------------------------------------------------------------------------------------------------- */

static void close_source(struct film *f)
{
    struct source *s = &f->source;

    if (s->view_fd >= 0)
        close(s->view_fd);
    video_fini(&s->view);
    sst_recording_close(s->reader);
    if (s->name[0])
        sst_storage_release(f->job->storage, s->name);
    memset(s, 0, offsetof(struct source, set));
    s->view_fd = -1;
}

/* The camera in the middle, or the nearest one that was recorded: the view of the see-through picture. */
static int middle_camera(const struct sst_recording_info *info)
{
    int best = -1;
    double least = INFINITY;

    for (int i = 0; i < info->cameras; i++) {
        const double away = hypot(info->track[i].row - (info->rows - 1) / 2, info->track[i].col - (info->cols - 1) / 2);

        if (away < least) {
            least = away;
            best = i;
        }
    }
    return best;
}

/* Wall time of a see-through picture. */
static int64_t view_time(const struct video *v, size_t i)
{
    return v->format.wall_ns + (v->frame[i].t_ns - v->frame[0].t_ns);
}

static int rate_of(const struct sst_recording *r)
{
    const double rate_hz = sst_recording_info(r)->rate_hz;

    return (int)fmax(RATE_LEAST, fmin(rate_hz > 0 ? ceil(rate_hz - 1e-3) : RATE_UNKNOWN, SST_MP4_RATE_MOST));
}

/* Tolerance for times that tremble about the rate: a picture belongs to the frame of the video that it is nearest to. */
static int64_t half_frame_ns(const struct sst_recording *r)
{
    return 500000000 / rate_of(r);
}

/* The first set that is not before a moment. */
static int first_set(struct film *f, int64_t from_ns)
{
    struct sst_recording_one one;
    int low = 0, high = sst_recording_sets(f->source.reader);

    while (low < high) { /* wall times grow, but for steps of the clock */
        const int middle = low + (high - low) / 2;

        if (!sst_recording_frame_of(f->source.reader, middle, f->source.camera, &one) && one.wall_ns < from_ns)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static int open_source(struct film *f, int64_t at_ns)
{
    struct source *s = &f->source;
    const char *wanted = f->job->span->recording;
    char dir[SST_PATH_MAX], path[SST_PATH_MAX];
    int err = sst_storage_hold(f->job->storage, wanted[0] ? wanted : NULL, at_ns, s->name, dir);

    if (err) {
        s->name[0] = 0;
        return refuse(f, err, "no recording has this moment");
    }
    err = sst_recording_open(&s->reader, dir);
    if (err)
        return refuse(f, err, "the recording %.40s cannot be read: %s", s->name, strerror(-err));
    s->camera = middle_camera(sst_recording_info(s->reader));
    if (s->camera < 0)
        return refuse(f, -ENOENT, "the recording %.40s has no camera", s->name);
    s->set_next = first_set(f, at_ns - half_frame_ns(s->reader));
    if (video_of_view(&s->view, dir)) /* it was not recorded: there is a camera alone */
        video_fini(&s->view);
    if (s->view.count && !sst_path_join(path, dir, SST_VIDEO_PICTURES))
        s->view_fd = open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    json_array_append_new(f->recordings, json_string(s->name));
    return 0;
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

/* Draw into a cell, whole, with black edges where the shapes differ. */
static int draw(struct film *f, int cell, uint32_t fourcc, const uint8_t *data, size_t bytes)
{
    const struct source *s = &f->source;
    const struct sst_recording_info *info = sst_recording_info(s->reader);
    const int height = f->layout.height - f->layout.band;
    struct sst_raw raw = { .fourcc = fourcc, .data = data, .bytes = bytes };
    struct sst_image image;
    double scale;
    int err, w, h, x, y;

    raw.width = cell ? info->width : s->view.format.width;
    raw.height = cell ? info->height : s->view.format.height;
    raw.stride = cell ? s->set.frame[s->camera].stride : 0;
    err = sst_raw_is_jpeg(fourcc) ? sst_jpeg_decode_small(&image, data, bytes, "a picture", f->layout.cell)
                                  : sst_raw_decode(&image, &raw);
    if (err) /* a damaged picture: the one before stays */
        return 0;
    scale = fmin((double)f->layout.cell / image.width, (double)height / image.height);
    w = (int)(image.width * scale) & ~1;
    h = (int)(image.height * scale) & ~1;
    x = ((f->layout.alone ? 0 : cell * f->layout.cell) + (f->layout.cell - w) / 2) & ~1;
    y = ((height - h) / 2) & ~1;
    err = sst_mp4_put(f->mp4, &image, (struct sst_rect){ .x0 = x, .y0 = y, .x1 = x + w, .y1 = y + h });
    sst_image_fini(&image);
    return err;
}

/* The last set up to a moment, if it is another one. */
static int show_set(struct film *f, int64_t at_ns)
{
    struct source *s = &f->source;
    const int sets = sst_recording_sets(s->reader);
    uint8_t *data = NULL;
    size_t bytes;
    int last = -1, err;

    for (; s->set_next < sets; s->set_next++) {
        struct sst_recording_one one;

        err = sst_recording_frame_of(s->reader, s->set_next, s->camera, &one);
        if (err && err != -EBADMSG)
            return refuse(f, err, "the recording %.40s cannot be read: %s", s->name, strerror(-err));
        if (!err && one.wall_ns > at_ns + half_frame_ns(s->reader))
            break;
        if (!err && one.frame.present && one.frame.bytes)
            last = s->set_next;
    }
    if (last < 0 || sst_recording_set(s->reader, last, &s->set) ||
        sst_recording_picture(s->reader, &s->set, s->camera, &data, &bytes))
        return 0;
    s->set_ns = s->set.wall_ns;
    err = draw(f, 1, sst_recording_info(s->reader)->fourcc, data, bytes);
    free(data);
    return err;
}

/* The last see-through picture up to a moment, if it is another one. */
static int show_view(struct film *f, int64_t at_ns)
{
    struct source *s = &f->source;
    const size_t before = s->view_next;
    const struct sst_mkv_frame *frame;
    uint8_t *data;
    int err = 0;

    while (s->view_next < s->view.count && view_time(&s->view, s->view_next) <= at_ns + half_frame_ns(s->reader))
        s->view_next++;
    if (s->view_next == before || s->view_fd < 0 || f->layout.alone)
        return 0;
    frame = &s->view.frame[s->view_next - 1];
    data = malloc(frame->bytes);
    if (!data)
        return -ENOMEM;
    if (pread(s->view_fd, data, frame->bytes, frame->offset) == (ssize_t)frame->bytes) {
        s->view_ns = view_time(&s->view, s->view_next - 1);
        f->clear = true;
        err = draw(f, 0, s->view.format.fourcc, data, frame->bytes);
    }
    free(data);
    return err;
}

/* --- captions ----------------------------------------------------------------------------------------------------- */

/* Letters that the font has, for texts in UTF-8 of western languages. */
static void plain(char *out, size_t size, const char *text)
{
    static const char *const latin[64] = { /* U+00C0 on */
        "A", "A", "A", "A", "AE", "A", "AE", "C", "E", "E", "E", "E", "I", "I", "I", "I",
        "D", "N", "O", "O", "O", "O", "OE", "x", "O", "U", "U", "U", "UE", "Y", "TH", "SS",
        "A", "A", "A", "A", "AE", "A", "AE", "C", "E", "E", "E", "E", "I", "I", "I", "I",
        "D", "N", "O", "O", "O", "O", "OE", "/", "O", "U", "U", "U", "UE", "Y", "TH", "Y"
    };

    out[0] = 0;
    for (const uint8_t *p = (const uint8_t *)text; *p; p++) {
        if (*p < 0x80)
            sst_text_add(out, size, "%c", *p);
        else if (*p == 0xc3 && (p[1] & 0xc0) == 0x80)
            sst_text_add(out, size, "%s", latin[*++p & 63]);
        else if ((*p & 0xc0) == 0xc0)
            sst_text_add(out, size, "_");
    }
}

/* "2026-11-21 19:05:00.1 +0100" of this machine's time zone. */
static void local_time(char *out, size_t size, int64_t wall_ns)
{
    const time_t seconds = (time_t)(wall_ns / 1000000000);
    char zone[16], day[32];
    struct tm tm;

    localtime_r(&seconds, &tm);
    strftime(day, sizeof(day), "%Y-%m-%d %H:%M:%S", &tm);
    strftime(zone, sizeof(zone), "%z", &tm);
    snprintf(out, size, "%s.%d %s", day, (int)(wall_ns / 100000000 % 10), zone);
}

static int draw_caption(struct film *f)
{
    const struct layout *l = &f->layout;
    const struct source *s = &f->source;
    const struct sst_pen black = { &f->band, 0, l->zoom }, white = { &f->band, 0xffffff, l->zoom };
    char text[LINES][2][192] = { { "", "" } }, site[160], when[64];

    memset(text, 0, sizeof(text)); /* they are compared whole */
    plain(site, sizeof(site), f->job->site);
    if (s->view.count && !l->alone)
        snprintf(text[0][0], sizeof(text[0][0]), "SEE-THROUGH");
    else
        snprintf(text[0][0], sizeof(text[0][0]), "SEE-THROUGH VIEW WAS NOT RECORDED");
    if (s->view_ns && (s->view_ns > s->set_ns + LATE_NS || s->view_ns < s->set_ns - LATE_NS)) {
        local_time(when, sizeof(when), s->view_ns);
        sst_text_add(text[0][0], sizeof(text[0][0]), ", OF %.10s", when + 11);
    }
    snprintf(text[0][1], sizeof(text[0][1]), "CAMERA %s", f->camera);
    local_time(when, sizeof(when), s->set_ns ? s->set_ns : f->from_ns);
    snprintf(text[1][0], sizeof(text[1][0]), "%s", when);
    snprintf(text[1][1], sizeof(text[1][1]), "%s, SST " SST_VERSION, site);
    if (!memcmp(text, f->caption, sizeof(text)))
        return 0;
    memcpy(f->caption, text, sizeof(text));
    sst_pen_fill(&black, (struct sst_rect){ .x1 = l->width, .y1 = l->band });
    for (int i = 0; i < LINES; i++)
        for (int side = 0; side < 2; side++)
            sst_pen_text(&white, side * l->width / 2 + PAD_DOTS * l->zoom,
                         l->zoom * (PAD_DOTS + i * (SST_FONT_HEIGHT + PAD_DOTS)), text[i][side]);
    return sst_mp4_put(f->mp4, &f->band,
                       (struct sst_rect){ .y0 = l->height - l->band, .x1 = l->width, .y1 = l->height });
}

/* --- the file ----------------------------------------------------------------------------------------------------- */

/* Cells of equal size, each large enough for its picture, within the limits of players. */
static void lay_out(struct film *f)
{
    const struct sst_recording_info *info = sst_recording_info(f->source.reader);
    const struct video *v = &f->source.view;
    struct layout *l = &f->layout;
    double shape = (double)info->height / info->width;
    int height, cells, most;

    l->alone = !v->count;
    cells = l->alone ? 1 : 2;
    most = SST_MP4_WIDTH_MOST / cells;
    l->cell = info->width;
    if (v->count && v->format.width > 0) {
        shape = fmax(shape, (double)v->format.height / v->format.width);
        l->cell = l->cell > v->format.width ? l->cell : v->format.width;
    }
    l->cell = (l->cell < most ? l->cell : most) & ~1;
    l->cell = l->cell < WIDTH_LEAST / cells ? WIDTH_LEAST / cells : l->cell;
    l->width = cells * l->cell;
    l->zoom = l->width / (CHARACTERS * SST_FONT_WIDTH);
    l->zoom = l->zoom < 1 ? 1 : l->zoom;
    l->band = (l->zoom * (PAD_DOTS + LINES * (SST_FONT_HEIGHT + PAD_DOTS)) + 1) & ~1;
    height = (int)ceil(l->cell * shape);
    if (height > SST_MP4_HEIGHT_MOST - l->band)
        height = SST_MP4_HEIGHT_MOST - l->band;
    l->height = ((height + 1) & ~1) + l->band;
}

static int begin(struct film *f)
{
    const struct sst_recording_info *info = sst_recording_info(f->source.reader);
    const struct sst_recorder_track *track = &info->track[f->source.camera];
    struct sst_mp4_config cfg = { .portable = true, .title = f->job->span->title };
    char *held, said[SST_LOG_MAX] = "";
    struct sst_recording_one one;
    int err;

    f->rate_hz = rate_of(f->source.reader);
    snprintf(f->camera, sizeof(f->camera), "R%dC%d %.60s", track->row, track->col,
             track->serial[0] ? track->serial : track->port);
    if (f->source.set_next >= sst_recording_sets(f->source.reader))
        return refuse(f, -ENOENT, "no recording has this moment");
    if (!sst_recording_frame_of(f->source.reader, f->source.set_next, f->source.camera, &one) && one.wall_ns > f->from_ns)
        f->from_ns = one.wall_ns;
    if (f->from_ns >= f->to_ns)
        return refuse(f, -ENOENT, "nothing of it was recorded");
    lay_out(f);
    cfg.width = f->layout.width;
    cfg.height = f->layout.height;
    cfg.rate_hz = f->rate_hz;
    err = sst_image_init(&f->band, f->layout.width, f->layout.band);
    held = sst_log_hold_errors(said);
    err = err ? err : sst_mp4_open(&f->mp4, f->job->path, &cfg);
    sst_log_hold_errors(held);
    return err && said[0] ? refuse(f, err, "%.250s", said) : err;
}

/* Black instead of the last recording's see-through view. */
static int clear_view(struct film *f)
{
    const struct layout *l = &f->layout;
    const struct sst_pen black = { &f->band, 0, l->zoom };

    if (l->alone)
        return 0;
    sst_pen_fill(&black, (struct sst_rect){ .x1 = l->width, .y1 = l->band });
    memset(f->caption, 0, sizeof(f->caption)); /* it is drawn again into the band */
    return sst_mp4_put(f->mp4, &f->band, (struct sst_rect){ .x1 = l->cell, .y1 = l->height - l->band });
}

/* After the end of a recording, another one that goes on. @return 0, -ENODATA: there is none */
static int go_on(struct film *f, int64_t at_ns)
{
    struct source *s = &f->source;
    char before[64], dir[SST_PATH_MAX], name[64];
    int err;

    if (s->set_next < sst_recording_sets(s->reader) || at_ns < s->set_ns + NEXT_NS)
        return 0;
    memcpy(before, s->name, sizeof(before));
    err = f->job->span->recording[0] ? -ENOENT : sst_storage_hold(f->job->storage, NULL, at_ns, name, dir);
    if (err)
        return -ENODATA;
    sst_storage_release(f->job->storage, name);
    if (!strcmp(name, before))
        return -ENODATA;
    close_source(f);
    err = open_source(f, at_ns);
    if (!err && !f->source.view.count)
        err = clear_view(f);
    return err || f->source.set_next >= sst_recording_sets(f->source.reader) ? -ENODATA : 0;
}

static int make_frames(struct film *f, int64_t *end_ns)
{
    int err = 0;

    for (int64_t k = 0; !err; k++) {
        const int64_t at_ns = f->from_ns + k * 1000000000 / f->rate_hz;

        if (at_ns >= f->to_ns)
            break;
        err = go_on(f, at_ns);
        if (err == -ENODATA)
            return 0;
        err = err ? err : show_set(f, at_ns);
        err = err ? err : show_view(f, at_ns);
        err = err ? err : draw_caption(f);
        err = err ? err : sst_mp4_next(f->mp4);
        *end_ns = at_ns + 1000000000 / f->rate_hz;
        if (!err && !f->job->progress(f->job->arg, (double)(at_ns - f->from_ns) / (double)(f->to_ns - f->from_ns)))
            err = -ECANCELED;
    }
    return err;
}

static json_t *facts_of(const struct film *f, int64_t end_ns)
{
    char from[SST_CLOCK_TEXT], to[SST_CLOCK_TEXT];

    sst_clock_text(from, f->from_ns);
    sst_clock_text(to, end_ns);
    return json_pack("{s:s, s:s, s:I, s:i, s:i, s:i, s:b, s:s, s:O}", "from", from, "to", to, "milliseconds",
                     (json_int_t)((end_ns - f->from_ns) / 1000000), "width", f->layout.width, "height", f->layout.height,
                     "rate_hz", f->rate_hz, "clear", f->clear, "camera", f->camera, "recordings", f->recordings);
}

int case_video_make(const struct case_video *v, json_t **facts, char why[CASE_WHY])
{
    struct film *f = calloc(1, sizeof(*f));
    char *held, said[SST_LOG_MAX] = "";
    int64_t end_ns = v->span->from_ns;
    int err;

    if (!f)
        return -ENOMEM;
    why[0] = 0;
    *f = (struct film){
        .job = v, .from_ns = v->span->from_ns, .to_ns = v->span->to_ns, .recordings = json_array(), .why = why
    };
    f->source.view_fd = -1;
    err = open_source(f, f->from_ns);
    err = err ? err : begin(f);
    held = sst_log_hold_errors(said);
    err = err ? err : make_frames(f, &end_ns);
    err = err ? err : sst_mp4_commit(f->mp4);
    sst_log_hold_errors(held);
    if (!err) {
        *facts = facts_of(f, end_ns);
        err = *facts ? 0 : -ENOMEM;
    }
    if (err && !why[0])
        snprintf(why, CASE_WHY, "%.250s", said[0] ? said : strerror(-err));
    sst_mp4_close(f->mp4);
    close_source(f);
    sst_image_fini(&f->band);
    json_decref(f->recordings);
    free(f);
    return err;
}

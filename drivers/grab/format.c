/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/grab/grab_internal.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"

/* Bounds for enumerations that never end with a broken driver. */
#define FORMATS_MAX 64
#define SIZES_MAX   256
#define RATES_MAX   64

/* Tolerance between requested and actual rate: 29.97 is 30. */
#define RATE_TOLERANCE 0.005

/* --- enumeration -------------------------------------------------------------------------------------------------- */

static bool format_at(int fd, uint32_t type, uint32_t index, struct v4l2_fmtdesc *f)
{
    *f = (struct v4l2_fmtdesc){ .index = index, .type = type };
    return index < FORMATS_MAX && !node_ioctl(fd, VIDIOC_ENUM_FMT, f);
}

static bool size_at(int fd, uint32_t fourcc, uint32_t index, struct v4l2_frmsizeenum *s)
{
    *s = (struct v4l2_frmsizeenum){ .index = index, .pixel_format = fourcc };
    return index < SIZES_MAX && !node_ioctl(fd, VIDIOC_ENUM_FRAMESIZES, s);
}

static bool interval_at(int fd, const struct sst_grab_config *cfg, uint32_t index, struct v4l2_frmivalenum *v)
{
    *v = (struct v4l2_frmivalenum){
        .index = index, .pixel_format = cfg->fourcc, .width = (uint32_t)cfg->width, .height = (uint32_t)cfg->height
    };
    return index < RATES_MAX && !node_ioctl(fd, VIDIOC_ENUM_FRAMEINTERVALS, v);
}

static void add_format_names(int fd, char *out, size_t size)
{
    const uint32_t type = node_type(fd);
    struct v4l2_fmtdesc f;

    for (uint32_t i = 0; format_at(fd, type, i, &f); i++) {
        char name[5];

        fourcc_name(name, f.pixelformat);
        sst_text_add(out, size, "%s%s", i ? ", " : "", name);
    }
}

/* The multiple of step from lo that is nearest to v, within lo..hi. */
static int nearest_step(int v, uint32_t lo, uint32_t hi, uint32_t step)
{
    const int64_t s = step ? step : 1, n = ((int64_t)v - lo + s / 2) / s;
    const int64_t x = lo + (n < 0 ? 0 : n) * s;

    return (int)(x > hi ? hi - (hi - lo) % s : x);
}

/* The nearest size by sides, -1 if the camera lists none. */
static void nearest_size(int fd, uint32_t fourcc, const struct sst_grab_config *cfg, int best[2], char *list,
                         size_t size)
{
    struct v4l2_frmsizeenum s;
    int64_t best_off = -1;

    for (uint32_t i = 0; size_at(fd, fourcc, i, &s); i++) {
        const bool discrete = s.type == V4L2_FRMSIZE_TYPE_DISCRETE;
        const int w = discrete
                          ? (int)s.discrete.width
                          : nearest_step(cfg->width, s.stepwise.min_width, s.stepwise.max_width, s.stepwise.step_width);
        const int h =
            discrete ? (int)s.discrete.height
                     : nearest_step(cfg->height, s.stepwise.min_height, s.stepwise.max_height, s.stepwise.step_height);
        const int64_t off = llabs((long long)w - cfg->width) + llabs((long long)h - cfg->height);

        if (discrete)
            sst_text_add(list, size, "%s%dx%d", i ? ", " : "", w, h);
        else
            sst_text_add(list, size, "%ux%u to %ux%u", s.stepwise.min_width, s.stepwise.min_height,
                         s.stepwise.max_width, s.stepwise.max_height);
        if (best_off < 0 || off < best_off) {
            best_off = off;
            best[0] = w;
            best[1] = h;
        }
        if (!discrete)
            return;
    }
}

static double hz(struct v4l2_fract interval)
{
    return interval.numerator ? (double)interval.denominator / interval.numerator : 0;
}

static void add_rates(int fd, const struct sst_grab_config *cfg, char *out, size_t size)
{
    struct v4l2_frmivalenum v;
    double best = 0;

    for (uint32_t i = 0; interval_at(fd, cfg, i, &v); i++) {
        const bool discrete = v.type == V4L2_FRMIVAL_TYPE_DISCRETE;
        const double rate =
            discrete ? hz(v.discrete) : fmin(fmax(cfg->rate_hz, hz(v.stepwise.max)), hz(v.stepwise.min));

        if (discrete)
            sst_text_add(out, size, "%s%.4g", i ? ", " : "; it offers ", rate);
        else
            sst_text_add(out, size, "; it offers %.4g to %.4g", hz(v.stepwise.max), hz(v.stepwise.min));
        if (!best || fabs(rate - cfg->rate_hz) < fabs(best - cfg->rate_hz))
            best = rate;
        if (!discrete)
            break;
    }
    if (best)
        sst_text_add(out, size, " Hz, nearest %.4g", best);
}

/* --- setting ------------------------------------------------------------------------------------------------------ */

const char *field_name(uint32_t field)
{
    static const char *const names[] = {
        [V4L2_FIELD_ANY] = "any",
        [V4L2_FIELD_NONE] = "none",
        [V4L2_FIELD_TOP] = "alternating",
        [V4L2_FIELD_BOTTOM] = "alternating",
        [V4L2_FIELD_INTERLACED] = "interlaced",
        [V4L2_FIELD_SEQ_TB] = "sequential, top first",
        [V4L2_FIELD_SEQ_BT] = "sequential, bottom first",
        [V4L2_FIELD_ALTERNATE] = "alternating",
        [V4L2_FIELD_INTERLACED_TB] = "interlaced, top first",
        [V4L2_FIELD_INTERLACED_BT] = "interlaced, bottom first",
    };

    return field < ARRAY_LEN(names) ? names[field] : "unknown";
}

bool field_fits(uint32_t field)
{
    return field == V4L2_FIELD_NONE || field == V4L2_FIELD_ANY; /* ANY: the driver does not say */
}

static int refuse_field(const struct sst_grab_config *cfg, uint32_t field, char *why, size_t size)
{
    sst_text_add(
        why, size,
        "at %dx%d its pictures are made of fields (%s), and only whole (progressive) pictures can be used; set "
        "cameras: width and height, or another input or mode of the device",
        cfg->width, cfg->height, field_name(field));
    return -EINVAL;
}

/* A format of either API. */
struct picture {
    uint32_t fourcc, width, height, field, planes;
    size_t stride;
};

static struct picture read_picture(const struct v4l2_format *f)
{
    const struct v4l2_pix_format *one = &f->fmt.pix;
    const struct v4l2_pix_format_mplane *mp = &f->fmt.pix_mp;

    if (f->type == V4L2_BUF_TYPE_VIDEO_CAPTURE)
        return (struct picture){ one->pixelformat, one->width, one->height, one->field, 1, one->bytesperline };
    return (struct picture){ mp->pixelformat, mp->width,      mp->height,
                             mp->field,       mp->num_planes, mp->plane_fmt[0].bytesperline };
}

static void write_picture(struct v4l2_format *f, uint32_t fourcc, const struct sst_grab_config *cfg)
{
    struct v4l2_pix_format *one = &f->fmt.pix;
    struct v4l2_pix_format_mplane *mp = &f->fmt.pix_mp;

    if (f->type == V4L2_BUF_TYPE_VIDEO_CAPTURE) {
        one->width = (uint32_t)cfg->width;
        one->height = (uint32_t)cfg->height;
        one->pixelformat = fourcc;
        one->field = V4L2_FIELD_NONE;
    } else {
        mp->width = (uint32_t)cfg->width;
        mp->height = (uint32_t)cfg->height;
        mp->pixelformat = fourcc;
        mp->field = V4L2_FIELD_NONE;
        mp->num_planes = 1;
    }
}

bool format_fits(uint32_t fourcc, uint32_t wanted)
{
    return fourcc == wanted || (wanted == V4L2_PIX_FMT_MJPEG && fourcc == V4L2_PIX_FMT_JPEG);
}

static bool picture_fits(const struct picture *got, const struct sst_grab_config *cfg)
{
    return format_fits(got->fourcc, cfg->fourcc) && (int)got->width == cfg->width && (int)got->height == cfg->height &&
           field_fits(got->field) && got->planes == 1;
}

/* Width and height of the configuration belong to one camera; a split picture has several. */
static void add_size_remedy(const struct sst_grab_config *cfg, const int nearest[2], char *why, size_t size)
{
    const int rows = sst_max_int(cfg->split.rows, 1), cols = sst_max_int(cfg->split.cols, 1);

    if (rows * cols == 1)
        sst_text_add(why, size, "; set cameras: width and height");
    else if (nearest[0] % cols || nearest[1] % rows)
        sst_text_add(why, size, ", which does not divide into %dx%d cameras of one size; set cameras: split", rows,
                     cols);
    else
        sst_text_add(why, size, ", which is %dx%d cameras of %dx%d; set cameras: width, height and split", rows, cols,
                     nearest[0] / cols, nearest[1] / rows);
}

static int refuse(int fd, const struct sst_grab_config *cfg, const struct picture *got, char *why, size_t size)
{
    char want[5], sizes[384] = "", nearest[32];
    int best[2] = { -1, -1 };

    fourcc_name(want, cfg->fourcc);
    if (!format_fits(got->fourcc, cfg->fourcc)) {
        sst_text_add(why, size, "it does not support format %s, it offers ", want);
        add_format_names(fd, why, size);
        sst_text_add(why, size, "; set cameras: format");
        return -EINVAL;
    }
    if (!field_fits(got->field) && (int)got->width == cfg->width && (int)got->height == cfg->height)
        return refuse_field(cfg, got->field, why, size);
    if (got->planes != 1) {
        sst_text_add(why, size,
                     "its %s pictures come in %u planes of memory, and only those in one can be used; set "
                     "cameras: format",
                     want, got->planes);
        return -EINVAL;
    }
    nearest_size(fd, got->fourcc, cfg, best, sizes, sizeof(sizes));
    snprintf(nearest, sizeof(nearest), "%dx%d", best[0] < 0 ? (int)got->width : best[0],
             best[0] < 0 ? (int)got->height : best[1]);
    sst_text_add(why, size, "it has no %s of %dx%d, nearest is %s", want, cfg->width, cfg->height, nearest);
    if (*sizes && strcmp(sizes, nearest))
        sst_text_add(why, size, " of %s", sizes);
    add_size_remedy(cfg, best[0] < 0 ? (const int[2]){ (int)got->width, (int)got->height } : best, why, size);
    return -EINVAL;
}

/* Request a format. @return 0: *got is the format that the driver sets, or would set; else -errno */
static int try_picture(int fd, uint32_t fourcc, const struct sst_grab_config *cfg, struct picture *got)
{
    const uint32_t type = node_type(fd);
    struct v4l2_format f = { .type = type };
    int err;

    write_picture(&f, fourcc, cfg);
    err = node_ioctl(fd, VIDIOC_S_FMT, &f);
    /* Some drivers refuse instead of offering the nearest format: query the one that they would set. */
    if (err == -EINVAL) {
        f = (struct v4l2_format){ .type = type };
        err = node_ioctl(fd, VIDIOC_G_FMT, &f) ? err : 0;
    }
    *got = read_picture(&f);
    return err;
}

static int set_picture(int fd, const struct sst_grab_config *cfg, size_t *stride, char *why, size_t size)
{
    struct picture got;
    int err = try_picture(fd, cfg->fourcc, cfg, &got);

    if (!err && cfg->fourcc == V4L2_PIX_FMT_MJPEG && got.fourcc != V4L2_PIX_FMT_MJPEG) /* the same by another name */
        err = try_picture(fd, V4L2_PIX_FMT_JPEG, cfg, &got);
    if (err)
        return err;
    if (!picture_fits(&got, cfg))
        return refuse(fd, cfg, &got, why, size);
    *stride = raw_bytes(cfg->fourcc, cfg->width, cfg->height, 0) ? got.stride : 0;
    return 0;
}

static int set_rate(int fd, const struct sst_grab_config *cfg, char *why, size_t size)
{
    struct v4l2_streamparm p = { .type = node_type(fd) };
    struct v4l2_captureparm *c = &p.parm.capture;
    double got, before;
    int err = node_ioctl(fd, VIDIOC_G_PARM, &p);

    if (err == -ENODEV || err == -EIO)
        return err;
    before = err ? 0 : hz(c->timeperframe);
    if (err || !(c->capability & V4L2_CAP_TIMEPERFRAME)) {
        sst_text_add(why, size, "it does not support setting the rate, %.4g Hz is ignored", cfg->rate_hz);
        return 0;
    }
    c->timeperframe.numerator = 10000;
    c->timeperframe.denominator = (uint32_t)lround(cfg->rate_hz * 10000);
    err = node_ioctl(fd, VIDIOC_S_PARM, &p);
    if (err == -ENODEV)
        return err;
    got = err ? before : hz(c->timeperframe);
    if (err && !before) { /* its rate is unknown: it may be the right one */
        sst_text_add(why, size, "its driver does not set the rate (%s), %.4g Hz is ignored", strerror(-err),
                     cfg->rate_hz);
        return 0;
    }
    if (fabs(got - cfg->rate_hz) <= RATE_TOLERANCE * cfg->rate_hz)
        return 0;
    sst_text_add(why, size, "at %dx%d it delivers %.4g Hz, not %.4g", cfg->width, cfg->height, got, cfg->rate_hz);
    if (err)
        sst_text_add(why, size, ": its driver does not set the rate (%s)", strerror(-err));
    add_rates(fd, cfg, why, size);
    return cfg->triggered ? 0 : -EINVAL;
}

int format_set(int fd, const struct sst_grab_config *cfg, size_t *stride, char *why, size_t size)
{
    int err;

    *why = 0;
    err = set_picture(fd, cfg, stride, why, size);
    return err || cfg->rate_hz <= 0 ? err : set_rate(fd, cfg, why, size);
}

void format_summary(int fd, struct sst_grab_device *device)
{
    const uint32_t type = node_type(fd);
    const size_t size = sizeof(device->formats);
    char *const out = device->formats;
    struct v4l2_fmtdesc f;

    *out = 0;
    for (uint32_t i = 0; format_at(fd, type, i, &f); i++) {
        struct v4l2_frmsizeenum s;
        char name[5];

        if (i < SST_GRAB_FOURCC_MAX)
            device->fourcc[i] = f.pixelformat;
        fourcc_name(name, f.pixelformat);
        sst_text_add(out, size, "%s%s", i ? ", " : "", name);
        for (uint32_t j = 0; size_at(fd, f.pixelformat, j, &s); j++) {
            if (s.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
                sst_text_add(out, size, " %ux%u", s.discrete.width, s.discrete.height);
                continue;
            }
            sst_text_add(out, size, " %ux%u-%ux%u", s.stepwise.min_width, s.stepwise.min_height, s.stepwise.max_width,
                         s.stepwise.max_height);
            break;
        }
    }
}

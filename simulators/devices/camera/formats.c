/* Pixel formats, sizes and frame rates of a simulated camera. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "simulators/devices/camera/camera_internal.h"

struct format {
    uint32_t fourcc;
    const char *name; /* the kernel's name */
    int bits;         /* per pixel; 0: compressed */
};

static const struct format formats[] = {
    { V4L2_PIX_FMT_MJPEG, "Motion-JPEG", 0 },
    { V4L2_PIX_FMT_YUYV, "YUYV 4:2:2", 16 },
    { V4L2_PIX_FMT_GREY, "8-bit Greyscale", 8 },
    { V4L2_PIX_FMT_Y16, "16-bit Greyscale", 16 },
    { V4L2_PIX_FMT_SBGGR8, "8-bit Bayer BGBG/GRGR", 8 },
    { V4L2_PIX_FMT_SGBRG8, "8-bit Bayer GBGB/RGRG", 8 },
    { V4L2_PIX_FMT_SGRBG8, "8-bit Bayer GRGR/BGBG", 8 },
    { V4L2_PIX_FMT_SRGGB8, "8-bit Bayer RGRG/GBGB", 8 },
};

static const uint32_t rates[] = { 30, 25, 20, 15, 10, 5, 2, 1 };

static const struct format *find_format(uint32_t fourcc)
{
    for (size_t i = 0; i < ARRAY_LEN(formats); i++)
        if (formats[i].fourcc == fourcc)
            return &formats[i];
    return NULL;
}

/* The supported size nearest to the requested one. */
static void nearest_size(const struct sim_cam *cam, uint32_t *width, uint32_t *height)
{
    const int(*sizes)[2];
    const int count = sst_sim_world_sizes(cam->world, &sizes);
    int64_t best = INT64_MAX;
    int at = 0;

    for (int i = 0; i < count; i++) {
        const int64_t off = llabs((int64_t)sizes[i][0] - *width) + llabs((int64_t)sizes[i][1] - *height);

        if (off < best) {
            best = off;
            at = i;
        }
    }
    *width = (uint32_t)sizes[at][0];
    *height = (uint32_t)sizes[at][1];
}

static bool is_size(const struct sim_cam *cam, uint32_t width, uint32_t height)
{
    uint32_t w = width, h = height;

    nearest_size(cam, &w, &h);
    return w == width && h == height;
}

/* Adjust a requested format to a supported one; never fails. */
static void adjust(const struct sim_cam *cam, struct v4l2_pix_format *p)
{
    const struct format *f = find_format(p->pixelformat);
    struct v4l2_pix_format out = { .width = p->width,
                                   .height = p->height,
                                   .field = V4L2_FIELD_NONE,
                                   .colorspace = V4L2_COLORSPACE_SRGB,
                                   .priv = V4L2_PIX_FMT_PRIV_MAGIC,
                                   .ycbcr_enc = V4L2_YCBCR_ENC_601,
                                   .quantization = V4L2_QUANTIZATION_DEFAULT,
                                   .xfer_func = V4L2_XFER_FUNC_SRGB };

    if (sim_cam_fault(cam, SST_SIM_FAULT_FIELD) >= 10)
        out.field = (uint32_t)sim_cam_fault(cam, SST_SIM_FAULT_FIELD) % 10;
    if (!f)
        f = &formats[0];
    nearest_size(cam, &out.width, &out.height);
    out.pixelformat = f->fourcc;
    out.bytesperline = out.width * (uint32_t)f->bits / 8;
    out.sizeimage = f->bits ? out.bytesperline * out.height : out.width * out.height * 2;
    *p = out;
}

void sim_cam_formats_reset(struct sim_cam *cam)
{
    const int(*sizes)[2];

    (void)sst_sim_world_sizes(cam->world, &sizes);
    cam->format = (struct v4l2_pix_format){ .pixelformat = V4L2_PIX_FMT_MJPEG,
                                            .width = (uint32_t)sizes[0][0],
                                            .height = (uint32_t)sizes[0][1] };
    adjust(cam, &cam->format);
    cam->interval = (struct v4l2_fract){ 1, 30 };
}

static int enum_format(const struct sim_cam *cam, struct v4l2_fmtdesc *d)
{
    const uint32_t index = d->index;

    if (d->type != sim_cam_type(cam) || index >= ARRAY_LEN(formats))
        return -EINVAL;
    *d = (struct v4l2_fmtdesc){ .index = index,
                                .type = d->type,
                                .pixelformat = formats[index].fourcc,
                                .flags = formats[index].bits ? 0 : V4L2_FMT_FLAG_COMPRESSED };
    (void)snprintf((char *)d->description, sizeof(d->description), "%s", formats[index].name);
    return 0;
}

static int enum_size(const struct sim_cam *cam, struct v4l2_frmsizeenum *e)
{
    const int(*sizes)[2];
    const int count = sst_sim_world_sizes(cam->world, &sizes);

    if (!find_format(e->pixel_format) || e->index >= (uint32_t)count)
        return -EINVAL;
    *e = (struct v4l2_frmsizeenum){ .index = e->index,
                                    .pixel_format = e->pixel_format,
                                    .type = V4L2_FRMSIZE_TYPE_DISCRETE,
                                    .discrete = { (uint32_t)sizes[e->index][0], (uint32_t)sizes[e->index][1] } };
    return 0;
}

static int enum_interval(const struct sim_cam *cam, struct v4l2_frmivalenum *e)
{
    if (!find_format(e->pixel_format) || !is_size(cam, e->width, e->height) || e->index >= ARRAY_LEN(rates))
        return -EINVAL;
    *e = (struct v4l2_frmivalenum){ .index = e->index,
                                    .pixel_format = e->pixel_format,
                                    .width = e->width,
                                    .height = e->height,
                                    .type = V4L2_FRMIVAL_TYPE_DISCRETE,
                                    .discrete = { 1, rates[e->index] } };
    return 0;
}

static int set_format(struct sim_cam *cam, struct v4l2_format *f, bool keep)
{
    if (f->type != sim_cam_type(cam))
        return -EINVAL;
    adjust(cam, &f->fmt.pix);
    if (!keep)
        return 0;
    if (cam->queue.count || sim_cam_fault(cam, SST_SIM_FAULT_BUSY) > 0)
        return -EBUSY;
    cam->format = f->fmt.pix;
    return 0;
}

static int get_format(const struct sim_cam *cam, struct v4l2_format *f)
{
    if (f->type != sim_cam_type(cam))
        return -EINVAL;
    memset(f, 0, sizeof(*f));
    f->type = sim_cam_type(cam);
    f->fmt.pix = cam->format;
    return 0;
}

static int get_rate(const struct sim_cam *cam, struct v4l2_streamparm *p)
{
    if (p->type != sim_cam_type(cam))
        return -EINVAL;
    memset(&p->parm, 0, sizeof(p->parm));
    p->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
    p->parm.capture.timeperframe = cam->interval;
    return 0;
}

static int set_rate(struct sim_cam *cam, struct v4l2_streamparm *p)
{
    const struct v4l2_fract want = p->parm.capture.timeperframe;
    double best = 1e300;

    if (p->type != sim_cam_type(cam))
        return -EINVAL;
    if (cam->queue.streaming)
        return -EBUSY;
    if (sim_cam_fault(cam, SST_SIM_FAULT_PARM_ERRNO) > 0)
        return -(int)sim_cam_fault(cam, SST_SIM_FAULT_PARM_ERRNO);
    /* The nearest interval; 0 selects the camera's default. */
    for (size_t i = 0; i < ARRAY_LEN(rates); i++) {
        const double seconds =
            want.numerator && want.denominator ? (double)want.numerator / want.denominator : 1.0 / 30;
        const double off = seconds > 1.0 / rates[i] ? seconds - 1.0 / rates[i] : 1.0 / rates[i] - seconds;

        if (off < best) {
            best = off;
            cam->interval = (struct v4l2_fract){ 1, rates[i] };
        }
    }
    return get_rate(cam, p);
}

int sim_cam_formats_ioctl(struct sim_cam *cam, struct sim_request *r)
{
    void *a = r->data;

    switch (r->call.cmd) {
    case VIDIOC_ENUM_FMT:
        return enum_format(cam, a);
    case VIDIOC_ENUM_FRAMESIZES:
        return enum_size(cam, a);
    case VIDIOC_ENUM_FRAMEINTERVALS:
        return enum_interval(cam, a);
    case VIDIOC_G_FMT:
        return get_format(cam, a);
    case VIDIOC_TRY_FMT:
        return set_format(cam, a, false);
    case VIDIOC_S_FMT:
        return set_format(cam, a, true);
    case VIDIOC_G_PARM:
        return get_rate(cam, a);
    case VIDIOC_S_PARM:
        return set_rate(cam, a);
    default:
        return -ENOTTY;
    }
}

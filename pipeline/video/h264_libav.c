/* H.264 encoders of FFmpeg, in the part libsst-video.so: devices first, then programs.
 *
 * An encoder counts as working when it has encoded a grey picture at once: drivers open and then refuse their first
 * picture, or hold it back until the next one comes, which viewers would see as delay. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/video/h264.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <libavcodec/avcodec.h>
#include <libavutil/hwcontext.h>
#include <libavutil/opt.h>

#define RATE_HZ     10      /* of the rate control, which counts pictures, not time */
#define BUFFER      12      /* pictures, whose bytes one picture may take: key pictures have 5 times those of others */
#define KEY_FAR     1000000 /* pictures; the caller asks for key pictures */
#define SLICED_FROM 1500000 /* pixels, from which on several threads share a picture */
#define HEADERS_MAX 512     /* bytes of parameter sets */

enum encoder_kind { KIND_PROGRAM = 0, KIND_VAAPI = 1, KIND_V4L2 = 2 };

static const struct encoder {
    const char *name;
    enum encoder_kind kind;
    enum AVPixelFormat format;
    const char *options[8][2];
} encoders[] = {
    { "h264_vaapi", KIND_VAAPI, AV_PIX_FMT_NV12, { { "async_depth", "1" }, { "rc_mode", "VBR" } } },
    { "h264_v4l2m2m", KIND_V4L2, AV_PIX_FMT_NV12, { { NULL } } },
    { "h264_v4l2m2m", KIND_V4L2, AV_PIX_FMT_YUV420P, { { NULL } } },
    { "libx264",
      KIND_PROGRAM,
      AV_PIX_FMT_YUV420P,
      { { "preset", "superfast" }, { "tune", "zerolatency" }, { "crf", "25" }, { "forced-idr", "1" } } },
    { "libopenh264", KIND_PROGRAM, AV_PIX_FMT_YUV420P, { { "allow_skip_frames", "0" } } },
};

static atomic_uint failed; /* bits of encoders that are not tried again */

struct sst_h264 {
    const struct encoder *encoder;
    AVBufferRef *device; /* NULL: none */
    AVCodecContext *codec;
    AVFrame *frame, *uploaded;
    AVPacket *packet;
    uint8_t *joined; /* parameter sets and a key picture that came without */
    char name[16], codec_text[16];
    uint8_t headers[HEADERS_MAX];
    size_t headers_bytes;
};

static int explain(char why[256], const char *what, int err)
{
    char text[AV_ERROR_MAX_STRING_SIZE] = "no memory";

    if (err < 0)
        av_strerror(err, text, sizeof(text));
    snprintf(why, 256, "%s: %s", what, text);
    return err >= 0 || err == AVERROR(ENOMEM) ? -ENOMEM : -EIO;
}

/* FFmpeg would open all video devices, cameras too. */
static bool has_v4l2_encoder(void)
{
    static const char folder[] = "/sys/class/video4linux";
    DIR *dir = opendir(folder);
    const struct dirent *e;
    bool found = false;

    while (dir && !found && (e = readdir(dir))) {
        char path[512], name[64] = "";
        FILE *f;

        snprintf(path, sizeof(path), "%s/%.200s/name", folder, e->d_name);
        f = fopen(path, "re");
        if (f && fgets(name, sizeof(name), f)) {
            for (char *c = name; *c; c++)
                *c = (char)tolower((unsigned char)*c);
            found = strstr(name, "enc") || strstr(name, "codec");
        }
        if (f)
            fclose(f);
    }
    if (dir)
        closedir(dir);
    return found;
}

static int open_device(struct sst_h264 *h)
{
    const int level = av_log_get_level();
    AVHWFramesContext *frames;
    AVBufferRef *pool;
    int err;

    av_log_set_level(AV_LOG_QUIET); /* most machines have none */
    err = av_hwdevice_ctx_create(&h->device, AV_HWDEVICE_TYPE_VAAPI, NULL, NULL, 0);
    av_log_set_level(level);
    if (err < 0)
        return err;
    pool = av_hwframe_ctx_alloc(h->device);
    if (!pool)
        return AVERROR(ENOMEM);
    frames = (AVHWFramesContext *)(void *)pool->data;
    frames->format = AV_PIX_FMT_VAAPI;
    frames->sw_format = h->encoder->format;
    frames->width = h->codec->width;
    frames->height = h->codec->height;
    frames->initial_pool_size = 4;
    err = av_hwframe_ctx_init(pool);
    h->codec->pix_fmt = AV_PIX_FMT_VAAPI;
    h->codec->hw_frames_ctx = pool;
    h->uploaded = av_frame_alloc();
    return err < 0 ? err : h->uploaded ? 0 : AVERROR(ENOMEM);
}

static int open_codec(struct sst_h264 *h, const AVCodec *found, const struct sst_h264_config *cfg)
{
    const int64_t rate = (int64_t)cfg->bytes_per_picture * 8 * RATE_HZ;
    AVCodecContext *c = h->codec = avcodec_alloc_context3(found);
    int err = 0;

    if (!c)
        return AVERROR(ENOMEM);
    c->log_level_offset = AV_LOG_TRACE; /* libx264 reports every opening and end */
    c->width = cfg->width;
    c->height = cfg->height;
    c->pix_fmt = h->encoder->format;
    c->time_base = (AVRational){ 1, RATE_HZ };
    c->framerate = (AVRational){ RATE_HZ, 1 };
    c->gop_size = KEY_FAR;
    c->max_b_frames = 0;
    c->bit_rate = h->encoder->kind || strcmp(h->encoder->name, "libx264") ? rate : 0;
    c->rc_max_rate = rate;
    c->rc_buffer_size = (int)(rate / RATE_HZ * BUFFER);
    c->flags |= AV_CODEC_FLAG_LOW_DELAY;
    c->thread_count = cfg->width * cfg->height < SLICED_FROM ? 1 : 4;
    c->color_range = cfg->full_range ? AVCOL_RANGE_JPEG : AVCOL_RANGE_MPEG;
    c->colorspace = AVCOL_SPC_SMPTE170M;
    c->color_primaries = AVCOL_PRI_BT709;
    c->color_trc = AVCOL_TRC_IEC61966_2_1;
    if (h->encoder->kind == KIND_VAAPI)
        err = open_device(h);
    for (int i = 0; h->encoder->options[i][0]; i++) /* of a library of another version: as it comes */
        (void)av_opt_set(c->priv_data, h->encoder->options[i][0], h->encoder->options[i][1], 0);
    return err < 0 ? err : avcodec_open2(c, found, NULL);
}

static int open_frame(struct sst_h264 *h)
{
    h->packet = av_packet_alloc();
    h->frame = av_frame_alloc();
    if (!h->packet || !h->frame)
        return AVERROR(ENOMEM);
    h->frame->format = h->encoder->format;
    h->frame->width = h->codec->width;
    h->frame->height = h->codec->height;
    h->frame->color_range = h->codec->color_range;
    h->frame->pts = 0;
    return av_frame_get_buffer(h->frame, 0);
}

static void fill(AVFrame *f, const struct sst_h264_picture *p)
{
    for (int y = 0; y < f->height; y++)
        memcpy(f->data[0] + (ptrdiff_t)y * f->linesize[0], p->plane[0] + (size_t)y * p->stride[0], (size_t)f->width);
    for (int y = 0; y < f->height / 2; y++) {
        const uint8_t *cb = p->plane[1] + (size_t)y * p->stride[1], *cr = p->plane[2] + (size_t)y * p->stride[2];
        uint8_t *to = f->data[1] + (ptrdiff_t)y * f->linesize[1];

        if (f->format != AV_PIX_FMT_NV12) {
            memcpy(to, cb, (size_t)f->width / 2);
            memcpy(f->data[2] + (ptrdiff_t)y * f->linesize[2], cr, (size_t)f->width / 2);
            continue;
        }
        for (int x = 0; x < f->width / 2; x++) {
            to[2 * x] = cb[x];
            to[2 * x + 1] = cr[x];
        }
    }
}

/* The frame as the encoder takes it. */
static int upload(struct sst_h264 *h, AVFrame **out)
{
    int err;

    *out = h->frame;
    if (!h->device)
        return 0;
    av_frame_unref(h->uploaded);
    err = av_hwframe_get_buffer(h->codec->hw_frames_ctx, h->uploaded, 0);
    err = err < 0 ? err : av_hwframe_transfer_data(h->uploaded, h->frame, 0);
    h->uploaded->pts = h->frame->pts;
    h->uploaded->pict_type = h->frame->pict_type;
    *out = h->uploaded;
    return err;
}

/** Next NAL unit at or after `at`. @return its length without start code, 0: none; `at` is its first byte */
static size_t next_nal(const uint8_t *data, size_t bytes, size_t *at)
{
    size_t i = *at, end;

    while (i + 3 < bytes && (data[i] || data[i + 1] || data[i + 2] != 1))
        i++;
    if (i + 3 >= bytes)
        return 0;
    *at = i + 3;
    for (end = *at; end < bytes; end++)
        if (end + 3 <= bytes && !data[end] && !data[end + 1] && data[end + 2] <= 1)
            break;
    return end - *at;
}

/* Parameter sets of an access unit or of the extradata are kept. @return it has some */
static bool keep_headers(struct sst_h264 *h, const uint8_t *data, size_t bytes)
{
    size_t at = 0, n, kept = 0;

    while ((n = next_nal(data, bytes, &at))) {
        const int type = data[at] & 31;

        if ((type == 7 || type == 8) && kept + n + 4 <= HEADERS_MAX) {
            memcpy(h->headers + kept, "\0\0\0\1", 4);
            memcpy(h->headers + kept + 4, data + at, n);
            kept += n + 4;
        }
        if (type == 7 && n >= 4)
            snprintf(h->codec_text, sizeof(h->codec_text), "avc1.%02x%02x%02x", data[at + 1], data[at + 2],
                     data[at + 3]);
        at += n;
    }
    h->headers_bytes = kept ? kept : h->headers_bytes;
    return kept > 0;
}

/* Some devices send parameter sets once; a viewer that comes later needs them too. */
static int give(struct sst_h264 *h, struct sst_h264_unit *out)
{
    const AVPacket *p = h->packet;
    const bool key = (p->flags & AV_PKT_FLAG_KEY) != 0;

    *out = (struct sst_h264_unit){ .data = p->data, .bytes = (size_t)p->size, .key = key };
    if (key && !keep_headers(h, p->data, out->bytes)) {
        free(h->joined);
        h->joined = malloc(h->headers_bytes + out->bytes);
        if (!h->joined)
            return AVERROR(ENOMEM);
        memcpy(h->joined, h->headers, h->headers_bytes);
        memcpy(h->joined + h->headers_bytes, p->data, out->bytes);
        out->data = h->joined;
        out->bytes += h->headers_bytes;
    }
    memcpy(out->codec, h->codec_text, sizeof(out->codec));
    return 0;
}

static int encode(struct sst_h264 *h, const struct sst_h264_picture *picture, struct sst_h264_unit *out)
{
    AVFrame *frame;
    int err = av_frame_make_writable(h->frame);

    if (err < 0)
        return err;
    fill(h->frame, picture);
    h->frame->pts++;
    h->frame->pict_type = picture->key ? AV_PICTURE_TYPE_I : AV_PICTURE_TYPE_NONE;
    av_packet_unref(h->packet);
    err = upload(h, &frame);
    err = err < 0 ? err : avcodec_send_frame(h->codec, frame);
    err = err < 0 ? err : avcodec_receive_packet(h->codec, h->packet);
    if (err == AVERROR(EAGAIN) || (err >= 0 && h->packet->pts != h->frame->pts))
        err = AVERROR(ETIME); /* held back */
    err = err < 0 ? err : give(h, out);
    return err < 0 ? err : picture->key && !out->key ? AVERROR(ENOSYS) : 0;
}

static int try_grey(struct sst_h264 *h)
{
    struct sst_h264_picture grey = { .key = true };
    struct sst_h264_unit unit;
    const size_t width = (size_t)h->codec->width;
    uint8_t *row = malloc(width);
    int err = AVERROR(ENOMEM);

    if (row) {
        memset(row, 128, width);
        grey.plane[0] = grey.plane[1] = grey.plane[2] = row; /* every row is this one */
        err = encode(h, &grey, &unit);
    }
    free(row);
    return err < 0 ? err : h->codec_text[0] ? 0 : AVERROR_INVALIDDATA;
}

static void h264_close(struct sst_h264 *h)
{
    if (!h)
        return;
    avcodec_free_context(&h->codec);
    av_frame_free(&h->frame);
    av_frame_free(&h->uploaded);
    av_packet_free(&h->packet);
    av_buffer_unref(&h->device);
    free(h->joined);
    free(h);
}

static int try_encoder(struct sst_h264 **out, const struct encoder *e, const struct sst_h264_config *cfg)
{
    const AVCodec *found = avcodec_find_encoder_by_name(e->name);
    struct sst_h264 *h;
    int err;

    if (!found || (e->kind == KIND_V4L2 && !has_v4l2_encoder()))
        return AVERROR_ENCODER_NOT_FOUND;
    h = calloc(1, sizeof(*h));
    if (!h)
        return AVERROR(ENOMEM);
    h->encoder = e;
    snprintf(h->name, sizeof(h->name), "%s", e->name);
    err = open_codec(h, found, cfg);
    err = err < 0 ? err : open_frame(h);
    if (err >= 0 && h->codec->extradata_size > 0)
        (void)keep_headers(h, h->codec->extradata, (size_t)h->codec->extradata_size);
    err = err < 0 ? err : try_grey(h);
    if (err < 0)
        h264_close(h);
    else
        *out = h;
    return err;
}

static int h264_open(struct sst_h264 **out, const struct sst_h264_config *cfg, char why[256])
{
    int err = AVERROR_ENCODER_NOT_FOUND;

    if (cfg->width < 32 || cfg->height < 32 || cfg->width % 2 || cfg->height % 2 || cfg->width > 8192 ||
        cfg->height > 8192) {
        snprintf(why, 256, "pictures of %d x %d are not encoded as H.264", cfg->width, cfg->height);
        return -ENOTSUP;
    }
    for (size_t i = 0; i < ARRAY_LEN(encoders); i++) {
        if (atomic_load(&failed) & 1u << i)
            continue;
        err = try_encoder(out, &encoders[i], cfg);
        if (err >= 0 || err == AVERROR(ENOMEM))
            break;
        if (encoders[i].kind) /* a device is tried once: that can take long */
            atomic_fetch_or(&failed, 1u << i);
    }
    if (err >= 0)
        return 0;
    if (explain(why, "no encoder of H.264 works", err) == -ENOMEM)
        return -ENOMEM;
    return -ENOTSUP;
}

static const char *h264_name(const struct sst_h264 *h)
{
    return h->name;
}

static int h264_encode(struct sst_h264 *h, const struct sst_h264_picture *picture, struct sst_h264_unit *out,
                       char why[256])
{
    const int err = encode(h, picture, out);

    if (err >= 0)
        return 0;
    if (h->encoder->kind)
        atomic_fetch_or(&failed, 1u << (h->encoder - encoders));
    return explain(why, h->name, err);
}

extern const struct sst_h264_part sst_h264_part;
const struct sst_h264_part sst_h264_part = { h264_open, h264_name, h264_encode, h264_close };

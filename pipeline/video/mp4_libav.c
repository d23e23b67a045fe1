/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/video/video_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>

#define PARTS   4 /* of a frame that are drawn each time */
#define THREADS 4 /* always: the bytes of a file depend on it */

/* Scaling of a picture's size to a part's. */
struct part {
    int from_width, from_height, width, height;
    struct SwsContext *scale; /* NULL: unused */
};

struct video_encoder {
    AVFormatContext *format;
    AVCodecContext *codec;
    AVStream *stream;
    AVFrame *frame;
    AVPacket *packet;
    int64_t frames;
    struct part part[PARTS];
};

/* libav's errors are negative errnos or its own tags; callers know errnos only. */
static int failed(char why[VIDEO_WHY], const char *what, int err)
{
    snprintf(why, VIDEO_WHY, "%s: %s", what, err < 0 ? av_err2str(err) : "no memory");
    return err >= 0 || err == AVERROR(ENOMEM) ? -ENOMEM : err == AVERROR(ENOSPC) ? -ENOSPC : -EIO;
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static const AVCodec *find_codec(bool portable)
{
    static const char *const names[] = { "libx264", "libopenh264" };
    const AVCodec *codec = NULL;

    for (size_t i = 0; !codec && i < ARRAY_LEN(names); i++)
        codec = avcodec_find_encoder_by_name(names[i]);
    return codec || portable ? codec : avcodec_find_encoder(AV_CODEC_ID_MPEG4);
}

static void set_quality(AVCodecContext *c, const AVCodec *codec, const struct sst_mp4_config *cfg)
{
    const bool x264 = !strcmp(codec->name, "libx264");

    c->bit_rate = (int64_t)(0.25 * cfg->width * cfg->height * cfg->rate_hz); /* for encoders without constant quality */
    if (x264) {
        c->bit_rate = 0;
        av_opt_set(c->priv_data, "crf", cfg->portable ? "20" : "18", 0);
    }
    if (!cfg->portable)
        return;
    if (c->bit_rate > SST_MP4_KBIT_MOST * INT64_C(1000))
        c->bit_rate = SST_MP4_KBIT_MOST * INT64_C(1000);
    c->gop_size = (int)(2 * cfg->rate_hz);
    c->rc_max_rate = SST_MP4_KBIT_MOST * INT64_C(1000);
    c->profile = FF_PROFILE_H264_HIGH;
    if (!x264)
        return;
    c->rc_buffer_size = 2 * SST_MP4_KBIT_MOST * 1000;
    c->level = 41;
    av_opt_set(c->priv_data, "preset", "veryfast", 0);
    av_opt_set(c->priv_data, "profile", "high", 0);
}

static int open_codec(struct video_encoder *v, const struct sst_mp4_config *cfg, char why[VIDEO_WHY])
{
    const AVCodec *codec = find_codec(cfg->portable);
    AVCodecContext *c;
    int err;

    if (!codec) {
        snprintf(why, VIDEO_WHY, "libavcodec on this machine has no encoder of H.264%s; install its package with libx264",
                 cfg->portable ? "" : " or MPEG-4");
        return -ENOTSUP;
    }
    c = v->codec = avcodec_alloc_context3(codec);
    v->stream = avformat_new_stream(v->format, NULL);
    if (!v->codec || !v->stream)
        return failed(why, "cannot set up", 0);
    c->width = cfg->width & ~1;
    c->height = cfg->height & ~1;
    c->pix_fmt = AV_PIX_FMT_YUV420P;
    c->framerate = av_d2q(cfg->rate_hz, 60000);
    c->time_base = av_inv_q(c->framerate);
    c->sample_aspect_ratio = (AVRational){ 1, 1 };
    c->thread_count = THREADS;
    c->color_range = AVCOL_RANGE_MPEG;
    c->colorspace = AVCOL_SPC_BT709;
    c->color_primaries = AVCOL_PRI_BT709;
    c->color_trc = AVCOL_TRC_BT709;
    set_quality(c, codec, cfg);
    if (v->format->oformat->flags & AVFMT_GLOBALHEADER)
        c->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    err = avcodec_open2(c, codec, NULL);
    if (err < 0)
        return failed(why, "cannot start the encoder", err);
    v->stream->time_base = c->time_base;
    v->stream->avg_frame_rate = v->stream->r_frame_rate = c->framerate;
    v->stream->sample_aspect_ratio = c->sample_aspect_ratio;
    err = avcodec_parameters_from_context(v->stream->codecpar, c);
    return err < 0 ? failed(why, "cannot set up", err) : 0;
}

/* The first frame is black. */
static int open_frame(struct video_encoder *v, char why[VIDEO_WHY])
{
    AVFrame *f = v->frame = av_frame_alloc();

    v->packet = av_packet_alloc();
    if (!v->packet || !f)
        return failed(why, "cannot set up", 0);
    f->format = AV_PIX_FMT_YUV420P;
    f->width = v->codec->width;
    f->height = v->codec->height;
    if (av_frame_get_buffer(f, 0) < 0)
        return failed(why, "cannot set up", 0);
    for (int i = 0; i < 3; i++)
        memset(f->data[i], i ? 128 : 16, (size_t)f->linesize[i] * (size_t)(i ? (f->height + 1) / 2 : f->height));
    return 0;
}

static int open_file(struct video_encoder *v, const char *path, const struct sst_mp4_config *cfg, char why[VIDEO_WHY])
{
    AVDictionary *options = NULL;
    int err = avio_open(&v->format->pb, path, AVIO_FLAG_WRITE);

    if (err >= 0 && cfg->title)
        err = av_dict_set(&v->format->metadata, "title", cfg->title, 0);
    if (err >= 0)
        err = av_dict_set(&options, "movflags", "+faststart", 0);
    if (err >= 0)
        err = avformat_write_header(v->format, &options);
    av_dict_free(&options);
    return err < 0 ? failed(why, "cannot begin", err) : 0;
}

int video_encoder_open(struct video_encoder **out, const char *path, const struct sst_mp4_config *cfg,
                       char why[VIDEO_WHY])
{
    struct video_encoder *v;
    int err;

    if (cfg->portable && (cfg->width > SST_MP4_WIDTH_MOST || cfg->height > SST_MP4_HEIGHT_MOST ||
                          !(cfg->rate_hz >= 1 && cfg->rate_hz <= SST_MP4_RATE_MOST))) {
        snprintf(why, VIDEO_WHY, "%d x %d pixels at %g Hz are beyond level 4.1 of H.264", cfg->width, cfg->height,
                 cfg->rate_hz);
        return -EINVAL;
    }
    av_log_set_level(AV_LOG_ERROR);
    v = calloc(1, sizeof(*v));
    if (!v)
        return -ENOMEM;
    /* The path is needed for moving the index to the beginning, for which the muxer opens the file again. */
    err = avformat_alloc_output_context2(&v->format, NULL, "mp4", path) < 0 ? failed(why, "cannot set up", 0) : 0;
    err = err ? err : open_codec(v, cfg, why);
    err = err ? err : open_frame(v, why);
    err = err ? err : open_file(v, path, cfg, why);
    if (err)
        video_encoder_close(v);
    else
        *out = v;
    return err;
}

/* --- pictures ----------------------------------------------------------------------------------------------------- */

static bool is_of(const struct part *p, const struct sst_image *img, int width, int height)
{
    return p->scale && p->from_width == img->width && p->from_height == img->height && p->width == width &&
           p->height == height;
}

static struct SwsContext *scaler(struct video_encoder *v, const struct sst_image *img, int width, int height)
{
    struct part *p = &v->part[0];

    for (int i = 0; i < PARTS; i++) {
        if (is_of(&v->part[i], img, width, height))
            return v->part[i].scale;
        if (p->scale && !v->part[i].scale)
            p = &v->part[i];
    }
    sws_freeContext(p->scale);
    *p = (struct part){ img->width, img->height, width, height, NULL };
    p->scale = sws_getContext(img->width, img->height, AV_PIX_FMT_GBRP, width, height, AV_PIX_FMT_YUV420P,
                              img->width > width ? SWS_AREA : SWS_BILINEAR, NULL, NULL, NULL);
    if (p->scale)
        sws_setColorspaceDetails(p->scale, sws_getCoefficients(SWS_CS_DEFAULT), 1, sws_getCoefficients(SWS_CS_ITU709),
                                 0, 0, 1 << 16, 1 << 16);
    return p->scale;
}

int video_encoder_put(struct video_encoder *v, const struct sst_image *img, struct sst_rect part, char why[VIDEO_WHY])
{
    const uint8_t *const gbr[4] = { img->plane[1], img->plane[2], img->plane[0], NULL };
    const int from[4] = { (int)img->stride, (int)img->stride, (int)img->stride, 0 };
    const int width = part.x1 - part.x0, height = part.y1 - part.y0;
    uint8_t *to[4] = { NULL };
    struct SwsContext *scale;

    if (((part.x0 | part.y0 | width | height) & 1) || part.x0 < 0 || part.y0 < 0 || width < 2 || height < 2 ||
        part.x1 > v->codec->width || part.y1 > v->codec->height) {
        snprintf(why, VIDEO_WHY, "a part of %d x %d pixels at %d, %d does not fit", width, height, part.x0, part.y0);
        return -EINVAL;
    }
    scale = scaler(v, img, width, height);
    if (!scale || av_frame_make_writable(v->frame) < 0)
        return failed(why, "cannot draw", 0);
    for (int i = 0; i < 3; i++)
        to[i] = v->frame->data[i] + (part.y0 >> !!i) * (ptrdiff_t)v->frame->linesize[i] + (part.x0 >> !!i);
    sws_scale(scale, gbr, from, 0, img->height, to, v->frame->linesize);
    return 0;
}

/* Pass a frame to the encoder (NULL: the end) and write its output. */
static int encode(struct video_encoder *v, const AVFrame *frame, char why[VIDEO_WHY])
{
    int err = avcodec_send_frame(v->codec, frame);

    while (err >= 0) {
        err = avcodec_receive_packet(v->codec, v->packet);
        if (err == AVERROR(EAGAIN) || err == AVERROR_EOF)
            return 0;
        if (err < 0)
            break;
        if (!v->packet->duration)
            v->packet->duration = 1;
        av_packet_rescale_ts(v->packet, v->codec->time_base, v->stream->time_base);
        v->packet->stream_index = v->stream->index;
        err = av_interleaved_write_frame(v->format, v->packet);
    }
    return failed(why, "cannot encode", err);
}

int video_encoder_next(struct video_encoder *v, char why[VIDEO_WHY])
{
    v->frame->pts = v->frames++;
    return encode(v, v->frame, why);
}

int video_encoder_end(struct video_encoder *v, char why[VIDEO_WHY])
{
    int err = encode(v, NULL, why);

    if (err)
        return err;
    err = av_write_trailer(v->format);
    if (err >= 0)
        err = avio_closep(&v->format->pb);
    return err < 0 ? failed(why, "cannot finish", err) : 0;
}

void video_encoder_close(struct video_encoder *v)
{
    if (!v)
        return;
    if (v->format)
        avio_closep(&v->format->pb);
    for (int i = 0; i < PARTS; i++)
        sws_freeContext(v->part[i].scale);
    av_frame_free(&v->frame);
    av_packet_free(&v->packet);
    avcodec_free_context(&v->codec);
    avformat_free_context(v->format);
    free(v);
}

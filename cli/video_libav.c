#include "cli/cli_internal.h"
#include "cli/render_internal.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>

struct video {
    struct sst_outfile out;
    AVFormatContext *format;
    AVCodecContext *codec;
    AVStream *stream;
    AVFrame *frame;
    AVPacket *packet;
    struct SwsContext *scale;
    int width, height; /* of the pictures */
};

/* libav's errors are negative errnos or its own tags; callers know errnos only. */
static int failed(const struct video *v, const char *what, int err)
{
    sst_log_error("%s %s: %s", what, v->out.path, err < 0 ? av_err2str(err) : "no memory");
    return err >= 0 || err == AVERROR(ENOMEM) ? -ENOMEM : err == AVERROR(ENOSPC) ? -ENOSPC : -EIO;
}

static int open_codec(struct video *v, double fps)
{
    const AVCodec *codec = avcodec_find_encoder_by_name("libx264");
    int err;

    if (!codec)
        codec = avcodec_find_encoder(AV_CODEC_ID_H264);
    if (!codec)
        codec = avcodec_find_encoder(AV_CODEC_ID_MPEG4);
    if (!codec) {
        sst_log_error("libavcodec on this machine encodes neither H.264 nor MPEG-4; write a folder instead");
        return -ENOTSUP;
    }
    v->codec = avcodec_alloc_context3(codec);
    v->stream = avformat_new_stream(v->format, NULL);
    if (!v->codec || !v->stream)
        return failed(v, "cannot set up", 0);
    v->codec->width = v->width & ~1;
    v->codec->height = v->height & ~1;
    v->codec->pix_fmt = AV_PIX_FMT_YUV420P;
    v->codec->framerate = av_d2q(fps, 60000);
    v->codec->time_base = av_inv_q(v->codec->framerate);
    v->codec->bit_rate = (int64_t)(0.25 * v->width * v->height * fps); /* for encoders without constant quality */
    if (codec->id == AV_CODEC_ID_H264 && !strcmp(codec->name, "libx264")) {
        v->codec->bit_rate = 0;
        av_opt_set(v->codec->priv_data, "crf", "18", 0);
    }
    if (v->format->oformat->flags & AVFMT_GLOBALHEADER)
        v->codec->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    err = avcodec_open2(v->codec, codec, NULL);
    if (err < 0)
        return failed(v, "cannot start the encoder of", err);
    v->stream->time_base = v->codec->time_base;
    v->stream->avg_frame_rate = v->codec->framerate;
    err = avcodec_parameters_from_context(v->stream->codecpar, v->codec);
    return err < 0 ? failed(v, "cannot set up", err) : 0;
}

static int open_buffers(struct video *v)
{
    v->packet = av_packet_alloc();
    v->frame = av_frame_alloc();
    v->scale = sws_getContext(v->codec->width, v->codec->height, AV_PIX_FMT_GBRP, v->codec->width, v->codec->height,
                              AV_PIX_FMT_YUV420P, SWS_BILINEAR, NULL, NULL, NULL);
    if (!v->packet || !v->frame || !v->scale)
        return failed(v, "cannot set up", 0);
    v->frame->format = AV_PIX_FMT_YUV420P;
    v->frame->width = v->codec->width;
    v->frame->height = v->codec->height;
    return av_frame_get_buffer(v->frame, 0) < 0 ? failed(v, "cannot set up", 0) : 0;
}

int video_open(struct video **out, const char *path, int width, int height, double fps)
{
    struct video *v;
    int err;

    if (width < 2 || height < 2) {
        sst_log_error("a video of %d x %d pixels is not possible; write a folder of pictures instead", width, height);
        return -EINVAL;
    }
    av_log_set_level(AV_LOG_ERROR);
    v = calloc(1, sizeof(*v));
    if (!v)
        return -ENOMEM;
    v->width = width;
    v->height = height;
    err = sst_outfile_open(&v->out, path);
    if (err)
        goto fail;
    if (avformat_alloc_output_context2(&v->format, NULL, "mp4", NULL) < 0) {
        err = failed(v, "cannot set up", 0);
        goto fail;
    }
    err = open_codec(v, fps);
    err = err ? err : open_buffers(v);
    if (err)
        goto fail;
    err = avio_open(&v->format->pb, v->out.temporary, AVIO_FLAG_WRITE);
    if (err >= 0)
        err = avformat_write_header(v->format, NULL);
    if (err < 0) {
        err = failed(v, "cannot write", err);
        goto fail;
    }
    *out = v;
    return 0;

fail:
    video_close(v);
    return err;
}

/* Pass a frame to the encoder (NULL: the end) and write its output. */
static int encode(struct video *v, const AVFrame *frame)
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
    return failed(v, "cannot write", err);
}

int video_add(struct video *v, const struct sst_image *img)
{
    const uint8_t *const gbr[4] = { img->plane[1], img->plane[2], img->plane[0], NULL };
    const int stride[4] = { (int)img->stride, (int)img->stride, (int)img->stride, 0 };

    if (av_frame_make_writable(v->frame) < 0)
        return failed(v, "cannot write", 0);
    sws_scale(v->scale, gbr, stride, 0, v->codec->height, v->frame->data, v->frame->linesize);
    v->frame->pts = v->frame->pts == AV_NOPTS_VALUE ? 0 : v->frame->pts + 1;
    return encode(v, v->frame);
}

int video_commit(struct video *v)
{
    int err = encode(v, NULL);

    if (err)
        return err;
    err = av_write_trailer(v->format);
    if (err >= 0)
        err = avio_closep(&v->format->pb);
    return err < 0 ? failed(v, "cannot finish", err) : sst_outfile_commit(&v->out);
}

void video_close(struct video *v)
{
    if (!v)
        return;
    if (v->format)
        avio_closep(&v->format->pb);
    sws_freeContext(v->scale);
    av_frame_free(&v->frame);
    av_packet_free(&v->packet);
    avcodec_free_context(&v->codec);
    avformat_free_context(v->format);
    sst_outfile_abort(&v->out);
    free(v);
}

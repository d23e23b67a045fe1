/* Matroska by libavformat. av_write_frame() reads the camera's bytes in place; libavformat gathers them in one cluster
 * and passes it to write_bytes(), which keeps position and errors. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/recording/recording_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"

#if WITH_AVFORMAT
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <linux/videodev2.h>

#define IO_BYTES (64 << 10)

static const struct {
    uint32_t fourcc;
    enum AVPixelFormat pixel;
} raw_formats[] = {
    { V4L2_PIX_FMT_YUYV, AV_PIX_FMT_YUYV422 },       { V4L2_PIX_FMT_GREY, AV_PIX_FMT_GRAY8 },
    { V4L2_PIX_FMT_Y16, AV_PIX_FMT_GRAY16LE },       { V4L2_PIX_FMT_SBGGR8, AV_PIX_FMT_BAYER_BGGR8 },
    { V4L2_PIX_FMT_SGBRG8, AV_PIX_FMT_BAYER_GBRG8 }, { V4L2_PIX_FMT_SGRBG8, AV_PIX_FMT_BAYER_GRBG8 },
    { V4L2_PIX_FMT_SRGGB8, AV_PIX_FMT_BAYER_RGGB8 }, { V4L2_PIX_FMT_RGB24, AV_PIX_FMT_RGB24 },
};

/* --- bytes out ---------------------------------------------------------------------------------------------------- */

/* libavformat 61 made the buffer const. */
#if LIBAVFORMAT_VERSION_MAJOR >= 61
static int write_bytes(void *opaque, const uint8_t *data, int size)
#else
static int write_bytes(void *opaque, uint8_t *data, int size)
#endif
{
    struct segment_file *s = opaque;

    if (!s->error)
        s->error = sst_file_write_at(s->fd, data, (size_t)size, s->pos);
    if (!s->error)
        s->pos += size;
    if (s->pos > s->end)
        s->end = s->pos;
    return s->error ? s->error : size;
}

static int64_t seek(void *opaque, int64_t offset, int whence)
{
    struct segment_file *s = opaque;

    if (whence == AVSEEK_SIZE)
        return s->end;
    if (whence != SEEK_SET || offset < 0)
        return AVERROR(EINVAL);
    s->pos = offset;
    return offset;
}

/* Error of a call of libavformat: the system call's, if one failed. */
static int failure(const struct segment_file *s, int err)
{
    return s->error ? s->error : err == AVERROR(ENOMEM) ? -ENOMEM : -EIO;
}

/* --- the head ----------------------------------------------------------------------------------------------------- */

void segment_set_codec(AVCodecParameters *par, uint32_t fourcc, int width, int height)
{
    par->codec_type = AVMEDIA_TYPE_VIDEO;
    par->codec_id = AV_CODEC_ID_MJPEG;
    par->width = width;
    par->height = height;
    for (size_t i = 0; i < ARRAY_LEN(raw_formats); i++) {
        if (raw_formats[i].fourcc != fourcc)
            continue;
        par->codec_id = AV_CODEC_ID_RAWVIDEO;
        par->format = raw_formats[i].pixel;
    }
}

int segment_write_head(AVFormatContext *format, AVDictionary **options)
{
    int err;

    format->flags |= AVFMT_FLAG_BITEXACT; /* no random numbers: the same frames give the same file */
    format->avoid_negative_ts = AVFMT_AVOID_NEG_TS_DISABLED;
    av_dict_set(options, "allow_raw_vfw", "1", 0);
    av_dict_set(options, "write_crc32", "0", 0);
    err = avformat_init_output(format, options);
    if (err < 0)
        return err;
    /* The start clears tags that AVI does not know; Matroska takes any, and players go by them. */
    for (unsigned k = 0; k < format->nb_streams; k++) {
        AVCodecParameters *par = format->streams[k]->codecpar;

        if (par->codec_id == AV_CODEC_ID_RAWVIDEO)
            par->codec_tag = avcodec_pix_fmt_to_codec_tag((enum AVPixelFormat)par->format);
    }
    return avformat_write_header(format, NULL);
}

static int add_track(AVFormatContext *format, const struct sst_recorder_config *cfg, int k)
{
    const struct sst_recorder_track *track = &cfg->tracks[k];
    AVStream *stream = avformat_new_stream(format, NULL);
    char title[192];

    if (!stream)
        return -ENOMEM;
    stream->id = k + 1;
    segment_set_codec(stream->codecpar, cfg->fourcc, cfg->width, cfg->height);
    if (cfg->rate_hz > 0)
        stream->avg_frame_rate = av_d2q(cfg->rate_hz, 60000);
    snprintf(title, sizeof(title), "r%02d c%02d %s", track->row, track->col,
             track->serial[0] ? track->serial : track->port);
    return av_dict_set(&stream->metadata, "title", title, 0) < 0 ? -ENOMEM : 0;
}

static int write_head(struct segment_file *s, const struct sst_recorder_config *cfg)
{
    AVDictionary *options = NULL;
    int err = 0;

    for (int k = 0; !err && k < cfg->cameras; k++)
        err = add_track(s->format, cfg, k);
    if (err)
        return err;
    err = segment_write_head(s->format, &options);
    av_dict_free(&options);
    if (err < 0 && !s->error && err != AVERROR(ENOMEM)) {
        sst_log_error("libavformat refuses to write %s: %s", s->path, av_err2str(err));
        return -EINVAL;
    }
    if (err < 0)
        return failure(s, err);
    avio_flush(s->format->pb);
    return s->error;
}

static void close_format(struct segment_file *s)
{
    if (s->format && s->format->pb) {
        av_freep(&s->format->pb->buffer);
        avio_context_free(&s->format->pb);
    }
    avformat_free_context(s->format);
    av_packet_free(&s->packet);
    if (s->fd >= 0)
        close(s->fd);
    free(s->path);
    free(s);
}

int segment_possible(void)
{
    return avformat_version() ? 0 : -ENOTSUP;
}

int segment_open(struct segment_file **out, const char *path, const struct sst_recorder_config *cfg, int64_t start_ns)
{
    struct segment_file *s = calloc(1, sizeof(*s));
    uint8_t *buffer = NULL;
    int err = -ENOMEM;

    if (!s)
        return -ENOMEM;
    s->cameras = cfg->cameras;
    s->start_ns = start_ns;
    s->fd = open(path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (s->fd < 0) {
        err = -errno;
        free(s);
        return err;
    }
    s->path = strdup(path);
    s->packet = av_packet_alloc();
    if (!s->path || !s->packet || avformat_alloc_output_context2(&s->format, NULL, "matroska", NULL) < 0)
        goto fail;
    buffer = av_malloc(IO_BYTES);
    s->format->pb = buffer ? avio_alloc_context(buffer, IO_BYTES, 1, s, NULL, write_bytes, seek) : NULL;
    if (!s->format->pb) {
        av_free(buffer);
        goto fail;
    }
    s->format->pb->direct = 1; /* write clusters without another copy */
    err = write_head(s, cfg);
    if (err)
        goto fail;
    *out = s;
    return 0;

fail:
    if (s->path)
        unlink(s->path);
    close_format(s);
    return err;
}

/* --- sets --------------------------------------------------------------------------------------------------------- */

static int add_frame(struct segment_file *s, const struct sst_frameset *set, const struct sst_frame *f)
{
    int64_t from_set = f->t_ns - set->t_ns, ms;

    if (from_set > STAMP_SLACK_NS)
        from_set = STAMP_SLACK_NS;
    if (from_set < -STAMP_SLACK_NS)
        from_set = -STAMP_SLACK_NS;
    ms = set->t_ns + from_set - s->start_ns;
    ms = ms > 0 ? (ms + 500000) / 1000000 : 0;
    if (ms < s->last_ms[f->cam])
        ms = s->last_ms[f->cam];
    s->last_ms[f->cam] = ms;
    s->packet->data = (uint8_t *)f->data;
    s->packet->size = (int)f->bytes;
    s->packet->stream_index = f->cam;
    s->packet->flags = AV_PKT_FLAG_KEY;
    s->packet->pts = s->packet->dts = ms;
    return av_write_frame(s->format, s->packet);
}

/* One element at pos: enter it, note its frame, or skip it. @return offset of the next one, or -errno */
static int64_t read_element(const struct segment_file *s, int64_t pos, const struct sst_frameset *set, int64_t *offset)
{
    uint8_t head[SST_EBML_HEAD_MAX + 8];
    const ssize_t n = pread(s->fd, head, sizeof(head), pos);
    struct ebml e;
    uint64_t track;
    size_t bytes;

    if (n <= 0)
        return n < 0 ? -errno : -EIO;
    if (ebml_head(head, (size_t)n, &e))
        return -EIO;
    if (e.id == SST_EBML_CLUSTER || e.id == SST_EBML_BLOCK_GROUP)
        return pos + (int64_t)e.head;
    if (e.size > (uint64_t)(s->end - pos))
        return -EIO;
    if (e.id == SST_EBML_SIMPLE_BLOCK || e.id == SST_EBML_BLOCK) {
        /* A block: the track's number, two bytes of time, one of flags, the frame. */
        bytes = ebml_number(head + e.head, (size_t)n - e.head, &track) + 3;
        if (bytes == 3 || track < 1 || track > (uint64_t)s->cameras || !set->frame[track - 1] ||
            e.size != bytes + set->frame[track - 1]->bytes)
            return -EIO;
        offset[track - 1] = pos + (int64_t)(e.head + bytes);
    }
    return pos + (int64_t)(e.head + e.size);
}

/* libavformat does not report where it wrote a frame. */
static int find_frames(const struct segment_file *s, int64_t pos, const struct sst_frameset *set, int64_t *offset)
{
    while (pos >= 0 && pos < s->end)
        pos = read_element(s, pos, set, offset);
    for (int k = 0; pos >= 0 && k < s->cameras; k++) {
        if (set->frame[k] && set->frame[k]->bytes && offset[k] < 0)
            pos = -EIO;
    }
    if (pos < 0)
        sst_log_error("%s does not read back as it was written (%s); check the disk", s->path, strerror((int)-pos));
    return pos < 0 ? (int)pos : 0;
}

int segment_add(struct segment_file *s, const struct sst_frameset *set, int64_t offset[SST_CAMERAS_MAX])
{
    const int64_t from = s->end;
    int err = 0;

    for (int k = 0; k < s->cameras; k++)
        offset[k] = -1;
    for (int k = 0; err >= 0 && k < s->cameras; k++) {
        if (set->frame[k] && set->frame[k]->bytes)
            err = add_frame(s, set, set->frame[k]);
    }
    if (err >= 0)
        err = av_write_frame(s->format, NULL); /* ends the cluster */
    avio_flush(s->format->pb);
    if (err < 0 || s->error)
        return failure(s, err);
    return find_frames(s, from, set, offset);
}

int segment_finish(struct segment_file *s, bool sync)
{
    int err = av_write_trailer(s->format);

    avio_flush(s->format->pb);
    if (err < 0 || s->error) {
        err = failure(s, err);
        segment_abandon(s);
        return err;
    }
    err = sync && fdatasync(s->fd) ? -errno : 0;
    close_format(s);
    return err;
}

void segment_abandon(struct segment_file *s)
{
    if (!s)
        return;
    s->error = s->error ? s->error : -ECANCELED; /* discards the data inside libavformat */
    if (!s->kept)
        unlink(s->path);
    else if (ftruncate(s->fd, s->kept))
        sst_log_warning("cannot truncate %s after its last set: %s; readers skip the rest", s->path, strerror(errno));
    close_format(s);
}

#else

#include "base/absent.h"

int segment_possible(void)
{
    sst_log_error("this build has no libavformat, so it cannot record; build it with libavformat");
    return -ENOTSUP;
}

SST_ABSENT(int, -ENOTSUP, segment_open, struct segment_file **out, const char *path,
           const struct sst_recorder_config *cfg, int64_t start_ns)
SST_ABSENT(int, -ENOTSUP, segment_add, struct segment_file *s, const struct sst_frameset *set,
           int64_t offset[SST_CAMERAS_MAX])
SST_ABSENT(int, -ENOTSUP, segment_finish, struct segment_file *s, bool sync)
SST_ABSENT(void, , segment_abandon, struct segment_file *s)

#endif

/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/recording/mkv.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#if WITH_AVFORMAT
#include <libavformat/avformat.h>

#include "base/clock.h"
#include "capture/recording/recording_internal.h"

#define CLUSTER_MS 1000
#define CUE_BYTES  26 /* of an entry of the index at most: files below 1 TB, shorter than 49 days */

static int64_t ms_of(const struct sst_mkv_frame *frame, size_t i)
{
    return (frame[i].t_ns - frame[0].t_ns) / 1000000;
}

/* The last frame is shown as long as the average one, a second at most. */
static int64_t mean_ms(const struct sst_mkv_frame *frame, size_t count)
{
    const int64_t ms = count > 1 ? ms_of(frame, count - 1) / (int64_t)(count - 1) : 1;

    return ms < 1000 ? ms : 1000;
}

static int write_head(AVFormatContext *format, const struct sst_mkv_config *cfg, size_t count)
{
    AVStream *stream = avformat_new_stream(format, NULL);
    AVDictionary *options = NULL;
    char text[SST_CLOCK_TEXT];
    int err = stream ? 0 : AVERROR(ENOMEM);

    if (err)
        return err;
    segment_set_codec(stream->codecpar, cfg->fourcc, cfg->width, cfg->height);
    if (cfg->rate_hz > 0)
        stream->avg_frame_rate = av_d2q(cfg->rate_hz, 60000);
    err = av_dict_set(&stream->metadata, "title", cfg->track, 0);
    if (err >= 0)
        err = av_dict_set(&format->metadata, "title", cfg->title, 0);
    if (err >= 0 && cfg->wall_ns) {
        sst_clock_text(text, cfg->wall_ns);
        err = av_dict_set(&format->metadata, "creation_time", text, 0);
    }
    if (err >= 0)
        err = av_dict_set_int(&options, "reserve_index_space", (int64_t)count * CUE_BYTES + 64, 0);
    if (err >= 0)
        err = segment_write_head(format, &options);
    av_dict_free(&options);
    return err;
}

/* Each frame has an entry in the index. A cluster begins at least with the first frame of each second, so that players
 * can read a second at a time. */
static int write_frames(AVFormatContext *format, AVPacket *packet, const struct sst_mkv_frames *frames)
{
    const struct sst_mkv_frame *frame = frames->frame;
    int64_t cluster_ms = 0;
    int err = 0;

    for (size_t i = 0; !err && i < frames->count; i++) {
        const int64_t ms = ms_of(frame, i);

        if (ms - cluster_ms >= CLUSTER_MS) {
            err = av_write_frame(format, NULL); /* ends the cluster */
            cluster_ms = ms;
        }
        if (err >= 0)
            err = av_new_packet(packet, (int)frame[i].bytes);
        if (err < 0)
            break;
        err = frames->read(frames->arg, i, packet->data);
        packet->flags = AV_PKT_FLAG_KEY;
        packet->pts = packet->dts = ms;
        packet->duration = mean_ms(frame, frames->count);
        err = err ? err : av_write_frame(format, packet);
        av_packet_unref(packet);
        if (format->pb->error < 0)
            err = format->pb->error;
    }
    return err;
}

int sst_mkv_write(int fd, const struct sst_mkv_config *cfg, const struct sst_mkv_frames *frames)
{
    AVFormatContext *format = NULL;
    AVPacket *packet = av_packet_alloc();
    char path[64];
    int err = packet ? avformat_alloc_output_context2(&format, NULL, "matroska", NULL) : AVERROR(ENOMEM);

    snprintf(path, sizeof(path), "file:/proc/self/fd/%d", fd);
    if (err >= 0)
        err = avio_open(&format->pb, path, AVIO_FLAG_WRITE);
    if (err >= 0)
        err = write_head(format, cfg, frames->count);
    if (err >= 0) {
        int last;

        err = write_frames(format, packet, frames);
        last = av_write_trailer(format); /* frees the memory of the head, also after an error */
        err = err < 0 ? err : last;
    }
    if (format && format->pb) {
        const int closed = avio_closep(&format->pb);

        err = err < 0 ? err : closed;
    }
    avformat_free_context(format);
    av_packet_free(&packet);
    /* Codes of libavformat's own are tags below any errno. */
    return err >= 0 ? 0 : err < -4095 ? -EIO : err;
}

#else

int sst_mkv_write(int fd SST_UNUSED, const struct sst_mkv_config *cfg SST_UNUSED,
                  const struct sst_mkv_frames *frames SST_UNUSED)
{
    return -ENOTSUP;
}

#endif

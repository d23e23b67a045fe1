/* Functions of FFmpeg that recording calls. It brings more than a hundred libraries and is loaded by the first call, so
 * that a program that does not record starts five times as fast. Without it nothing can be opened. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/base.h"

#include <dlfcn.h>
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <pthread.h>

#include "base/log.h"

static void *library;

static void load(void)
{
    const char *name = "libavformat.so." AV_STRINGIFY(LIBAVFORMAT_VERSION_MAJOR);

    library = dlopen(name, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        sst_log_error("recordings need FFmpeg: %s; Debian's package sst-video brings it", dlerror());
}

static void *find(const char *name)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;

    pthread_once(&once, load);
    return library ? dlsym(library, name) : NULL; /* also in the libraries that it needs */
}

#define LAZY(type, function, parameters, arguments, without)                                                           \
    type function parameters                                                                                           \
    {                                                                                                                  \
        static void *_Atomic found;                                                                                    \
        void *at = found;                                                                                              \
        __typeof__(&(function)) call;                                                                                  \
                                                                                                                       \
        if (!at)                                                                                                       \
            found = at = find(#function);                                                                              \
        *(void **)&call = at;                                                                                          \
        return call ? call arguments : without;                                                                        \
    }

LAZY(unsigned, avformat_version, (void), (), 0)
LAZY(int, avformat_alloc_output_context2,
     (AVFormatContext * *context, const AVOutputFormat *format, const char *name, const char *file),
     (context, format, name, file), AVERROR(ENOSYS))
LAZY(AVStream *, avformat_new_stream, (AVFormatContext * context, const AVCodec *codec), (context, codec), NULL)
LAZY(int, avformat_init_output, (AVFormatContext * context, AVDictionary **options), (context, options),
     AVERROR(ENOSYS))
LAZY(int, avformat_write_header, (AVFormatContext * context, AVDictionary **options), (context, options),
     AVERROR(ENOSYS))
LAZY(int, av_write_frame, (AVFormatContext * context, AVPacket *packet), (context, packet), AVERROR(ENOSYS))
LAZY(int, av_write_trailer, (AVFormatContext * context), (context), AVERROR(ENOSYS))
LAZY(void, avformat_free_context, (AVFormatContext * context), (context), (void)0)
LAZY(AVIOContext *, avio_alloc_context,
     (unsigned char *buffer, int size, int writes, void *opaque, int (*read_bytes)(void *, uint8_t *, int),
#if LIBAVFORMAT_VERSION_MAJOR >= 61
      int (*write_bytes)(void *, const uint8_t *, int),
#else
      int (*write_bytes)(void *, uint8_t *, int),
#endif
      int64_t (*seek_to)(void *, int64_t, int)),
     (buffer, size, writes, opaque, read_bytes, write_bytes, seek_to), NULL)
LAZY(void, avio_context_free, (AVIOContext * *context), (context), (void)0)
LAZY(void, avio_flush, (AVIOContext * context), (context), (void)0)
LAZY(int, avio_open, (AVIOContext * *context, const char *url, int flags), (context, url, flags), AVERROR(ENOSYS))
LAZY(int, avio_closep, (AVIOContext * *context), (context), 0)
LAZY(AVPacket *, av_packet_alloc, (void), (), NULL)
LAZY(int, av_new_packet, (AVPacket * packet, int size), (packet, size), AVERROR(ENOSYS))
LAZY(void, av_packet_unref, (AVPacket * packet), (packet), (void)0)
LAZY(void, av_packet_free, (AVPacket * *packet), (packet), (void)0)
LAZY(unsigned, avcodec_pix_fmt_to_codec_tag, (enum AVPixelFormat format), (format), 0)
LAZY(int, av_dict_set, (AVDictionary * *options, const char *key, const char *value, int flags),
     (options, key, value, flags), AVERROR(ENOSYS))
LAZY(int, av_dict_set_int, (AVDictionary * *options, const char *key, int64_t value, int flags),
     (options, key, value, flags), AVERROR(ENOSYS))
LAZY(void, av_dict_free, (AVDictionary * *options), (options), (void)0)
LAZY(AVRational, av_d2q, (double value, int max), (value, max), ((AVRational){ 0, 1 }))
LAZY(void *, av_malloc, (size_t size), (size), NULL)
LAZY(void, av_free, (void *block), (block), (void)0)
LAZY(void, av_freep, (void *block), (block), (void)0)
LAZY(int, av_strerror, (int error, char *text, size_t size), (error, text, size), -1)

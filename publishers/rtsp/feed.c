/* Pictures by path, and the pipelines that carry them: one for all clients of a path, made for the first one.
 *
 *   slot -> appsrc -> rtpjpegpay                                  mjpeg: as they are
 *                  -> jpegdec -> convert -> x264enc -> rtph264pay  h264
 *
 * The thread of appsrc gets the newest frame when it needs data, so nothing queues, and the encoder works on the newest
 * frame. A picture that stands still is sent again each second: recorders give up a camera that is silent. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "publishers/rtsp/rtsp_internal.h"

#include <errno.h>
#include <gst/app/gstappsrc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "base/log.h"
#include "pipeline/image/codec_formats.h"

#define REPEAT_NS  1000000000LL /* a still picture is shown again */
#define STILL_NS   300000000LL  /* a picture stands still if no newer one came for this long */
#define EAGER_NS   3000000000LL /* it is repeated more often for this long after a client came: receivers need some */
#define EAGER_STEP 100000000LL  /*     pictures before they show the first */
#define KEY_NS     2000000000LL /* between key frames, for clients that come later */
#define FRESH_NS   1000000000LL /* a picture is worth waiting that long for a newer one */
#define FIRST_NS   3000000000LL /* ... and that long for the first */
#define STEP_NS    1000000LL    /* least between two pictures' times */
#define HD_LINES   720          /* from here on receivers expect the colours of BT.709 */
#define KBIT_LEAST 500
#define KBIT_MOST  8000
#define FEED_KEY   "sst-feed"

/** Factory of a mounted picture: makes its pipeline for the first client. */
struct rtsp_factory {
    GstRTSPMediaFactory parent;
    struct rtsp_server *rtsp;
    enum rtsp_kind kind;
    char name[RTSP_NAME_MAX + 1], path[RTSP_NAME_MAX + 16];
    atomic_uint ended; /* counts pipelines that stop: a client that comes meanwhile gets a new one */
};

struct rtsp_factory_class {
    GstRTSPMediaFactoryClass parent;
};

/** Source of one pipeline; freed with its bin. */
struct feed {
    enum sst_rtsp_codec codec;
    struct rtsp_picture *picture;
    struct rtsp_factory *factory; /* a reference */
    char path[RTSP_NAME_MAX + 16];
    atomic_bool joined, over, refresh;
    /* the source's thread alone */
    uint64_t number; /* of the last picture */
    int64_t pushed_ns, new_ns, key_ns, came_ns;
    GstClockTime pts; /* of the last picture; none before */
    bool logged;      /* that frames do not fit */
};

/* --- feeding --------------------------------------------------------------------------------------------------- */

static void feed_leave(struct feed *f)
{
    if (atomic_exchange(&f->joined, false))
        sst_slot_leave(f->picture->slot);
}

static void feed_free(gpointer arg)
{
    struct feed *f = arg;

    feed_leave(f);
    rtsp_picture_unref(f->picture);
    g_object_unref(f->factory);
    free(f);
}

static void jpeg_free(gpointer arg)
{
    sst_slot_jpeg_unref(arg);
}

/* The pipeline's clock is ours: a picture has the time of its set, so that receivers see when it was taken. Repeated
 * pictures go on from there. */
static GstClockTime time_of(const struct feed *f, GstElement *src, const struct sst_jpeg *jpeg, int64_t now_ns)
{
    GstClock *clock = gst_element_get_clock(src);
    const GstClockTime base = gst_element_get_base_time(src);
    int64_t pts, age = now_ns - jpeg->t_ns;

    if (jpeg->number == f->number)
        return f->pts + (GstClockTime)(now_ns - f->pushed_ns > STEP_NS ? now_ns - f->pushed_ns : STEP_NS);
    pts = clock ? (int64_t)(gst_clock_get_time(clock) - base) : 0;
    if (clock)
        gst_object_unref(clock);
    pts -= age > 0 ? age : 0;
    pts = pts > 0 ? pts : 0;
    if (f->pts != GST_CLOCK_TIME_NONE && pts < (int64_t)f->pts + STEP_NS)
        pts = (int64_t)f->pts + STEP_NS;
    return (GstClockTime)pts;
}

static void ask_for_key(GstElement *src)
{
    GstStructure *what = gst_structure_new("GstForceKeyUnit", "all-headers", G_TYPE_BOOLEAN, TRUE, NULL);

    gst_element_send_event(src, gst_event_new_custom(GST_EVENT_CUSTOM_DOWNSTREAM, what));
}

static void push(struct feed *f, GstAppSrc *src, const struct sst_jpeg *jpeg, int64_t now_ns)
{
    GstBuffer *buffer = gst_buffer_new_wrapped_full(GST_MEMORY_FLAG_READONLY, (gpointer)jpeg->data, jpeg->bytes, 0,
                                                    jpeg->bytes, (gpointer)jpeg, jpeg_free);

    GST_BUFFER_PTS(buffer) = f->pts = time_of(f, GST_ELEMENT(src), jpeg, now_ns);
    if (jpeg->number != f->number)
        f->new_ns = now_ns;
    f->number = jpeg->number;
    f->pushed_ns = now_ns;
    if (f->codec == SST_RTSP_H264 && now_ns - f->key_ns >= KEY_NS) {
        ask_for_key(GST_ELEMENT(src));
        f->key_ns = now_ns;
    }
    gst_app_src_push_buffer(src, buffer); /* fails when the pipeline stops, and that is as well */
}

/* A damaged frame is dropped; a form that never fits is logged. */
static bool fits(struct feed *f, const struct sst_jpeg *jpeg)
{
    char why[96];

    if (f->codec != SST_RTSP_MJPEG || rtsp_jpeg_fits(jpeg->data, jpeg->bytes, why, sizeof(why)))
        return true;
    if (!f->logged)
        sst_log_warning("rtsp: pictures of %s cannot be sent as they are, %s; set rtsp.codec: h264", f->path, why);
    f->logged = true;
    f->number = jpeg->number;
    return false;
}

/* Picture to show now: a newer one, or the same again for a new viewer or as a sign of life. NULL: none. */
static const struct sst_jpeg *next(struct feed *f, int64_t now_ns)
{
    const bool fresh = atomic_exchange(&f->refresh, false);
    const struct sst_jpeg *jpeg = sst_slot_get(f->picture->slot, f->number);
    int64_t repeat_ns;

    if (fresh) {
        f->key_ns = now_ns - KEY_NS;
        f->came_ns = now_ns;
    }
    repeat_ns = now_ns - f->came_ns < EAGER_NS && now_ns - f->new_ns > STILL_NS ? EAGER_STEP : REPEAT_NS;
    if (!jpeg && f->pts != GST_CLOCK_TIME_NONE && (fresh || now_ns - f->pushed_ns >= repeat_ns))
        jpeg = sst_slot_get(f->picture->slot, 0);
    if (jpeg && !fits(f, jpeg)) {
        sst_slot_jpeg_unref(jpeg);
        return NULL;
    }
    return jpeg;
}

static void need_data(GstAppSrc *src, guint length SST_UNUSED, gpointer arg)
{
    struct feed *f = arg;
    const struct sst_jpeg *jpeg;
    int64_t now_ns;

    /* Whoever stops the pipeline waits for this thread; its wish shows in the state that is aimed at. A pause is waited
     * out here: the source does not ask twice for one buffer. */
    for (GstState aim; (aim = GST_STATE_TARGET(src)) >= GST_STATE_PAUSED;) {
        if (sst_slot_is_shut(f->picture->slot)) {
            atomic_store(&f->over, true);
            atomic_fetch_add(&f->factory->ended, 1);
            gst_app_src_end_of_stream(src);
            return;
        }
        now_ns = sst_clock_now_ns();
        if (aim == GST_STATE_PAUSED) { /* the pipeline's time stands still */
            if (f->pts != GST_CLOCK_TIME_NONE)
                f->pushed_ns = now_ns;
            nanosleep(&(struct timespec){ .tv_nsec = RTSP_SLICE_MS * 1000000L }, NULL);
            continue;
        }
        jpeg = next(f, now_ns);
        if (jpeg) {
            push(f, src, jpeg, now_ns);
            return;
        }
        sst_slot_wait(f->picture->slot, f->number, RTSP_SLICE_MS);
    }
}

/* NULL: the media has ended under a client that still commands it. */
static struct feed *feed_of(GstRTSPMedia *media)
{
    GstElement *bin = media ? gst_rtsp_media_get_element(media) : NULL;
    struct feed *f = bin ? g_object_get_data(G_OBJECT(bin), FEED_KEY) : NULL;

    if (bin)
        gst_object_unref(bin); /* the media holds another reference */
    return f;
}

void rtsp_feed_refresh(GstRTSPMedia *media)
{
    struct feed *f = feed_of(media);

    if (f)
        atomic_store(&f->refresh, true);
}

bool rtsp_feed_is_over(GstRTSPMedia *media)
{
    struct feed *f = feed_of(media);

    return !f || atomic_load(&f->over);
}

/* --- pipelines --------------------------------------------------------------------------------------------------- */

/* Quality is constant, so that a scene that stands still costs little; the rate is bounded. Sizes are made even, and
 * colours are the ones that receivers expect of video. */
static GstElement *make_bin(enum sst_rtsp_codec codec, int width, int height)
{
    const double kbit = (double)width * height / 200;
    GError *error = NULL;
    GstElement *bin;
    char text[1024];

    if (codec == SST_RTSP_MJPEG)
        snprintf(text, sizeof(text), "( appsrc name=src ! rtpjpegpay name=pay0 pt=26 )");
    else
        snprintf(text, sizeof(text),
                 "( appsrc name=src ! jpegdec max-errors=-1 ! videoconvertscale ! "
                 "video/x-raw,format=I420,width=%d,height=%d,colorimetry=%s,pixel-aspect-ratio=1/1 ! "
                 "x264enc tune=zerolatency speed-preset=ultrafast pass=qual quantizer=23 bitrate=%d threads=1 "
                 "key-int-max=600 ! video/x-h264,profile=baseline ! "
                 "rtph264pay name=pay0 pt=96 config-interval=-1 aggregate-mode=zero-latency )",
                 width & ~1, height & ~1, height < HD_LINES ? "bt601" : "bt709",
                 (int)(kbit < KBIT_LEAST  ? KBIT_LEAST
                       : kbit > KBIT_MOST ? KBIT_MOST
                                          : kbit));
    bin = gst_parse_launch(text, &error);
    if (error) {
        sst_log_error("rtsp: GStreamer cannot make a pipeline: %s", error->message);
        g_error_free(error);
        if (bin)
            gst_object_unref(bin);
        bin = NULL;
    }
    return bin;
}

static void attach(struct feed *f, GstElement *bin, int width, int height)
{
    GstElement *src = gst_bin_get_by_name(GST_BIN(bin), "src");
    GstAppSrcCallbacks callbacks = { .need_data = need_data };
    GstCaps *caps = gst_caps_new_simple("image/jpeg", "parsed", G_TYPE_BOOLEAN, TRUE, "width", G_TYPE_INT, width,
                                        "height", G_TYPE_INT, height, "framerate", GST_TYPE_FRACTION, 0, 1, NULL);

    g_object_set(src, "is-live", TRUE, "format", GST_FORMAT_TIME, "do-timestamp", FALSE, NULL);
    gst_app_src_set_caps(GST_APP_SRC(src), caps);
    gst_app_src_set_callbacks(GST_APP_SRC(src), &callbacks, f, NULL);
    g_object_set_data_full(G_OBJECT(bin), FEED_KEY, f, feed_free);
    gst_caps_unref(caps);
    gst_object_unref(src);
}

static struct feed *feed_create(struct rtsp_factory *at)
{
    struct feed *f = calloc(1, sizeof(*f));

    if (!f)
        return NULL;
    f->picture = rtsp_picture_get(at->kind, at->name);
    if (!f->picture) {
        free(f);
        return NULL;
    }
    f->factory = g_object_ref(at);
    f->codec = at->rtsp->codec;
    f->pts = GST_CLOCK_TIME_NONE;
    snprintf(f->path, sizeof(f->path), "%s", at->path);
    sst_slot_join(f->picture->slot);
    atomic_store(&f->joined, true);
    return f;
}

/* Wait for a frame of now; an old one is enough if no newer one comes soon. */
static bool wait_for_frame(struct sst_slot *slot)
{
    const int64_t start_ns = sst_clock_now_ns();
    uint64_t number;
    int64_t now_ns;
    bool fresh, any;

    do {
        const struct sst_jpeg *jpeg = sst_slot_get(slot, 0);

        now_ns = sst_clock_now_ns();
        any = jpeg;
        number = any ? jpeg->number : 0;
        fresh = any && now_ns - jpeg->t_ns < FRESH_NS;
        if (any)
            sst_slot_jpeg_unref(jpeg);
        if (!fresh)
            sst_slot_wait(slot, number, RTSP_SLICE_MS);
    } while (!fresh && !sst_slot_is_shut(slot) && now_ns - start_ns < (any ? FRESH_NS : FIRST_NS));
    return any;
}

static GstElement *create_element(GstRTSPMediaFactory *factory, const GstRTSPUrl *url SST_UNUSED)
{
    struct rtsp_factory *at = (struct rtsp_factory *)factory;
    struct feed *f = feed_create(at);
    const struct sst_jpeg *jpeg = f && wait_for_frame(f->picture->slot) ? sst_slot_get(f->picture->slot, 0) : NULL;
    GstElement *bin = NULL;
    int width, height;

    if (jpeg && !sst_jpeg_size(&width, &height, jpeg->data, jpeg->bytes, at->path))
        bin = make_bin(at->rtsp->codec, width, height);
    sst_slot_jpeg_unref(jpeg);
    if (bin)
        attach(f, bin, width, height);
    else if (f)
        feed_free(f);
    return bin;
}

static void unprepared(GstRTSPMedia *media, gpointer arg SST_UNUSED)
{
    struct feed *f = feed_of(media);

    if (f)
        feed_leave(f);
}

static void aims_at(GstRTSPMedia *media SST_UNUSED, gint state, gpointer factory)
{
    if (state == GST_STATE_NULL)
        atomic_fetch_add(&((struct rtsp_factory *)factory)->ended, 1);
}

static void unref_factory(gpointer factory, GClosure *closure SST_UNUSED)
{
    g_object_unref(factory);
}

static void configure(GstRTSPMediaFactory *factory, GstRTSPMedia *media)
{
    GST_RTSP_MEDIA_FACTORY_CLASS(g_type_class_peek(GST_TYPE_RTSP_MEDIA_FACTORY))->configure(factory, media);
    g_signal_connect(media, "unprepared", G_CALLBACK(unprepared), NULL);
    g_signal_connect_data(media, "target-state", G_CALLBACK(aims_at), g_object_ref(factory), unref_factory,
                          (GConnectFlags)0);
}

/* Whatever a client adds to the path, it shares the pipeline. */
static gchar *gen_key(GstRTSPMediaFactory *factory, const GstRTSPUrl *url SST_UNUSED)
{
    struct rtsp_factory *at = (struct rtsp_factory *)factory;

    return g_strdup_printf("%s %u", at->path, atomic_load(&at->ended));
}

static void class_init(gpointer class, gpointer data SST_UNUSED)
{
    GstRTSPMediaFactoryClass *c = class;

    c->create_element = create_element;
    c->configure = configure;
    c->gen_key = gen_key;
}

static GType factory_type(void)
{
    static gsize type;

    if (g_once_init_enter(&type))
        g_once_init_leave(&type, g_type_register_static_simple(GST_TYPE_RTSP_MEDIA_FACTORY, "SstRtspFactory",
                                                               sizeof(struct rtsp_factory_class), class_init,
                                                               sizeof(struct rtsp_factory), NULL, (GTypeFlags)0));
    return type;
}

/* --- paths ----------------------------------------------------------------------------------------------------- */

static bool parse_path(const char *path, enum rtsp_kind *kind, char name[RTSP_NAME_MAX + 1])
{
    static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
    const char *from;

    *kind = RTSP_VIEW;
    if (!strcmp(path, "/main"))
        from = "main";
    else if (!strncmp(path, "/view/", 6))
        from = path + 6;
    else if (!strncmp(path, "/camera/", 8)) {
        from = path + 8;
        *kind = RTSP_CAMERA;
    } else {
        return false;
    }
    if (!from[0] || strlen(from) > RTSP_NAME_MAX || from[strspn(from, letters)])
        return false;
    strcpy(name, from);
    return true;
}

/* Views come and go, each with its own name: paths that have no source are unmounted; DESCRIBE mounts them again. */
static void unmount_unused_locked(struct rtsp_server *rtsp)
{
    for (guint i = rtsp->factories->len; i-- > 0;) {
        const struct rtsp_factory *at = rtsp->factories->pdata[i];

        if (rtsp_picture_is_open(at->kind, at->name))
            continue;
        gst_rtsp_mount_points_remove_factory(rtsp->mounts, at->path);
        g_ptr_array_remove_index_fast(rtsp->factories, i);
    }
}

static void mount_path(struct rtsp_server *rtsp, const char *path, enum rtsp_kind kind, const char *name)
{
    struct rtsp_factory *at;
    bool known = false;

    pthread_mutex_lock(&rtsp->lock);
    for (guint i = 0; i < rtsp->factories->len && !known; i++)
        known = !strcmp(((struct rtsp_factory *)rtsp->factories->pdata[i])->path, path);
    if (!known) {
        unmount_unused_locked(rtsp);
        at = g_object_new(factory_type(), NULL);
        at->rtsp = rtsp;
        at->kind = kind;
        snprintf(at->name, sizeof(at->name), "%s", name);
        snprintf(at->path, sizeof(at->path), "%s", path);
        gst_rtsp_media_factory_set_shared(&at->parent, TRUE);
        gst_rtsp_media_factory_set_protocols(&at->parent, GST_RTSP_LOWER_TRANS_UDP | GST_RTSP_LOWER_TRANS_TCP);
        g_ptr_array_add(rtsp->factories, at);
        gst_rtsp_mount_points_add_factory(rtsp->mounts, path, &at->parent);
    }
    pthread_mutex_unlock(&rtsp->lock);
}

GstRTSPStatusCode rtsp_mount(struct rtsp_server *rtsp, const char *path)
{
    GstRTSPStatusCode status = GST_RTSP_STS_SERVICE_UNAVAILABLE;
    struct rtsp_picture *picture;
    char name[RTSP_NAME_MAX + 1];
    enum rtsp_kind kind;

    if (!parse_path(path, &kind, name))
        return GST_RTSP_STS_NOT_FOUND;
    picture = rtsp_picture_get(kind, name);
    if (!picture)
        return status;
    sst_slot_join(picture->slot);
    if (wait_for_frame(picture->slot)) {
        mount_path(rtsp, path, kind, name);
        status = GST_RTSP_STS_OK;
    } else if (atomic_load(&picture->err) == -ENOENT) {
        status = GST_RTSP_STS_NOT_FOUND;
    }
    sst_slot_leave(picture->slot);
    rtsp_picture_unref(picture);
    return status;
}

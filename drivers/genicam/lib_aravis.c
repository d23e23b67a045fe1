/* Cameras by Aravis 0.8, the part libsst-aravis.so. Features are named by the SFNC; where GigE Vision 1 had other names,
 * both are tried. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arv.h>
#include <errno.h>
#include <linux/videodev2.h>
#include <math.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "drivers/genicam/genicam_internal.h"

#define SCAN_NS      INT64_C(900000000) /* a list of devices is used that long */
#define ROOM_ALIGN   64
#define PRIORITY     40 /* below the trigger's */
#define TOLERANCE    0.02 /* of values read back: cameras round them to their steps */

struct genicam_lib {
    /* fixed after open */
    ArvCamera *camera;
    ArvStream *stream; /* NULL: not started */
    const struct genicam_pixels *pixels;
    struct sst_genicam_config cfg; /* bindings are the caller's */
    bool network;                  /* GigE Vision */
    const char *ptp_role, *ptp_offset, *ptp_latch, *clock_latch, *clock_value; /* features; NULL: it has none */
    double tick_ns;                                                           /* of clock_value */
    int cam, slots;
    struct genicam_slot *slot;
    struct genicam_lib_events events;
    /* under lock */
    pthread_mutex_t lock;
    int lent;
    bool closed;
};

/* --- helpers ------------------------------------------------------------------------------------------------------ */

static int64_t now_ns(clockid_t clock)
{
    struct timespec t;

    clock_gettime(clock, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void add(char *text, const char *fmt, ...) SST_PRINTF(2, 3);
static void add(char *text, const char *fmt, ...)
{
    const size_t n = strlen(text);
    va_list args;

    va_start(args, fmt);
    vsnprintf(text + n, GENICAM_WHY_MAX - n, fmt, args);
    va_end(args);
}

/* Text of a device, or of a stranger on its network: valid UTF-8 without control characters, which terminals obey. */
static void copy(char *out, size_t size, const char *text)
{
    const char *bad;

    snprintf(out, size, "%s", text ? text : "");
    while (!g_utf8_validate(out, -1, &bad))
        out[bad - out] = '?';
    for (char *p = out, *next; *p; p = next) {
        next = g_utf8_next_char(p);
        if (g_unichar_iscntrl(g_utf8_get_char(p)))
            memset(p, '?', (size_t)(next - p));
    }
}

/* Cameras with a name that copy() changed are found by address. */
static ArvCamera *open_device(const struct sst_genicam_device *d, GError **error)
{
    return arv_camera_new(strchr(d->id, '?') && *d->address ? d->address : d->id, error);
}

/* Forget an error. @return there was one */
static bool failed(GError **error)
{
    const bool any = *error != NULL;

    g_clear_error(error);
    return any;
}

static bool has(ArvCamera *camera, const char *feature)
{
    return arv_camera_is_feature_available(camera, feature, NULL);
}

/* The first of two names that it has; NULL: neither. */
static const char *either(ArvCamera *camera, const char *name, const char *other)
{
    return has(camera, name) ? name : has(camera, other) ? other : NULL;
}

/* Error of the library as errno; silence and a cut cable are one. */
static int code_of(const GError *error)
{
    if (error->domain == ARV_DEVICE_ERROR && error->code == ARV_DEVICE_ERROR_NOT_FOUND)
        return -ENODEV;
    if (error->domain == ARV_DEVICE_ERROR &&
        (error->code == ARV_DEVICE_ERROR_TIMEOUT || error->code == ARV_DEVICE_ERROR_NOT_CONNECTED ||
         error->code == ARV_DEVICE_ERROR_TRANSFER_ERROR))
        return -EIO;
    return -EINVAL;
}

/* --- discovery ---------------------------------------------------------------------------------------------------- */

static pthread_mutex_t scan_lock = PTHREAD_MUTEX_INITIALIZER;
static int64_t scanned_ns; /* under scan_lock */

static void scan_locked(void)
{
    if (scanned_ns && now_ns(CLOCK_MONOTONIC) - scanned_ns < SCAN_NS)
        return;
    arv_update_device_list();
    scanned_ns = now_ns(CLOCK_MONOTONIC);
}

static void describe_locked(struct sst_genicam_device *d, unsigned i)
{
    copy(d->id, sizeof(d->id), arv_get_device_id(i));
    copy(d->vendor, sizeof(d->vendor), arv_get_device_vendor(i));
    copy(d->model, sizeof(d->model), arv_get_device_model(i));
    copy(d->serial, sizeof(d->serial), arv_get_device_serial_nbr(i));
    copy(d->address, sizeof(d->address), arv_get_device_address(i));
    copy(d->protocol, sizeof(d->protocol), arv_get_device_protocol(i));
}

int genicam_lib_list(struct sst_genicam_device **devices, int *count)
{
    struct sst_genicam_device *list;
    unsigned n;

    pthread_mutex_lock(&scan_lock);
    scan_locked();
    n = arv_get_n_devices();
    list = calloc(n ? n : 1, sizeof(*list));
    for (unsigned i = 0; list && i < n; i++)
        describe_locked(&list[i], i);
    pthread_mutex_unlock(&scan_lock);
    if (!list)
        return -ENOMEM;
    *devices = list;
    *count = (int)n;
    return 0;
}

static bool matches(const struct sst_genicam_binding *b, const struct sst_genicam_device *d)
{
    if (*b->address && strcmp(b->address, d->address) != 0)
        return false;
    return !*b->id || !strcmp(b->id, d->serial) || !strcmp(b->id, d->id);
}

/* @return 0, -ENODEV, or -ENOTUNIQ: why is set */
static int find(struct sst_genicam_device *out, const struct sst_genicam_binding *b, char *why)
{
    int found = 0;

    pthread_mutex_lock(&scan_lock);
    scan_locked();
    for (unsigned i = 0; i < arv_get_n_devices(); i++) {
        struct sst_genicam_device d = { 0 };

        describe_locked(&d, i);
        if (!matches(b, &d))
            continue;
        if (found++)
            add(why, "%s and %s both have it: bind by Vendor-Model-Serial, or by port: its address", out->id, d.id);
        else
            *out = d;
    }
    pthread_mutex_unlock(&scan_lock);
    if (found)
        return found == 1 ? 0 : -ENOTUNIQ;
    if (!*b->address)
        return -ENODEV;
    /* Broadcasts do not reach cameras behind a router. */
    *out = (struct sst_genicam_device){ .protocol = "GigEVision" };
    copy(out->id, sizeof(out->id), b->address);
    copy(out->address, sizeof(out->address), b->address);
    copy(out->serial, sizeof(out->serial), b->id);
    return 0;
}

/* --- settings ----------------------------------------------------------------------------------------------------- */

static int set_pixels(struct genicam_lib *lib, char *why)
{
    const char **have = NULL;
    GError *error = NULL;
    unsigned n = 0;
    int at = 0;

    if (*lib->cfg.pixel_format) {
        lib->pixels = genicam_pixels_named(lib->cfg.pixel_format);
        arv_camera_set_pixel_format_from_string(lib->camera, lib->pixels->name, &error);
        if (!failed(&error))
            return 0;
        lib->pixels = NULL;
    }
    while (!*lib->cfg.pixel_format && (lib->pixels = genicam_pixels_next(lib->cfg.fourcc, &at))) {
        if (!arv_camera_is_enumeration_entry_available(lib->camera, "PixelFormat", lib->pixels->name, NULL))
            continue;
        arv_camera_set_pixel_format_from_string(lib->camera, lib->pixels->name, &error);
        if (!failed(&error))
            return 0;
    }
    have = arv_camera_dup_available_pixel_formats_as_strings(lib->camera, &n, NULL);
    add(why, "it has no pixel format for cameras: format%s%s; it has", *lib->cfg.pixel_format ? " and genicam: " : "",
        lib->cfg.pixel_format);
    for (unsigned i = 0; i < n; i++)
        add(why, "%s %s", i ? "," : "", have[i]);
    g_free(have);
    return -EINVAL;
}

/* The middle of the sensor. */
static void centre(ArvCamera *camera)
{
    gint x_max = 0, y_max = 0, least;
    gint x_step, y_step;

    arv_camera_get_x_offset_bounds(camera, &least, &x_max, NULL);
    arv_camera_get_y_offset_bounds(camera, &least, &y_max, NULL);
    x_step = sst_max_int(arv_camera_get_x_offset_increment(camera, NULL), 1);
    y_step = sst_max_int(arv_camera_get_y_offset_increment(camera, NULL), 1);
    if (x_max > 0 && x_max < 65536)
        arv_camera_set_integer(camera, "OffsetX", x_max / 2 / x_step * x_step, NULL);
    if (y_max > 0 && y_max < 65536)
        arv_camera_set_integer(camera, "OffsetY", y_max / 2 / y_step * y_step, NULL);
}

static int set_region(struct genicam_lib *lib, char *why)
{
    const bool offsets = arv_camera_is_region_offset_available(lib->camera, NULL);
    gint x = 0, y = 0, width = 0, height = 0, low, high_x = 0, high_y = 0;
    GError *error = NULL;

    if (offsets)
        arv_camera_set_region(lib->camera, 0, 0, lib->cfg.width, lib->cfg.height, &error);
    else
        arv_camera_set_region(lib->camera, -1, -1, lib->cfg.width, lib->cfg.height, &error);
    g_clear_error(&error);
    if (offsets)
        centre(lib->camera);
    arv_camera_get_region(lib->camera, &x, &y, &width, &height, &error);
    if (error) {
        const int err = code_of(error);

        add(why, "its region cannot be read: %s", error->message);
        g_clear_error(&error);
        return err;
    }
    if (width == lib->cfg.width && height == lib->cfg.height)
        return 0;
    arv_camera_get_width_bounds(lib->camera, &low, &high_x, NULL);
    arv_camera_get_height_bounds(lib->camera, &low, &high_y, NULL);
    add(why, "its pictures are %dx%d, not %dx%d: set cameras: width and height to a size that it has, up to %dx%d", width,
        height, lib->cfg.width, lib->cfg.height, high_x, high_y);
    return -EINVAL;
}

static void compare(char *note, const char *name, double wanted, double got)
{
    if (fabs(got - wanted) > TOLERANCE * fmax(fabs(wanted), 1e-9))
        add(note, "%s%s is %.6g, not %.6g", *note ? ", " : "", name, got, wanted);
}

static void set_exposure(struct genicam_lib *lib, char *note)
{
    GError *error = NULL;

    if (lib->cfg.exposure_us > 0) {
        if (arv_camera_is_exposure_auto_available(lib->camera, NULL))
            arv_camera_set_exposure_time_auto(lib->camera, ARV_AUTO_OFF, NULL);
        arv_camera_set_exposure_time(lib->camera, lib->cfg.exposure_us, &error);
        g_clear_error(&error);
        compare(note, "exposure (us)", lib->cfg.exposure_us, arv_camera_get_exposure_time(lib->camera, &error));
        g_clear_error(&error);
    }
    if (isnan(lib->cfg.gain))
        return;
    if (!arv_camera_is_gain_available(lib->camera, NULL)) {
        add(note, "%sit has no gain", *note ? ", " : "");
        return;
    }
    if (arv_camera_is_gain_auto_available(lib->camera, NULL))
        arv_camera_set_gain_auto(lib->camera, ARV_AUTO_OFF, NULL);
    arv_camera_set_gain(lib->camera, lib->cfg.gain, &error);
    g_clear_error(&error);
    compare(note, "gain", lib->cfg.gain, arv_camera_get_gain(lib->camera, &error));
    g_clear_error(&error);
}

static void set_rate(struct genicam_lib *lib, char *note)
{
    GError *error = NULL;

    if (!arv_camera_is_frame_rate_available(lib->camera, NULL)) {
        add(note, "%sit has no frame rate to set", *note ? ", " : "");
        return;
    }
    arv_camera_set_frame_rate(lib->camera, lib->cfg.rate_hz, &error);
    g_clear_error(&error);
    compare(note, "rate (Hz)", lib->cfg.rate_hz, arv_camera_get_frame_rate(lib->camera, &error));
    g_clear_error(&error);
}

/* Keys of an action, for the selector that ends the name of its trigger source. */
static void set_action(struct genicam_lib *lib, const char *source)
{
    if (has(lib->camera, "ActionSelector"))
        arv_camera_set_integer(lib->camera, "ActionSelector", atoi(source + strlen("Action")), NULL);
    arv_camera_set_integer(lib->camera, "ActionDeviceKey", lib->cfg.action.device_key, NULL);
    arv_camera_set_integer(lib->camera, "ActionGroupKey", lib->cfg.action.group_key, NULL);
    arv_camera_set_integer(lib->camera, "ActionGroupMask", lib->cfg.action.group_mask, NULL);
}

static const char *source_of(struct genicam_lib *lib)
{
    static const char *const actions[] = { "Action0", "Action1" };

    if (lib->cfg.trigger == SST_GENICAM_SOFTWARE)
        return "Software";
    if (lib->cfg.trigger == SST_GENICAM_WIRE)
        return lib->cfg.line;
    for (size_t i = 0; i < ARRAY_LEN(actions); i++)
        if (arv_camera_is_enumeration_entry_available(lib->camera, "TriggerSource", actions[i], NULL))
            return actions[i];
    return "Action0";
}

static int refuse_trigger(struct genicam_lib *lib, const char *source, char *why)
{
    unsigned n = 0;
    const char **have = arv_camera_dup_available_trigger_sources(lib->camera, &n, NULL);

    add(why, "its trigger cannot be set to %s: set genicam: trigger and line to one of", source);
    for (unsigned i = 0; i < n; i++)
        add(why, "%s %s", i ? "," : "", have[i]);
    g_free(have);
    return -EINVAL;
}

static int set_trigger(struct genicam_lib *lib, char *why, char *note)
{
    GError *error = NULL;
    const char *source, *got, *mode;

    arv_camera_clear_triggers(lib->camera, NULL);
    if (lib->cfg.trigger == SST_GENICAM_FREE) {
        set_rate(lib, note);
        return 0;
    }
    source = source_of(lib);
    arv_camera_set_trigger(lib->camera, source, &error);
    if (failed(&error))
        return refuse_trigger(lib, source, why);
    if (lib->cfg.trigger == SST_GENICAM_ACTION)
        set_action(lib, source);
    got = arv_camera_get_trigger_source(lib->camera, &error);
    mode = failed(&error) ? NULL : arv_camera_get_string(lib->camera, "TriggerMode", &error);
    if (failed(&error) || !got || !mode || strcmp(got, source) != 0 || strcmp(mode, "On") != 0)
        return refuse_trigger(lib, source, why);
    return 0;
}

static void set_network(struct genicam_lib *lib, char *note)
{
    GError *error = NULL;

    /* The packet socket, which root would get, sees packets of other cameras until its filter is set, and takes their
     * frames for this camera's (findings/aravis-packet-socket-foreign-frames.sh). */
    arv_camera_gv_set_stream_options(lib->camera, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    arv_camera_gv_set_packet_size_adjustment(lib->camera, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
    if (lib->cfg.packet_bytes) {
        arv_camera_gv_set_packet_size(lib->camera, lib->cfg.packet_bytes, &error);
        g_clear_error(&error);
        compare(note, "packet size", lib->cfg.packet_bytes, arv_camera_gv_get_packet_size(lib->camera, NULL));
    } else {
        arv_camera_gv_auto_packet_size(lib->camera, &error);
        g_clear_error(&error);
    }
    if (!lib->cfg.packet_delay_ns)
        return;
    arv_camera_gv_set_packet_delay(lib->camera, lib->cfg.packet_delay_ns, &error);
    g_clear_error(&error);
    compare(note, "packet delay (ns)", lib->cfg.packet_delay_ns,
            (double)arv_camera_gv_get_packet_delay(lib->camera, NULL));
}

/* Features of clocks; PTP is switched only if it is wanted, and else stays as the camera is set. Without a note nothing is
 * set. */
static void set_clock(struct genicam_lib *lib, char *note)
{
    ArvCamera *camera = lib->camera;
    const char *enable = either(camera, "PtpEnable", "GevIEEE1588");
    gint64 ticks = 0;

    if (lib->cfg.ptp && !enable && note)
        add(note, "%sit has no PTP", *note ? ", " : "");
    if (lib->cfg.ptp && enable && note) {
        arv_camera_set_boolean(camera, enable, TRUE, NULL);
        if (!arv_camera_get_boolean(camera, enable, NULL))
            add(note, "%s%s stays off", *note ? ", " : "", enable);
    }
    lib->ptp_role = either(camera, "PtpStatus", "GevIEEE1588Status");
    lib->ptp_offset = either(camera, "PtpOffsetFromMaster", "GevIEEE1588OffsetFromMaster");
    lib->ptp_latch = either(camera, "PtpDataSetLatch", "GevIEEE1588DataSetLatch");
    lib->clock_latch = either(camera, "TimestampLatch", "GevTimestampControlLatch");
    lib->clock_value = either(camera, "TimestampLatchValue", "GevTimestampValue");
    lib->tick_ns = 1;
    if (lib->clock_value && !strcmp(lib->clock_value, "GevTimestampValue")) {
        ticks = arv_camera_get_integer(camera, "GevTimestampTickFrequency", NULL);
        lib->tick_ns = ticks > 0 ? 1e9 / (double)ticks : 0;
    }
    if (!lib->clock_latch || !(lib->tick_ns > 0))
        lib->clock_value = NULL;
}

static int apply(struct genicam_lib *lib, char *why, char *note)
{
    GError *error = NULL;
    int err;

    arv_camera_stop_acquisition(lib->camera, NULL); /* of a program that died */
    arv_camera_set_acquisition_mode(lib->camera, ARV_ACQUISITION_MODE_CONTINUOUS, &error);
    if (error) {
        err = code_of(error);
        add(why, "it refuses settings: %s", error->message);
        g_clear_error(&error);
        return err;
    }
    err = set_pixels(lib, why);
    err = err ? err : set_region(lib, why);
    err = err ? err : set_trigger(lib, why, note);
    if (err)
        return err;
    set_exposure(lib, note);
    if (lib->network)
        set_network(lib, note);
    set_clock(lib, note);
    return 0;
}

/* --- open --------------------------------------------------------------------------------------------------------- */

static void on_control_lost(ArvDevice *device SST_UNUSED, void *arg)
{
    const struct genicam_lib *lib = arg;

    lib->events.lost(lib->events.arg);
}

static int create_slots(struct genicam_lib *lib)
{
    const size_t bytes = genicam_frame_bytes(lib->pixels, lib->cfg.width, lib->cfg.height);
    const size_t room = (bytes > genicam_bytes(lib->pixels, lib->cfg.width, lib->cfg.height)
                             ? bytes
                             : genicam_bytes(lib->pixels, lib->cfg.width, lib->cfg.height)) + ROOM_ALIGN;

    lib->slots = sst_clamp_int(lib->cfg.buffers, 2, 32);
    lib->slot = calloc((size_t)lib->slots, sizeof(*lib->slot));
    for (int i = 0; lib->slot && i < lib->slots; i++) {
        struct genicam_slot *s = &lib->slot[i];
        void *data = NULL;

        s->lib = lib;
        if (posix_memalign(&data, ROOM_ALIGN, (room + ROOM_ALIGN - 1) / ROOM_ALIGN * ROOM_ALIGN))
            return -ENOMEM;
        s->frame = (struct sst_frame){
            .cam = lib->cam,
            .fourcc = lib->cfg.fourcc,
            .width = lib->cfg.width,
            .height = lib->cfg.height,
            .stride = bytes / (size_t)lib->cfg.height,
            .data = data,
            .pool = s,
        };
        /* Its size is the payload, without the room to unpack: Aravis counts the packets of a frame by it. */
        s->buffer = arv_buffer_new_full(genicam_bytes(lib->pixels, lib->cfg.width, lib->cfg.height), data, s, NULL);
    }
    return lib->slot ? 0 : -ENOMEM;
}

static void destroy(struct genicam_lib *lib)
{
    for (int i = 0; lib->slot && i < lib->slots; i++)
        free((void *)lib->slot[i].frame.data);
    pthread_mutex_destroy(&lib->lock);
    free(lib->slot);
    free(lib);
}

static bool under_control(struct genicam_lib *lib)
{
    ArvDevice *device = arv_camera_get_device(lib->camera);

    return !lib->network || arv_gv_device_is_controller(ARV_GV_DEVICE(device));
}

int genicam_lib_open(struct genicam_lib **out, const struct genicam_lib_query *query,
                     struct sst_genicam_device *device, char *why, char *note)
{
    struct genicam_lib *lib = NULL;
    GError *error = NULL;
    int err = find(device, query->binding, why);

    if (err)
        return err;
    lib = calloc(1, sizeof(*lib));
    if (!lib)
        return -ENOMEM;
    pthread_mutex_init(&lib->lock, NULL);
    lib->cfg = *query->cfg;
    lib->cam = query->cam;
    lib->camera = open_device(device, &error);
    if (error || !lib->camera) {
        err = error ? code_of(error) : -ENODEV;
        g_clear_error(&error);
        goto fail;
    }
    lib->network = arv_camera_is_gv_device(lib->camera);
    if (!under_control(lib)) {
        err = -EBUSY;
        add(why, "another program controls it; stop that, or wait some seconds if it died");
        goto fail;
    }
    err = apply(lib, why, note);
    if (err)
        goto fail;
    *out = lib;
    return 0;

fail:
    genicam_lib_close(lib, false);
    return err;
}

/* --- stream ------------------------------------------------------------------------------------------------------- */

static void fill(struct genicam_lib *lib, struct genicam_slot *slot, ArvBuffer *buffer)
{
    const ArvBufferStatus status = arv_buffer_get_status(buffer);
    const int64_t system_ns = (int64_t)arv_buffer_get_system_timestamp(buffer);
    const bool image = status == ARV_BUFFER_STATUS_SUCCESS &&
                       arv_buffer_get_payload_type(buffer) == ARV_BUFFER_PAYLOAD_TYPE_IMAGE;
    size_t bytes = 0;

    if (image)
        (void)arv_buffer_get_image_data(buffer, &bytes);
    slot->cancelled = status == ARV_BUFFER_STATUS_ABORTED || status == ARV_BUFFER_STATUS_CLEARED;
    slot->whole = image && bytes >= genicam_bytes(lib->pixels, lib->cfg.width, lib->cfg.height) &&
                  arv_buffer_get_image_pixel_format(buffer) == lib->pixels->code;
    slot->id = arv_buffer_get_frame_id(buffer);
    if (!lib->network) /* USB3 Vision counts from 0, and its frames always have their number */
        slot->id++;
    slot->stamp_ns = (int64_t)arv_buffer_get_timestamp(buffer);
    slot->seen_ns = system_ns ? system_ns - now_ns(CLOCK_REALTIME) + now_ns(CLOCK_MONOTONIC) : 0;
    slot->frame.bytes = slot->whole ? genicam_frame_bytes(lib->pixels, lib->cfg.width, lib->cfg.height) : 0;
    if (slot->whole)
        genicam_unpack((uint8_t *)slot->frame.data, (size_t)lib->cfg.width * (size_t)lib->cfg.height, lib->pixels);
}

/* On the thread that receives packets: the socket's buffer holds the next ones meanwhile. */
static void on_buffer(void *arg, ArvStreamCallbackType type, ArvBuffer *done SST_UNUSED)
{
    struct genicam_lib *lib = arg;
    ArvBuffer *buffer;

    /* A packet that waits is stamped late; without the right to it, on a busy machine some are. */
    if (type == ARV_STREAM_CALLBACK_TYPE_INIT)
        (void)pthread_setschedparam(pthread_self(), SCHED_FIFO, &(struct sched_param){ .sched_priority = PRIORITY });
    if (type != ARV_STREAM_CALLBACK_TYPE_BUFFER_DONE)
        return;
    while (lib->stream && (buffer = arv_stream_try_pop_buffer(lib->stream))) {
        struct genicam_slot *slot = (struct genicam_slot *)arv_buffer_get_user_data(buffer);

        pthread_mutex_lock(&lib->lock);
        lib->lent++;
        pthread_mutex_unlock(&lib->lock);
        fill(lib, slot, buffer);
        lib->events.image(lib->events.arg, slot);
    }
}

/* Number and stamps of an image come with its first packet; without that packet, they must not be the last image's. */
static void give(struct genicam_lib *lib, struct genicam_slot *slot)
{
    arv_buffer_set_frame_id(slot->buffer, 0);
    arv_buffer_set_timestamp(slot->buffer, 0);
    arv_buffer_set_system_timestamp(slot->buffer, 0);
    arv_stream_push_buffer(lib->stream, slot->buffer);
}

static void set_stream(struct genicam_lib *lib)
{
    const double period_us = lib->cfg.rate_hz > 0 ? 1e6 / lib->cfg.rate_hz : 2e5;

    if (!ARV_IS_GV_STREAM(lib->stream))
        return;
    /* A frame that is incomplete holds up its successors that long. */
    g_object_set(lib->stream, "packet-resend",
                 lib->cfg.resend ? ARV_GV_STREAM_PACKET_RESEND_ALWAYS : ARV_GV_STREAM_PACKET_RESEND_NEVER,
                 "frame-retention", (guint)sst_clamp_double(period_us, 20000, 200000), "packet-timeout", 20000u, NULL);
}

int genicam_lib_start(struct genicam_lib *lib, const struct genicam_lib_events *events, char *why)
{
    GError *error = NULL;
    int err = create_slots(lib);

    if (err)
        return err;
    lib->events = *events;
    g_signal_connect(arv_camera_get_device(lib->camera), "control-lost", G_CALLBACK(on_control_lost), lib);
    lib->stream = arv_camera_create_stream(lib->camera, on_buffer, lib, &error);
    if (lib->stream) {
        set_stream(lib);
        for (int i = 0; i < lib->slots; i++)
            give(lib, &lib->slot[i]);
        arv_camera_start_acquisition(lib->camera, &error);
    }
    if (!error && lib->stream)
        return 0;
    add(why, "it cannot be started: %s", error ? error->message : "no stream");
    err = error ? code_of(error) : -EIO;
    g_clear_error(&error);
    return err;
}

int genicam_lib_trigger(struct genicam_lib *lib)
{
    GError *error = NULL;

    arv_camera_software_trigger(lib->camera, &error);
    return failed(&error) ? -EIO : 0;
}

static void read_ptp(struct genicam_lib *lib, struct sst_genicam_ptp *out)
{
    GError *error = NULL;
    const char *role;

    if (!lib->ptp_role)
        return;
    if (lib->ptp_latch)
        arv_camera_execute_command(lib->camera, lib->ptp_latch, NULL);
    role = arv_camera_get_string(lib->camera, lib->ptp_role, &error);
    if (failed(&error) || !role)
        return;
    copy(out->role, sizeof(out->role), role);
    if (!lib->ptp_offset)
        return;
    out->offset_ns = arv_camera_get_integer(lib->camera, lib->ptp_offset, &error);
    out->has_offset = !failed(&error);
}

/* The stamp is of the time between the command and its acknowledgement, so not later than that. */
static void read_clock(struct genicam_lib *lib, struct genicam_reading *out)
{
    GError *error = NULL;
    gint64 value;

    if (!lib->clock_value)
        return;
    arv_camera_execute_command(lib->camera, lib->clock_latch, &error);
    out->seen_ns = now_ns(CLOCK_MONOTONIC);
    if (failed(&error))
        return;
    value = arv_camera_get_integer(lib->camera, lib->clock_value, &error);
    if (failed(&error) || value <= 0 || (double)value * lib->tick_ns >= (double)INT64_MAX)
        return;
    out->stamp_ns = lib->tick_ns == 1 ? value : (int64_t)((double)value * lib->tick_ns);
    out->latched = true;
}

int genicam_lib_read(struct genicam_lib *lib, struct genicam_reading *out)
{
    if (ARV_IS_GV_STREAM(lib->stream)) {
        guint64 resent = 0, missing = 0;

        arv_gv_stream_get_statistics(ARV_GV_STREAM(lib->stream), &resent, &missing);
        out->resent_packets = resent;
        out->missing_packets = missing;
    }
    read_ptp(lib, &out->ptp);
    read_clock(lib, out);
    return 0;
}

int genicam_lib_ptp(const struct sst_genicam_device *device, struct sst_genicam_ptp *out)
{
    struct genicam_lib lib = { .cfg = { .ptp = false } };

    lib.camera = open_device(device, NULL);
    if (!lib.camera)
        return -EIO;
    set_clock(&lib, NULL);
    read_ptp(&lib, out);
    g_object_unref(lib.camera);
    return 0;
}

/* --- end ---------------------------------------------------------------------------------------------------------- */

void genicam_lib_release(struct genicam_slot *slot)
{
    struct genicam_lib *lib = slot->lib;
    bool last;

    pthread_mutex_lock(&lib->lock);
    lib->lent--;
    last = lib->closed && !lib->lent;
    if (lib->closed)
        g_object_unref(slot->buffer);
    else
        give(lib, slot);
    pthread_mutex_unlock(&lib->lock);
    if (last)
        destroy(lib);
}

/* Buffers that are not lent out belong to the stream, which frees them. */
void genicam_lib_close(struct genicam_lib *lib, bool silent)
{
    ArvStream *stream;
    bool last;

    if (!lib)
        return;
    if (lib->camera && lib->stream && !silent)
        arv_camera_stop_acquisition(lib->camera, NULL);
    pthread_mutex_lock(&lib->lock);
    stream = lib->stream;
    lib->closed = true;
    lib->lent++; /* itself, until the stream's thread has ended */
    pthread_mutex_unlock(&lib->lock);
    if (lib->camera)
        g_signal_handlers_disconnect_by_data(arv_camera_get_device(lib->camera), lib);
    if (stream)
        g_object_unref(stream);
    for (int i = 0; lib->slot && !stream && i < lib->slots; i++)
        g_clear_object((GObject **)&lib->slot[i].buffer);
    g_clear_object(&lib->camera);
    pthread_mutex_lock(&lib->lock);
    last = !--lib->lent;
    pthread_mutex_unlock(&lib->lock);
    if (last)
        destroy(lib);
}

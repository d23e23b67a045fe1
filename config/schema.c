#include "config/schema.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define PLACE(type, field) .offset = offsetof(type, field), .size = sizeof(((type *)0)->field)
#define KEY(part, key, kind_, field, standard_, reload_, help_)                                                        \
    .section = part, .name = key, .type = SST_KEY_##kind_, PLACE(struct sst_config, field), .standard = standard_,     \
    .reload = SST_RELOAD_##reload_, .help = help_
#define FIELD(of, key, kind_, standard_, help_)                                                                        \
    .section = "", .name = #key, .type = SST_KEY_##kind_, PLACE(of, key), .standard = standard_, .help = help_
#define RANGE(low, high)  .min = low, .max = high
#define CHOICE(list)      .names = list, .n_names = (int)ARRAY_LEN(list)
#define KIND(what)        .kind = SST_TEXT_##what
#define COUNT(field)      .count_offset = offsetof(struct sst_config, field)
#define STRIDE(field)     .stride = sizeof(((struct sst_config *)0)->field[0])
#define FIELDS(list)      .fields = list, .n_fields = (int)ARRAY_LEN(list)
#define WORD(text, value) .word = text, .word_value = value

static const char *const sources[] = { "gpio", "software", "free-run" };
static const char *const modes[] = { "off", "continuous", "event" };
static const char *const codecs[] = { "h264", "mjpeg" };

const char *const sst_event_types[] = {
    "*",       "state",        "camera-lost", "camera-found", "trigger-lost", "trigger-found", "skew",
    "storage", "record-start", "record-stop", "motion",       "label",        "snapshot",      "export",
    "reload",  "calibration",  "certificate", "clock",        "client",       "start",         "stop",
};
const int sst_event_types_count = (int)ARRAY_LEN(sst_event_types);

static const struct sst_key bind_keys[] = {
    { FIELD(struct sst_config_camera, row, INT, NULL, "row of its place"), RANGE(0, SST_CAMERAS_MAX - 1) },
    { FIELD(struct sst_config_camera, col, INT, NULL, "column of its place"), RANGE(0, SST_CAMERAS_MAX - 1) },
    { FIELD(struct sst_config_camera, serial, TEXT, "", "serial number of the camera; or its port is given") },
    { FIELD(struct sst_config_camera, port, TEXT, "",
            "the USB port that it hangs on: one of both (sst cameras lists them)") },
    { FIELD(struct sst_config_camera, line, LINE, "",
            "trigger line that exposes it; without: that of its row, or the "
            "first where there is not one for each row") },
};

static const struct sst_key zone_keys[] = {
    { FIELD(struct sst_zone, name, TEXT, NULL, "of a-z, 0-9, - and _"), KIND(NAME) },
    { FIELD(struct sst_zone, x0, DOUBLE, NULL, "left edge, as a share of the picture's width"), RANGE(0, 1) },
    { FIELD(struct sst_zone, y0, DOUBLE, NULL, "upper edge, as a share of its height"), RANGE(0, 1) },
    { FIELD(struct sst_zone, x1, DOUBLE, NULL, "right edge"), RANGE(0, 1) },
    { FIELD(struct sst_zone, y1, DOUBLE, NULL, "lower edge"), RANGE(0, 1) },
};

static const struct sst_key record_keys[] = {
    { FIELD(struct sst_record_trigger, zone, ZONE, "", "zone that is watched; without: the whole picture") },
    { FIELD(struct sst_record_trigger, label, TEXT, "",
            "label that must appear, Pedestrian for example; without: any "
            "change") },
    { FIELD(struct sst_record_trigger, share, DOUBLE, "0.01",
            "of the zone that must change or bear the label; half "
            "of it keeps an event"),
      RANGE(0.0001, 1) },
    { FIELD(struct sst_record_trigger, begin_s, DOUBLE, "0.3", "an event begins when that was so for this long"),
      RANGE(0.05, 60) },
    { FIELD(struct sst_record_trigger, end_s, DOUBLE, "1", "and ends when it was not for this long"), RANGE(0.1, 600) },
};

static const struct sst_key hook_keys[] = {
    { FIELD(struct sst_hook, event, TEXT, NULL, "type of the event; \"*\" for all"), KIND(EVENT) },
    { .section = "",
      .name = "run",
      .type = SST_KEY_TEXTS,
      PLACE(struct sst_hook, argv),
      .stride = SST_CONFIG_TEXT_MAX,
      .count_offset = SST_KEY_NO_COUNT,
      .help = "program, by its absolute path, and its arguments; no shell is involved" },
};

static const struct sst_key keys[] = {
    { KEY("array", "rows", INT, array.rows, "6", CAMERAS,
          "places for cameras: row 0 is at the top, column 0 at the left, seen from behind the cameras"),
      RANGE(1, SST_CAMERAS_MAX) },
    { KEY("array", "cols", INT, array.cols, "6", CAMERAS, "columns; rows times columns make 256 at most"),
      RANGE(1, SST_CAMERAS_MAX) },
    { KEY("array", "spacing_mm", DOUBLE, array.spacing_mm, "0", CAMERAS,
          "between neighbours, written into recordings; 0: not known"),
      RANGE(0, 1e5) },

    { KEY("cameras", "format", FORMAT, array.fourcc, "MJPEG", CAMERAS, "pixel format"), CHOICE(sst_format_names) },
    { KEY("cameras", "width", INT, array.width, "640", CAMERAS, "of the picture"), RANGE(16, 16384) },
    { KEY("cameras", "height", INT, array.height, "480", CAMERAS, "of the picture"), RANGE(16, 16384) },
    { KEY("cameras", "rate_hz", DOUBLE, array.rate_hz, "10", CAMERAS,
          "asked from the cameras; with a trigger it is the most that they can be asked for"),
      RANGE(0.01, 1000) },
    { KEY("cameras", "buffers", INT, array.buffers, "8", CAMERAS, "frames per camera that may be under way"),
      RANGE(2, 32) },
    { KEY("cameras", "stall_ms", INT, array.stall_ms, "1000", CAMERAS, "a frame this late starts recovery"),
      RANGE(10, 600000) },
    { KEY("cameras", "port_power", BOOL, array.port_power, "false", CAMERAS,
          "recovery may switch a hub port off and on") },
    { KEY("cameras", "check_frozen", BOOL, array.check_frozen, "true", CAMERAS,
          "tell when a camera repeats a picture byte for byte") },
    { KEY("cameras", "controls", CONTROLS, array.control, "{}", CAMERAS,
          "controls by the names of v4l2-ctl --list-ctrls, set at each start and read back; files add to one another"),
      COUNT(array.controls), STRIDE(array.control) },
    { KEY("cameras", "bind", LIST, array.camera, "[]", CAMERAS,
          "which camera sits where; empty: all that are there, in the order of their ports"),
      COUNT(array.bound), STRIDE(array.camera), FIELDS(bind_keys) },

    { KEY("trigger", "source", CHOICE, array.source, "free-run", CAMERAS,
          "gpio: pulses on lines; software: marks in time for cameras that run on their own; free-run: none"),
      CHOICE(sources) },
    { KEY("trigger", "chip", TEXT, array.chip, "", CAMERAS,
          "label of the GPIO chip; line names alone are enough if they are unique") },
    { KEY("trigger", "lines", TEXTS, array.line, "[]", CAMERAS, "names of the lines to pulse (gpioinfo lists them)"),
      COUNT(array.lines), STRIDE(array.line) },
    { KEY("trigger", "loopback", TEXT, array.loopback, "", CAMERAS,
          "input wired to the first line: its kernel time stamps are the edges") },
    { KEY("trigger", "delay_us", INTS, array.delay_us, "0", CAMERAS,
          "of each line after the beat; one number, or one per line"),
      RANGE(0, 1e6), COUNT(array.lines), STRIDE(array.delay_us) },
    { KEY("trigger", "active_low", BOOL, array.active_low, "false", CAMERAS, "pulses go from high to low") },
    { KEY("trigger", "pulse_us", INT, array.pulse_us, "1000", CAMERAS, "length of a pulse"), RANGE(10, 1000000) },
    { KEY("trigger", "rate_hz", DOUBLE, array.trigger_hz, "10", CAMERAS, "sets per second"), RANGE(0.01, 1000) },

    { KEY("sets", "window_us", INT, array.window_us, "0", CAMERAS,
          "a frame this near to its trigger belongs to it; 0: 0.4 of the period"),
      RANGE(0, 10000000) },
    { KEY("sets", "wait_ms", INT, array.wait_ms, "0", CAMERAS,
          "a set is closed this long after its trigger, complete or not; 0: 2.5 periods, at least 250 ms"),
      RANGE(0, 600000) },
    { KEY("sets", "skew_limit_us", INT, array.skew_limit_us, "1000", CAMERAS, "sets with more are counted and told"),
      RANGE(1, 10000000) },

    { KEY("rig", "bus", TEXT, array.rig_bus, "", LIVE, "tcp:HOST:PORT or rtu:DEVICE,BAUD,8E1") },
    { KEY("rig", "profile", TEXT, array.rig_profile, "", LIVE,
          "the drive's registers: a file of config/profiles, or a path") },
    { KEY("rig", "axes", INT, array.rig_axes, "2", LIVE, "x, y and, with 3, z"), RANGE(1, 3) },
    { KEY("rig", "units", INTS, array.rig_unit, "[1, 2, 3]", LIVE, "Modbus unit of each axis"), RANGE(0, 247),
      COUNT(array.rig_axes), STRIDE(array.rig_unit) },
    { KEY("rig", "travel_min_mm", DOUBLES, array.rig_travel_min_mm, "0", LIVE, "one number, or one per axis"),
      RANGE(-1e5, 1e5), COUNT(array.rig_axes), STRIDE(array.rig_travel_min_mm) },
    { KEY("rig", "travel_max_mm", DOUBLES, array.rig_travel_max_mm, "400", LIVE, "likewise"), RANGE(-1e5, 1e5),
      COUNT(array.rig_axes), STRIDE(array.rig_travel_max_mm) },
    { KEY("rig", "um_per_count", DOUBLES, array.rig_um_per_count, "1", LIVE,
          "likewise; negative: the axis is mounted the other way round"),
      RANGE(-1e6, 1e6), COUNT(array.rig_axes), STRIDE(array.rig_um_per_count) },
    { KEY("rig", "speed_mm_s", DOUBLE, array.rig_speed_mm_s, "0", LIVE, "0: what the drives are set to"),
      RANGE(0, 1e5) },
    { KEY("rig", "accel_mm_s2", DOUBLE, array.rig_accel_mm_s2, "0", LIVE, "likewise"), RANGE(0, 1e6) },
    { KEY("rig", "tolerance_um", DOUBLE, array.rig_tolerance_um, "10", LIVE,
          "a position read back this near to the target is there"),
      RANGE(0.001, 1e5) },
    { KEY("rig", "response_ms", INT, array.rig_response_ms, "200", LIVE, "time-out of a reply"), RANGE(1, 60000) },
    { KEY("rig", "retries", INT, array.rig_retries, "2", LIVE, "of a request without a good reply"), RANGE(0, 100) },
    { KEY("rig", "reconnect_ms", INT, array.rig_reconnect_ms, "5000", LIVE, "a lost bus is given up after this"),
      RANGE(0, 600000) },
    { KEY("rig", "settle_ms", INT, array.rig_settle_ms, "200", LIVE, "stand still this long before a frame"),
      RANGE(0, 60000) },

    { KEY("live", "enabled", BOOL, live.enabled, "true", PICTURE, "false: only capture, show cameras and record") },
    { KEY("live", "calibration", TEXT, live.calibration, "", PICTURE,
          "file that sst calibrate wrote; \"\": views are as the cameras saw them"),
      KIND(FILE) },
    { KEY("live", "plane_mm", DOUBLE, live.plane_mm, "auto", PICTURE,
          "plane of rectification; auto: that of the calibration"),
      RANGE(1, 1e9), WORD("auto", -1) },
    { KEY("live", "model", TEXT, live.model, "", PICTURE, "network for labels (ONNX); \"\": the one that ships"),
      KIND(FILE) },
    { KEY("live", "range_min_px", DOUBLE, live.range_min_px, "0", PICTURE,
          "smallest disparity searched, px per spacing; equal to the largest: estimated"),
      RANGE(-1000, 1000) },
    { KEY("live", "range_max_px", DOUBLE, live.range_max_px, "0", PICTURE, "largest"), RANGE(-1000, 1000) },
    { KEY("live", "rate_hz", DOUBLE, live.rate_hz, "0", LIVE,
          "sets processed per second at most; 0: as many as the machine can"),
      RANGE(0, 1000) },
    { KEY("live", "threads", INT, live.threads, "0", PICTURE, "0: all processors"), RANGE(0, 256) },
    { KEY("live", "skip_change", BOOL, live.skip_change, "true", PICTURE,
          "compute only what changed; false: everything, for each set") },
    { KEY("live", "skip_labels", BOOL, live.skip_labels, "true", PICTURE, "label key views only, and after changes") },
    { KEY("live", "focus_px", DOUBLE, live.focus_px, "auto", LIVE,
          "of the main view, px per spacing; auto: behind what is in front"),
      RANGE(-1000, 1000), WORD("auto", NAN) },
    { KEY("live", "sigma_px", DOUBLE, live.sigma_px, "0", LIVE,
          "depth of what is seen around the focus; 0: 1/10 of the disparity range"),
      RANGE(0, 1e6) },
    { KEY("live", "c1", DOUBLE, live.c1, "0.005", LIVE, "least weight of rays far from the focus"), RANGE(0, 1) },
    { KEY("live", "c2", DOUBLE, live.c2, "0.02", LIVE, "least weight of rays of other objects"), RANGE(0, 1) },
    { KEY("live", "label_factor", DOUBLE, live.label_factor, "2", LIVE,
          "with a label in focus, the weight of the others is divided by this"),
      RANGE(1, 1000) },
    { KEY("live", "verify_rays", BOOL, live.verify_rays, "true", LIVE,
          "behind dense or moving leaves, count rays whose colours agree at the focus; false: by depth and label "
          "alone") },
    { KEY("live", "jpeg_quality", INT, live.jpeg_quality, "85", LIVE, "of the pictures made here"), RANGE(1, 100) },

    { KEY("", "zones", LIST, zone, "[]", PICTURE, "parts of the reference view that are watched"), COUNT(zones),
      STRIDE(zone), FIELDS(zone_keys) },

    { KEY("control", "socket", TEXT, control.socket, "/run/sst/control.sock", DAEMON,
          "UNIX socket for sst status and other programs"),
      KIND(PATH) },
    { KEY("control", "group", TEXT, control.group, "sst", DAEMON,
          "members of this group may control the service through the socket; \"\": root and its own user alone"),
      .optional = true },
    { KEY("control", "view_group", TEXT, control.view_group, "", DAEMON, "members may look; \"\": none") },

    { KEY("web", "enabled", BOOL, web.enabled, "true", DAEMON, "serve the page and the API over TCP") },
    { KEY("web", "address", TEXT, web.address, "127.0.0.1", DAEMON, "numeric; 0.0.0.0 or :: for all networks"),
      KIND(ADDRESS) },
    { KEY("web", "port", INT, web.port, "8090", DAEMON, "0: any that is free"), RANGE(0, 65535) },
    { KEY("web", "host", TEXT, web.host, "", DAEMON, "further name under which the page is reached") },
    { KEY("web", "token_file", TEXT, web.token_file, "/var/lib/sst/token", DAEMON,
          "made at the first start; who has the token may control. Beside it, ending in .view, the one for looking"),
      KIND(PATH) },
    { KEY("web", "tls_certificate", TEXT, web.tls_certificate, "", LIVE, "PEM file; with tls_key: HTTPS"), KIND(FILE),
      .switches = true },
    { KEY("web", "tls_key", TEXT, web.tls_key, "", LIVE, "PEM file"), KIND(FILE), .switches = true },
    { KEY("web", "insecure", BOOL, web.insecure, "false", DAEMON,
          "allow an address other than loopback without TLS: who listens in sees pictures and token") },
    { KEY("web", "clients", INT, web.clients, "64", DAEMON, "connections at a time"), RANGE(1, 1000) },
    { KEY("web", "streams", INT, web.streams, "32", DAEMON, "of them moving pictures"), RANGE(1, 1000) },
    { KEY("web", "stream_hz", DOUBLE, web.stream_hz, "10", DAEMON, "pictures per second for each of them at most"),
      RANGE(0.1, 1000) },
    { KEY("web", "views", INT, web.views, "4", LIVE, "viewers with a focus of their own at a time"), RANGE(1, 16) },

    { KEY("rtsp", "enabled", BOOL, rtsp.enabled, "false", LIVE, "serve the main view to video recorders") },
    { KEY("rtsp", "address", TEXT, rtsp.address, "127.0.0.1", LIVE, "numeric"), KIND(ADDRESS) },
    { KEY("rtsp", "port", INT, rtsp.port, "8554", LIVE, "0: any that is free"), RANGE(0, 65535) },
    { KEY("rtsp", "codec", CHOICE, rtsp.codec, "h264", LIVE, "how pictures are compressed"), CHOICE(codecs) },
    { KEY("rtsp", "user", TEXT, rtsp.user, "", LIVE, "asked for with a password") },
    { KEY("rtsp", "password_file", TEXT, rtsp.password_file, "", LIVE, "holds the password in its first line"),
      KIND(FILE) },
    { KEY("rtsp", "insecure", BOOL, rtsp.insecure, "false", LIVE,
          "allow an address other than loopback without a password") },

    { KEY("storage", "dir", TEXT, storage.dir, "/var/lib/sst", DAEMON, "folder of recordings, snapshots and exports"),
      KIND(PATH) },
    { KEY("storage", "mode", CHOICE, storage.mode, "off", LIVE,
          "off: record when asked to; continuous: always; event: when something of record_on happens"),
      CHOICE(modes) },
    { KEY("storage", "record_view", BOOL, storage.record_view, "true", LIVE,
          "record the see-through view as well, to be played without computing it again") },
    { KEY("storage", "quota_gb", DOUBLE, storage.quota_gb, "0", LIVE,
          "room for all that is kept; the oldest is removed beyond it; 0: no limit"),
      RANGE(0, 1e6) },
    { KEY("storage", "min_free_gb", DOUBLE, storage.min_free_gb, "2", LIVE, "room on the disk that is left to others"),
      RANGE(0, 1e6) },
    { KEY("storage", "max_age_days", DOUBLE, storage.max_age_days, "0", LIVE,
          "older recordings that made themselves are removed, none of what was made by hand; 0: none"),
      RANGE(0, 36500) },
    { KEY("storage", "by_hand_gb", DOUBLE, storage.by_hand_gb, "0", LIVE,
          "recordings on demand, snapshots and exports outlive the rest up to this; 0: half of the room"),
      RANGE(0, 1e6) },
    { KEY("storage", "by_hand_max_age_days", DOUBLE, storage.by_hand_max_age_days, "0", LIVE,
          "older recordings on demand, snapshots and exports are removed, which max_age_days leaves alone; 0: none"),
      RANGE(0, 36500) },
    { KEY("storage", "segment_s", DOUBLE, storage.segment_s, "60", LIVE, "a recording's files are this long at most"),
      RANGE(1, 3600) },
    { KEY("storage", "sync_s", DOUBLE, storage.sync_s, "1", LIVE, "after a power cut at most this much is missing"),
      RANGE(0.05, 60) },
    { KEY("storage", "preroll_s", DOUBLE, storage.preroll_s, "5", LIVE, "recorded of the time before an event"),
      RANGE(0, 3600) },
    { KEY("storage", "postroll_s", DOUBLE, storage.postroll_s, "10", LIVE, "and after it"), RANGE(0, 3600) },
    { KEY("storage", "ring_mb", INT, storage.ring_mb, "512", DAEMON, "memory for the sets of the last moments"),
      RANGE(1, 1 << 20) },
    { KEY("storage", "record_on", LIST, storage.trigger, "[]", LIVE, "what starts a recording on event"),
      COUNT(storage.triggers), STRIDE(storage.trigger), FIELDS(record_keys) },

    { KEY("mqtt", "enabled", BOOL, mqtt.enabled, "false", LIVE, "tell an MQTT broker what happens") },
    { KEY("mqtt", "host", TEXT, mqtt.host, "localhost", LIVE, "the broker") },
    { KEY("mqtt", "port", INT, mqtt.port, "1883", LIVE, "its port; 8883 is usual with TLS"), RANGE(1, 65535) },
    { KEY("mqtt", "user", TEXT, mqtt.user, "", LIVE, "account at the broker") },
    { KEY("mqtt", "password_file", TEXT, mqtt.password_file, "", LIVE, "holds the password in its first line"),
      KIND(FILE) },
    { KEY("mqtt", "ca_file", TEXT, mqtt.ca_file, "", LIVE,
          "certificates (PEM) that the broker's is checked against; with it the connection is TLS"),
      KIND(FILE) },
    { KEY("mqtt", "topic", TEXT, mqtt.topic, "sst", LIVE, "what topics begin with; one of its own for each array"),
      KIND(TOPIC) },
    { KEY("mqtt", "discovery", TEXT, mqtt.discovery, "homeassistant", LIVE,
          "Home Assistant's prefix, under which the array announces itself; \"\": it does not"),
      KIND(TOPIC), .optional = true },
    { KEY("mqtt", "picture_s", DOUBLE, mqtt.picture_s, "1", LIVE,
          "a picture of the main view goes to the broker at most this often; 0: never"),
      RANGE(0, 3600) },

    { KEY("", "hooks", LIST, hook, "[]", LIVE, "programs that are run when something happens"), COUNT(hooks),
      STRIDE(hook), FIELDS(hook_keys) },
};

const struct sst_key *sst_schema(int *count)
{
    *count = (int)ARRAY_LEN(keys);
    return keys;
}

int sst_schema_index(const char *dotted)
{
    const char *dot = strchr(dotted, '.');
    const size_t n = dot ? (size_t)(dot - dotted) : 0;
    int i = 0;

    while (i < (int)ARRAY_LEN(keys) && (strlen(keys[i].section) != n || strncmp(keys[i].section, dotted, n) != 0 ||
                                        strcmp(keys[i].name, dot ? dot + 1 : dotted) != 0))
        i++;
    assert(i < (int)ARRAY_LEN(keys));
    return i;
}

bool sst_key_of_array(const struct sst_key *key)
{
    static const char *const sections[] = { "array", "cameras", "trigger", "sets", "rig" };

    for (size_t i = 0; i < ARRAY_LEN(sections); i++)
        if (!strcmp(key->section, sections[i]))
            return true;
    return false;
}

const char *sst_schema_section_help(const char *section)
{
    static const char *const help[][2] = {
        { "array", "The grid of cameras." },
        { "cameras", "What is asked of every camera, and which one sits where." },
        { "trigger", "What exposes the cameras together." },
        { "sets", "How frames become sets, one frame of each camera for one trigger." },
        { "rig", "The motor rig of sst capture rig; the service does not use it." },
        { "live", "The picture that sees through." },
        { "control", "The UNIX socket on which the service is asked and told." },
        { "web", "The page, the API and the moving pictures over TCP, with a token." },
        { "rtsp", "The main view for video recorders." },
        { "storage", "What is recorded, and the room for it." },
        { "mqtt", "Events and state for home automation and other programs, over an MQTT broker." },
    };

    for (size_t i = 0; i < ARRAY_LEN(help); i++)
        if (!strcmp(help[i][0], section))
            return help[i][1];
    return "";
}

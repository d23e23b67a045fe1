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

static const char *const roles[] = { "single", "node", "head" };
static const char *const sources[] = { "gpio", "software", "free-run", "external" };
static const char *const modes[] = { "off", "continuous", "event" };
static const char *const reduced[] = { "off", "view", "changed", "sets", "tiles" };
static const char *const methods[] = { "refocus", "sst", "clear" };
static const char *const codecs[] = { "h264", "mjpeg" };
static const char *const still_files[] = { "jpeg", "raw", "raw+jpeg" };
static const char *const focuses[] = { "leave", "manual", "locked" };

const char *const sst_event_types[] = {
    "*",         "state",        "camera-lost", "camera-found", "trigger-lost", "trigger-found", "skew",
    "storage",   "record-start", "record-stop", "motion",       "label",        "visit",         "line",
    "snapshot",  "export",       "reload",      "calibration",  "certificate",  "clock",         "client",
    "host-lost", "host-found",   "device-lost", "device-found", "start",        "stop",
};
const int sst_event_types_count = (int)ARRAY_LEN(sst_event_types);

static const struct sst_key bind_keys[] = {
    { FIELD(struct sst_config_camera, row, INT, NULL, "row of its position in the grid"),
      RANGE(0, SST_CAMERAS_MAX - 1) },
    { FIELD(struct sst_config_camera, col, INT, NULL, "column of its position in the grid"),
      RANGE(0, SST_CAMERAS_MAX - 1) },
    { FIELD(struct sst_config_camera, serial, TEXT, "", "serial number of the camera; either this or port") },
    { FIELD(struct sst_config_camera, port, TEXT, "",
            "USB port of the camera; either this or serial (sst cameras lists both)") },
    { FIELD(struct sst_config_camera, node, INT, "0",
            "which of the video nodes of that device, from 1, if it has several (colour and infrared; sst cameras "
            "--local lists them); 0: the first that delivers format and size"),
      RANGE(0, 64) },
    { FIELD(struct sst_config_camera, line, LINE, "",
            "trigger line that exposes it; default: the line of its row, or the first line where there is not one for "
            "each row") },
};

static const char *const line_directions[] = { "both", "forward", "backward" };

static const struct sst_key zone_keys[] = {
    { FIELD(struct sst_zone, name, TEXT, NULL, "name of the zone, of a-z, 0-9, - and _"), KIND(NAME) },
    { FIELD(struct sst_zone, x0, DOUBLE, "0", "left edge, as a fraction of the picture's width"), RANGE(0, 1) },
    { FIELD(struct sst_zone, y0, DOUBLE, "0", "upper edge, as a fraction of the picture's height"), RANGE(0, 1) },
    { FIELD(struct sst_zone, x1, DOUBLE, "1", "right edge"), RANGE(0, 1) },
    { FIELD(struct sst_zone, y1, DOUBLE, "1", "lower edge"), RANGE(0, 1) },
    { FIELD(struct sst_zone, points, TEXT, "",
            "instead of the four edges a polygon of 3 to 16 points \"x,y x,y ...\", fractions as above; of a line its "
            "two ends"),
      KIND(POINTS) },
    { FIELD(struct sst_zone, near_px, DOUBLE, "none",
            "the zone ends there towards the cameras, px per spacing; none: no limit"),
      RANGE(-1000, 1000), WORD("none", INFINITY) },
    { FIELD(struct sst_zone, far_px, DOUBLE, "none",
            "the zone ends there away from the cameras, px per spacing; none: no limit"),
      RANGE(-1000, 1000), WORD("none", -INFINITY) },
    { .section = "",
      .name = "labels",
      .type = SST_KEY_TEXTS,
      PLACE(struct sst_zone, labels),
      .stride = sizeof(((struct sst_zone *)0)->labels[0]),
      .count_offset = SST_KEY_NO_COUNT,
      .standard = "[]",
      .help = "visits of these labels alone are in the zone, for example [Pedestrian]; default: all" },
    { FIELD(struct sst_zone, mask, BOOL, "false",
            "the zone is ignored: no visits in it, no motion in other zones where they overlap") },
    { FIELD(struct sst_zone, line, BOOL, "false",
            "the zone is a line between two points; a visit that crosses it is reported, and is in the zone from then "
            "on") },
    { FIELD(struct sst_zone, direction, CHOICE, "both",
            "of a line: forward counts crossings to its right-hand side, seen from the first point to the second"),
      CHOICE(line_directions) },
};

static const struct sst_key record_keys[] = {
    { FIELD(struct sst_record_trigger, zone, ZONE, "", "zone to watch; default: the whole picture") },
    { FIELD(struct sst_record_trigger, label, TEXT, "",
            "label that must appear, for example Pedestrian; default: any change") },
    { FIELD(
        struct sst_record_trigger, visit, BOOL, "false",
        "while a visit lasts, also of a person behind leaves; with a zone or label, while one is in it or has it") },
    { FIELD(
          struct sst_record_trigger, share, DOUBLE, "0.01",
          "fraction of the zone that must change or have the label to start an event; half of it continues the event"),
      RANGE(0.0001, 1) },
    { FIELD(struct sst_record_trigger, begin_s, DOUBLE, "0.3",
            "an event starts after the condition has held this long"),
      RANGE(0.05, 60) },
    { FIELD(struct sst_record_trigger, end_s, DOUBLE, "1", "an event ends after the condition has not held this long"),
      RANGE(0.1, 600) },
};

static const struct sst_key hook_keys[] = {
    { FIELD(struct sst_hook, event, TEXT, NULL, "type of the event; \"*\" for all"), KIND(EVENT) },
    { .section = "",
      .name = "run",
      .type = SST_KEY_TEXTS,
      PLACE(struct sst_hook, argv),
      .stride = SST_CONFIG_TEXT_MAX,
      .count_offset = SST_KEY_NO_COUNT,
      .help = "absolute path of the program and its arguments; no shell is involved" },
};

static const struct sst_key keys[] = {
    { KEY("", "role", CHOICE, array.role, "single", DAEMON,
          "single: this host has all cameras; node: it has some of them and sends their sets to a head; head: it "
          "assembles "
          "the sets of all nodes, and of its own cameras if cameras: bind lists any"),
      CHOICE(roles) },

    { KEY("array", "rows", INT, array.rows, "6", CAMERAS,
          "rows of cameras; row 0 is at the top, column 0 at the left, seen from behind the cameras"),
      RANGE(1, SST_CAMERAS_MAX) },
    { KEY("array", "cols", INT, array.cols, "6", CAMERAS, "columns of cameras; rows times columns is at most 256"),
      RANGE(1, SST_CAMERAS_MAX) },
    { KEY("array", "spacing_mm", DOUBLE, array.spacing_mm, "0", CAMERAS,
          "distance between neighbouring cameras, written into recordings; 0: unknown"),
      RANGE(0, 1e5) },

    { KEY("cameras", "format", FORMAT, array.fourcc, "MJPEG", CAMERAS, "pixel format"), CHOICE(sst_format_names) },
    { KEY("cameras", "width", INT, array.width, "640", CAMERAS, "width of the picture"), RANGE(16, 16384) },
    { KEY("cameras", "height", INT, array.height, "480", CAMERAS, "height of the picture"), RANGE(16, 16384) },
    { KEY("cameras", "rate_hz", DOUBLE, array.rate_hz, "10", CAMERAS,
          "frame rate requested from the cameras; with a trigger, set the highest rate that they support"),
      RANGE(0.01, 1000) },
    { KEY("cameras", "buffers", INT, array.buffers, "8", CAMERAS, "frame buffers per camera"), RANGE(2, 32) },
    { KEY("cameras", "stall_ms", INT, array.stall_ms, "1000", CAMERAS, "recovery starts when a frame is this late"),
      RANGE(10, 600000) },
    { KEY("cameras", "port_power", BOOL, array.port_power, "false", CAMERAS,
          "allow recovery to switch a hub port off and on") },
    { KEY("cameras", "check_frozen", BOOL, array.check_frozen, "true", CAMERAS,
          "report a camera that repeats a picture byte for byte") },
    { KEY("cameras", "controls", CONTROLS, array.control, "{}", CAMERAS,
          "controls by the names of v4l2-ctl --list-ctrls, set at each start and read back; the controls of all files "
          "are combined"),
      COUNT(array.controls), STRIDE(array.control) },
    { KEY("cameras", "bind", LIST, array.camera, "[]", CAMERAS,
          "position of each camera in the grid; empty: all connected cameras in the order of their ports"),
      COUNT(array.bound), STRIDE(array.camera), FIELDS(bind_keys) },

    { KEY("trigger", "source", CHOICE, array.source, "free-run", CAMERAS,
          "gpio: pulses on lines; software: timer ticks for cameras that run on their own; free-run: none; external: "
          "pulses of another host or a generator, with edges on the line loopback"),
      CHOICE(sources) },
    { KEY("trigger", "chip", TEXT, array.chip, "", CAMERAS,
          "GPIO chip: its label, its device in sysfs (path or name, such as 1-2:1.0) or its path in /dev; not needed "
          "if the "
          "line names are unique") },
    { KEY("trigger", "lines", TEXTS, array.line, "[]", CAMERAS, "names of the lines to pulse (gpioinfo lists them)"),
      COUNT(array.lines), STRIDE(array.line) },
    { KEY("trigger", "loopback", TEXT, array.loopback, "", CAMERAS,
          "input wired to the first line; its kernel time stamps give the times of the edges") },
    { KEY("trigger", "delay_us", INTS, array.delay_us, "0", CAMERAS,
          "delay of each line after the tick of the trigger; one number, or one per line"),
      RANGE(0, 1e6), COUNT(array.lines), STRIDE(array.delay_us) },
    { KEY("trigger", "active_low", BOOL, array.active_low, "false", CAMERAS, "pulses go from high to low") },
    { KEY("trigger", "pulse_us", INT, array.pulse_us, "1000", CAMERAS, "length of a pulse"), RANGE(10, 1000000) },
    { KEY("trigger", "rate_hz", DOUBLE, array.trigger_hz, "10", CAMERAS, "sets per second"), RANGE(0.01, 1000) },

    { KEY("sets", "window_us", INT, array.window_us, "0", CAMERAS,
          "a frame belongs to a trigger if it lies within this time of it; 0: 0.4 of the period"),
      RANGE(0, 10000000) },
    { KEY("sets", "wait_ms", INT, array.wait_ms, "0", CAMERAS,
          "a set closes this long after its trigger, complete or not; 0: 2.5 periods, at least 250 ms"),
      RANGE(0, 600000) },
    { KEY("sets", "skew_limit_us", INT, array.skew_limit_us, "1000", CAMERAS,
          "sets with a larger skew are counted and logged"),
      RANGE(1, 10000000) },

    { KEY("rig", "bus", TEXT, array.rig_bus, "", LIVE, "tcp:HOST:PORT or rtu:DEVICE,BAUD,8E1") },
    { KEY("rig", "profile", TEXT, array.rig_profile, "", LIVE,
          "register map of the drive: the name of a file in config/profiles, or a path") },
    { KEY("rig", "axes", INT, array.rig_axes, "2", LIVE, "number of axes: x, y, z"), RANGE(1, 3) },
    { KEY("rig", "units", INTS, array.rig_unit, "[1, 2, 3]", LIVE, "Modbus unit of each axis"), RANGE(0, 247),
      COUNT(array.rig_axes), STRIDE(array.rig_unit) },
    { KEY("rig", "travel_min_mm", DOUBLES, array.rig_travel_min_mm, "0", LIVE,
          "start of the travel; one number, or one per axis"),
      RANGE(-1e5, 1e5), COUNT(array.rig_axes), STRIDE(array.rig_travel_min_mm) },
    { KEY("rig", "travel_max_mm", DOUBLES, array.rig_travel_max_mm, "400", LIVE,
          "end of the travel; one number, or one per axis"),
      RANGE(-1e5, 1e5), COUNT(array.rig_axes), STRIDE(array.rig_travel_max_mm) },
    { KEY("rig", "um_per_count", DOUBLES, array.rig_um_per_count, "1", LIVE,
          "travel per count of the drive; one number, or one per axis; negative: the axis is mounted the other way "
          "round"),
      RANGE(-1e6, 1e6), COUNT(array.rig_axes), STRIDE(array.rig_um_per_count) },
    { KEY("rig", "speed_mm_s", DOUBLE, array.rig_speed_mm_s, "0", LIVE,
          "speed of all axes; 0: the setting of the drives"),
      RANGE(0, 1e5) },
    { KEY("rig", "accel_mm_s2", DOUBLE, array.rig_accel_mm_s2, "0", LIVE,
          "acceleration of all axes; 0: the setting of the drives"),
      RANGE(0, 1e6) },
    { KEY("rig", "tolerance_um", DOUBLE, array.rig_tolerance_um, "10", LIVE,
          "a target is reached when the position read back is this close to it"),
      RANGE(0.001, 1e5) },
    { KEY("rig", "response_ms", INT, array.rig_response_ms, "200", LIVE, "time-out of a reply"), RANGE(1, 60000) },
    { KEY("rig", "retries", INT, array.rig_retries, "2", LIVE, "retries of a request without a valid reply"),
      RANGE(0, 100) },
    { KEY("rig", "reconnect_ms", INT, array.rig_reconnect_ms, "5000", LIVE,
          "time after which reconnecting a lost bus is given up"),
      RANGE(0, 600000) },
    { KEY("rig", "settle_ms", INT, array.rig_settle_ms, "200", LIVE, "time of standstill before a frame"),
      RANGE(0, 60000) },

    { KEY("still", "exposure", TEXT, array.still_exposure, "", LIVE,
          "exposure time in seconds, for example 1/125; \"\": as the camera is set, as for the next three keys") },
    { KEY("still", "aperture", TEXT, array.still_aperture, "", LIVE, "aperture, for example 8") },
    { KEY("still", "iso", TEXT, array.still_iso, "", LIVE, "sensitivity, for example 100") },
    { KEY("still", "format", TEXT, array.still_format, "", LIVE,
          "the camera's own name for the kind and quality of its files (gphoto2 --get-config imageformat or "
          "imagequality), or the number in it") },
    { KEY("still", "files", CHOICE, array.still_files, "jpeg", LIVE,
          "files of an exposure; jpeg: one is the view; raw: one is developed to the view and kept; raw+jpeg: the JPEG "
          "is "
          "the view, the raw file is kept"),
      CHOICE(still_files) },
    { KEY("still", "focus", CHOICE, array.still_focus, "manual", LIVE,
          "manual: as the lens is set; locked: focused automatically by an exposure that is discarded, then manual; "
          "leave: as the camera is set"),
      CHOICE(focuses) },
    { KEY("still", "mirror_ms", INT, array.still_mirror_ms, "0", LIVE,
          "pause between the release that lifts the mirror and the one that exposes, for cameras set to mirror "
          "lock-up; "
          "0: one release"),
      RANGE(0, 20000) },
    { KEY("still", "card_ms", INT, array.still_card_ms, "20000", LIVE,
          "longest time from a release until the camera has written the files, exposure included"),
      RANGE(100, 600000) },
    { KEY("still", "quiet_ms", INT, array.still_quiet_ms, "0", LIVE,
          "the first release, and one after a failure or a busy camera, are watched for this time: a file of an "
          "earlier "
          "release may come first; 0: as card_ms"),
      RANGE(0, 600000) },
    { KEY("still", "response_ms", INT, array.still_response_ms, "10000", LIVE, "time-out of an answer over USB"),
      RANGE(100, 120000) },
    { KEY("still", "reopen_ms", INT, array.still_reopen_ms, "20000", LIVE,
          "time for a camera that was unplugged or hangs to come back"),
      RANGE(0, 600000) },
    { KEY("still", "battery_percent", INT, array.still_battery_percent, "5", LIVE,
          "the capture stops when the battery has less; 0: never"),
      RANGE(0, 100) },
    { KEY("still", "keep", BOOL, array.still_keep, "false", LIVE,
          "files stay on the camera's card; false: they are deleted there when they are stored") },
    { KEY("hosts", "head", TEXT, array.hosts.head, "", DAEMON, "of a node: numeric address of the head"), KIND(ADDRESS),
      .optional = true },
    { KEY("hosts", "head_name", TEXT, array.hosts.head_name, "head", DAEMON,
          "of a node: common name (CN) of the head's certificate; another one is refused"),
      KIND(NAME) },
    { KEY("hosts", "address", TEXT, array.hosts.address, "0.0.0.0", DAEMON,
          "of a head: numeric address to listen on for its nodes"),
      KIND(ADDRESS) },
    { KEY("hosts", "port", INT, array.hosts.port, "8444", DAEMON, "port of the head"), RANGE(1, 65535) },
    { KEY("hosts", "nodes", TEXTS, array.hosts.node, "[]", DAEMON,
          "of a head: common names (CN) of the certificates of its nodes; others are refused"),
      KIND(NAME), COUNT(array.hosts.nodes), STRIDE(array.hosts.node) },
    { KEY("hosts", "ca", TEXT, array.hosts.ca, "", DAEMON,
          "PEM file: the authority that signed the certificates of all hosts"),
      KIND(FILE) },
    { KEY("hosts", "certificate", TEXT, array.hosts.certificate, "", DAEMON,
          "PEM file: certificate of this host, with its name as common name"),
      KIND(FILE) },
    { KEY("hosts", "key", TEXT, array.hosts.key, "", DAEMON, "PEM file: its private key"), KIND(FILE) },
    { KEY("hosts", "datagrams", BOOL, array.hosts.datagrams, "true", DAEMON,
          "pictures go from nodes to the head by UDP datagrams (DTLS) with error correction, where both hosts can; "
          "false, or "
          "if they do not arrive: over TLS") },
    { KEY("hosts", "parity", INT, array.hosts.parity, "10", DAEMON,
          "of a node: datagrams that are sent more than a set needs, in percent, and two: as many of each 128 may be "
          "lost"),
      RANGE(0, 80) },
    { KEY("hosts", "queue", INT, array.hosts.queue, "4", DAEMON,
          "of a node: sets that wait to be sent; when it is full the oldest is dropped, counted"),
      RANGE(1, 256) },
    {
        KEY("hosts", "skip_unchanged", BOOL, array.hosts.skip_unchanged, "true", DAEMON,
            "of a node: pictures in which nothing changed since the last one sent are named to the head, not sent"),
    },

    { KEY("live", "enabled", BOOL, live.enabled, "true", PICTURE, "false: only capture, show the cameras and record") },
    { KEY("live", "calibration", TEXT, live.calibration, "", PICTURE,
          "calibration file written by sst calibrate; \"\": views are not rectified"),
      KIND(FILE) },
    { KEY("live", "plane_mm", DOUBLE, live.plane_mm, "auto", PICTURE,
          "distance of the rectification plane; auto: as in the calibration"),
      RANGE(1, 1e9), WORD("auto", -1) },
    { KEY("live", "model", TEXT, live.model, "", PICTURE, "segmentation network (ONNX); \"\": the installed one"),
      KIND(FILE) },
    { KEY("live", "range_min_px", DOUBLE, live.range_min_px, "0", PICTURE,
          "smallest disparity searched, px per spacing; if it equals range_max_px, the range is estimated"),
      RANGE(-1000, 1000) },
    { KEY("live", "range_max_px", DOUBLE, live.range_max_px, "0", PICTURE, "largest disparity searched"),
      RANGE(-1000, 1000) },
    { KEY("live", "rate_hz", DOUBLE, live.rate_hz, "0", LIVE,
          "maximum number of sets processed per second; 0: no limit"),
      RANGE(0, 1000) },
    { KEY("live", "threads", INT, live.threads, "0", PICTURE, "number of threads; 0: one per processor"),
      RANGE(0, 256) },
    { KEY("live", "skip_change", BOOL, live.skip_change, "true", PICTURE,
          "compute only changed tiles; false: everything for each set") },
    { KEY("live", "skip_labels", BOOL, live.skip_labels, "true", PICTURE,
          "label key views only, and again after changes") },
    { KEY(
        "live", "device", TEXT, live.device, "cpu", PICTURE,
        "where pictures are rendered and the network runs: cpu; gpu: the fastest GPU that can be opened; auto: "
        "such a GPU, if there is one; or a part of a device's name, which a software device needs. Work that it fails "
        "at falls back to the CPU") },
    { KEY("live", "device_memory_mb", INT, live.device_memory_mb, "0", PICTURE,
          "memory of the device to use at most, MiB, a quarter of it for the network; 0: three quarters of the "
          "device's"),
      RANGE(0, 1 << 24) },
    { KEY("live", "method", CHOICE, live.method, "clear", LIVE,
          "picture of the main view: clear: all in focus, without the foreground; sst: one plane, seen through "
          "the foreground; refocus: one plane"),
      CHOICE(methods) },
    { KEY("live", "cut_px", DOUBLE, live.cut_px, "auto", LIVE,
          "clear: nearer surfaces are removed, px per spacing; auto: a gap in depth, if there is one"),
      RANGE(-1000, 1000), WORD("auto", NAN) },
    { KEY("live", "remove_label", TEXT, live.remove_label, "", LIVE,
          "clear: objects with this label are removed, for example Pedestrian; \"\": none") },
    { KEY("live", "outline", BOOL, live.outline, "false", LIVE, "clear: draw a faint outline of removed objects") },
    { KEY("live", "tint", BOOL, live.tint, "false", LIVE,
          "clear: tint pixels that were last seen more than a second ago") },
    { KEY("live", "focus_px", DOUBLE, live.focus_px, "auto", LIVE,
          "focus of the main view, px per spacing; auto: behind the foreground"),
      RANGE(-1000, 1000), WORD("auto", NAN) },
    { KEY("live", "sigma_px", DOUBLE, live.sigma_px, "0", LIVE,
          "width of the depth weight around the focus; 0: 1/10 of the disparity range"),
      RANGE(0, 1e6) },
    { KEY("live", "c1", DOUBLE, live.c1, "0.005", LIVE, "minimum weight of rays far from the focus"), RANGE(0, 1) },
    { KEY("live", "c2", DOUBLE, live.c2, "0.02", LIVE, "minimum weight of rays of other objects"), RANGE(0, 1) },
    { KEY("live", "label_factor", DOUBLE, live.label_factor, "2", LIVE,
          "with a focus label, the weight of the other labels is divided by this"),
      RANGE(1, 1000) },
    { KEY("live", "hidden_alarms_per_hour", DOUBLE, live.hidden_alarms_per_hour, "1", PICTURE,
          "search for people and vehicles behind leaves, with about this number of false visits an hour; 0: no search"),
      RANGE(0, 60) },
    { KEY("live", "verify_rays", BOOL, live.verify_rays, "true", LIVE,
          "behind dense or moving leaves, weight rays by whether their colours agree at the focus; false: by depth and "
          "label alone") },
    { KEY("live", "jpeg_quality", INT, live.jpeg_quality, "85", LIVE, "JPEG quality of rendered pictures"),
      RANGE(1, 100) },

    { KEY("", "zones", LIST, zone, "[]", LIVE, "regions of the reference view that are watched"), COUNT(zones),
      STRIDE(zone), FIELDS(zone_keys) },

    { KEY("control", "socket", TEXT, control.socket, "/run/sst/control.sock", DAEMON,
          "UNIX socket for sst status and other programs"),
      KIND(PATH) },
    { KEY("control", "group", TEXT, control.group, "sst", DAEMON,
          "members of this group may control the service through the socket; \"\": only root and the service's own "
          "user"),
      .optional = true },
    { KEY("control", "view_group", TEXT, control.view_group, "sst-view", DAEMON,
          "members of this group may view only, as sst-rtsp does; \"\": no group"),
      .optional = true },

    { KEY("web", "enabled", BOOL, web.enabled, "true", DAEMON, "serve the page and the API over TCP") },
    { KEY("web", "address", TEXT, web.address, "127.0.0.1", DAEMON,
          "numeric address to listen on; 0.0.0.0 or :: for all networks"),
      KIND(ADDRESS) },
    { KEY("web", "port", INT, web.port, "8090", DAEMON, "0: any free port"), RANGE(0, 65535) },
    { KEY("web", "host", TEXT, web.host, "", DAEMON, "additional host name under which the page is reached") },
    { KEY("web", "token_file", TEXT, web.token_file, "/var/lib/sst/token", DAEMON,
          "file of the control token, created at the first start. The file beside it that ends in .view holds the "
          "token for viewing only"),
      KIND(PATH) },
    { KEY("web", "zones_file", TEXT, web.zones_file, "/var/lib/sst/zones.yaml", LIVE,
          "zones drawn on the page; written by the service, read after all other files. Where it exists, it replaces "
          "their zones; \"\": zones cannot be drawn"),
      KIND(PATH), .optional = true },
    { KEY("web", "tls_certificate", TEXT, web.tls_certificate, "", LIVE, "PEM file; with tls_key: HTTPS"), KIND(FILE),
      .switches = true },
    { KEY("web", "tls_key", TEXT, web.tls_key, "", LIVE, "PEM file"), KIND(FILE), .switches = true },
    { KEY("web", "insecure", BOOL, web.insecure, "false", DAEMON,
          "allow an address other than loopback without TLS; pictures and token can then be read on the network") },
    { KEY("web", "clients", INT, web.clients, "64", DAEMON, "maximum number of connections"), RANGE(1, 1000) },
    { KEY("web", "streams", INT, web.streams, "32", DAEMON, "maximum number of connections that stream video"),
      RANGE(1, 1000) },
    { KEY("web", "stream_hz", DOUBLE, web.stream_hz, "10", DAEMON, "maximum pictures per second of each stream"),
      RANGE(0.1, 1000) },
    { KEY("web", "views", INT, web.views, "4", LIVE, "maximum number of clients with a focus of their own"),
      RANGE(1, 16) },

    { KEY("rtsp", "enabled", BOOL, rtsp.enabled, "false", LIVE, "serve the main view to video recorders") },
    { KEY("rtsp", "address", TEXT, rtsp.address, "127.0.0.1", LIVE, "numeric address to listen on"), KIND(ADDRESS) },
    { KEY("rtsp", "port", INT, rtsp.port, "8554", LIVE, "0: any free port"), RANGE(0, 65535) },
    { KEY("rtsp", "codec", CHOICE, rtsp.codec, "h264", LIVE, "video compression"), CHOICE(codecs) },
    { KEY("rtsp", "user", TEXT, rtsp.user, "", LIVE, "user name that clients must give, with a password") },
    { KEY("rtsp", "password_file", TEXT, rtsp.password_file, "", LIVE, "file with the password in its first line"),
      KIND(FILE) },
    { KEY("rtsp", "insecure", BOOL, rtsp.insecure, "false", LIVE,
          "allow an address other than loopback without a password") },

    { KEY("storage", "dir", TEXT, storage.dir, "/var/lib/sst", DAEMON, "folder of recordings, snapshots and exports"),
      KIND(PATH) },
    { KEY("storage", "mode", CHOICE, storage.mode, "off", LIVE,
          "off: record on demand only; continuous: always; event: when a trigger of record_on fires"),
      CHOICE(modes) },
    { KEY("storage", "record_view", BOOL, storage.record_view, "true", LIVE,
          "also record the see-through view, so that playing it needs no rendering") },
    { KEY("storage", "reduced", CHOICE, storage.reduced, "off", LIVE,
          "recorded at all times when no full recording is made; view: the main view and a set a minute; sets: the "
          "view "
          "and every reduced_every-th set; changed: the same where something changed, else a set a minute; tiles: of "
          "these only "
          "the parts of the pictures that changed (MJPEG)"),
      CHOICE(reduced) },
    { KEY("storage", "reduced_every", INT, storage.reduced_every, "50", LIVE,
          "of how many sets one is kept by reduced: sets and changed"),
      RANGE(2, 100000) },
    { KEY("storage", "reduced_gb", DOUBLE, storage.reduced_gb, "0", LIVE,
          "up to this size, reduced recordings are kept longer than full ones; 0: a third of the available space"),
      RANGE(0, 1e6) },
    { KEY("storage", "reduced_max_age_days", DOUBLE, storage.reduced_max_age_days, "0", LIVE,
          "reduced recordings older than this are deleted; 0: no limit"),
      RANGE(0, 36500) },
    { KEY("storage", "visits_days", INT, storage.visits_days, "30", LIVE,
          "how long visits (an object that came into view, with two pictures) are kept; 0: they are not; about 100 kB "
          "each, in quota_gb, of which a tenth is theirs"),
      RANGE(0, 36500) },
    { KEY("storage", "quota_gb", DOUBLE, storage.quota_gb, "0", LIVE,
          "maximum disk space of recordings, snapshots, exports and visits; beyond it the oldest are deleted; 0: no limit"),
      RANGE(0, 1e6) },
    { KEY("storage", "min_free_gb", DOUBLE, storage.min_free_gb, "2", LIVE, "disk space that is left free"),
      RANGE(0, 1e6) },
    { KEY("storage", "max_age_days", DOUBLE, storage.max_age_days, "0", LIVE,
          "automatic recordings of all sets older than this are deleted, but not recordings on demand and reduced "
          "ones; 0: no limit"),
      RANGE(0, 36500) },
    { KEY("storage", "by_hand_gb", DOUBLE, storage.by_hand_gb, "0", LIVE,
          "up to this size, recordings on demand, snapshots and exports are kept longer than automatic recordings; 0: "
          "half of the available space"),
      RANGE(0, 1e6) },
    { KEY("storage", "by_hand_max_age_days", DOUBLE, storage.by_hand_max_age_days, "0", LIVE,
          "recordings on demand, snapshots and exports older than this are deleted; max_age_days does not apply to "
          "them; 0: no limit"),
      RANGE(0, 36500) },
    { KEY("storage", "segment_s", DOUBLE, storage.segment_s, "60", LIVE, "maximum length of each file of a recording"),
      RANGE(1, 3600) },
    { KEY("storage", "sync_s", DOUBLE, storage.sync_s, "1", LIVE, "maximum time that a power cut may lose"),
      RANGE(0.05, 60) },
    { KEY("storage", "preroll_s", DOUBLE, storage.preroll_s, "5", LIVE, "time recorded before an event"),
      RANGE(0, 3600) },
    { KEY("storage", "postroll_s", DOUBLE, storage.postroll_s, "10", LIVE, "time recorded after an event"),
      RANGE(0, 3600) },
    { KEY("storage", "ring_mb", INT, storage.ring_mb, "512", DAEMON, "memory for the most recent sets"),
      RANGE(1, 1 << 20) },
    { KEY("storage", "record_on", LIST, storage.trigger, "[]", LIVE, "triggers of event recording"),
      COUNT(storage.triggers), STRIDE(storage.trigger), FIELDS(record_keys) },

    { KEY("mqtt", "enabled", BOOL, mqtt.enabled, "false", LIVE, "publish events and state to an MQTT broker") },
    { KEY("mqtt", "host", TEXT, mqtt.host, "localhost", LIVE, "host name of the broker") },
    { KEY("mqtt", "port", INT, mqtt.port, "1883", LIVE, "port of the broker; 8883 is usual with TLS"),
      RANGE(1, 65535) },
    { KEY("mqtt", "user", TEXT, mqtt.user, "", LIVE, "account at the broker") },
    { KEY("mqtt", "password_file", TEXT, mqtt.password_file, "", LIVE, "file with the password in its first line"),
      KIND(FILE) },
    { KEY("mqtt", "ca_file", TEXT, mqtt.ca_file, "", LIVE, "CA certificates (PEM) that verify the broker; enables TLS"),
      KIND(FILE) },
    { KEY("mqtt", "insecure", BOOL, mqtt.insecure, "false", LIVE,
          "allow a broker on another machine without TLS (ca_file)") },
    { KEY("mqtt", "topic", TEXT, mqtt.topic, "sst", LIVE, "prefix of all topics; each array needs its own"),
      KIND(TOPIC) },
    { KEY("mqtt", "discovery", TEXT, mqtt.discovery, "homeassistant", LIVE,
          "Home Assistant's discovery prefix; \"\": the array is not announced"),
      KIND(TOPIC), .optional = true },
    { KEY("mqtt", "picture_s", DOUBLE, mqtt.picture_s, "1", LIVE,
          "minimum time between pictures of the main view sent to the broker; 0: none are sent"),
      RANGE(0, 3600) },

    { KEY("", "hooks", LIST, hook, "[]", LIVE, "programs that run on events"), COUNT(hooks), STRIDE(hook),
      FIELDS(hook_keys) },
};

_Static_assert(ARRAY_LEN(keys) <= SST_CONFIG_KEYS_MAX, "places of keys in files");

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
    static const char *const sections[] = { "array", "cameras", "trigger", "sets", "rig", "still", "hosts" };

    for (size_t i = 0; i < ARRAY_LEN(sections); i++)
        if (!strcmp(key->section, sections[i]))
            return true;
    return !*key->section && !strcmp(key->name, "role");
}

const char *sst_schema_section_help(const char *section)
{
    static const char *const help[][2] = {
        { "array", "The grid of cameras." },
        { "cameras", "Settings of every camera, and the position of each in the grid." },
        { "trigger", "The trigger that exposes all cameras together." },
        { "sets", "How frames are grouped into framesets (short: sets), one frame of each camera for one trigger." },
        { "rig", "The motor rig of sst capture rig; the service does not use it." },
        { "still", "A still camera on the rig (sst capture rig --camera still); the service does not use it." },
        { "hosts", "Several hosts that capture one array together; role says which one this is." },
        { "live", "The live picture." },
        { "control", "The UNIX socket through which local clients control the service." },
        { "web", "The page, the API and the video streams over TCP, with a token." },
        { "rtsp", "The main view for video recorders." },
        { "storage", "Recordings, and the disk space for them." },
        { "mqtt", "Events and state for home automation and other programs, through an MQTT broker." },
    };

    for (size_t i = 0; i < ARRAY_LEN(help); i++)
        if (!strcmp(help[i][0], section))
            return help[i][1];
    return "";
}

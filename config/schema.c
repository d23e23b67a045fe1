/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "config/schema.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define PLACE(type, field) .offset = offsetof(type, field), .size = sizeof(((type *)0)->field)
#define KEY(part, key, kind_, field, standard_, reload_)                                                               \
    .section = part, .name = key, .type = SST_KEY_##kind_, PLACE(struct sst_config, field), .standard = standard_,     \
    .reload = SST_RELOAD_##reload_
#define FIELD(of, key, kind_, standard_)                                                                               \
    .section = "", .name = #key, .type = SST_KEY_##kind_, PLACE(of, key), .standard = standard_
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
static const char *const kinds[] = { "v4l2", "genicam" };
static const char *const genicam_triggers[] = { "wire", "software", "action", "none" };
static const char *const focuses[] = { "leave", "manual", "locked" };

const char *const sst_event_types[] = {
    "*",         "state",        "camera-lost", "camera-found", "trigger-lost", "trigger-found", "skew",
    "storage",   "record-start", "record-stop", "motion",       "label",        "visit",         "line",
    "snapshot",  "export",       "reload",      "calibration",  "certificate",  "clock",         "client",
    "host-lost", "host-found",   "device-lost", "device-found", "start",        "stop",
};
const int sst_event_types_count = (int)ARRAY_LEN(sst_event_types);

static const struct sst_key bind_keys[] = {
    { FIELD(struct sst_config_camera, row, INT, NULL), RANGE(0, SST_CAMERAS_MAX - 1) },
    { FIELD(struct sst_config_camera, col, INT, NULL), RANGE(0, SST_CAMERAS_MAX - 1) },
    { FIELD(struct sst_config_camera, kind, CHOICE, "v4l2"), CHOICE(kinds) },
    { FIELD(struct sst_config_camera, serial, TEXT, "") },
    { FIELD(struct sst_config_camera, port, TEXT, "") },
    { FIELD(struct sst_config_camera, node, INT, "0"), RANGE(0, 64) },
    { FIELD(struct sst_config_camera, line, LINE, "") },
};

static const char *const line_directions[] = { "both", "forward", "backward" };

static const struct sst_key zone_keys[] = {
    { FIELD(struct sst_zone, name, TEXT, NULL), KIND(NAME) },
    { FIELD(struct sst_zone, x0, DOUBLE, "0"), RANGE(0, 1) },
    { FIELD(struct sst_zone, y0, DOUBLE, "0"), RANGE(0, 1) },
    { FIELD(struct sst_zone, x1, DOUBLE, "1"), RANGE(0, 1) },
    { FIELD(struct sst_zone, y1, DOUBLE, "1"), RANGE(0, 1) },
    { FIELD(struct sst_zone, points, TEXT, ""), KIND(POINTS) },
    { FIELD(struct sst_zone, near_px, DOUBLE, "none"), RANGE(-1000, 1000), WORD("none", INFINITY) },
    { FIELD(struct sst_zone, far_px, DOUBLE, "none"), RANGE(-1000, 1000), WORD("none", -INFINITY) },
    { FIELD(struct sst_zone, labels, TEXTS, "[]"), .stride = sizeof(((struct sst_zone *)0)->labels[0]),
      .count_offset = SST_KEY_NO_COUNT },
    { FIELD(struct sst_zone, mask, BOOL, "false") },
    { FIELD(struct sst_zone, line, BOOL, "false") },
    { FIELD(struct sst_zone, direction, CHOICE, "both"), CHOICE(line_directions) },
};

static const struct sst_key mask_keys[] = {
    { FIELD(struct sst_config_mask, name, TEXT, NULL), KIND(NAME) },
    { FIELD(struct sst_config_mask, row, INT, "all"), RANGE(0, SST_CAMERAS_MAX - 1), WORD("all", -1) },
    { FIELD(struct sst_config_mask, col, INT, "all"), RANGE(0, SST_CAMERAS_MAX - 1), WORD("all", -1) },
    { FIELD(struct sst_config_mask, x0, DOUBLE, "0"), RANGE(0, 1) },
    { FIELD(struct sst_config_mask, y0, DOUBLE, "0"), RANGE(0, 1) },
    { FIELD(struct sst_config_mask, x1, DOUBLE, "1"), RANGE(0, 1) },
    { FIELD(struct sst_config_mask, y1, DOUBLE, "1"), RANGE(0, 1) },
    { FIELD(struct sst_config_mask, points, TEXT, ""), KIND(POINTS) },
    { FIELD(struct sst_config_mask, near_px, DOUBLE, "none"), RANGE(-1000, 1000), WORD("none", INFINITY) },
    { FIELD(struct sst_config_mask, far_px, DOUBLE, "0"), RANGE(-1000, 1000) },
};

static const struct sst_key record_keys[] = {
    { FIELD(struct sst_record_trigger, zone, ZONE, "") },
    { FIELD(struct sst_record_trigger, label, TEXT, "") },
    { FIELD(struct sst_record_trigger, visit, BOOL, "false") },
    { FIELD(struct sst_record_trigger, share, DOUBLE, "0.01"), RANGE(0.0001, 1) },
    { FIELD(struct sst_record_trigger, begin_s, DOUBLE, "0.3"), RANGE(0.05, 60) },
    { FIELD(struct sst_record_trigger, end_s, DOUBLE, "1"), RANGE(0.1, 600) },
};

static const struct sst_key hook_keys[] = {
    { FIELD(struct sst_hook, event, TEXT, NULL), KIND(EVENT) },
    { .section = "",
      .name = "run",
      .type = SST_KEY_TEXTS,
      PLACE(struct sst_hook, argv),
      .stride = SST_CONFIG_TEXT_MAX,
      .count_offset = SST_KEY_NO_COUNT },
};

static const struct sst_key keys[] = {
    { KEY("", "role", CHOICE, array.role, "single", DAEMON), CHOICE(roles) },
    { KEY("", "site", TEXT, site, "", LIVE) },

    { KEY("array", "rows", INT, array.rows, "6", CAMERAS), RANGE(1, SST_CAMERAS_MAX) },
    { KEY("array", "cols", INT, array.cols, "6", CAMERAS), RANGE(1, SST_CAMERAS_MAX) },
    { KEY("array", "spacing_mm", DOUBLE, array.spacing_mm, "0", CAMERAS), RANGE(0, 1e5) },

    { KEY("cameras", "format", FORMAT, array.fourcc, "MJPEG", CAMERAS), CHOICE(sst_format_names) },
    { KEY("cameras", "width", INT, array.width, "640", CAMERAS), RANGE(16, SST_CONFIG_SIDE_MAX) },
    { KEY("cameras", "height", INT, array.height, "480", CAMERAS), RANGE(16, SST_CONFIG_SIDE_MAX) },
    { KEY("cameras", "split", TEXT, array.split, "1x1", CAMERAS), KIND(SPLIT) },
    { KEY("cameras", "rate_hz", DOUBLE, array.rate_hz, "10", CAMERAS), RANGE(0.01, 1000) },
    { KEY("cameras", "buffers", INT, array.buffers, "8", CAMERAS), RANGE(2, 32) },
    { KEY("cameras", "stall_ms", INT, array.stall_ms, "1000", CAMERAS), RANGE(10, 600000) },
    { KEY("cameras", "port_power", BOOL, array.port_power, "false", CAMERAS) },
    { KEY("cameras", "check_frozen", BOOL, array.check_frozen, "true", CAMERAS) },
    { KEY("cameras", "controls", CONTROLS, array.control, "{}", CAMERAS), COUNT(array.controls),
      STRIDE(array.control) },
    { KEY("cameras", "bind", LIST, array.camera, "[]", CAMERAS), COUNT(array.bound), STRIDE(array.camera),
      FIELDS(bind_keys) },

    { KEY("genicam", "trigger", CHOICE, array.genicam.trigger, "wire", CAMERAS), CHOICE(genicam_triggers) },
    { KEY("genicam", "line", TEXT, array.genicam.line, "Line0", CAMERAS) },
    { KEY("genicam", "pixel_format", TEXT, array.genicam.pixel_format, "", CAMERAS) },
    { KEY("genicam", "exposure_us", DOUBLE, array.genicam.exposure_us, "0", CAMERAS), RANGE(0, 1e8) },
    { KEY("genicam", "gain", DOUBLE, array.genicam.gain, "unchanged", CAMERAS), RANGE(-1000, 100000),
      WORD("unchanged", NAN) },
    { KEY("genicam", "packet_bytes", INT, array.genicam.packet_bytes, "0", CAMERAS), RANGE(0, 16384) },
    { KEY("genicam", "packet_delay_ns", INT, array.genicam.packet_delay_ns, "0", CAMERAS), RANGE(0, 10000000) },
    { KEY("genicam", "resend", BOOL, array.genicam.resend, "true", CAMERAS) },
    { KEY("genicam", "ptp", BOOL, array.genicam.ptp, "false", CAMERAS) },
    { KEY("genicam", "device_key", INT, array.genicam.device_key, "1", CAMERAS), RANGE(0, 2147483647) },
    { KEY("genicam", "group_key", INT, array.genicam.group_key, "1", CAMERAS), RANGE(0, 2147483647) },
    { KEY("genicam", "group_mask", INT, array.genicam.group_mask, "1", CAMERAS), RANGE(1, 2147483647) },
    { KEY("genicam", "action_address", TEXT, array.genicam.action_address, "255.255.255.255", CAMERAS), KIND(ADDRESS) },
    { KEY("genicam", "action_delay_us", INT, array.genicam.action_delay_us, "0", CAMERAS), RANGE(0, 1000000) },

    { KEY("trigger", "source", CHOICE, array.source, "free-run", CAMERAS), CHOICE(sources) },
    { KEY("trigger", "chip", TEXT, array.chip, "", CAMERAS) },
    { KEY("trigger", "lines", TEXTS, array.line, "[]", CAMERAS), COUNT(array.lines), STRIDE(array.line) },
    { KEY("trigger", "loopback", TEXT, array.loopback, "", CAMERAS) },
    { KEY("trigger", "delay_us", INTS, array.delay_us, "0", CAMERAS), RANGE(0, 1e6), COUNT(array.lines),
      STRIDE(array.delay_us) },
    { KEY("trigger", "active_low", BOOL, array.active_low, "false", CAMERAS) },
    { KEY("trigger", "pulse_us", INT, array.pulse_us, "1000", CAMERAS), RANGE(10, 1000000) },
    { KEY("trigger", "rate_hz", DOUBLE, array.trigger_hz, "10", CAMERAS), RANGE(0.01, 1000) },

    { KEY("sets", "window_us", INT, array.window_us, "0", CAMERAS), RANGE(0, 10000000) },
    { KEY("sets", "wait_ms", INT, array.wait_ms, "0", CAMERAS), RANGE(0, 600000) },
    { KEY("sets", "skew_limit_us", INT, array.skew_limit_us, "1000", CAMERAS), RANGE(1, 10000000) },

    { KEY("rig", "bus", TEXT, array.rig_bus, "", LIVE) },
    { KEY("rig", "profile", TEXT, array.rig_profile, "", LIVE) },
    { KEY("rig", "axes", INT, array.rig_axes, "2", LIVE), RANGE(1, 3) },
    { KEY("rig", "units", INTS, array.rig_unit, "[1, 2, 3]", LIVE), RANGE(0, 247), COUNT(array.rig_axes),
      STRIDE(array.rig_unit) },
    { KEY("rig", "travel_min_mm", DOUBLES, array.rig_travel_min_mm, "0", LIVE), RANGE(-1e5, 1e5), COUNT(array.rig_axes),
      STRIDE(array.rig_travel_min_mm) },
    { KEY("rig", "travel_max_mm", DOUBLES, array.rig_travel_max_mm, "400", LIVE), RANGE(-1e5, 1e5),
      COUNT(array.rig_axes), STRIDE(array.rig_travel_max_mm) },
    { KEY("rig", "um_per_count", DOUBLES, array.rig_um_per_count, "1", LIVE), RANGE(-1e6, 1e6), COUNT(array.rig_axes),
      STRIDE(array.rig_um_per_count) },
    { KEY("rig", "speed_mm_s", DOUBLE, array.rig_speed_mm_s, "0", LIVE), RANGE(0, 1e5) },
    { KEY("rig", "accel_mm_s2", DOUBLE, array.rig_accel_mm_s2, "0", LIVE), RANGE(0, 1e6) },
    { KEY("rig", "tolerance_um", DOUBLE, array.rig_tolerance_um, "10", LIVE), RANGE(0.001, 1e5) },
    { KEY("rig", "response_ms", INT, array.rig_response_ms, "200", LIVE), RANGE(1, 60000) },
    { KEY("rig", "retries", INT, array.rig_retries, "2", LIVE), RANGE(0, 100) },
    { KEY("rig", "reconnect_ms", INT, array.rig_reconnect_ms, "5000", LIVE), RANGE(0, 600000) },
    { KEY("rig", "settle_ms", INT, array.rig_settle_ms, "200", LIVE), RANGE(0, 60000) },

    { KEY("still", "exposure", TEXT, array.still_exposure, "", LIVE) },
    { KEY("still", "aperture", TEXT, array.still_aperture, "", LIVE) },
    { KEY("still", "iso", TEXT, array.still_iso, "", LIVE) },
    { KEY("still", "format", TEXT, array.still_format, "", LIVE) },
    { KEY("still", "files", CHOICE, array.still_files, "jpeg", LIVE), CHOICE(still_files) },
    { KEY("still", "focus", CHOICE, array.still_focus, "manual", LIVE), CHOICE(focuses) },
    { KEY("still", "mirror_ms", INT, array.still_mirror_ms, "0", LIVE), RANGE(0, 20000) },
    { KEY("still", "card_ms", INT, array.still_card_ms, "20000", LIVE), RANGE(100, 600000) },
    { KEY("still", "quiet_ms", INT, array.still_quiet_ms, "0", LIVE), RANGE(0, 600000) },
    { KEY("still", "response_ms", INT, array.still_response_ms, "10000", LIVE), RANGE(100, 120000) },
    { KEY("still", "reopen_ms", INT, array.still_reopen_ms, "20000", LIVE), RANGE(0, 600000) },
    { KEY("still", "battery_percent", INT, array.still_battery_percent, "5", LIVE), RANGE(0, 100) },
    { KEY("still", "keep", BOOL, array.still_keep, "false", LIVE) },
    { KEY("hosts", "head", TEXT, array.hosts.head, "", DAEMON), KIND(ADDRESS), .optional = true },
    { KEY("hosts", "head_name", TEXT, array.hosts.head_name, "head", DAEMON), KIND(NAME) },
    { KEY("hosts", "address", TEXT, array.hosts.address, "0.0.0.0", DAEMON), KIND(ADDRESS) },
    { KEY("hosts", "port", INT, array.hosts.port, "8444", DAEMON), RANGE(1, 65535) },
    { KEY("hosts", "nodes", TEXTS, array.hosts.node, "[]", DAEMON), KIND(NAME), COUNT(array.hosts.nodes),
      STRIDE(array.hosts.node) },
    { KEY("hosts", "ca", TEXT, array.hosts.ca, "", DAEMON), KIND(FILE) },
    { KEY("hosts", "certificate", TEXT, array.hosts.certificate, "", DAEMON), KIND(FILE) },
    { KEY("hosts", "key", TEXT, array.hosts.key, "", DAEMON), KIND(FILE) },
    { KEY("hosts", "datagrams", BOOL, array.hosts.datagrams, "true", DAEMON) },
    { KEY("hosts", "parity", INT, array.hosts.parity, "10", DAEMON), RANGE(0, 80) },
    { KEY("hosts", "queue", INT, array.hosts.queue, "4", DAEMON), RANGE(1, 256) },
    {
        KEY("hosts", "skip_unchanged", BOOL, array.hosts.skip_unchanged, "true", DAEMON),
    },

    { KEY("privacy", "masks", LIST, array.mask, "[]", CAMERAS), COUNT(array.masks), STRIDE(array.mask),
      FIELDS(mask_keys) },

    { KEY("live", "enabled", BOOL, live.enabled, "true", PICTURE) },
    { KEY("live", "calibration", TEXT, live.calibration, "", PICTURE), KIND(FILE) },
    { KEY("live", "plane_mm", DOUBLE, live.plane_mm, "auto", PICTURE), RANGE(1, 1e9), WORD("auto", -1) },
    { KEY("live", "poses", TEXT, live.poses, "", PICTURE), KIND(FILE) },
    { KEY("live", "surface_m", DOUBLE, live.surface_m, "ground", PICTURE), RANGE(0.01, 1e5), WORD("ground", 0) },
    { KEY("live", "near_m", DOUBLE, live.near_m, "auto", PICTURE), RANGE(0.01, 1e5), WORD("auto", 0) },
    { KEY("live", "far_m", DOUBLE, live.far_m, "auto", PICTURE), RANGE(0.01, 1e5), WORD("auto", 0) },
    { KEY("live", "fit_every_min", DOUBLE, live.fit_every_min, "10", PICTURE), RANGE(0, 1e5) },
    { KEY("live", "compare_px", INT, live.compare_px, "384", PICTURE), RANGE(64, 4096) },
    { KEY("live", "model", TEXT, live.model, "", PICTURE), KIND(FILE) },
    { KEY("live", "black_level", INT, live.black_level, "0", PICTURE), RANGE(0, 65535) },
    { KEY("live", "white_level", INT, live.white_level, "0", PICTURE), RANGE(0, 65535) },
    { KEY("live", "range_min_px", DOUBLE, live.range_min_px, "0", PICTURE), RANGE(-1000, 1000) },
    { KEY("live", "range_max_px", DOUBLE, live.range_max_px, "0", PICTURE), RANGE(-1000, 1000) },
    { KEY("live", "rate_hz", DOUBLE, live.rate_hz, "0", LIVE), RANGE(0, 1000) },
    { KEY("live", "threads", INT, live.threads, "0", PICTURE), RANGE(0, 256) },
    { KEY("live", "skip_change", BOOL, live.skip_change, "true", PICTURE) },
    { KEY("live", "skip_labels", BOOL, live.skip_labels, "true", PICTURE) },
    { KEY("live", "device", TEXT, live.device, "cpu", PICTURE) },
    { KEY("live", "device_memory_mb", INT, live.device_memory_mb, "0", PICTURE), RANGE(0, 1 << 24) },
    { KEY("live", "method", CHOICE, live.method, "clear", LIVE), CHOICE(methods) },
    { KEY("live", "cut_px", DOUBLE, live.cut_px, "auto", LIVE), RANGE(-1000, 1000), WORD("auto", NAN) },
    { KEY("live", "remove_label", TEXT, live.remove_label, "", LIVE) },
    { KEY("live", "outline", BOOL, live.outline, "false", LIVE) },
    { KEY("live", "tint", BOOL, live.tint, "false", LIVE) },
    { KEY("live", "outline_moving", BOOL, live.outline_moving, "true", LIVE) },
    { KEY("live", "keep_moving", BOOL, live.keep_moving, "false", LIVE) },
    { KEY("live", "demo_labels", BOOL, live.demo_labels, "false", LIVE) },
    { KEY("live", "focus_px", DOUBLE, live.focus_px, "auto", LIVE), RANGE(-1000, 1000), WORD("auto", NAN) },
    { KEY("live", "sigma_px", DOUBLE, live.sigma_px, "0", LIVE), RANGE(0, 1e6) },
    { KEY("live", "c1", DOUBLE, live.c1, "0.005", LIVE), RANGE(0, 1) },
    { KEY("live", "c2", DOUBLE, live.c2, "0.02", LIVE), RANGE(0, 1) },
    { KEY("live", "label_factor", DOUBLE, live.label_factor, "2", LIVE), RANGE(1, 1000) },
    { KEY("live", "hidden_alarms_per_hour", DOUBLE, live.hidden_alarms_per_hour, "1", PICTURE), RANGE(0, 60) },
    { KEY("live", "verify_rays", BOOL, live.verify_rays, "true", LIVE) },
    { KEY("live", "jpeg_quality", INT, live.jpeg_quality, "85", LIVE), RANGE(1, 100) },

    { KEY("", "zones", LIST, zone, "[]", LIVE), COUNT(zones), STRIDE(zone), FIELDS(zone_keys) },

    { KEY("control", "socket", TEXT, control.socket, "/run/sst/control.sock", DAEMON), KIND(PATH) },
    { KEY("control", "group", TEXT, control.group, "sst", DAEMON), .optional = true },
    { KEY("control", "view_group", TEXT, control.view_group, "sst-view", DAEMON), .optional = true },

    { KEY("web", "enabled", BOOL, web.enabled, "true", DAEMON) },
    { KEY("web", "address", TEXT, web.address, "127.0.0.1", DAEMON), KIND(ADDRESS) },
    { KEY("web", "port", INT, web.port, "8090", DAEMON), RANGE(0, 65535) },
    { KEY("web", "host", TEXT, web.host, "", DAEMON) },
    { KEY("web", "url", TEXT, web.url, "", DAEMON), KIND(URL) },
    { KEY("web", "token_file", TEXT, web.token_file, "/var/lib/sst/token", DAEMON), KIND(PATH) },
    { KEY("web", "zones_file", TEXT, web.zones_file, "/var/lib/sst/zones.yaml", LIVE), KIND(PATH), .optional = true },
    { KEY("web", "tls_certificate", TEXT, web.tls_certificate, "", LIVE), KIND(FILE), .switches = true },
    { KEY("web", "tls_key", TEXT, web.tls_key, "", LIVE), KIND(FILE), .switches = true },
    { KEY("web", "insecure", BOOL, web.insecure, "false", DAEMON) },
    { KEY("web", "clients", INT, web.clients, "64", DAEMON), RANGE(1, 1000) },
    { KEY("web", "streams", INT, web.streams, "32", DAEMON), RANGE(1, 1000) },
    { KEY("web", "stream_hz", DOUBLE, web.stream_hz, "10", DAEMON), RANGE(0.1, 1000) },
    { KEY("web", "views", INT, web.views, "4", LIVE), RANGE(1, 16) },

    { KEY("proxy", "addresses", TEXTS, proxy.address, "[]", DAEMON), KIND(ADDRESS), COUNT(proxy.addresses),
      STRIDE(proxy.address) },
    { KEY("proxy", "user_header", TEXT, proxy.user_header, "X-Remote-User", DAEMON) },
    { KEY("proxy", "rights", TEXTS, proxy.right, "[]", DAEMON), COUNT(proxy.rights), STRIDE(proxy.right) },

    { KEY("rtsp", "enabled", BOOL, rtsp.enabled, "false", LIVE) },
    { KEY("rtsp", "address", TEXT, rtsp.address, "127.0.0.1", LIVE), KIND(ADDRESS) },
    { KEY("rtsp", "port", INT, rtsp.port, "8554", LIVE), RANGE(0, 65535) },
    { KEY("rtsp", "codec", CHOICE, rtsp.codec, "h264", LIVE), CHOICE(codecs) },
    { KEY("rtsp", "user", TEXT, rtsp.user, "", LIVE) },
    { KEY("rtsp", "password_file", TEXT, rtsp.password_file, "", LIVE), KIND(FILE) },
    { KEY("rtsp", "insecure", BOOL, rtsp.insecure, "false", LIVE) },

    { KEY("onvif", "enabled", BOOL, onvif.enabled, "false", LIVE) },
    { KEY("onvif", "address", TEXT, onvif.address, "127.0.0.1", LIVE), KIND(ADDRESS) },
    { KEY("onvif", "port", INT, onvif.port, "8000", LIVE), RANGE(0, 65535) },
    { KEY("onvif", "host", TEXT, onvif.host, "", LIVE) },
    { KEY("onvif", "name", TEXT, onvif.name, "See-through array", LIVE) },
    { KEY("onvif", "user", TEXT, onvif.user, "", LIVE) },
    { KEY("onvif", "password_file", TEXT, onvif.password_file, "", LIVE), KIND(FILE) },
    { KEY("onvif", "discovery", BOOL, onvif.discovery, "true", LIVE) },

    { KEY("storage", "dir", TEXT, storage.dir, "/var/lib/sst", DAEMON), KIND(PATH) },
    { KEY("storage", "mode", CHOICE, storage.mode, "off", LIVE), CHOICE(modes) },
    { KEY("storage", "record_view", BOOL, storage.record_view, "true", LIVE) },
    { KEY("storage", "reduced", CHOICE, storage.reduced, "off", LIVE), CHOICE(reduced) },
    { KEY("storage", "reduced_every", INT, storage.reduced_every, "50", LIVE), RANGE(2, 100000) },
    { KEY("storage", "reduced_gb", DOUBLE, storage.reduced_gb, "0", LIVE), RANGE(0, 1e6) },
    { KEY("storage", "reduced_max_age_days", DOUBLE, storage.reduced_max_age_days, "0", LIVE), RANGE(0, 36500) },
    { KEY("storage", "visits_days", INT, storage.visits_days, "30", LIVE), RANGE(0, 36500) },
    { KEY("storage", "quota_gb", DOUBLE, storage.quota_gb, "0", LIVE), RANGE(0, 1e6) },
    { KEY("storage", "min_free_gb", DOUBLE, storage.min_free_gb, "2", LIVE), RANGE(0, 1e6) },
    { KEY("storage", "max_age_days", DOUBLE, storage.max_age_days, "0", LIVE), RANGE(0, 36500) },
    { KEY("storage", "by_hand_gb", DOUBLE, storage.by_hand_gb, "0", LIVE), RANGE(0, 1e6) },
    { KEY("storage", "by_hand_max_age_days", DOUBLE, storage.by_hand_max_age_days, "0", LIVE), RANGE(0, 36500) },
    { KEY("storage", "segment_s", DOUBLE, storage.segment_s, "60", LIVE), RANGE(1, 3600) },
    { KEY("storage", "sync_s", DOUBLE, storage.sync_s, "1", LIVE), RANGE(0.05, 60) },
    { KEY("storage", "preroll_s", DOUBLE, storage.preroll_s, "5", LIVE), RANGE(0, 3600) },
    { KEY("storage", "postroll_s", DOUBLE, storage.postroll_s, "10", LIVE), RANGE(0, 3600) },
    { KEY("storage", "ring_mb", INT, storage.ring_mb, "512", DAEMON), RANGE(1, 1 << 20) },
    { KEY("storage", "record_on", LIST, storage.trigger, "[]", LIVE), COUNT(storage.triggers), STRIDE(storage.trigger),
      FIELDS(record_keys) },

    { KEY("mqtt", "enabled", BOOL, mqtt.enabled, "false", LIVE) },
    { KEY("mqtt", "host", TEXT, mqtt.host, "localhost", LIVE) },
    { KEY("mqtt", "port", INT, mqtt.port, "1883", LIVE), RANGE(1, 65535) },
    { KEY("mqtt", "user", TEXT, mqtt.user, "", LIVE) },
    { KEY("mqtt", "password_file", TEXT, mqtt.password_file, "", LIVE), KIND(FILE) },
    { KEY("mqtt", "ca_file", TEXT, mqtt.ca_file, "", LIVE), KIND(FILE) },
    { KEY("mqtt", "insecure", BOOL, mqtt.insecure, "false", LIVE) },
    { KEY("mqtt", "topic", TEXT, mqtt.topic, "sst", LIVE), KIND(TOPIC) },
    { KEY("mqtt", "discovery", TEXT, mqtt.discovery, "homeassistant", LIVE), KIND(TOPIC), .optional = true },
    { KEY("mqtt", "picture_s", DOUBLE, mqtt.picture_s, "1", LIVE), RANGE(0, 3600) },

    { KEY("push", "enabled", BOOL, push.enabled, "true", LIVE) },
    { KEY("push", "hosts", TEXTS, push.host, "[]", LIVE), COUNT(push.hosts), STRIDE(push.host) },
    { KEY("push", "private_hosts", BOOL, push.private_hosts, "false", LIVE) },
    { KEY("push", "ca_file", TEXT, push.ca_file, "", LIVE), KIND(FILE) },
    { KEY("push", "contact", TEXT, push.contact, "", LIVE) },
    { KEY("push", "cool_down_s", DOUBLE, push.cool_down_s, "30", LIVE), RANGE(0, 86400) },

    { KEY("", "hooks", LIST, hook, "[]", LIVE), COUNT(hooks), STRIDE(hook), FIELDS(hook_keys) },
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

bool sst_key_places_masks(const struct sst_key *key)
{
    return !strcmp(key->section, "live") && !strcmp(key->name, "calibration");
}

bool sst_key_of_array(const struct sst_key *key)
{
    static const char *const sections[] = { "array", "cameras", "genicam", "trigger", "sets",
                                            "rig",   "still",   "hosts",   "privacy" };

    for (size_t i = 0; i < ARRAY_LEN(sections); i++)
        if (!strcmp(key->section, sections[i]))
            return true;
    return !*key->section && !strcmp(key->name, "role");
}

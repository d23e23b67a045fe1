#include "config/array.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "config/yaml.h"

#define DEFAULT_PATH "/etc/sst/sstd.yaml"

/* V4L2 pixel formats that the pipeline reads, by the names that v4l2-ctl and people use. */
static const char *const format_names[] = { "MJPEG", "YUYV", "GREY", "Y16", "BGGR8", "GBRG8", "GRBG8", "RGGB8" };
static const char format_codes[][5] = { "MJPG", "YUYV", "GREY", "Y16 ", "BA81", "GBRG", "GRBG", "RGGB" };

static uint32_t fourcc_of(const char code[5])
{
    return (uint32_t)code[0] | (uint32_t)code[1] << 8 | (uint32_t)code[2] << 16 | (uint32_t)code[3] << 24;
}

uint32_t sst_array_format(const char *name)
{
    for (size_t i = 0; i < ARRAY_LEN(format_names); i++)
        if (!strcasecmp(name, format_names[i]) || !strncmp(name, format_codes[i], 4))
            return fourcc_of(format_codes[i]);
    return 0;
}

const char *sst_array_format_name(uint32_t fourcc)
{
    for (size_t i = 0; i < ARRAY_LEN(format_names); i++)
        if (fourcc_of(format_codes[i]) == fourcc)
            return format_names[i];
    return NULL;
}

void sst_array_config_defaults(struct sst_array_config *cfg)
{
    *cfg = (struct sst_array_config){
        .rows = 6,
        .cols = 6,
        .fourcc = fourcc_of("MJPG"),
        .width = 640,
        .height = 480,
        .buffers = 8,
        .stall_ms = 1000,
        .rate_hz = 10,
        .check_frozen = true,
        .source = SST_CONFIG_FREE_RUN,
        .pulse_us = 1000,
        .trigger_hz = 10,
        .skew_limit_us = 1000,
        .rig_axes = 2,
        .rig_unit = { 1, 2, 3 },
        .rig_travel_max_mm = { 400, 400, 400 },
        .rig_um_per_count = { 1, 1, 1 },
        .rig_tolerance_um = 10,
        .rig_response_ms = 200,
        .rig_retries = 2,
        .rig_reconnect_ms = 5000,
        .rig_settle_ms = 200,
    };
}

static void read_array(struct sst_yaml *doc, struct sst_yaml_node *n, struct sst_array_config *cfg)
{
    struct sst_yaml_node *cols = sst_yaml_get(n, "cols");

    sst_yaml_int(doc, sst_yaml_get(n, "rows"), 1, SST_CAMERAS_MAX, &cfg->rows);
    if (sst_yaml_int(doc, cols, 1, SST_CAMERAS_MAX, &cfg->cols) && cfg->rows * cfg->cols > SST_CAMERAS_MAX)
        sst_yaml_fault(doc, cols, "with these rows makes more than %d views", SST_CAMERAS_MAX);
    sst_yaml_double(doc, sst_yaml_get(n, "spacing_mm"), 0.01, 1e5, &cfg->spacing_mm);
}

static void read_controls(struct sst_yaml *doc, struct sst_yaml_node *n, struct sst_array_config *cfg)
{
    if (!n)
        return;
    if (n->type != SST_YAML_MAP) {
        sst_yaml_fault(doc, n, "must be a mapping of control names (v4l2-ctl --list-ctrls) to numbers");
        return;
    }
    sst_yaml_know_all(n);
    for (struct sst_yaml_node *c = n->first; c; c = c->next) {
        double value;

        if (cfg->controls == SST_CONFIG_CONTROLS_MAX) {
            sst_yaml_fault(doc, c, "is one control too many: at most %d", SST_CONFIG_CONTROLS_MAX);
            return;
        }
        if (strlen(c->key) >= sizeof(cfg->control[0].name)) {
            sst_yaml_fault(doc, c, "is no control's name: too long");
            continue;
        }
        if (!sst_yaml_double(doc, c, -9e15, 9e15, &value))
            continue;
        if (value != floor(value)) {
            sst_yaml_fault(doc, c, "must be a whole number");
            continue;
        }
        strcpy(cfg->control[cfg->controls].name, c->key);
        cfg->control[cfg->controls++].value = (int64_t)value;
    }
}

static void check_twice(struct sst_yaml *doc, const struct sst_yaml_node *at, const struct sst_array_config *cfg)
{
    const struct sst_config_camera *c = &cfg->camera[cfg->bound];

    for (int i = 0; i < cfg->bound; i++) {
        const struct sst_config_camera *o = &cfg->camera[i];

        if (o->row == c->row && o->col == c->col)
            sst_yaml_fault(doc, at, "gives row %d, col %d a second camera", c->row, c->col);
        if (c->serial[0] && !strcmp(o->serial, c->serial))
            sst_yaml_fault(doc, at, "uses serial %s again", c->serial);
        if (c->port[0] && !strcmp(o->port, c->port))
            sst_yaml_fault(doc, at, "uses port %s again", c->port);
    }
}

/** Index of a trigger line by name, or -1. */
static int line_index(const struct sst_array_config *cfg, const char *name)
{
    for (int i = 0; i < cfg->lines; i++)
        if (!strcmp(cfg->line[i], name))
            return i;
    return -1;
}

static void read_binding(struct sst_yaml *doc, struct sst_yaml_node *n, struct sst_array_config *cfg)
{
    struct sst_config_camera *c = &cfg->camera[cfg->bound];
    struct sst_yaml_node *serial, *port, *line;
    char name[64];

    *c = (struct sst_config_camera){ .line = -1 };
    if (n->type != SST_YAML_MAP) {
        sst_yaml_fault(doc, n, "must be a mapping like { row: 0, col: 0, serial: ABC }");
        return;
    }
    sst_yaml_int(doc, sst_yaml_need(doc, n, "row"), 0, cfg->rows - 1, &c->row);
    sst_yaml_int(doc, sst_yaml_need(doc, n, "col"), 0, cfg->cols - 1, &c->col);
    serial = sst_yaml_get(n, "serial");
    port = sst_yaml_get(n, "port");
    line = sst_yaml_get(n, "line");
    sst_yaml_string(doc, serial, c->serial, sizeof(c->serial));
    sst_yaml_string(doc, port, c->port, sizeof(c->port));
    if (!serial == !port)
        sst_yaml_fault(doc, n, "needs the camera's serial or its port, one of both (sst cameras lists them)");
    if (sst_yaml_string(doc, line, name, sizeof(name))) {
        c->line = line_index(cfg, name);
        if (c->line < 0)
            sst_yaml_fault(doc, line, "names no line of trigger: lines");
    }
    check_twice(doc, n, cfg);
    cfg->bound++;
}

static void read_bindings(struct sst_yaml *doc, struct sst_yaml_node *n, struct sst_array_config *cfg)
{
    if (!n)
        return;
    if (n->type != SST_YAML_LIST) {
        sst_yaml_fault(doc, n, "must be a list, an entry for each camera");
        return;
    }
    for (struct sst_yaml_node *c = n->first; c; c = c->next) {
        if (cfg->bound == cfg->rows * cfg->cols) {
            sst_yaml_fault(doc, c, "is a camera more than the array has places");
            return;
        }
        read_binding(doc, c, cfg);
    }
}

static void read_cameras(struct sst_yaml *doc, struct sst_yaml_node *n, struct sst_array_config *cfg)
{
    int format;

    if (sst_yaml_choice(doc, sst_yaml_get(n, "format"), format_names, ARRAY_LEN(format_names), &format))
        cfg->fourcc = fourcc_of(format_codes[format]);
    sst_yaml_int(doc, sst_yaml_get(n, "width"), 16, 16384, &cfg->width);
    sst_yaml_int(doc, sst_yaml_get(n, "height"), 16, 16384, &cfg->height);
    sst_yaml_double(doc, sst_yaml_get(n, "rate_hz"), 0.01, 1000, &cfg->rate_hz);
    sst_yaml_int(doc, sst_yaml_get(n, "buffers"), 2, 32, &cfg->buffers);
    sst_yaml_int(doc, sst_yaml_get(n, "stall_ms"), 10, 600000, &cfg->stall_ms);
    sst_yaml_bool(doc, sst_yaml_get(n, "port_power"), &cfg->port_power);
    sst_yaml_bool(doc, sst_yaml_get(n, "check_frozen"), &cfg->check_frozen);
    read_controls(doc, sst_yaml_get(n, "controls"), cfg);
    read_bindings(doc, sst_yaml_get(n, "bind"), cfg);
}

static void read_lines(struct sst_yaml *doc, struct sst_yaml_node *n, struct sst_array_config *cfg)
{
    if (!n)
        return;
    if (n->type != SST_YAML_LIST || n->count < 1 || n->count > SST_CONFIG_LINES_MAX) {
        sst_yaml_fault(doc, n, "must be a list of 1 to %d line names", SST_CONFIG_LINES_MAX);
        return;
    }
    for (struct sst_yaml_node *c = n->first; c; c = c->next) {
        if (sst_yaml_string(doc, c, cfg->line[cfg->lines], sizeof(cfg->line[0])) &&
            line_index(cfg, cfg->line[cfg->lines]) >= 0)
            sst_yaml_fault(doc, c, "is in the list twice");
        cfg->lines++;
    }
}

static void read_trigger(struct sst_yaml *doc, struct sst_yaml_node *n, struct sst_array_config *cfg)
{
    static const char *const sources[] = { "gpio", "software", "free-run" };
    struct sst_yaml_node *source = sst_yaml_get(n, "source"), *delay = sst_yaml_get(n, "delay_us");
    double delays[SST_CONFIG_LINES_MAX] = { 0 };
    int index;

    if (sst_yaml_choice(doc, source, sources, ARRAY_LEN(sources), &index))
        cfg->source = (enum sst_config_source)index;
    sst_yaml_string(doc, sst_yaml_get(n, "chip"), cfg->chip, sizeof(cfg->chip));
    read_lines(doc, sst_yaml_get(n, "lines"), cfg);
    if (source && cfg->source == SST_CONFIG_GPIO && !cfg->lines)
        sst_yaml_fault(doc, source, "gpio needs trigger: lines, the names of the lines to pulse (gpioinfo lists them)");
    if (delay && sst_yaml_doubles(doc, delay, 0, 1e6, delays, sst_max_int(cfg->lines, 1)))
        for (int i = 0; i < cfg->lines; i++)
            cfg->delay_us[i] = (int)delays[i];
    sst_yaml_string(doc, sst_yaml_get(n, "loopback"), cfg->loopback, sizeof(cfg->loopback));
    sst_yaml_bool(doc, sst_yaml_get(n, "active_low"), &cfg->active_low);
    sst_yaml_int(doc, sst_yaml_get(n, "pulse_us"), 10, 1000000, &cfg->pulse_us);
    sst_yaml_double(doc, sst_yaml_get(n, "rate_hz"), 0.01, 1000, &cfg->trigger_hz);
    if (source && cfg->source == SST_CONFIG_GPIO && cfg->pulse_us * 1e-6 * cfg->trigger_hz > 0.9)
        sst_yaml_fault(doc, n, "has pulses that fill its period: lower pulse_us or rate_hz");
}

static void read_sets(struct sst_yaml *doc, struct sst_yaml_node *n, struct sst_array_config *cfg)
{
    sst_yaml_int(doc, sst_yaml_get(n, "window_us"), 1, 10000000, &cfg->window_us);
    sst_yaml_int(doc, sst_yaml_get(n, "wait_ms"), 1, 600000, &cfg->wait_ms);
    sst_yaml_int(doc, sst_yaml_get(n, "skew_limit_us"), 1, 10000000, &cfg->skew_limit_us);
}

static void read_rig(struct sst_yaml *doc, struct sst_yaml_node *n, struct sst_array_config *cfg)
{
    double unit[3] = { 1, 2, 3 };
    struct sst_yaml_node *units = sst_yaml_get(n, "units");

    sst_yaml_string(doc, sst_yaml_get(n, "bus"), cfg->rig_bus, sizeof(cfg->rig_bus));
    sst_yaml_string(doc, sst_yaml_get(n, "profile"), cfg->rig_profile, sizeof(cfg->rig_profile));
    sst_yaml_int(doc, sst_yaml_get(n, "axes"), 1, 3, &cfg->rig_axes);
    if (units && sst_yaml_doubles(doc, units, 0, 247, unit, cfg->rig_axes))
        for (int a = 0; a < cfg->rig_axes; a++)
            cfg->rig_unit[a] = (int)unit[a];
    sst_yaml_doubles(doc, sst_yaml_get(n, "travel_min_mm"), -1e5, 1e5, cfg->rig_travel_min_mm, cfg->rig_axes);
    sst_yaml_doubles(doc, sst_yaml_get(n, "travel_max_mm"), -1e5, 1e5, cfg->rig_travel_max_mm, cfg->rig_axes);
    sst_yaml_doubles(doc, sst_yaml_get(n, "um_per_count"), -1e6, 1e6, cfg->rig_um_per_count, cfg->rig_axes);
    sst_yaml_double(doc, sst_yaml_get(n, "tolerance_um"), 0.001, 1e5, &cfg->rig_tolerance_um);
    sst_yaml_double(doc, sst_yaml_get(n, "speed_mm_s"), 0, 1e5, &cfg->rig_speed_mm_s);
    sst_yaml_double(doc, sst_yaml_get(n, "accel_mm_s2"), 0, 1e6, &cfg->rig_accel_mm_s2);
    sst_yaml_int(doc, sst_yaml_get(n, "response_ms"), 1, 60000, &cfg->rig_response_ms);
    sst_yaml_int(doc, sst_yaml_get(n, "retries"), 0, 100, &cfg->rig_retries);
    sst_yaml_int(doc, sst_yaml_get(n, "reconnect_ms"), 0, 600000, &cfg->rig_reconnect_ms);
    sst_yaml_int(doc, sst_yaml_get(n, "settle_ms"), 0, 60000, &cfg->rig_settle_ms);
    for (int a = 0; n && a < cfg->rig_axes; a++) {
        if (cfg->rig_um_per_count[a] == 0)
            sst_yaml_fault(doc, n, "needs um_per_count other than 0");
        if (cfg->rig_travel_min_mm[a] >= cfg->rig_travel_max_mm[a])
            sst_yaml_fault(doc, n, "has a travel_min_mm that is not below travel_max_mm");
    }
}

/** Without `line`, cameras hang on the line of their row where there is one for each row, else on the first. */
static void default_lines(struct sst_array_config *cfg)
{
    for (int i = 0; i < cfg->bound; i++)
        if (cfg->camera[i].line < 0)
            cfg->camera[i].line = cfg->lines == cfg->rows ? cfg->camera[i].row : 0;
}

int sst_array_config_read(struct sst_array_config *cfg, const char *path)
{
    struct sst_array_config *next;
    struct sst_yaml *doc = NULL;
    struct sst_yaml_node *root;
    uint8_t *text = NULL;
    size_t size;
    int err;

    if (!path) {
        if (!sst_path_exists(DEFAULT_PATH))
            return 0;
        path = DEFAULT_PATH;
    }
    next = malloc(sizeof(*next));
    if (!next)
        return -ENOMEM;
    *next = *cfg;
    err = sst_file_read(path, SST_YAML_MAX_BYTES, &text, &size);
    if (!err)
        err = sst_yaml_parse(&doc, (const char *)text, size, path);
    if (err)
        goto out;
    root = sst_yaml_root(doc);
    read_array(doc, sst_yaml_get(root, "array"), next);
    read_trigger(doc, sst_yaml_get(root, "trigger"), next);
    read_cameras(doc, sst_yaml_get(root, "cameras"), next);
    read_sets(doc, sst_yaml_get(root, "sets"), next);
    read_rig(doc, sst_yaml_get(root, "rig"), next);
    default_lines(next);
    err = sst_yaml_finish(doc);
    if (!err)
        *cfg = *next;
out:
    sst_yaml_destroy(doc);
    free(text);
    free(next);
    return err;
}

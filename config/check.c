/* Checks between values, after all files are read. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "config/config_internal.h"

/* Where the first of two keys was read; if it is in no file, the second. */
static const struct config_place *source(const struct config_load *load, const char *key, const char *other)
{
    const struct config_place *p = &load->at[sst_schema_index(key)];

    return p->node || !other ? p : &load->at[sst_schema_index(other)];
}

/* A key in no file has its default, which fits the other defaults: no fault is noted for it. */
static void fault(const struct config_place *p, const struct sst_yaml_node *node, const char *fmt, ...)
    SST_PRINTF(3, 4);
static void fault(const struct config_place *p, const struct sst_yaml_node *node, const char *fmt, ...)
{
    char text[300];
    va_list args;

    va_start(args, fmt);
    vsnprintf(text, sizeof(text), fmt, args);
    va_end(args);
    if (p->doc)
        sst_yaml_fault(p->doc, node ? node : p->node, "%s", text);
}

/* The list's first element; NULL if it is not a list. */
static struct sst_yaml_node *elements(const struct config_place *p)
{
    return p->node && p->node->type == SST_YAML_LIST ? p->node->first : NULL;
}

/* --- array -------------------------------------------------------------------------------------------------------- */

static int line_index(const struct sst_array_config *a, const char *name)
{
    for (int i = 0; i < a->lines; i++)
        if (!strcmp(a->line[i], name))
            return i;
    return -1;
}

static void check_twice(const struct config_place *p, const struct sst_yaml_node *at, const struct sst_array_config *a,
                        int i)
{
    const struct sst_config_camera *c = &a->camera[i];

    for (int k = 0; k < i; k++) {
        const struct sst_config_camera *o = &a->camera[k];

        if (o->row == c->row && o->col == c->col)
            fault(p, at, "assigns a second camera to row %d, col %d", c->row, c->col);
        if (c->node && o->node && c->node != o->node) /* two nodes of one device */
            continue;
        if (c->serial[0] && !strcmp(o->serial, c->serial))
            fault(p, at, "lists serial %s twice", c->serial);
        if (c->port[0] && !strcmp(o->port, c->port))
            fault(p, at, "lists port %s twice", c->port);
    }
}

/* Formats that GenICam cameras have, and the source of their trigger. */
static void check_genicam(const struct config_load *load)
{
    const struct sst_array_config *a = &load->cfg->array;
    const char *format = sst_array_format_name(a->fourcc);
    const bool gpio = a->source == SST_CONFIG_GPIO || a->source == SST_CONFIG_EXTERNAL;

    if (!sst_array_count(a, SST_CONFIG_GENICAM))
        return;
    if (format && (!strcmp(format, "MJPEG") || !strcmp(format, "YUYV")))
        fault(source(load, "cameras.format", "cameras.bind"), NULL,
              "%s is no format of GenICam cameras; set GREY, Y16, RGB24, RGGB8, GRBG8, GBRG8 or BGGR8", format);
    if (a->source == SST_CONFIG_SOFTWARE && a->genicam.trigger == SST_CONFIG_WIRE)
        fault(source(load, "genicam.trigger", "trigger.source"), NULL,
              "wire needs pulses, but trigger: source software has none: set genicam: trigger to software, action or "
              "none, or trigger: source to gpio or external");
    if (a->source == SST_CONFIG_SOFTWARE && a->genicam.trigger != SST_CONFIG_NONE && !gpio &&
        sst_array_count(a, SST_CONFIG_V4L2))
        fault(source(load, "genicam.trigger", "trigger.source"), NULL,
              "timer ticks cannot expose V4L2 cameras: set trigger: source gpio to expose both kinds together, or "
              "genicam: trigger none");
    if (a->genicam.action_delay_us && !a->genicam.ptp)
        fault(source(load, "genicam.action_delay_us", NULL), NULL,
              "needs genicam: ptp: true, the clock by which cameras execute scheduled actions");
}

/* The number after the last '#', and the bytes before it; 0: there is none. */
static int part_of(const char *name, size_t *device)
{
    const char *mark = strrchr(name, '#');
    const size_t digits = mark ? strspn(mark + 1, "0123456789") : 0;

    *device = mark ? (size_t)(mark - name) : strlen(name);
    return digits >= 1 && digits <= 2 && !mark[1 + digits] ? atoi(mark + 1) : 0;
}

/* Cameras in one picture are bound by device and part, and exposed together. */
static void check_part(const struct config_place *p, const struct sst_yaml_node *at, const struct sst_array_config *a,
                       int i)
{
    const struct sst_config_camera *c = &a->camera[i];
    const char *name = c->serial[0] ? c->serial : c->port;
    int split[2];
    const int parts = sst_array_split(a, split);
    size_t device, other;
    const int part = part_of(name, &device);

    if (parts == 1 || !name[0] || c->kind == SST_CONFIG_GENICAM)
        return;
    if (part < 1 || part > parts) {
        fault(p, at, "has %s, but pictures of cameras: split %s have %d cameras; name one, such as \"%.*s#1\"", name,
              a->split, parts, (int)device, name);
        return;
    }
    for (int k = 0; k < i; k++) {
        const struct sst_config_camera *o = &a->camera[k];
        const char *before = c->serial[0] ? o->serial : o->port;

        if (part_of(before, &other) && other == device && !strncmp(before, name, device) && o->node == c->node &&
            o->line >= 0 && c->line >= 0 && o->line != c->line) {
            fault(p, at, "exposes %s by another line than %s, which is in the same picture", name, before);
            return;
        }
    }
}

static void check_bind(struct config_load *load)
{
    const struct config_place *p = source(load, "cameras.bind", NULL);
    struct sst_array_config *a = &load->cfg->array;
    struct sst_yaml_node *n = elements(p);
    int split[2];
    struct in_addr v4;

    for (int i = 0; n && i < a->bound; i++, n = n->next) {
        struct sst_config_camera *c = &a->camera[i];
        const struct sst_yaml_node *line = sst_yaml_get(n, "line");

        if (n->type != SST_YAML_MAP)
            continue;
        if (i == a->rows * a->cols) {
            fault(p, n, "lists more cameras than the array has positions");
            break;
        }
        if (c->row >= a->rows)
            fault(p, n, "has row %d, but rows are 0..%d", c->row, a->rows - 1);
        if (c->col >= a->cols)
            fault(p, n, "has col %d, but columns are 0..%d", c->col, a->cols - 1);
        if (c->kind == SST_CONFIG_GENICAM && !c->serial[0] && !c->port[0])
            fault(p, n, "needs the camera's serial, or its address as port (sst cameras lists them)");
        if (c->kind == SST_CONFIG_GENICAM && !c->port[strspn(c->port, "0123456789.")] && c->port[0] &&
            inet_pton(AF_INET, c->port, &v4) != 1)
            fault(p, n, "has the port %s, which is no address such as 192.168.1.7", c->port);
        if (c->kind == SST_CONFIG_V4L2 && !c->serial[0] == !c->port[0])
            fault(p, n, "needs either the camera's serial or its port (sst cameras lists them)");
        if (line && *line->text)
            c->line = line_index(a, line->text);
        if (line && *line->text && c->line < 0)
            sst_yaml_unknown(p->doc, line, "trigger line", "add it to trigger: lines");
        check_twice(p, n, a, i);
        check_part(p, n, a, i);
    }
    /* Without `line`, the line of the camera's row exposes it if there is one per row, else the first line. */
    for (int i = 0; i < a->bound; i++)
        if (a->camera[i].line < 0)
            a->camera[i].line = a->lines == a->rows && sst_array_split(a, split) == 1 ? a->camera[i].row : 0;
}

static void check_lengths(const struct config_load *load)
{
    int count;
    const struct sst_key *keys = sst_schema(&count);

    for (int i = 0; i < count; i++) {
        const struct config_place *p = &load->at[i];
        const bool numbers = keys[i].type == SST_KEY_INTS || keys[i].type == SST_KEY_DOUBLES;
        const int want = numbers ? sst_max_int(sst_key_count(&keys[i], load->cfg), 1) : 0;

        if (numbers && p->node && p->node->type == SST_YAML_LIST && p->node->count != want)
            fault(p, NULL, "has %d numbers; give %d, or one for all", p->node->count, want);
    }
}

static void check_rig(const struct config_load *load)
{
    const struct sst_array_config *a = &load->cfg->array;
    bool zero = false, travel = false;

    for (int axis = 0; axis < a->rig_axes; axis++) {
        zero = zero || a->rig_um_per_count[axis] == 0;
        travel = travel || a->rig_travel_min_mm[axis] >= a->rig_travel_max_mm[axis];
    }
    if (zero)
        fault(source(load, "rig.um_per_count", NULL), NULL, "must not be 0");
    if (travel)
        fault(source(load, "rig.travel_min_mm", "rig.travel_max_mm"), NULL,
              "leaves no travel: travel_min_mm must be below travel_max_mm");
}

static void check_hosts(const struct config_load *load)
{
    const struct sst_array_config *a = &load->cfg->array;
    const struct config_place *role = source(load, "role", NULL);
    const bool cameras = a->role == SST_CONFIG_NODE || a->bound;

    if (a->role == SST_CONFIG_SINGLE)
        return;
    if (!a->hosts.ca[0] || !a->hosts.certificate[0] || !a->hosts.key[0])
        fault(role, NULL, "%s needs hosts: ca, certificate and key (docs/use/hosts.md makes them)",
              a->role == SST_CONFIG_NODE ? "node" : "head");
    if (a->role == SST_CONFIG_NODE && !a->hosts.head[0])
        fault(role, NULL, "node needs hosts: head, the address of the head");
    if (a->role == SST_CONFIG_HEAD && !a->hosts.nodes)
        fault(role, NULL, "head needs hosts: nodes, the names of its nodes");
    if (cameras && a->source != SST_CONFIG_GPIO && a->source != SST_CONFIG_EXTERNAL)
        fault(role, NULL,
              "%s needs trigger: source gpio if it fires the trigger, else external: all hosts count its edges",
              a->role == SST_CONFIG_NODE ? "node" : "head");
}

static bool has_edges(struct sst_yaml_node *region)
{
    return sst_yaml_get(region, "x0") || sst_yaml_get(region, "y0") || sst_yaml_get(region, "x1") ||
           sst_yaml_get(region, "y1");
}

/* @return NULL: no fault */
static const char *mask_fault(const struct sst_array_config *a, const struct sst_config_mask *m,
                              struct sst_yaml_node *n)
{
    double x[SST_MASK_POINTS], y[SST_MASK_POINTS];

    if (n->type != SST_YAML_MAP)
        return NULL;
    if (*m->points && has_edges(n))
        return "has both points and edges; give either";
    if (*m->points && sst_mask_corners(m, x, y) == 2)
        return "has two points, which are no region; give more";
    if (!*m->points && m->x0 >= m->x1)
        return "has an x0 that is not below its x1";
    if (!*m->points && m->y0 >= m->y1)
        return "has a y0 that is not below its y1";
    if ((m->row < 0) != (m->col < 0))
        return "needs both row and col of its camera, or neither: the reference view";
    if (m->row >= a->rows || m->col >= a->cols)
        return "names a camera beyond the rows and columns of the array";
    if (m->row >= 0 && (isfinite(m->near_px) || m->far_px != 0))
        return "has a depth, which masks of one camera's frames do not have; leave out near_px and far_px";
    if (m->row < 0 && !isfinite(m->near_px))
        return "is of the reference view and needs near_px, the disparity where the region begins (px per spacing)";
    return m->row < 0 && m->far_px >= m->near_px ? "has a far_px that is not below its near_px" : NULL;
}

/* Time, size and place of a file as one number, which differs when it is written again. 0: there is none. */
static int64_t stamp_of(const char *path)
{
    struct stat st;

    if (stat(path, &st))
        return 0;
    return (int64_t)st.st_mtim.tv_sec * 1000000000 + st.st_mtim.tv_nsec + (int64_t)st.st_size + (int64_t)st.st_ino;
}

static void check_masks(struct config_load *load)
{
    const struct config_place *p = source(load, "privacy.masks", NULL);
    struct sst_array_config *a = &load->cfg->array;
    struct sst_yaml_node *n = elements(p);

    a->mask_calibration[0] = 0;
    a->mask_stamp = 0;
    for (int i = 0; n && i < a->masks; i++, n = n->next) {
        const struct sst_config_mask *m = &a->mask[i];

        if (mask_fault(a, m, n))
            fault(p, n, "has a mask that %s", mask_fault(a, m, n));
        for (int k = 0; k < i; k++)
            if (*m->name && !strcmp(a->mask[k].name, m->name))
                fault(p, n, "has two masks named %s", m->name);
        if (m->row < 0)
            memcpy(a->mask_calibration, load->cfg->live.calibration, sizeof(a->mask_calibration));
    }
    if (a->mask_calibration[0])
        a->mask_stamp = stamp_of(a->mask_calibration);
}

void config_check_array(struct config_load *load)
{
    const struct sst_array_config *a = &load->cfg->array;
    const bool gpio = a->source == SST_CONFIG_GPIO;
    char why[256];

    if (a->rows * a->cols > SST_CAMERAS_MAX)
        fault(source(load, "array.cols", "array.rows"), NULL,
              "gives %d views (%d rows, %d columns), more than the limit of %d", a->rows * a->cols, a->rows, a->cols,
              SST_CAMERAS_MAX);
    if (gpio && !a->lines)
        fault(source(load, "trigger.source", "trigger.lines"), NULL,
              "gpio needs trigger: lines, the names of the lines to pulse (gpioinfo lists them)");
    if (gpio && a->pulse_us * 1e-6 * a->trigger_hz > 0.9)
        fault(source(load, "trigger.pulse_us", "trigger.rate_hz"), NULL,
              "fills more than 90 %% of the trigger period: lower pulse_us or rate_hz");
    if (a->source == SST_CONFIG_EXTERNAL && !a->loopback[0])
        fault(source(load, "trigger.source", "trigger.loopback"), NULL,
              "external needs trigger: loopback, the input on which the edges come (gpioinfo lists lines)");
    if (sst_array_split_fault(a, why, sizeof(why)))
        fault(source(load, "cameras.split", "cameras.width"), NULL, "%s", why);
    check_lengths(load);
    check_bind(load);
    check_genicam(load);
    check_rig(load);
    check_hosts(load);
    check_masks(load);
}

/* --- service ------------------------------------------------------------------------------------------------------ */

/* Keys that only lines have, and keys that they cannot have. @return NULL: no fault */
static const char *line_fault(const struct sst_zone *z)
{
    double x[SST_ZONE_POINTS], y[SST_ZONE_POINTS];
    const int n = sst_zone_corners(z, x, y);

    if (z->line && *z->points && n > 2)
        return "has a line of more than two points; give \"x,y x,y\"";
    if (z->line && !*z->points)
        return "has a line without its two points; give points: \"x,y x,y\"";
    if (z->line && z->mask)
        return "has a line that is a mask; give either";
    if (!z->line && n == 2)
        return "has a zone of two points; give more, or line: true";
    return !z->line && z->direction != SST_LINE_BOTH ? "has a direction but is no line; add line: true" : NULL;
}

static void check_zones(const struct config_load *load)
{
    const struct config_place *p = source(load, "zones", NULL);
    const struct sst_config *c = load->cfg;
    struct sst_yaml_node *n = elements(p);

    for (int i = 0; n && i < c->zones; i++, n = n->next) {
        const struct sst_zone *z = &c->zone[i];

        if (n->type == SST_YAML_MAP && *z->points && has_edges(n))
            fault(p, n, "has a zone with both points and edges; give either");
        else if (n->type == SST_YAML_MAP && !*z->points && z->x0 >= z->x1)
            fault(p, n, "has a zone whose x0 is not below its x1");
        else if (n->type == SST_YAML_MAP && !*z->points && z->y0 >= z->y1)
            fault(p, n, "has a zone whose y0 is not below its y1");
        if (line_fault(z))
            fault(p, n, "%s", line_fault(z));
        if (!(z->far_px < z->near_px))
            fault(p, n, "has a zone whose far_px is not below its near_px");
        for (int k = 0; k < i; k++)
            if (*z->name && !strcmp(c->zone[k].name, z->name))
                fault(p, n, "has two zones named %s", z->name);
    }
}

static int zone_index(const struct sst_config *c, const char *name)
{
    for (int i = 0; i < c->zones; i++)
        if (!strcmp(c->zone[i].name, name))
            return i;
    return -1;
}

static void check_triggers(struct config_load *load)
{
    const struct config_place *p = source(load, "storage.record_on", NULL);
    struct sst_config *c = load->cfg;
    struct sst_yaml_node *n = elements(p);

    for (int i = 0; n && i < c->storage.triggers; i++, n = n->next) {
        const struct sst_yaml_node *zone = sst_yaml_get(n, "zone");

        if (!zone || !*zone->text)
            continue;
        c->storage.trigger[i].zone = zone_index(c, zone->text);
        if (c->storage.trigger[i].zone < 0)
            sst_yaml_unknown(p->doc, zone, "zone", "add it to zones");
        else if (c->zone[c->storage.trigger[i].zone].mask)
            fault(p, zone, "names the zone %s, which is a mask: nothing is noticed there", zone->text);
        else if (c->zone[c->storage.trigger[i].zone].line && !c->storage.trigger[i].visit)
            fault(p, zone, "names the line %s, across which nothing but visits goes; add visit: true", zone->text);
    }
    if (c->storage.reduced == SST_REDUCED_TILES && strcmp(sst_array_format_name(c->array.fourcc), "MJPEG") != 0)
        fault(source(load, "storage.reduced", NULL), NULL, "tiles needs cameras: format: MJPEG; use changed");
    if (c->storage.mode != SST_RECORD_EVENT)
        return;
    p = source(load, "storage.mode", NULL);
    if (!c->storage.triggers)
        fault(p, NULL, "event needs storage: record_on, the list of recording triggers");
    if (!c->live.enabled)
        fault(p, NULL, "event needs live: enabled: true, which detects the events");
}

static void check_hooks(const struct config_load *load)
{
    const struct config_place *p = source(load, "hooks", NULL);
    struct sst_yaml_node *n = elements(p);

    for (int i = 0; n && i < load->cfg->hooks; i++, n = n->next) {
        const struct sst_yaml_node *run = sst_yaml_get(n, "run");
        const char *program = load->cfg->hook[i].argv[0];
        struct stat st;

        if (!run || run->type != SST_YAML_LIST)
            continue;
        if (!run->count)
            fault(p, run, "must begin with the program's path");
        else if (!*program)
            continue; /* already reported */
        else if (*program != '/')
            fault(p, run->first, "must begin with the program's absolute path such as /usr/bin/..., not %.60s",
                  program);
        else if (stat(program, &st))
            fault(p, run->first, "names the program %.100s, which cannot be found: %s", program, strerror(errno));
        else if (!S_ISREG(st.st_mode) || access(program, X_OK))
            fault(p, run->first, "names %.100s, which is not an executable file; chmod +x makes it one", program);
    }
}

static bool is_loopback(const char *address)
{
    return !strncmp(address, "127.", 4) || !strcmp(address, "::1");
}

/* A name may begin with a number, too. */
static bool is_local_host(const char *host)
{
    struct in_addr v4;

    return !strcasecmp(host, "localhost") || !strcmp(host, "::1") ||
           (is_loopback(host) && inet_pton(AF_INET, host, &v4) == 1);
}

static bool is_any(const char *address)
{
    return !strcmp(address, "0.0.0.0") || !strcmp(address, "::");
}

static bool share_port(const char *a, int a_port, const char *b, int b_port)
{
    return a_port && a_port == b_port && (!strcmp(a, b) || is_any(a) || is_any(b));
}

/* Recorders ask for the picture here and fetch it from rtsp, with one account. */
static void check_onvif(const struct config_load *load)
{
    const struct sst_config *c = load->cfg;

    if (!c->onvif.user[0] != !c->onvif.password_file[0])
        fault(source(load, "onvif.user", "onvif.password_file"), NULL, "needs both user and password_file");
    if (!c->onvif.enabled)
        return;
    if (!c->rtsp.enabled)
        fault(source(load, "onvif.enabled", NULL), NULL, "needs rtsp: enabled: true, whose stream it offers");
    else if (!c->rtsp.port)
        fault(source(load, "rtsp.port", "onvif.enabled"), NULL, "must be a fixed one, which onvif names to recorders");
    if (!is_loopback(c->onvif.address) && !c->onvif.user[0] && !c->rtsp.user[0] && !c->rtsp.insecure)
        fault(source(load, "onvif.address", NULL), NULL,
              "%s is open to the network: set rtsp: user and password_file, or rtsp: insecure: true",
              c->onvif.address);
    if (c->rtsp.enabled && share_port(c->onvif.address, c->onvif.port, c->rtsp.address, c->rtsp.port))
        fault(source(load, "onvif.port", "rtsp.port"), NULL, "%d is the port of both onvif and rtsp; choose different ones",
              c->onvif.port);
    if (c->web.enabled && share_port(c->onvif.address, c->onvif.port, c->web.address, c->web.port))
        fault(source(load, "onvif.port", "web.port"), NULL, "%d is the port of both onvif and web; choose different ones",
              c->onvif.port);
    if (c->onvif.host[strcspn(c->onvif.host, " /@?#<>&\"'")])
        fault(source(load, "onvif.host", NULL), NULL, "must be an address or a name, without scheme and path");
}

/* As capture/access/access.h names them. */
static bool is_right(const char *word)
{
    return !strcmp(word, "view") || !strcmp(word, "snapshot") || !strcmp(word, "recordings") ||
           !strcmp(word, "control");
}

/* Host name or address; IPv6 addresses alone have colons, at least two. */
static bool is_host(const char *host)
{
    return host[0] && !host[strcspn(host, " /@?#<>&\"'[]")] && (!strchr(host, ':') || strchr(host, ':') != strrchr(host, ':'));
}

static void check_push(const struct config_load *load)
{
    const struct sst_config *c = load->cfg;

    for (int i = 0; i < c->push.hosts; i++)
        if (!is_host(c->push.host[i]))
            fault(source(load, "push.hosts", NULL), NULL, "must be names such as push.example.org, without scheme, port and path");
    if (c->push.contact[0] && strncmp(c->push.contact, "mailto:", 7) != 0 && strncmp(c->push.contact, "https://", 8) != 0)
        fault(source(load, "push.contact", NULL), NULL, "must begin with mailto: or https://, such as mailto:guard@example.org");
}

/* Names and addresses stand alone: brackets are of addresses of the web, where a port follows. */
static void check_host_names(const struct config_load *load)
{
    const struct sst_config *c = load->cfg;
    const struct {
        const char *key, *host;
    } named[] = { { "mqtt.host", c->mqtt.host }, { "web.host", c->web.host } };

    for (size_t i = 0; i < ARRAY_LEN(named); i++)
        if (named[i].host[0] && !is_host(named[i].host))
            fault(source(load, named[i].key, NULL), NULL,
                  "must be a name or an address, such as host.example.org or fd00::5, without scheme, brackets, port and path");
}

static void check_sockets(const struct config_load *load)
{
    const struct sst_config *c = load->cfg;
    const bool tls = c->web.tls_certificate[0] && c->web.tls_key[0];
    const bool password = c->rtsp.user[0] && c->rtsp.password_file[0];

    if (strlen(c->control.socket) >= sizeof(((struct sockaddr_un *)0)->sun_path))
        fault(source(load, "control.socket", NULL), NULL,
              "is longer than 107 bytes, the limit for the path of a socket");
    if (!c->web.tls_certificate[0] != !c->web.tls_key[0])
        fault(source(load, "web.tls_certificate", "web.tls_key"), NULL, "needs both tls_certificate and tls_key");
    for (int i = 0; i < c->proxy.rights; i++)
        if (!is_right(c->proxy.right[i]))
            fault(source(load, "proxy.rights", NULL), NULL, "has %s, which is none of view, snapshot, recordings, control",
                  c->proxy.right[i]);
    if (c->proxy.addresses && (!c->proxy.rights || !c->proxy.user_header[0]))
        fault(source(load, "proxy.addresses", NULL), NULL, "needs user_header and rights as well");
    if (!c->rtsp.user[0] != !c->rtsp.password_file[0])
        fault(source(load, "rtsp.user", "rtsp.password_file"), NULL, "needs both user and password_file");
    if (c->mqtt.password_file[0] && !c->mqtt.user[0])
        fault(source(load, "mqtt.password_file", NULL), NULL, "needs mqtt: user as well");
    if (c->web.enabled && !is_loopback(c->web.address) && !tls && !c->web.insecure)
        fault(source(load, "web.address", NULL), NULL,
              "%s is open to the network: set tls_certificate and tls_key, or insecure: true", c->web.address);
    if (c->rtsp.enabled && !is_loopback(c->rtsp.address) && !password && !c->rtsp.insecure)
        fault(source(load, "rtsp.address", NULL), NULL,
              "%s is open to the network: set user and password_file, or insecure: true", c->rtsp.address);
    check_host_names(load);
    if (c->mqtt.enabled && !is_local_host(c->mqtt.host) && !c->mqtt.ca_file[0] && !c->mqtt.insecure)
        fault(source(load, "mqtt.host", "mqtt.enabled"), NULL,
              "%.100s is another machine: pictures, commands and the password would go there unencrypted; set ca_file "
              "(TLS), or insecure: true",
              c->mqtt.host);
    if (c->web.enabled && c->rtsp.enabled && share_port(c->web.address, c->web.port, c->rtsp.address, c->rtsp.port))
        fault(source(load, "rtsp.port", "web.port"), NULL, "%d is the port of both web and rtsp; choose different ones",
              c->rtsp.port);
    if (c->web.streams > c->web.clients)
        fault(source(load, "web.streams", "web.clients"), NULL,
              "must not exceed clients (%d), which includes the streams", c->web.clients);
}

/* --- amounts ------------------------------------------------------------------------------------------------------ */

/* Bytes per second of the whole array; `jpeg_bytes` is the size of a compressed pixel. */
static double array_rate(const struct sst_array_config *a, double jpeg_bytes)
{
    const char *format = sst_array_format_name(a->fourcc);
    const bool jpeg = format && !strcmp(format, "MJPEG"),
               two = format && (!strcmp(format, "YUYV") || !strcmp(format, "Y16")),
               rgb = format && !strcmp(format, "RGB24");
    const double hz = sst_array_sets_hz(a);

    return (a->bound ? a->bound : a->rows * a->cols) * hz * a->width * a->height * (jpeg ? jpeg_bytes : two ? 2 : rgb ? 3 : 1);
}

/* Cameras that stand anywhere: no lattice, no labels, no visits. */
static void check_poses(const struct config_load *load)
{
    const struct sst_config *c = load->cfg;
    const struct sst_live_settings *l = &c->live;

    if (l->near_m > 0 && l->far_m > 0 && l->near_m >= l->far_m)
        fault(source(load, "live.near_m", "live.far_m"), NULL, "must be below far_m");
    if (l->surface_m > 0 && l->near_m >= l->surface_m)
        fault(source(load, "live.near_m", "live.surface_m"), NULL, "must be below surface_m");
    if (l->surface_m > 0 && l->far_m > 0 && l->far_m <= l->surface_m)
        fault(source(load, "live.far_m", "live.surface_m"), NULL, "must be above surface_m");
    if (!l->poses[0])
        return;
    if (l->calibration[0])
        fault(source(load, "live.poses", NULL), NULL,
              "is for cameras that stand anywhere, calibration for a lattice; give either");
    for (int i = 0; i < c->storage.triggers; i++)
        if (c->storage.trigger[i].label[0] || c->storage.trigger[i].visit)
            fault(source(load, "storage.record_on", NULL), NULL,
                  "has a label or visit, which cameras with live: poses do not notice; changes and zones remain");
    for (int i = 0; i < c->array.masks; i++)
        if (c->array.mask[i].row < 0)
            fault(source(load, "privacy.masks", NULL), NULL,
                  "has a mask of the reference view, which cameras with live: poses do not have; give row and col");
    for (int i = 0; i < c->zones; i++)
        if (c->zone[i].line || isfinite(c->zone[i].near_px) || isfinite(c->zone[i].far_px))
            fault(source(load, "zones", NULL), NULL,
                  "has a line or a depth, which cameras with live: poses do not notice; give a zone of all depths");
}

void config_check_service(struct config_load *load)
{
    const struct sst_config *c = load->cfg;
    const double segment = array_rate(&c->array, 0.1) * c->storage.segment_s; /* of strongly compressed frames */

    check_zones(load);
    check_triggers(load);
    check_hooks(load);
    check_sockets(load);
    check_onvif(load);
    check_push(load);
    check_poses(load);
    if (c->live.white_level ? c->live.black_level >= c->live.white_level : c->live.black_level > 0)
        fault(source(load, "live.black_level", "live.white_level"), NULL, "must be below white_level");
    if (c->live.range_min_px > c->live.range_max_px)
        fault(source(load, "live.range_min_px", "live.range_max_px"), NULL, "must not exceed range_max_px");
    if (c->live.sigma_px > 0 && c->live.sigma_px < 1e-6)
        fault(source(load, "live.sigma_px", NULL), NULL, "must be 0 or at least 0.000001");
    if (c->storage.quota_gb > 0 && c->storage.quota_gb * 1e9 < segment)
        fault(source(load, "storage.quota_gb", NULL), NULL,
              "is smaller than one segment of %g s, at least %.2g GB; raise it or lower segment_s",
              c->storage.segment_s, segment / 1e9);
}

static void warn(const struct config_place *p, const char *text)
{
    if (p->node)
        sst_log_warning("%s:%d:%d: %s", sst_yaml_name(p->doc), p->node->line, p->node->column, text);
    else
        sst_log_warning("configuration: %s", text);
}

void config_warn(const struct config_load *load)
{
    const struct sst_config *c = load->cfg;
    const double need_mb = array_rate(&c->array, 0.33) * c->storage.preroll_s / (1 << 20);
    int count;
    const struct sst_key *keys = sst_schema(&count);
    char text[SST_CONFIG_TEXT_MAX + 100];

    if (need_mb > c->storage.ring_mb) {
        snprintf(text, sizeof(text),
                 "preroll_s %g of %d cameras needs about %.0f MB, more than ring_mb (%d); raise ring_mb, or recordings "
                 "begin later",
                 c->storage.preroll_s, c->array.bound ? c->array.bound : c->array.rows * c->array.cols, need_mb,
                 c->storage.ring_mb);
        warn(source(load, "storage.preroll_s", "storage.ring_mb"), text);
    }
    if (!c->live.poses[0] && (c->live.surface_m > 0 || c->live.near_m > 0 || c->live.far_m > 0))
        warn(source(load, "live.surface_m", "live.near_m"),
             "surface_m, near_m and far_m are of live: poses, which is not set; they change nothing");
    for (int i = 0; i < count; i++) {
        const char *file = (const char *)c + keys[i].offset;

        if (keys[i].type != SST_KEY_TEXT || keys[i].kind != SST_TEXT_FILE || !*file || sst_path_exists(file))
            continue;
        snprintf(text, sizeof(text), "%s: %s: %s does not exist", keys[i].section, keys[i].name, file);
        warn(&load->at[i], text);
    }
}

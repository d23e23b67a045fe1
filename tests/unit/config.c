/* The service's configuration: the shipped file, the table, parts in conf.d, faults with places, differences. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "base/yaml.h"
#include "config/schema.h"
#include "tests/folder.h"
#include "tests/test.h"

static struct sst_config cfg, other;
static char said[8192];

/* --- files -------------------------------------------------------------------------------------------------------- */

static int setup(void **state)
{
    sst_config_defaults(&cfg);
    return test_folder_create(state);
}

/* A file of the test's folder; with a '/' in its name in a subfolder. */
static void put(const char *name, const char *text)
{
    char path[SST_PATH_MAX], *slash;
    FILE *f;

    snprintf(path, sizeof(path), "%s/%s", test_folder, name);
    slash = strchr(path + strlen(test_folder) + 1, '/');
    if (slash) {
        *slash = 0;
        (void)mkdir(path, 0755);
        *slash = '/';
    }
    f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
}

/* Read it; all that was said on standard error is kept. */
static int read_back(struct sst_config *c, const char *name)
{
    FILE *kept = tmpfile();
    const int before = dup(2);
    int err;
    size_t n;

    assert_non_null(kept);
    fflush(stderr);
    dup2(fileno(kept), 2);
    err = sst_config_read(c, test_path("%s", name));
    fflush(stderr);
    dup2(before, 2);
    close(before);
    rewind(kept);
    n = fread(said, 1, sizeof(said) - 1, kept);
    said[n] = 0;
    fclose(kept);
    return err;
}

static void refuse(const char *text, const char *words)
{
    put("c.yaml", text);
    other = cfg;
    if (read_back(&cfg, "c.yaml") != -EBADMSG)
        fail_msg("taken: %s", text);
    assert_memory_equal(&cfg, &other, sizeof(cfg));
    assert_contains(said, words);
}

static void accept(const char *text)
{
    put("c.yaml", text);
    sst_config_defaults(&cfg);
    if (read_back(&cfg, "c.yaml"))
        fail_msg("refused: %s: %s", text, said);
}

/* --- the shipped file --------------------------------------------------------------------------------------------- */

/* The file with its examples in place of empty sections: "#-" and "#name" lose the mark. */
static char *with_examples(void)
{
    char *text, *out;
    size_t size, n = 0, opener = 0;

    assert_int_equal(sst_file_read("config/sstd.yaml", 1 << 20, (uint8_t **)&text, &size), 0);
    out = malloc(size + 1);
    assert_non_null(out);
    for (char *line = strtok(text, "\n"); line; line = strtok(NULL, "\n")) {
        char *mark = line + strspn(line, " "), *empty;

        if (*mark == '#' && mark[1] != ' ' && mark[1]) {
            *mark = ' ';
            empty = strpbrk(out + opener, "[{");
            if (empty && (empty[1] == ']' || empty[1] == '}') && empty < out + n)
                empty[0] = empty[1] = ' ';
        } else {
            opener = n;
        }
        n += (size_t)sprintf(out + n, "%s\n", line);
    }
    free(text);
    return out;
}

static void shipped_file_is_the_defaults(void **state)
{
    (void)state;
    sst_config_defaults(&cfg);
    other = cfg;
    assert_int_equal(sst_config_read(&other, "config/sstd.yaml"), 0);
    assert_memory_equal(&cfg, &other, sizeof(cfg));
}

static void shipped_file_has_every_key(void **state)
{
    char *text = with_examples();
    struct sst_yaml *doc;
    struct sst_yaml_node *root;
    int count;
    const struct sst_key *keys = sst_schema(&count);

    (void)state;
    put("c.yaml", text);
    sst_config_defaults(&cfg);
    if (read_back(&cfg, "c.yaml")) /* also: no key that the table lacks */
        fail_msg("%s", said);
    assert_int_equal(sst_yaml_parse(&doc, text, strlen(text), "sstd.yaml"), 0);
    root = sst_yaml_root(doc);
    for (int i = 0; i < count; i++) {
        struct sst_yaml_node *n = *keys[i].section ? sst_yaml_get(root, keys[i].section) : root;
        bool there;

        n = sst_yaml_get(n, keys[i].name);
        if (!n)
            fail_msg("%s.%s is not in config/sstd.yaml", keys[i].section, keys[i].name);
        for (int f = 0; f < keys[i].n_fields; f++) {
            there = false;
            for (struct sst_yaml_node *e = n->first; e; e = e->next)
                there = there || sst_yaml_get(e, keys[i].fields[f].name);
            if (!there)
                fail_msg("no example of %s in %s of config/sstd.yaml", keys[i].fields[f].name, keys[i].name);
        }
    }
    sst_yaml_destroy(doc);
    free(text);
    assert_int_equal(cfg.array.controls, 3);
    assert_int_equal(cfg.zones, 3);
    assert_int_equal(cfg.storage.triggers, 3);
    assert_int_equal(cfg.hooks, 2);
    assert_string_equal(cfg.hook[0].argv[3], "a camera was lost");
    assert_string_equal(cfg.hook[0].argv[4], "");
}

/* --- values ------------------------------------------------------------------------------------------------------- */

static void defaults_are_sensible(void **state)
{
    (void)state;
    sst_config_defaults(&cfg);
    assert_true(cfg.live.enabled && cfg.live.skip_change && cfg.live.skip_labels && isnan(cfg.live.focus_px));
    assert_true(cfg.live.plane_mm < 0 && cfg.live.c1 == 0.005 && cfg.live.jpeg_quality == 85);
    assert_string_equal(cfg.control.socket, "/run/sst/control.sock");
    assert_string_equal(cfg.control.group, "sst");
    assert_true(cfg.web.enabled && cfg.web.port == 8090 && cfg.web.clients == 64 && cfg.web.streams == 32);
    assert_true(cfg.web.stream_hz == 10 && cfg.web.views == 4 && !cfg.web.insecure);
    assert_string_equal(cfg.web.address, "127.0.0.1");
    assert_string_equal(cfg.storage.dir, "/var/lib/sst");
    assert_true(cfg.storage.mode == SST_RECORD_OFF && cfg.storage.min_free_gb == 2 && cfg.storage.ring_mb == 512);
    assert_true(!cfg.rtsp.enabled && cfg.rtsp.port == 8554 && cfg.rtsp.codec == SST_RTSP_H264);
    assert_true(!cfg.mqtt.enabled && cfg.mqtt.port == 1883);
    assert_int_equal(cfg.array.rig_unit[2], 3);
    assert_true(cfg.array.rig_travel_max_mm[1] == 400);
}

static void values_arrive(void **state)
{
    (void)state;
    accept("array: { rows: 2, cols: 2 }\n"
           "live: { enabled: true, focus_px: 7.25, plane_mm: 3000, range_min_px: -1, range_max_px: 30, c1: 1e-2 }\n"
           "zones:\n"
           "  - { name: gate, x0: 0, y0: 0.25, x1: 0.5, y1: 1 }\n"
           "  - { name: yard, x0: 0.5, y0: 0, x1: 1, y1: 1 }\n"
           "control: { group: \"\", socket: /tmp/s }\n"
           "web: { address: \"::1\", port: 0 }\n"
           "rtsp: { enabled: true, codec: mjpeg }\n"
           "storage:\n"
           "  mode: event\n"
           "  record_on:\n"
           "    - { zone: yard, label: Pedestrian, share: 0.5, end_s: 20 }\n"
           "    - { visit: true }\n"
           "mqtt: { enabled: true, host: broker, insecure: true, topic: site/sst, discovery: \"\" }\n"
           "hooks: [ { event: motion, run: [/bin/sh, -c, 'echo \"$SST_ZONE\"'] } ]\n");
    assert_true(cfg.live.focus_px == 7.25 && cfg.live.plane_mm == 3000 && cfg.live.c1 == 0.01);
    assert_int_equal(cfg.zones, 2);
    assert_string_equal(cfg.zone[1].name, "yard");
    assert_true(cfg.zone[0].y0 == 0.25 && cfg.zone[1].x1 == 1);
    assert_string_equal(cfg.control.group, "");
    assert_true(cfg.storage.mode == SST_RECORD_EVENT && cfg.storage.triggers == 2 && cfg.rtsp.codec == SST_RTSP_MJPEG);
    assert_int_equal(cfg.storage.trigger[0].zone, 1);
    assert_true(cfg.storage.trigger[0].share == 0.5 && cfg.storage.trigger[0].end_s == 20);
    assert_true(cfg.storage.trigger[1].begin_s == 0.3 && cfg.storage.trigger[1].end_s == 1);
    assert_int_equal(cfg.storage.trigger[1].zone, -1);
    assert_true(cfg.storage.trigger[1].visit && !cfg.storage.trigger[0].visit);
    assert_true(cfg.storage.trigger[1].share == 0.01 && !*cfg.storage.trigger[1].label);
    assert_string_equal(cfg.hook[0].argv[2], "echo \"$SST_ZONE\"");
    accept("");                                 /* nothing at all */
    accept("# live:\n#   c1: 7\n");             /* nothing but comments */
    accept("live:\n  # c1: 7\nzones:\n  []\n"); /* a section with nothing in it */
}

static void parts_replace_key_by_key(void **state)
{
    (void)state;
    put("s/sstd.yaml", "array: { rows: 2, cols: 3 }\n"
                       "trigger: { source: gpio, lines: [A, B], delay_us: [1, 2] }\n"
                       "cameras:\n"
                       "  controls: { gain: 1, exposure: 2 }\n"
                       "  bind: [ { row: 0, col: 0, serial: X, line: B }, { row: 1, col: 2, serial: Y } ]\n"
                       "web: { port: 1000, host: a.example }\n"
                       "zones: [ { name: a, x0: 0, y0: 0, x1: 1, y1: 1 }, { name: b, x0: 0, y0: 0, x1: 1, y1: 1 } ]\n"
                       "storage: { record_on: [ { zone: a } ] }\n");
    assert_int_equal(mkdir(test_path("s/conf.d"), 0755), 0);
    sst_config_defaults(&cfg);
    assert_int_equal(read_back(&cfg, "s/sstd.yaml"), 0); /* an empty folder is none */
    assert_int_equal(cfg.zones, 2);
    for (int i = 0; i < 4; i++) {
        static const char *const names[] = { "s/conf.d/90-late.yaml", "s/conf.d/10-early.yaml", "s/conf.d/.hidden.yaml",
                                             "s/conf.d/no.yaml~" };
        static const char *const texts[] = { "web: { port: 3000 }\ncameras: { controls: { gain: 9 } }\n",
                                             "web: { port: 2000, address: \"::1\" }\n"
                                             "trigger: { lines: [B, A] }\n"
                                             "zones: [ { name: a, x0: 0.5, y0: 0, x1: 1, y1: 1 } ]\n",
                                             "rubbish", "rubbish" };

        assert_int_equal(sst_file_write(test_path("%s", names[i]), texts[i], strlen(texts[i])), 0);
    }
    sst_config_defaults(&cfg);
    if (read_back(&cfg, "s/sstd.yaml"))
        fail_msg("%s", said);
    assert_int_equal(cfg.web.port, 3000);
    assert_string_equal(cfg.web.address, "::1");
    assert_string_equal(cfg.web.host, "a.example");
    assert_int_equal(cfg.zones, 1);
    assert_true(cfg.zone[0].x0 == 0.5);
    assert_int_equal(cfg.storage.trigger[0].zone, 0);
    assert_int_equal(cfg.array.controls, 2);
    assert_int_equal(cfg.array.control[0].value, 9);
    assert_int_equal(cfg.array.camera[0].line, 0); /* B comes first in the lines that count */
    assert_int_equal(cfg.array.camera[1].line, 1); /* the line of its row */
}

/* --- faults ------------------------------------------------------------------------------------------------------- */

static void single_faults_are_told(void **state)
{
    static const char *const bad[][2] = {
        { "web: { prot: 1 }\n", "c.yaml:1:8: unknown key `prot`; did you mean `port`?" },
        { "wbe: {}\n", "did you mean `web`?" },
        { "cameras: { bind: [ { row: 0, col: 0, kind: genicam, serial: A } ] }\n", "MJPEG is no format of GenICam cameras" },
        { "cameras: { format: GREY, bind: [ { row: 0, col: 0, kind: genicam } ] }\n", "or its address as port" },
        { "cameras: { format: GREY, bind: [ { row: 0, col: 0, kind: genicam, port: 10.0.0.300 } ] }\n",
          "has the port 10.0.0.300, which is no address" },
        { "cameras: { format: GREY, bind: [ { row: 0, col: 0, kind: genicam, serial: A } ] }\n"
          "trigger: { source: software }\n",
          "wire needs pulses" },
        { "cameras: { format: GREY, bind: [ { row: 0, col: 0, kind: genicam, serial: A }, { row: 0, col: 1, serial: B } ] }\n"
          "trigger: { source: software }\ngenicam: { trigger: action }\n",
          "timer ticks cannot expose V4L2 cameras" },
        { "cameras: { format: GREY, bind: [ { row: 0, col: 0, kind: genicam, port: 10.0.0.7 } ] }\n"
          "genicam: { action_delay_us: 500 }\n",
          "needs genicam: ptp: true" },
        { "cameras: { bind: [ { row: 0, col: 0, kind: genicm, serial: A } ] }\n", "genicam" },
        { "hook: []\n", "did you mean `hooks`?" },
        { "web: 5\n", "1:6: web must contain keys" },
        { "live: [ { name: a } ]\n", "1:7: live must contain keys" },
        { "zones: {}\n", "zones must be a list" },
        { "zones: [ 1 ]\n", "list of mappings such as - { name: ... }" },
        { "live: { enabled: no }\n", "must be false or true, not no" },
        { "live: { enabled: on }\n", "must be false or true, not on" },
        { "live: { threads: 012 }\n", "1:18: threads must be a whole number in 0..256, not 012" },
        { "live: { c1: 00.5 }\n", "c1 must be a number in 0..1, not 00.5" },
        { "live: { c1: nan }\n", "c1 must be a number" },
        { "live: { focus_px: .inf }\n", "focus_px must be a number" },
        { "live: { focus_px: 1e999 }\n", "focus_px must be a number" },
        { "live: { range_min_px: 3, range_max_px: 2 }\n", "range_min_px must not exceed" },
        { "live: { near_m: 30, far_m: 20 }\n", "near_m must be below far_m" },
        { "live: { surface_m: 0 }\n", "surface_m" },
        { "live: { surface_m: 20, near_m: 30 }\n", "near_m must be below surface_m" },
        { "live: { surface_m: 20, far_m: 20 }\n", "far_m must be above surface_m" },
        { "live: { poses: /a/pole.lf, calibration: /a/calib.yaml }\n", "poses is for cameras that stand anywhere" },
        { "live: { poses: /a/pole.lf }\nstorage: { record_on: [{ label: Car }] }\n", "record_on has a label or visit" },
        { "live: { poses: /a/pole.lf }\nzones: [{ name: a, near_px: 9 }]\n", "zones has a line or a depth" },
        { "live: { sigma_px: 1e-9 }\n", "sigma_px must be 0 or" },
        { "live: { calibration: calib.yaml }\n", "must be an absolute path" },
        { "control: { group: ~ }\n", "write \"\" for none" },
        { "control: { group: no }\n", "put no in quotes" },
        { "control: { socket: run/s }\n", "must be an absolute path" },
        { "web: { address: localhost }\n", "must be a numeric address such as 127.0.0.1" },
        { "web: { address: 10.0.0.1 }\n", "1:17: address 10.0.0.1 is open to the network" },
        { "web: { url: cam.example }\n", "must be an address such as https://cam.example/" },
        { "web: { url: 'https://cam.example/?a=b' }\n", "without ? and #" },
        { "web: { url: 'javascript://x' }\n", "must be an address such as" },
        { "web: { tls_key: /etc/hosts }\n", "needs both tls_certificate and tls_key" },
        { "web: { clients: 3 }\n", "must not exceed clients (3)" },
        { "web: { port: 65536 }\n", "0..65535" },
        { "web: { port: 8554 }\nrtsp: { enabled: true }\n", "1:14: port 8554 is the port of both web and rtsp" },
        { "rtsp: { enabled: true, port: 8090 }\n", "1:30: port 8090 is the port of both web and rtsp" },
        { "rtsp: { enabled: true, address: \"::\" }\n", "open to the network" },
        { "rtsp: { user: me }\n", "needs both user and password_file" },
        { "onvif: { enabled: true }\n", "1:19: enabled needs rtsp: enabled: true" },
        { "rtsp: { enabled: true, port: 0 }\nonvif: { enabled: true }\n", "port must be a fixed one" },
        { "rtsp: { enabled: true }\nonvif: { enabled: true, address: 0.0.0.0 }\n", "open to the network" },
        { "rtsp: { enabled: true }\nonvif: { enabled: true, port: 8554 }\n", "port 8554 is the port of both onvif and rtsp" },
        { "rtsp: { enabled: true }\nonvif: { enabled: true, port: 8090 }\n", "port 8090 is the port of both onvif and web" },
        { "onvif: { user: me }\n", "needs both user and password_file" },
        { "push: { contact: me@example.org }\n", "1:18: contact must begin with mailto:" },
        { "push: { hosts: [\"https://push.example.org\"] }\n", "hosts must be names such as push.example.org" },
        { "rtsp: { enabled: true }\nonvif: { enabled: true, host: \"http://a/\" }\n", "without scheme and path" },
        { "rtsp: { codec: h265 }\n", "must be h264 or mjpeg, not h265" },
        { "mqtt: { enabled: true, host: broker.example.org, user: me, password_file: /etc/hosts }\n",
          "1:30: host broker.example.org is another machine" },
        { "mqtt: { enabled: true, host: 192.0.2.1 }\n", "set ca_file (TLS), or insecure: true" },
        { "mqtt: { enabled: true, host: 127.example.org }\n", "is another machine" },
        { "mqtt: { host: \"[::1]\" }\n", "1:15: host must be a name or an address, such as host.example.org or fd00::5, without" },
        { "mqtt: { host: mqtt://broker }\n", "without scheme" },
        { "web: { host: \"cam.example:8090\" }\n", "without scheme, brackets, port" },
        { "mqtt: { topic: a/# }\n", "without spaces" },
        { "mqtt: { topic: a/ }\n", "outer slashes" },
        { "mqtt: { password_file: /etc/hosts }\n", "needs mqtt: user" },
        { "zones: [ { name: A, x0: 0, y0: 0, x1: 1, y1: 1 } ]\n", "must be a name of a-z" },
        { "zones: [ { name: a, x0: 0, y0: 0, x1: 1.1, y1: 1 } ]\n", "x1 must be a number in 0..1" },
        { "zones: [ { name: a, x0: 1, y0: 0, x1: 1, y1: 1 } ]\n", "x0 is not below" },
        { "zones: [ { x0: 0 } ]\n", "lacks the key `name`" },
        { "zones: [ { name: a, points: \"0,0 1,0\" } ]\n", "has a zone of two points" },
        { "zones: [ { name: a, points: \"0,0 0,0.005\", line: true } ]\n", "must be 3 to 16 points" },
        { "zones: [ { name: a, line: true } ]\n", "has a line without its two points" },
        { "zones: [ { name: a, points: \"0,0 1,0 1.1,1\" } ]\n", "must be 3 to 16 points" },
        { "zones: [ { name: a, points: \"0,0 0.5,0 1,0\" } ]\n", "that enclose an area" },
        { "zones: [ { name: a, x0: 0, points: \"0,0 1,0 1,1\" } ]\n", "both points and edges" },
        { "zones: [ { name: a, near_px: 3, far_px: 3 } ]\n", "far_px is not below its near_px" },
        { "zones: [ { name: a, mask: true } ]\nstorage: { record_on: [ { zone: a } ] }\n", "which is a mask" },
        { "zones: [ { name: a, x0: 0, y0: 0, x1: 1, y1: 1 }, { name: a, x0: 0, y0: 0, x1: 1, y1: 1 } ]\n",
          "two zones named a" },
        { "storage: { record_on: [ { zone: gate } ] }\n", "1:33: unknown zone `gate`" },
        { "storage: { record_on: [ { share: 0 } ] }\n", "share must be a number" },
        { "storage: { record_on: [ { end_s: 0 } ] }\n", "end_s must be a number" },
        { "storage: { mode: event }\n", "event needs storage: record_on" },
        { "live: { enabled: false }\nstorage: { mode: event, record_on: [ {} ] }\n", "event needs live" },
        { "storage: { quota_gb: 0.1 }\n", "is smaller than one segment" },
        { "storage: { dir: here }\n", "must be an absolute path" },
        { "hooks: [ { event: motion } ]\n", "lacks the key `run`" },
        { "hooks: [ { event: motion, run: [] } ]\n", "must begin with the program's path" },
        { "hooks: [ { event: motion, run: [logger] } ]\n", "1:33: run must begin with the program's absolute path" },
        { "hooks: [ { event: motion, run: [/nonexistent/x] } ]\n", "cannot be found" },
        { "hooks: [ { event: motion, run: [/etc/passwd] } ]\n", "not an executable file" },
        { "hooks: [ { event: motion, run: [/tmp] } ]\n", "not an executable file" },
        { "hooks: [ { event: movement, run: [/bin/sh] } ]\n", "camera-lost, camera-found" },
        { "hooks: [ { event: motion, run: /bin/sh } ]\n", "run must be a list" },
        { "trigger: { source: gpio, lines: [A, B], delay_us: [1, 2, 3] }\n", "has 3 numbers; give 2" },
        { "rig: { um_per_count: 0 }\n", "must not be 0" },
    };

    (void)state;
    sst_config_defaults(&cfg);
    for (size_t i = 0; i < ARRAY_LEN(bad); i++)
        refuse(bad[i][0], bad[i][1]);
}

/* Also faults of values that another file replaces, and of all files at once. */
static void all_faults_of_all_files_are_told(void **state)
{
    (void)state;
    put("a.yaml", "web: { port: x }\nlive: { c1: 2 }\nzonse: []\n");
    put("conf.d/10.yaml", "web: { port: 1 }\nlive: { c2: -1 }\n");
    put("conf.d/20.yaml", "storage: { record_on: [ { zone: z } ] }\nrtsp:\n  - 1\n");
    sst_config_defaults(&cfg);
    assert_int_equal(read_back(&cfg, "a.yaml"), -EBADMSG);
    assert_contains(said, "a.yaml:1:14: port");
    assert_contains(said, "a.yaml:2:13: c1");
    assert_contains(said, "a.yaml:3:1: unknown key `zonse`; did you mean `zones`?");
    assert_contains(said, "conf.d/10.yaml:2:13: c2");
    assert_contains(said, "conf.d/20.yaml:1:33: unknown zone");
    assert_contains(said, "conf.d/20.yaml:3:3: rtsp must contain keys");
    put("conf.d/15.yaml", "a: [\n"); /* no YAML: the others are told all the same */
    assert_int_equal(read_back(&cfg, "a.yaml"), -EBADMSG);
    assert_contains(said, "conf.d/15.yaml:2:1: invalid YAML");
    assert_contains(said, "a.yaml:1:14: port");
    assert_contains(said, "conf.d/10.yaml:2:13: c2");
    sst_path_remove_tree(test_path("conf.d"));
    assert_int_equal(read_back(&cfg, "missing.yaml"), -ENOENT);
}

static void what_is_odd_is_warned_of(void **state)
{
    (void)state;
    accept("storage: { ring_mb: 64 }\n");
    assert_contains(said, "warning: ");
    assert_contains(said, "c.yaml:1:21: preroll_s 5 of 36 cameras needs about 174 MB, more than ring_mb (64)");
    accept("live: { calibration: /nonexistent/calib.yaml }\n");
    assert_contains(said, "/nonexistent/calib.yaml does not exist");
    accept("live: { surface_m: 30 }\n");
    assert_contains(said, "c.yaml:1:20: surface_m, near_m and far_m are of live: poses, which is not set");
    accept("storage: { quota_gb: 1 }\n");
    assert_string_equal(said, "");
}

/* A service starts after an upgrade with the keys of an earlier version. */
static void retired_keys_are_warned_of(void **state)
{
    (void)state;
    accept("live: { skip_ranges: true, skip_views: [1], skip_error_db: 45 }\n");
    assert_contains(said, "warning: ");
    assert_contains(said, "c.yaml:1:9: live: skip_ranges has no effect any more: all disparities of the range are "
                          "searched; remove it");
    assert_contains(said, "c.yaml:1:28: live: skip_views has no effect any more: live pictures sum all rays; "
                          "remove it");
    assert_contains(said, "skip_error_db has no effect any more");
    put("a.yaml", "live: { skip_range: true }\n");
    sst_config_defaults(&cfg);
    assert_int_equal(read_back(&cfg, "a.yaml"), -EBADMSG);
    assert_null(strstr(said, "skip_ranges"));
}

/* sst capture must not stumble over sections that only the service reads. */
static void the_array_alone_leaves_the_service_alone(void **state)
{
    struct sst_array_config a;

    (void)state;
    put("c.yaml", "array: { rows: 3 }\nlive: { whatever: 1 }\nhooks: [ { event: motion, run: [/nonexistent] } ]\n");
    put("conf.d/a.yaml", "array: { cols: 4 }\nweb: { port: none }\n");
    sst_array_config_defaults(&a);
    assert_int_equal(sst_array_config_read(&a, test_path("c.yaml")), 0);
    assert_int_equal(a.rows * a.cols, 12);
    sst_path_remove_tree(test_path("conf.d"));
}

/* --- differences -------------------------------------------------------------------------------------------------- */

static const struct sst_config_change *find(const struct sst_config_change *list, int n, const char *key)
{
    for (int i = 0; i < n; i++)
        if (!strcmp(list[i].key, key))
            return &list[i];
    fail_msg("no change of %s", key);
    return NULL;
}

static void expect_change(const struct sst_config_change *list, int n, const char *key, const char *before,
                          const char *after, const char *class_)
{
    const struct sst_config_change *c = find(list, n, key);

    assert_string_equal(c->before, before);
    assert_string_equal(c->after, after);
    assert_string_equal(sst_reload_class_name(c->class_), class_);
}

/* Zones drawn on the page: over the zones of other files, and no other key. */
/* Masks of the reference view lie elsewhere after the calibration was written again, under the same name, too. */
static void masks_follow_their_calibration(void **state)
{
    char text[SST_PATH_MAX + 200];
    struct sst_array_config before;

    (void)state;
    snprintf(text, sizeof(text), "live: { calibration: %s/calib.yaml }\nprivacy: { masks: [ { name: a, near_px: 3 } ] }\n",
             test_folder);
    put("calib.yaml", "1");
    accept(text);
    before = cfg.array;
    accept(text);
    assert_true(sst_array_same_masks(&before, &cfg.array));
    put("calib.yaml", "1 2");
    accept(text);
    assert_false(sst_array_same_masks(&before, &cfg.array));
}

static void drawn_zones_replace_others(void **state)
{
    struct sst_zone drawn = { .name = "lawn",
                              .points = "0.1,0.2 0.9,0.2 0.5,0.9",
                              .x1 = 1,
                              .y1 = 1,
                              .near_px = 9.5,
                              .far_px = -INFINITY,
                              .labels = { "Pedestrian", "Car" } };
    double x[SST_ZONE_POINTS], y[SST_ZONE_POINTS];
    char text[SST_PATH_MAX + 200], *file = sst_zones_text(&drawn, 1);

    (void)state;
    snprintf(text, sizeof(text),
             "zones: [ { name: a }, { name: b, x1: 0.5 } ]\nweb: { zones_file: %s/zones/zones.yaml }\n", test_folder);
    accept(text);
    assert_int_equal(cfg.zones, 2);
    assert_int_equal(sst_zone_corners(&cfg.zone[1], x, y), 4);
    assert_true(x[1] == 0.5 && y[2] == 1 && isinf(cfg.zone[1].near_px) && !cfg.zone[1].labels[0][0]);
    put("zones/zones.yaml", file);
    accept(text);
    assert_int_equal(cfg.zones, 1);
    assert_string_equal(cfg.zone[0].labels[1], "Car");
    assert_true(cfg.zone[0].near_px == 9.5 && !cfg.zone[0].mask);
    assert_int_equal(sst_zone_corners(&cfg.zone[0], x, y), 3);
    assert_true(x[1] == 0.9 && y[2] == 0.9);
    free(file);
    file = sst_zones_text(&drawn, 0);
    put("zones/zones.yaml", file);
    accept(text);
    assert_int_equal(cfg.zones, 0);
    /* A try reads its text, and leaves the file alone. */
    other = cfg;
    assert_int_equal(sst_config_try_zones(&other, test_path("c.yaml"), "zones: [ { name: c } ]\n"), 0);
    assert_string_equal(other.zone[0].name, "c");
    put("zones/zones.yaml", "zones: []\nhooks: [ { event: \"*\", run: [/bin/true] } ]\n");
    put("c.yaml", text);
    assert_int_equal(read_back(&cfg, "c.yaml"), -EBADMSG);
    assert_contains(said, "zones.yaml:2:1: unknown key `hooks`");
    assert_int_equal(unlink(test_path("zones/zones.yaml")), 0);
    free(file);
}

static void differences_are_told(void **state)
{
    struct sst_config_change *list = NULL;
    int n;

    (void)state;
    accept("zones: [ { name: a, x0: 0, y0: 0, x1: 1, y1: 1 } ]\n");
    other = cfg;
    assert_int_equal(sst_config_diff(&list, &cfg, &other), 0); /* NaN is the same as NaN */
    free(list);
    accept("zones: [ { name: a, x0: 0.1, y0: 0, x1: 1, y1: 1 }, { name: b, x0: 0, y0: 0, x1: 1, y1: 0.5 } ]\n"
           "cameras: { rate_hz: 5, controls: { gain: 3 }, bind: [ { row: 0, col: 1, serial: \"007\" } ] }\n"
           "web: { stream_hz: 0.1 }\n"
           "live: { remove_label: 'a \"b', focus_px: 7.3 }\n"
           "storage: { record_on: [ { zone: b, share: 0.3 } ], mode: event }\n");
    n = sst_config_diff(&list, &other, &cfg);
    assert_int_equal(n, 10);
    expect_change(list, n, "zones[0].x0", "0", "0.1", "live");
    expect_change(list, n, "zones[1]", "", "{ name: b, y1: 0.5 }", "live");
    expect_change(list, n, "cameras.rate_hz", "10", "5", "restart-camera");
    expect_change(list, n, "cameras.controls", "{}", "{ gain: 3 }", "restart-camera");
    expect_change(list, n, "cameras.bind[0]", "", "{ row: 0, col: 1, serial: \"007\" }", "restart-camera");
    expect_change(list, n, "live.remove_label", "\"\"", "\"a \\\"b\"", "live");
    expect_change(list, n, "web.stream_hz", "10", "0.1", "restart-daemon");
    expect_change(list, n, "live.focus_px", "auto", "7.3", "live");
    expect_change(list, n, "storage.mode", "off", "event", "live");
    expect_change(list, n, "storage.record_on[0]", "", "{ zone: b, share: 0.3 }", "live");
    assert_string_equal(list[0].key, "cameras.rate_hz"); /* in the order of the file */
    free(list);
    n = sst_config_diff(&list, &cfg, &other);
    expect_change(list, n, "zones[1]", "{ name: b, y1: 0.5 }", "", "live");
    free(list);
}

/* The page's address in links: made of its parts, or as web.url says. */
static void page_of_links(void **state)
{
    static const struct {
        const char *host, *address, *url, *certificate, *page;
        int port;
    } cases[] = {
        { "", "127.0.0.1", "", "", "http://127.0.0.1:8090", 8090 },
        { "", "::1", "", "/c.pem", "https://[::1]:443", 443 },
        { "cam.example", "0.0.0.0", "", "", "http://cam.example:8090", 8090 },
        { "cam.example", "127.0.0.1", "https://door.example/sst//", "", "https://door.example/sst", 0 },
        { "", "127.0.0.1", "", "", "", 0 },
    };
    char page[512];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(cases); i++) {
        sst_config_defaults(&cfg);
        strcpy(cfg.web.host, cases[i].host);
        strcpy(cfg.web.address, cases[i].address);
        strcpy(cfg.web.url, cases[i].url);
        strcpy(cfg.web.tls_certificate, cases[i].certificate);
        cfg.web.port = cases[i].port;
        sst_config_page(page, &cfg);
        assert_string_equal(page, cases[i].page);
    }
    cfg.web.enabled = false;
    strcpy(cfg.web.url, "https://door.example");
    sst_config_page(page, &cfg);
    assert_string_equal(page, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shipped_file_is_the_defaults),
        cmocka_unit_test(shipped_file_has_every_key),
        cmocka_unit_test(defaults_are_sensible),
        cmocka_unit_test(values_arrive),
        cmocka_unit_test(parts_replace_key_by_key),
        cmocka_unit_test(single_faults_are_told),
        cmocka_unit_test(all_faults_of_all_files_are_told),
        cmocka_unit_test(what_is_odd_is_warned_of),
        cmocka_unit_test(retired_keys_are_warned_of),
        cmocka_unit_test(the_array_alone_leaves_the_service_alone),
        cmocka_unit_test(masks_follow_their_calibration),
        cmocka_unit_test(drawn_zones_replace_others),
        cmocka_unit_test(differences_are_told),
        cmocka_unit_test(page_of_links),
    };

    return cmocka_run_group_tests(tests, setup, test_folder_remove);
}

/* Reload of each key of the configuration, and the service when the wall clock is set. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/log.h"
#include "config/schema.h"
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"
#include "tests/test.h"

static char folder[64], base_yaml[600];
static struct sst_service *service;
static struct sst_config before;

/* --- a wall clock that can be set --------------------------------------------------------------------------------- */

static _Atomic int64_t shift_s;

/* Instead of the C library's, for all of this program. */
int clock_gettime(clockid_t id, struct timespec *ts)
{
    const int err = (int)syscall(SYS_clock_gettime, id, ts);

    if (!err && id == CLOCK_REALTIME)
        ts->tv_sec += (time_t)shift_s;
    return err;
}

/* --- a service without cameras ------------------------------------------------------------------------------------ */

static void write_config(const char *more)
{
    char path[100], text[1600];

    snprintf(path, sizeof(path), "%s/sstd.yaml", folder);
    snprintf(text, sizeof(text), "%s%s", base_yaml, more);
    assert_int_equal(sst_file_write(path, text, strlen(text)), 0);
}

static int begin(void **state)
{
    struct sst_service_config cfg = { .socket_fd = -1 };
    struct sst_config config;
    char path[100];

    (void)state;
    strcpy(folder, "/tmp/sst-reload-XXXXXX");
    if (!mkdtemp(folder))
        return -1;
    snprintf(path, sizeof(path), "%s/sstd.yaml", folder);
    /* Not in flow style: keys that a test adds come to the same sections, in conf.d. */
    snprintf(base_yaml, sizeof(base_yaml),
             "control: { socket: %s/c.sock, group: \"\" }\nweb: { port: 0, token_file: %s/token, zones_file: "
             "%s/zones.yaml }\n"
             "storage: { dir: %s/store, min_free_gb: 0, ring_mb: 4, preroll_s: 0 }\n",
             folder, folder, folder, folder);
    write_config("");
    sst_config_defaults(&config);
    assert_int_equal(sst_config_read(&config, path), 0);
    cfg.path = path;
    before = config;
    return sst_service_open(&service, &config, &cfg);
}

static int end(void **state)
{
    (void)state;
    shift_s = 0;
    assert_true(sst_service_stop(service));
    sst_path_remove_tree(folder);
    return 0;
}

/* conf.d/test.yaml: read over the rest, key by key. */
static void write_part(const char *text)
{
    char path[100];

    snprintf(path, sizeof(path), "%s/conf.d", folder);
    assert_int_equal(sst_path_make_dir(path), 0);
    snprintf(path, sizeof(path), "%s/conf.d/test.yaml", folder);
    assert_int_equal(sst_file_write(path, text, strlen(text)), 0);
}

static json_t *reload(bool dry_run)
{
    struct sst_api_answer answer = { 0 };

    if (service->api.reload(service->api.arg, dry_run, &answer))
        fail_msg("%s", answer.error);
    return answer.body;
}

/* --- every key ---------------------------------------------------------------------------------------------------- */

/* Keys with other values that must fit something else; the rest is made from the table. */
static const struct {
    const char *key, *yaml; /* %s: the folder */
} special[] = {
    { "site", "site: yard" },
    { "array.rows", "array: { rows: 3 }" },
    { "array.cols", "array: { cols: 3 }" },
    { "role", "role: head\nhosts: { nodes: [ a ], ca: /a.pem, certificate: /c.pem, key: /k.pem }" },
    { "hosts.head", "hosts: { head: 127.0.0.1 }" },
    { "hosts.address", "hosts: { address: 127.0.0.2 }" },
    { "hosts.nodes", "hosts: { nodes: [ a ] }" },
    { "cameras.format", "cameras: { format: YUYV }" },
    { "cameras.split", "cameras: { split: 1x2 }" },
    { "cameras.controls", "cameras: { controls: { gain: 3 } }" },
    { "cameras.bind", "cameras: { bind: [ { row: 0, col: 0, serial: A } ] }" },
    { "genicam.gain", "genicam: { gain: 3 }" },
    { "genicam.action_address", "genicam: { action_address: 10.0.0.255 }" },
    { "trigger.source", "trigger: { source: software }" },
    { "trigger.lines", "trigger: { lines: [ TRIG0 ] }" },
    { "live.black_level", "live: { black_level: 3, white_level: 9 }" },
    { "live.range_min_px", "live: { range_min_px: -1 }" },
    { "live.device", "live: { device: auto }" },
    { "live.cut_px", "live: { cut_px: 12 }" },
    { "live.focus_px", "live: { focus_px: 3 }" },
    { "live.plane_mm", "live: { plane_mm: 3000 }" },
    { "rig.travel_min_mm", "rig: { travel_min_mm: -5 }" },
    { "privacy.masks", "privacy: { masks: [ { name: a, row: 0, col: 0, x0: 0.5 } ] }" },
    { "zones", "zones: [ { name: a, x0: 0, y0: 0, x1: 1, y1: 1 } ]" },
    { "web.address", "web: { address: 127.0.0.2 }" },
    { "web.tls_certificate", "web: { tls_certificate: /c.pem, tls_key: /k.pem }" },
    { "web.tls_key", "web: { tls_certificate: /c.pem, tls_key: /k.pem }" },
    { "web.streams", "web: { streams: 33 }" },
    { "web.url", "web: { url: https://cam.example }" },
    { "proxy.addresses", "proxy: { addresses: [ 127.0.0.2 ], rights: [ view ] }" },
    { "proxy.rights", "proxy: { addresses: [ 127.0.0.2 ], rights: [ view ] }" },
    { "push.hosts", "push: { hosts: [ push.example.org ] }" },
    { "push.contact", "push: { contact: \"mailto:guard@example.org\" }" },
    { "rtsp.address", "rtsp: { address: 127.0.0.2 }" },
    { "rtsp.user", "rtsp: { user: u, password_file: /p }" },
    { "rtsp.password_file", "rtsp: { user: u, password_file: /p }" },
    { "onvif.enabled", "rtsp: { enabled: true }\nonvif: { enabled: true }" },
    { "onvif.address", "onvif: { address: 127.0.0.2 }" },
    { "onvif.user", "onvif: { user: u, password_file: /p }" },
    { "onvif.password_file", "onvif: { user: u, password_file: /p }" },
    { "storage.mode", "storage: { mode: continuous }" },
    { "storage.quota_gb", "storage: { quota_gb: 100 }" },
    { "storage.record_on", "storage: { record_on: [ { label: Pedestrian } ] }" },
    { "mqtt.enabled", "mqtt: { enabled: true, port: 1 }" },
    { "mqtt.password_file", "mqtt: { user: u, password_file: /p }" },
    { "hooks", "hooks: [ { event: stop, run: [ /bin/true ] } ]" },
};

/* Another value than the one it has, as a file of conf.d. */
static void other_value(const struct sst_key *key, const char *dotted, char *out, size_t size)
{
    const char *p = (const char *)&before + key->offset;
    char value[SST_KEY_TEXT_MAX];

    for (size_t i = 0; i < ARRAY_LEN(special); i++) {
        if (strcmp(special[i].key, dotted) != 0)
            continue;
        snprintf(out, size, "%s\n", special[i].yaml);
        return;
    }
    sst_key_text(key, &before, &before, value);
    if (key->type == SST_KEY_BOOL)
        snprintf(out, size, "%s: { %s: %s }\n", key->section, key->name, *(const bool *)p ? "false" : "true");
    else if (key->type == SST_KEY_INT || key->type == SST_KEY_INTS)
        snprintf(out, size, "%s: { %s: %d }\n", key->section, key->name,
                 *(const int *)p + (*(const int *)p < (int)key->max ? 1 : -1));
    else if (key->type == SST_KEY_DOUBLE || key->type == SST_KEY_DOUBLES)
        snprintf(out, size, "%s: { %s: %g }\n", key->section, key->name,
                 *(const double *)p < key->max ? (*(const double *)p + sst_min_int((int)key->max, 1000)) / 2
                                               : (*(const double *)p + key->min) / 2);
    else if (key->type == SST_KEY_CHOICE)
        snprintf(out, size, "%s: { %s: %s }\n", key->section, key->name, key->names[*(const int *)p ? 0 : 1]);
    else
        snprintf(out, size, "%s: { %s: %s }\n", key->section, key->name,
                 key->kind == SST_TEXT_PATH || key->kind == SST_TEXT_FILE ? "/tmp/other" : "other");
}

static const json_t *find_change(const json_t *answer, const char *dotted)
{
    const json_t *one;
    size_t i;

    json_array_foreach(json_object_get(answer, "changes"), i, one)
    {
        const char *key = json_string_value(json_object_get(one, "key"));

        if (!strncmp(key, dotted, strlen(dotted)) && (!key[strlen(dotted)] || key[strlen(dotted)] == '['))
            return one;
    }
    return NULL;
}

static void expect_takes(const json_t *answer, const char *dotted, const char *takes)
{
    const json_t *one = find_change(answer, dotted);

    if (!one || strcmp(json_string_value(json_object_get(one, "takes")), takes) != 0) {
        char *text = json_dumps(answer, 0);

        fail_msg("%s does not take %s: %s", dotted, takes, text);
    }
}

static bool is_now(const struct sst_key *key, const struct sst_config *now, const struct sst_config *wanted)
{
    static char a[SST_KEY_TEXT_MAX], b[SST_KEY_TEXT_MAX];

    if (key->type == SST_KEY_LIST)
        return sst_key_count(key, now) == sst_key_count(key, wanted);
    sst_key_text(key, now, now, a);
    sst_key_text(key, wanted, wanted, b);
    return !strcmp(a, b);
}

/* The parts use copies of their settings. */
static void expect_in_parts(const struct sst_key *key, const char *dotted, const struct sst_config *wanted)
{
    struct sst_config now;

    pthread_mutex_lock(&service->lock);
    now = service->config;
    pthread_mutex_unlock(&service->lock);
    if (!is_now(key, &now, wanted))
        fail_msg("%s is not what it should be", dotted);
    pthread_mutex_lock(&service->engine->lock);
    now = service->engine->config;
    pthread_mutex_unlock(&service->engine->lock);
    if (!is_now(key, &now, wanted))
        fail_msg("%s is not what it should be for the live picture", dotted);
}

/* What takes a restart is told so, again and again until it is restarted, and the old value holds. All else holds from
 * then on. */
static void every_key_does_what_the_table_says(void **state)
{
    int count, later = 0;
    const struct sst_key *keys = sst_schema(&count);

    (void)state;
    for (int i = 0; i < count; i++) {
        const struct sst_key *key = &keys[i];
        const bool switched = key->switches; /* from none to one */
        const enum sst_reload_class takes = switched ? SST_RELOAD_DAEMON : key->reload;
        struct sst_config wanted = before;
        char dotted[96], yaml[SST_KEY_TEXT_MAX], path[100];
        json_t *answer;

        snprintf(dotted, sizeof(dotted), "%s%s%s", key->section, *key->section ? "." : "", key->name);
        other_value(key, dotted, yaml, sizeof(yaml));
        write_part(yaml);
        snprintf(path, sizeof(path), "%s/sstd.yaml", folder);
        sst_config_defaults(&wanted);
        assert_int_equal(sst_config_read(&wanted, path), 0);

        answer = reload(true);
        expect_takes(answer, dotted, sst_reload_class_name(takes));
        assert_true(json_is_false(json_object_get(answer, "applied")));
        assert_int_equal(json_is_true(json_object_get(answer, "restarts_cameras")), takes == SST_RELOAD_CAMERAS);
        json_decref(answer);
        expect_in_parts(key, dotted, &before); /* only said */
        answer = reload(false);
        expect_takes(answer, dotted, sst_reload_class_name(takes));
        json_decref(answer);
        expect_in_parts(key, dotted, takes == SST_RELOAD_DAEMON ? &before : &wanted);
        answer = reload(true);
        if (takes == SST_RELOAD_DAEMON)
            expect_takes(answer, dotted, "restart-daemon");
        else
            assert_int_equal(json_array_size(json_object_get(answer, "changes")), 0);
        later += takes == SST_RELOAD_DAEMON;
        json_decref(answer);
        write_part("");
        json_decref(reload(false));
        expect_in_parts(key, dotted, &before);
    }
    assert_true(later > 10 && later < count / 3);
}

static void what_is_wrong_changes_nothing(void **state)
{
    struct sst_api_answer answer = { 0 };
    char said[SST_LOG_MAX], *shown;

    (void)state;
    write_part("live: { rate_hz: 3, colz: 1 }\nmqtt: { discovery: \"\" }\n");
    shown = sst_log_hold_errors(said);
    assert_int_equal(service->api.reload(service->api.arg, false, &answer), -EINVAL);
    sst_log_hold_errors(shown);
    assert_non_null(strstr(answer.error, "unknown key `colz`"));
    assert_null(answer.body);
    assert_true(service->config.live.rate_hz == before.live.rate_hz);
}

/* --- zones -------------------------------------------------------------------------------------------------------- */

/* @return result of the call; the answer's zones, or its error */
static int draw(const char *text, struct sst_api_answer *answer)
{
    json_t *request = json_loads(text, 0, NULL);
    int err;

    assert_non_null(request);
    *answer = (struct sst_api_answer){ 0 };
    err = service->api.zones_change(service->api.arg, request, answer);
    json_decref(request);
    return err;
}

static void expect_zones(const struct sst_api_answer *answer, int n, const char *first)
{
    const json_t *list = json_object_get(answer->body, "zones");

    assert_int_equal(json_array_size(list), n);
    assert_int_equal(service->config.zones, n);
    if (n)
        assert_string_equal(json_string_value(json_object_get(json_array_get(list, 0), "name")), first);
    json_decref(answer->body);
}

static void expect_refused(const char *text, int err, const char *why)
{
    struct sst_api_answer answer;
    char said[SST_LOG_MAX], *shown = sst_log_hold_errors(said);

    assert_int_equal(draw(text, &answer), err);
    sst_log_hold_errors(shown);
    if (!strstr(answer.error, why))
        fail_msg("%s: %s, not %s", text, answer.error, why);
    assert_null(answer.body);
}

static char *zones_file(void)
{
    char path[100];
    uint8_t *data = NULL;
    size_t size;

    snprintf(path, sizeof(path), "%s/zones.yaml", folder);
    return sst_path_exists(path) && !sst_file_read(path, 10000, &data, &size) ? (char *)data : NULL;
}

/* Drawn, renamed, removed; a fault changes neither the file nor the zones in effect. */
static void zones_are_drawn(void **state)
{
    static const char *const wrong[][2] = {
        { "{}", "zones must be the list" },
        { "{\"zones\": [{\"name\": \"Gate\", \"points\": [[0,0],[1,0],[1,1]]}]}", "must be a name of a-z" },
        { "{\"zones\": [{\"name\": \"a\", \"points\": [[0,0]]}]}", "points of zone a must be" },
        { "{\"zones\": [{\"name\": \"a\", \"points\": [[0,0],[1,0]]}]}", "has a zone of two points" },
        { "{\"zones\": [{\"name\": \"a\", \"points\": [[0,0],[1,0],[1,1]], \"line\": true}]}", "more than two points" },
        { "{\"zones\": [{\"name\": \"a\", \"points\": [[0,0],[1,0]], \"line\": true, \"mask\": true}]}",
          "that is a mask" },
        { "{\"zones\": [{\"name\": \"a\", \"points\": [[0,0],[1,0]], \"line\": true, \"direction\": \"up\"}]}",
          "both, forward" },
        { "{\"zones\": [{\"name\": \"a\", \"points\": [[0,0],[1,0],[1,1]], \"direction\": \"forward\"}]}",
          "is no line" },
        { "{\"zones\": [{\"name\": \"gate\", \"points\": [[0,0],[1,0]], \"line\": true}]}", "names the line gate" },
        { "{\"zones\": [{\"name\": \"a\", \"points\": [[0,0],[1,0],[2,0]]}]}", "must be [x, y]" },
        { "{\"zones\": [{\"name\": \"a\", \"points\": [[0,0],[0.5,0],[1,0]]}]}", "that enclose an area" },
        { "{\"zones\": [{\"name\": \"a\\\"}, hooks: \", \"points\": [[0,0],[1,0],[1,1]]}]}", "must be a name" },
        { "{\"zones\": [{\"name\": \"a\", \"points\": [[0,0],[1,0],[1,1]], \"near_px\": 2, \"far_px\": 3}]}",
          "far_px is not" },
        { "{\"zones\": [{\"name\": \"a\", \"points\": [[0,0],[1,0],[1,1]], \"maks\": true}]}", "did you mean" },
        { "{\"zones\": [{\"name\": \"b\", \"points\": [[0,0],[1,0],[1,1]]}]}", "unknown zone `gate`" },
    };
    struct sst_api_answer answer;
    char *text, *kept;

    (void)state;
    json_decref(reload(false));
    assert_null(zones_file());
    assert_int_equal(
        draw("{\"zones\": [{\"name\": \"gate\", \"points\": [[0.1,0.2],[0.9,0.2],[0.5,0.875]], \"near_px\": 9.5, "
             "\"labels\": [\"Pedestrian\"]}, {\"name\": \"tree\", \"points\": [[0,0],[1,0],[1,0.5]], \"mask\": true}]}",
             &answer),
        0);
    expect_zones(&answer, 2, "gate");
    text = zones_file();
    assert_non_null(strstr(
        text, "name: gate, points: \"0.1000,0.2000 0.9000,0.2000 0.5000,0.8750\", near_px: 9.5, labels: [Pedestrian]"));
    free(text);
    assert_true(service->config.zone[1].mask && isinf(service->config.zone[1].near_px));
    write_part("storage: { record_on: [ { zone: gate } ] }\n"); /* of the file that people write */
    json_decref(reload(false));
    kept = zones_file();
    for (size_t i = 0; i < ARRAY_LEN(wrong); i++) {
        expect_refused(wrong[i][0], -EINVAL, wrong[i][1]);
        text = zones_file();
        assert_string_equal(text, kept);
        free(text);
        assert_int_equal(service->config.zones, 2);
    }
    free(kept);
    expect_refused("{\"zones\": [], \"revision\": \"0\"}", -EBUSY, "another client");
    write_part("storage: { record_on: [ { zone: drive, visit: true } ] }\nzones: [ { name: drive, points: \"0,0 1,0\", "
               "line: true } ]\n");
    assert_int_equal(draw("{\"zones\": [{\"name\": \"drive\", \"points\": [[0.25,0.5],[0.75,0.5]], \"line\": true, "
                          "\"direction\": \"forward\"}]}",
                          &answer),
                     0);
    expect_zones(&answer, 1, "drive");
    text = zones_file();
    assert_non_null(
        strstr(text, "name: drive, points: \"0.2500,0.5000 0.7500,0.5000\", line: true, direction: forward"));
    free(text);
    assert_true(service->config.zone[0].line && service->config.zone[0].direction == SST_LINE_FORWARD);
    write_part("");
    assert_int_equal(draw("{\"zones\": []}", &answer), 0);
    expect_zones(&answer, 0, "");
    write_part("web: { zones_file: \"/proc/zones.yaml\" }\n"); /* nobody can write there */
    json_decref(reload(false));
    expect_refused("{\"zones\": []}", -EROFS, "/proc/zones.yaml cannot be written");
    write_part("web: { zones_file: \"\" }\n");
    json_decref(reload(false));
    expect_refused("{\"zones\": []}", -EINVAL, "zones cannot be drawn");
    write_part("");
    json_decref(reload(false));
}

/* --- clock -------------------------------------------------------------------------------------------------------- */

/* The last event of a type, and how many there were. */
static int events_of(const char *type, char line[2000])
{
    uint64_t id, after = 0;
    char wanted[64], *text;
    int n = 0;

    snprintf(wanted, sizeof(wanted), "\"type\":\"%s\"", type);
    while (sst_events_next(service->events, after, &id, &text)) {
        if (strstr(text, wanted)) {
            n++;
            snprintf(line, 2000, "%s", text);
        }
        free(text);
        after = id;
    }
    return n;
}

/* An hour on, back, to a machine without a battery, and to the right time again: told, each once, and nothing that is
 * measured by the other clock notices. */
static void the_wall_clock_may_be_set(void **state)
{
    const int64_t now_s = sst_clock_wall_ns() / 1000000000, steps_s[] = { 3600, -3600, -now_s, 0, 86400 * 365 };
    char status[512], line[2000] = "", year[8] = "";
    enum sst_service_phase phase;
    int told = 0;

    (void)state;
    phase = sst_service_tick(service, status);
    for (size_t i = 0; i < ARRAY_LEN(steps_s); i++) {
        struct sst_api_answer answer = { 0 };

        shift_s = steps_s[i];
        for (int k = 0; k < 3; k++)
            phase = sst_service_tick(service, status);
        assert_int_equal(events_of("clock", line), ++told);
        assert_true(sst_service_alive(service, INT64_C(20000000000)));
        assert_int_equal(service->api.status(service->api.arg, &answer), 0);
        assert_in_range((int)json_number_value(json_object_get(answer.body, "uptime_s")), 0, 60);
        snprintf(year, sizeof(year), "%.4s", json_string_value(json_object_get(answer.body, "time")));
        assert_int_equal(atoi(year) == 1970, steps_s[i] == -now_s);
        json_decref(answer.body);
        assert_true(phase == SST_SERVICE_STARTING || phase == SST_SERVICE_FAILED); /* no cameras, as before */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(every_key_does_what_the_table_says, begin, end),
        cmocka_unit_test_setup_teardown(what_is_wrong_changes_nothing, begin, end),
        cmocka_unit_test_setup_teardown(zones_are_drawn, begin, end),
        cmocka_unit_test_setup_teardown(the_wall_clock_may_be_set, begin, end),
    };

    sst_log_set_level(SST_LOG_ERROR);
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* tests/mqtt_session.h - sst-mqtt between a fake service and a real broker (mosquitto), with a subscriber that hears
 * everything. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_MQTT_SESSION_H
#define SST_TESTS_MQTT_SESSION_H

#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "config/sstd.h"
#include "daemon/publish/http.h"
#include "tests/folder.h"
#include "tests/free_port.h"
#include "tests/quick.h"

#define BROKER   "/usr/sbin/mosquitto"
#define PATIENCE 6000 /* looks, 10 ms apart, for what comes sooner or later */

extern char **environ;

static int port;
static pid_t broker, subscriber;
static struct sst_config cfg;
static pid_t program; /* sst-mqtt */
static struct sst_http *http;
static struct sst_counters http_counters;

/* --- a service that answers --------------------------------------------------------------------------------------- */

static struct sst_slot *slot;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct { /* under lock */
    char record[16], focus[32];
    bool recording, lost;
    int records, focuses, snapshots;
    int64_t start_ns;
} service;

static inline int status(void *arg, struct sst_api_answer *out)
{
    (void)arg;
    pthread_mutex_lock(&lock);
    out->body = json_pack(
        "{s:f, s:s, s:s, s:{s:i, s:i, s:f, s:{s:i}}, s:{s:b, s:f, s:{s:f}, s:f}, s:{s:s, s:I, s:{s:b}}}", "uptime_s",
        (double)(sst_clock_now_ns() - service.start_ns) * 1e-9, "state", service.lost ? "degraded" : "capturing",
        "reason", "", "capture", "cameras", 2, "present", service.lost ? 1 : 2, "rate_hz", 10.0, "skew_us", "p99", 180,
        "live", "ready", 1, "rate_hz", 6.1, "latency_ms", "p50", 210.0, "focus_px", 7.8, "storage", "state", "OK",
        "free_bytes", (json_int_t)123456789012, "recording", "active", service.recording);
    pthread_mutex_unlock(&lock);
    return out->body ? 0 : -ENOMEM;
}

static inline int cameras(void *arg, struct sst_api_answer *out)
{
    (void)arg;
    pthread_mutex_lock(&lock);
    out->body = json_pack("{s:[{s:s, s:s}, {s:s, s:s}]}", "cameras", "name", "r0c0", "state", "streaming", "name",
                          "r0c1", "state", service.lost ? "absent" : "streaming");
    pthread_mutex_unlock(&lock);
    return out->body ? 0 : -ENOMEM;
}

static inline int record(void *arg, const json_t *request, struct sst_api_answer *out)
{
    (void)arg;
    pthread_mutex_lock(&lock);
    snprintf(service.record, sizeof(service.record), "%s", json_string_value(json_object_get(request, "action")));
    service.recording = !strcmp(service.record, "start");
    service.records++;
    pthread_mutex_unlock(&lock);
    out->body = json_object();
    return 0;
}

static inline int snapshot(void *arg, const json_t *request, struct sst_api_answer *out)
{
    (void)arg;
    assert_int_equal(json_object_size(request), 0);
    pthread_mutex_lock(&lock);
    service.snapshots++;
    pthread_mutex_unlock(&lock);
    out->body = json_object();
    return 0;
}

static inline int view_change(void *arg, const char *client, const char *id, const json_t *settings, struct sst_api_answer *out)
{
    const json_t *px = json_object_get(settings, "focus_px");

    (void)arg;
    assert_string_equal(client, "");
    assert_string_equal(id, "main");
    pthread_mutex_lock(&lock);
    if (json_is_null(px))
        strcpy(service.focus, "null");
    else
        snprintf(service.focus, sizeof(service.focus), "%g", json_number_value(px));
    service.focuses++;
    pthread_mutex_unlock(&lock);
    out->body = json_object();
    return 0;
}

static inline int views(void *arg, struct sst_api_answer *out)
{
    (void)arg;
    pthread_mutex_lock(&lock);
    out->body =
        json_pack("{s:[{s:s, s:{s:f}}, {s:s, s:{s:o}}]}", "views", "id", "v1", "settings", "focus_px", 3.0, "id",
                  "main", "settings", "focus_px",
                  isdigit((unsigned char)service.focus[0]) ? json_real(strtod(service.focus, NULL)) : json_null());
    pthread_mutex_unlock(&lock);
    return out->body ? 0 : -ENOMEM;
}

static inline int get_outlet(void *arg, enum sst_api_picture kind, const char *name, struct sst_slot **out)
{
    (void)arg;
    assert_true(kind == SST_PICTURE_VIEW && !strcmp(name, "main"));
    *out = sst_slot_ref(slot);
    return 0;
}

static inline int visit_picture(void *arg, const char *visit, enum sst_visit_picture kind, uint8_t **data, size_t *size)
{
    char *text = malloc(100);

    (void)arg;
    snprintf(text, 100, "PICTURE of %s %d", visit, kind != SST_VISIT_SEEN);
    *data = (uint8_t *)text;
    *size = strlen(text);
    return 0;
}

static struct sst_api api = { .status = status,
                              .visit_picture = visit_picture,
                              .cameras = cameras,
                              .record = record,
                              .snapshot = snapshot,
                              .views = views,
                              .view_change = view_change,
                              .slot = get_outlet };

/* --- processes ---------------------------------------------------------------------------------------------------- */

static inline pid_t run(const char *const argv[], const char *output)
{
    posix_spawn_file_actions_t files;
    pid_t pid;

    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, 1, test_path("%s", output), O_WRONLY | O_CREAT | O_APPEND, 0600);
    posix_spawn_file_actions_adddup2(&files, 1, 2);
    assert_int_equal(posix_spawnp(&pid, argv[0], &files, NULL, (char *const *)(uintptr_t)argv, environ), 0);
    posix_spawn_file_actions_destroy(&files);
    return pid;
}

static inline void end(pid_t *pid)
{
    if (*pid > 0) {
        kill(*pid, SIGCONT);
        kill(*pid, SIGKILL);
        waitpid(*pid, NULL, 0);
    }
    *pid = 0;
}

static inline struct sockaddr_in here(int on)
{
    return (struct sockaddr_in){ .sin_family = AF_INET,
                                 .sin_port = htons((uint16_t)on),
                                 .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
}

static inline void start_broker(const char *more)
{
    const char *path = test_path("broker.conf");
    const struct sockaddr_in a = here(port);
    FILE *f = fopen(path, "w");

    assert_non_null(f);
    fprintf(f, "listener %d 127.0.0.1\nuser root\npersistence false\nset_tcp_nodelay true\n%s\n", port, more);
    fclose(f);
    broker = run((const char *const[]){ BROKER, "-c", path, NULL }, "broker.log");
    for (int i = 0; i < PATIENCE; i++) {
        const int s = socket(AF_INET, SOCK_STREAM, 0), err = connect(s, (const struct sockaddr *)&a, sizeof(a));

        close(s);
        if (!err)
            return;
        usleep(10000);
    }
    fail_msg("the broker does not listen");
}

static inline void publish(const char *topic, const char *payload, bool retained)
{
    char number[16];
    pid_t pid;
    int ended;

    snprintf(number, sizeof(number), "%d", port);
    pid = run((const char *const[]){ "timeout", "60", "mosquitto_pub", "-h", "127.0.0.1", "-p", number, "-t", topic,
                                     "-m", payload, "-q", "1", retained ? "-r" : NULL, NULL },
              "pub.log");
    assert_int_equal(waitpid(pid, &ended, 0), pid);
    assert_int_equal(ended, 0);
}

/* The text of a file that a program writes; "": not yet there. Valid until the next call. */
static inline char *read_text(const char *name)
{
    static char text[1 << 20];
    FILE *f = fopen(test_path("%s", name), "r");

    text[f ? fread(text, 1, sizeof(text) - 1, f) : 0] = 0;
    if (f)
        fclose(f);
    return text;
}

/* Lines of what the subscriber heard that begin with these words. @param last  out, [2048], of the last one */
static inline int heard(const char *words, char *last)
{
    int n = 0;

    for (char *line = strtok(read_text("heard"), "\n"); line; line = strtok(NULL, "\n")) {
        if (strncmp(line, words, strlen(words)) != 0)
            continue;
        n++;
        if (last)
            snprintf(last, 2048, "%s", line);
    }
    return n;
}

static inline void subscribe(void)
{
    char number[16];

    snprintf(number, sizeof(number), "%d", port);
    subscriber = run((const char *const[]){ "mosquitto_sub", "-h", "127.0.0.1", "-p", number, "-t", "#", "-q", "1",
                                            "-F", "%t %p", NULL },
                     "heard");
    for (int i = 0; i < PATIENCE && !heard("test/ready", NULL); i++)
        publish("test/ready", "yes", false);
    assert_true(heard("test/ready", NULL) > 0);
}

static inline void expect_heard(const char *words, char *last)
{
    for (int i = 0; i < PATIENCE && !heard(words, last); i++)
        usleep(10000);
    if (!heard(words, last))
        fail_msg("not heard: %s", words);
}

/* Connections of sst-mqtt that brokers have accepted: other clients have another interval of signs of life. */
static inline int connects(void)
{
    int n = 0;

    for (char *line = strtok(read_text("broker.log"), "\n"); line; line = strtok(NULL, "\n"))
        n += strstr(line, "New client connected") && strstr(line, " k30");
    return n;
}

static inline void expect_connected(void)
{
    for (int i = 0; i < PATIENCE && !connects(); i++)
        usleep(10000);
    assert_true(connects() > 0);
}

/* --- set-up ------------------------------------------------------------------------------------------------------- */

static inline void open_service(void)
{
    const struct sst_http_config c = { .socket = test_path("c.sock"),
                                       .socket_fd = -1,
                                       .clients = 16,
                                       .streams = 4,
                                       .api = &api,
                                       .counters = &http_counters };

    assert_int_equal(sst_http_open(&http, &c), 0);
}

static inline void write_config(void)
{
    FILE *f = fopen(test_path("sstd.yaml"), "w");

    assert_non_null(f);
    fprintf(f,
            "control: {socket: %s/c.sock, group: \"\"}\n"
            "web: {url: \"%s\"}\n"
            "zones: [{name: %s, x0: 0, y0: 0, x1: 1, y1: 1}%s]\n"
            "mqtt: {enabled: %s, host: %s, port: %d, topic: %s, picture_s: %g, user: \"%s\", password_file: \"%s\", "
            "ca_file: \"%s\"}\n",
            test_folder, cfg.web.url, cfg.zone[0].name,
            cfg.zones > 1 ? ", {name: drive, points: \"0.2,0.5 0.8,0.5\", line: true, direction: forward}" : "", cfg.mqtt.enabled ? "true" : "false", cfg.mqtt.host, cfg.mqtt.port,
            cfg.mqtt.topic, cfg.mqtt.picture_s, cfg.mqtt.user, cfg.mqtt.password_file, cfg.mqtt.ca_file);
    fclose(f);
}

static inline void open_mqtt(void)
{
    const char *build = getenv("SST_BUILD");
    char path[SST_PATH_MAX];

    write_config();
    snprintf(path, sizeof(path), "%s/sst-mqtt", build ? build : "build");
    program = run((const char *const[]){ path, "--config", test_path("sstd.yaml"), NULL }, "mqtt.log");
}

/* Ended by SIGTERM, with status 0. */
static inline void close_mqtt(void)
{
    int ended = -1;

    assert_int_equal(waitpid(program, NULL, WNOHANG), 0);
    kill(program, SIGTERM);
    assert_int_equal(waitpid(program, &ended, 0), program);
    assert_int_equal(ended, 0);
    program = 0;
}

static inline int setup(void **state)
{
    (void)state;
    assert_int_equal(test_folder_create(NULL), 0);
    port = free_port();
    sst_config_defaults(&cfg);
    cfg.mqtt.enabled = true;
    cfg.mqtt.port = port;
    strcpy(cfg.mqtt.host, "127.0.0.1");
    cfg.zones = 1;
    strcpy(cfg.zone[0].name, "gate");
    memset(&service, 0, sizeof(service));
    service.start_ns = sst_clock_now_ns();
    assert_int_equal(sst_events_create(&api.events, 64), 0);
    assert_int_equal(sst_slot_create(&slot), 0);
    sst_counters_init(&http_counters);
    open_service();
    return 0;
}

static inline int teardown(void **state)
{
    (void)state;
    end(&program);
    end(&subscriber);
    end(&broker);
    sst_slot_shut(slot);
    sst_events_shut(api.events);
    sst_http_close(http);
    http = NULL;
    sst_slot_unref(slot);
    sst_counters_fini(&http_counters);
    sst_events_destroy(api.events);
    return test_folder_remove(NULL);
}

static inline void expect_count(const char *words, int n)
{
    for (int i = 0; i < PATIENCE && heard(words, NULL) < n; i++)
        usleep(10000);
    if (heard(words, NULL) != n)
        fail_msg("heard %d times, not %d: %s", heard(words, NULL), n, words);
}

/* The last announcement of a device, to release; NULL: none that is not empty was heard last. */
static inline json_t *announced(const char *node)
{
    json_t *last = NULL;
    char words[128];

    snprintf(words, sizeof(words), "homeassistant/device/%s/config ", node);
    for (char *line = strtok(read_text("heard"), "\n"); line; line = strtok(NULL, "\n")) {
        if (strncmp(line, words, strlen(words)) != 0)
            continue;
        json_decref(last);
        last = json_loads(line + strlen(words), 0, NULL);
    }
    return last;
}

/* Wait until the last announcement has an entity of this platform, or not. @return the announcement, to release */
static inline json_t *expect_entity(const char *node, const char *id, const char *platform, bool there)
{
    json_t *device = NULL;

    for (int i = 0; i < PATIENCE; i++) {
        const json_t *p;

        json_decref(device);
        device = announced(node);
        p = json_object_get(json_object_get(json_object_get(device, "cmps"), id), "p");
        if (device && (p && !strcmp(json_string_value(p), platform)) == there)
            return device;
        usleep(10000);
    }
    fail_msg("the announcement %s %s of platform %s", there ? "lacks" : "has", id, platform);
    return NULL;
}

#define MQTT_TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

#ifndef WITH_MQTT /* this header alone */
#define WITH_MQTT 1
#endif

/** @return 77 with the reason printed if there is no broker, else 0 */
static inline int mqtt_missing(void)
{
    if (WITH_MQTT && !access(BROKER, X_OK) && !access("/usr/bin/mosquitto_sub", X_OK))
        return 0;
    puts(WITH_MQTT ? "mosquitto or mosquitto-clients is not installed" : "built without MQTT");
    return 77;
}

#endif

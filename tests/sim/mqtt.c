/* sst-mqtt between a fake service and a real broker (mosquitto): messages, commands, last will, reconnecting, brokers
 * that refuse or hang. */
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
    int records, focuses;
    int64_t start_ns;
} service;

static int status(void *arg, struct sst_api_answer *out)
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

static int cameras(void *arg, struct sst_api_answer *out)
{
    (void)arg;
    pthread_mutex_lock(&lock);
    out->body = json_pack("{s:[{s:s, s:s}, {s:s, s:s}]}", "cameras", "name", "r0c0", "state", "streaming", "name",
                          "r0c1", "state", service.lost ? "absent" : "streaming");
    pthread_mutex_unlock(&lock);
    return out->body ? 0 : -ENOMEM;
}

static int record(void *arg, const json_t *request, struct sst_api_answer *out)
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

static int view_change(void *arg, const char *id, const json_t *settings, struct sst_api_answer *out)
{
    const json_t *px = json_object_get(settings, "focus_px");

    (void)arg;
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

static int views(void *arg, struct sst_api_answer *out)
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

static int get_outlet(void *arg, enum sst_api_picture kind, const char *name, struct sst_slot **out)
{
    (void)arg;
    assert_true(kind == SST_PICTURE_VIEW && !strcmp(name, "main"));
    *out = sst_slot_ref(slot);
    return 0;
}

static int visit_picture(void *arg, const char *visit, enum sst_visit_picture kind, uint8_t **data, size_t *size)
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
                              .views = views,
                              .view_change = view_change,
                              .slot = get_outlet };

/* --- processes ---------------------------------------------------------------------------------------------------- */

static pid_t run(const char *const argv[], const char *output)
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

static void end(pid_t *pid)
{
    if (*pid > 0) {
        kill(*pid, SIGCONT);
        kill(*pid, SIGKILL);
        waitpid(*pid, NULL, 0);
    }
    *pid = 0;
}

static struct sockaddr_in here(int on)
{
    return (struct sockaddr_in){ .sin_family = AF_INET,
                                 .sin_port = htons((uint16_t)on),
                                 .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
}

/* Of those that the kernel gives nobody who connects: free while the broker is away, too. */
static int free_port(void)
{
    static unsigned at;
    int err = -1, number = 0;

    for (int i = 0; i < 1000 && err; i++) {
        const int s = socket(AF_INET, SOCK_STREAM, 0);
        struct sockaddr_in a;

        number = 10000 + (int)((unsigned)getpid() * 7 + ++at) % 20000;
        a = here(number);
        err = bind(s, (struct sockaddr *)&a, sizeof(a));
        close(s);
    }
    assert_int_equal(err, 0);
    return number;
}

static void start_broker(const char *more)
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

static void publish(const char *topic, const char *payload, bool retained)
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
static char *read_text(const char *name)
{
    static char text[1 << 20];
    FILE *f = fopen(test_path("%s", name), "r");

    text[f ? fread(text, 1, sizeof(text) - 1, f) : 0] = 0;
    if (f)
        fclose(f);
    return text;
}

/* Lines of what the subscriber heard that begin with these words. @param last  out, [2048], of the last one */
static int heard(const char *words, char *last)
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

static void subscribe(void)
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

static void expect_heard(const char *words, char *last)
{
    for (int i = 0; i < PATIENCE && !heard(words, last); i++)
        usleep(10000);
    if (!heard(words, last))
        fail_msg("not heard: %s", words);
}

/* Connections of sst-mqtt that brokers have accepted: other clients have another interval of signs of life. */
static int connects(void)
{
    int n = 0;

    for (char *line = strtok(read_text("broker.log"), "\n"); line; line = strtok(NULL, "\n"))
        n += strstr(line, "New client connected") && strstr(line, " k30");
    return n;
}

static void expect_connected(void)
{
    for (int i = 0; i < PATIENCE && !connects(); i++)
        usleep(10000);
    assert_true(connects() > 0);
}

/* --- set-up ------------------------------------------------------------------------------------------------------- */

static void open_service(void)
{
    const struct sst_http_config c = { .socket = test_path("c.sock"),
                                       .socket_fd = -1,
                                       .clients = 16,
                                       .streams = 4,
                                       .api = &api,
                                       .counters = &http_counters };

    assert_int_equal(sst_http_open(&http, &c), 0);
}

static void write_config(void)
{
    FILE *f = fopen(test_path("sstd.yaml"), "w");

    assert_non_null(f);
    fprintf(f,
            "control: {socket: %s/c.sock, group: \"\"}\n"
            "zones: [{name: %s, x0: 0, y0: 0, x1: 1, y1: 1}]\n"
            "mqtt: {enabled: %s, host: %s, port: %d, topic: %s, picture_s: %g, user: \"%s\", password_file: \"%s\", "
            "ca_file: \"%s\"}\n",
            test_folder, cfg.zone[0].name, cfg.mqtt.enabled ? "true" : "false", cfg.mqtt.host, cfg.mqtt.port,
            cfg.mqtt.topic, cfg.mqtt.picture_s, cfg.mqtt.user, cfg.mqtt.password_file, cfg.mqtt.ca_file);
    fclose(f);
}

static void open_mqtt(void)
{
    const char *build = getenv("SST_BUILD");
    char path[SST_PATH_MAX];

    write_config();
    snprintf(path, sizeof(path), "%s/sst-mqtt", build ? build : "build");
    program = run((const char *const[]){ path, "--config", test_path("sstd.yaml"), NULL }, "mqtt.log");
}

/* Ended by SIGTERM, with status 0. */
static void close_mqtt(void)
{
    int ended = -1;

    assert_int_equal(waitpid(program, NULL, WNOHANG), 0);
    kill(program, SIGTERM);
    assert_int_equal(waitpid(program, &ended, 0), program);
    assert_int_equal(ended, 0);
    program = 0;
}

static int setup(void **state)
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

static int teardown(void **state)
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

static void motion(bool active)
{
    sst_events_emit(api.events, SST_EVENT_INFO, "motion", json_pack("{s:s, s:b}", "zone", "gate", "active", active),
                    "something moves");
}

/* --- tests -------------------------------------------------------------------------------------------------------- */

static void state_and_events_are_published(void **state)
{
    char line[2048];
    json_t *o;

    (void)state;
    start_broker("allow_anonymous true");
    subscribe();
    sst_events_emit(api.events, SST_EVENT_INFO, "start", NULL, "before there is a connection");
    open_mqtt();
    expect_heard("sst/available online", NULL);
    expect_heard("sst/event/start {", NULL);
    expect_heard("sst/status {", line);
    o = json_loads(strchr(line, '{'), 0, NULL);
    assert_non_null(o);
    assert_string_equal(json_string_value(json_object_get(o, "state")), "capturing");
    assert_int_equal(json_integer_value(json_object_get(o, "present")), 2);
    assert_true(json_number_value(json_object_get(o, "free_gb")) == 123.46);
    assert_true(json_is_false(json_object_get(o, "recording")));
    json_decref(o);
    expect_heard("sst/record OFF", NULL);
    expect_heard("sst/focus auto", NULL); /* the setting, not the 7.8 px that it comes to */
    expect_heard("sst/camera/r0c1/state streaming", NULL);
    motion(true);
    expect_heard("sst/event/motion {", line);
    o = json_loads(strchr(line, '{'), 0, NULL);
    assert_string_equal(json_string_value(json_object_get(json_object_get(o, "data"), "zone")), "gate");
    json_decref(o);
    expect_heard("sst/zone/gate/motion ON", NULL);
    pthread_mutex_lock(&lock);
    service.lost = true;
    pthread_mutex_unlock(&lock);
    sst_events_emit(api.events, SST_EVENT_WARNING, "camera-lost", NULL, "a camera is gone");
    expect_heard("sst/camera/r0c1/state absent", NULL); /* long before the ten seconds */
    assert_int_equal(heard("sst/camera/r0c0/state", NULL), 1);
    close_mqtt();
    expect_heard("sst/available offline", NULL);
}

/* Every entity of the announcement names topics that are told, and belongs to the one device. */
static void home_assistant_finds_the_array(void **state)
{
    static const char *const ids[] = { "sensor/sst/state",
                                       "binary_sensor/sst/problem",
                                       "sensor/sst/rate",
                                       "switch/sst/record",
                                       "camera/sst/picture",
                                       "sensor/sst/latency",
                                       "sensor/sst/free",
                                       "binary_sensor/sst/camera_r0c1",
                                       "sensor/sst/storage",
                                       "sensor/sst/live_rate",
                                       "binary_sensor/sst/zone_gate",
                                       "binary_sensor/sst/cameras" };
    char line[2048], words[128];

    (void)state;
    start_broker("allow_anonymous true");
    open_mqtt();
    expect_connected();
    subscribe(); /* later: all of it is retained */
    for (size_t i = 0; i < ARRAY_LEN(ids); i++) {
        const char *topic;
        json_t *o;

        snprintf(words, sizeof(words), "homeassistant/%s/config {", ids[i]);
        expect_heard(words, line);
        o = json_loads(strchr(line, '{'), 0, NULL);
        assert_non_null(o);
        assert_string_equal(json_string_value(json_object_get(o, "availability_topic")), "sst/available");
        assert_string_equal(
            json_string_value(json_array_get(json_object_get(json_object_get(o, "device"), "identifiers"), 0)), "sst");
        assert_non_null(json_object_get(o, "unique_id"));
        topic = json_string_value(json_object_get(o, strncmp(ids[i], "camera/", 7) ? "state_topic" : "topic"));
        assert_non_null(topic);
        assert_int_equal(strncmp(topic, "sst/", 4), 0);
        if (!strcmp(ids[i], "binary_sensor/sst/problem")) /* not of a loop of recordings that fills its quota */
            assert_non_null(strstr(json_string_value(json_object_get(o, "value_template")),
                                   "value_json.storage == 'LOW' and value_json.storage_limit == 'quota'"));
        if (!strncmp(ids[i], "switch/", 7))
            assert_string_equal(json_string_value(json_object_get(o, "command_topic")), "sst/record/set");
        json_decref(o);
    }
}

static void expect_count(const char *words, int n)
{
    for (int i = 0; i < PATIENCE && heard(words, NULL) < n; i++)
        usleep(10000);
    if (heard(words, NULL) != n)
        fail_msg("heard %d times, not %d: %s", heard(words, NULL), n, words);
}

static void visit(const char *name, bool active, const char *label, const char *zones)
{
    sst_events_emit(api.events, SST_EVENT_INFO, "visit",
                    json_pack("{s:s, s:s, s:b, s:s, s:o}", "visit", name, "page", "http://h:8090/#visit=x", "active", active,
                              "label", label, "zones", json_loads(zones, 0, NULL)),
                    "somebody is there");
}

/* Who is in a zone, of which label; the last visit with its picture and address; triggers. */
static void visits_reach_home_assistant(void **state)
{
    static const char *const ids[] = { "binary_sensor/sst/visited_gate",       "sensor/sst/visit_gate",
                                       "binary_sensor/sst/label_Pedestrian_gate", "sensor/sst/last_visit",
                                       "image/sst/picture_gate",               "image/sst/visit_picture",
                                       "device_automation/sst/began_gate",     "device_automation/sst/ended_anywhere_" };
    char line[2048], words[128];
    json_t *o;

    (void)state;
    start_broker("allow_anonymous true");
    cfg.mqtt.picture_s = 1;
    subscribe();
    sst_events_emit(api.events, SST_EVENT_INFO, "camera-back", NULL, "before there is a connection");
    open_mqtt();
    expect_heard("sst/event/camera-back {", NULL); /* events arrive now, too */
    for (size_t i = 0; i < ARRAY_LEN(ids); i++) {
        snprintf(words, sizeof(words), "homeassistant/%s/config {", ids[i]);
        expect_heard(words, line);
        o = json_loads(strchr(line, '{'), 0, NULL);
        assert_non_null(json_object_get(o, "device"));
        if (!strncmp(ids[i], "image/", 6))
            assert_string_equal(json_string_value(json_object_get(o, "content_type")), "image/jpeg");
        if (!strcmp(ids[i], "device_automation/sst/began_gate")) {
            assert_string_equal(json_string_value(json_object_get(o, "topic")), "sst/zone/gate/trigger");
            assert_string_equal(json_string_value(json_object_get(o, "payload")), "came");
            assert_string_equal(json_string_value(json_object_get(o, "subtype")), "gate");
        }
        json_decref(o);
    }
    expect_heard("sst/zone/gate/visited OFF", NULL);
    visit("a-1", true, "Pedestrian", "[]");
    expect_heard("sst/visit/trigger came", NULL);
    expect_heard("sst/visit {\"visit\":\"a-1\",\"page\":\"http://h:8090/#visit=x\"", NULL);
    visit("a-1", true, "Pedestrian", "[\"gate\", \"unknown\"]"); /* it enters the zone */
    expect_heard("sst/zone/gate/visited ON", NULL);
    expect_heard("sst/zone/gate/label/Pedestrian ON", NULL);
    expect_heard("sst/zone/gate/visit {", NULL);
    expect_heard("sst/zone/gate/picture PICTURE of a-1 0", NULL); /* what was seen through */
    expect_heard("sst/visit/picture PICTURE of a-1 0", NULL);
    visit("b-2", true, "Car", "[\"gate\"]");
    expect_heard("sst/zone/gate/label/Car ON", NULL);
    visit("a-1", false, "Pedestrian", "[\"gate\"]");
    expect_heard("sst/visit/trigger gone", NULL);
    expect_count("sst/zone/gate/label/Pedestrian OFF", 2); /* at first, and when it has gone */
    assert_int_equal(heard("sst/zone/gate/visited OFF", NULL), 1); /* the car is there */
    visit("b-2", false, "Car", "[\"gate\"]");
    expect_count("sst/zone/gate/visited OFF", 2);
    assert_int_equal(heard("sst/zone/gate/trigger came", NULL), 2);
    assert_int_equal(heard("sst/zone/gate/trigger gone", NULL), 2);
    assert_int_equal(heard("sst/visit/trigger came", NULL), 2);
    visit("c-3", true, "Car", "[\"gate\"]"); /* and then the service is started anew */
    expect_count("sst/zone/gate/visited ON", 4);
    sst_events_emit(api.events, SST_EVENT_INFO, "start", NULL, "anew");
    expect_count("sst/zone/gate/visited OFF", 3);
    visit("../etc", true, "Car", "[\"gate\"]"); /* no name of a visit */
    visit("d-4", true, "Car", "[]");
    expect_heard("sst/visit {\"visit\":\"d-4\"", NULL);
    assert_int_equal(heard("sst/visit {\"visit\":\"../etc\"", NULL), 0);
}

static void configure(void)
{
    write_config();
    sst_events_emit(api.events, SST_EVENT_INFO, "reload", NULL, "configuration applied");
}

/* What is announced is what the configuration has, after a reload and after a restart with another one. */
static void zones_come_and_go(void **state)
{
    (void)state;
    start_broker("allow_anonymous true");
    publish("homeassistant/binary_sensor/sst/zone_old/config", "{\"of\": \"before the restart\"}", true);
    publish("homeassistant/binary_sensor/other/zone_old/config", "{\"of\": \"another array\"}", true);
    publish("sst/zone/old/motion", "ON", true);
    subscribe();
    open_mqtt();
    expect_heard("homeassistant/binary_sensor/sst/zone_gate/config {", NULL);
    expect_count("homeassistant/binary_sensor/sst/zone_old/config ", 2);
    expect_heard("sst/zone/old/motion ", NULL);
    assert_int_equal(heard("homeassistant/binary_sensor/other/zone_old/config ", NULL), 1);
    assert_int_equal(heard("homeassistant/binary_sensor/sst/zone_gate/config ", NULL), 1);
    motion(true);
    expect_heard("sst/zone/gate/motion ON", NULL);

    strcpy(cfg.zone[0].name, "door");
    cfg.mqtt.picture_s = 0;
    configure();
    expect_heard("homeassistant/binary_sensor/sst/zone_door/config {", NULL);
    expect_count("homeassistant/binary_sensor/sst/zone_gate/config ", 2); /* the second is empty */
    expect_count("homeassistant/camera/sst/picture/config ", 2);
    expect_count("sst/zone/gate/motion ", 2);
    assert_int_equal(heard("homeassistant/binary_sensor/sst/zone_gate/config {", NULL), 1);
    assert_int_equal(connects(), 1);
}

/* Another topic, another broker, none: without a restart. */
static void connection_follows_the_configuration(void **state)
{
    const int first = port;
    pid_t first_broker;

    (void)state;
    start_broker("allow_anonymous true");
    subscribe();
    cfg.mqtt.enabled = false;
    open_mqtt();
    cfg.mqtt.enabled = true;
    configure();
    expect_heard("sst/available online", NULL);
    expect_heard("homeassistant/binary_sensor/sst/zone_gate/config {", NULL); /* the last */
    strcpy(cfg.mqtt.topic, "roof/array");
    configure();
    expect_heard("roof/array/available online", NULL);
    expect_heard("homeassistant/binary_sensor/roof_array/zone_gate/config {", NULL);
    expect_count("sst/available offline", 1);
    expect_count("homeassistant/switch/sst/record/config ", 2);
    expect_count("homeassistant/binary_sensor/sst/camera_r0c1/config ", 2);
    cfg.mqtt.enabled = false;
    configure();
    expect_heard("roof/array/available offline", NULL);
    assert_int_equal(heard("homeassistant/switch/roof_array/record/config ", NULL), 1); /* it is only away */

    first_broker = broker;
    port = free_port();
    start_broker("allow_anonymous true");
    cfg.mqtt.enabled = true;
    cfg.mqtt.port = port;
    configure();
    for (int i = 0; i < PATIENCE && connects() < 3; i++)
        usleep(10000);
    assert_int_not_equal(port, first);
    assert_int_equal(connects(), 3);
    end(&first_broker);
}

static void commands_reach_the_service(void **state)
{
    bool done;

    (void)state;
    start_broker("allow_anonymous true");
    publish("sst/record/set", "ON", true); /* left behind by somebody: must not start a recording */
    subscribe();
    open_mqtt();
    expect_heard("sst/available online", NULL);
    expect_heard("sst/record OFF", NULL);
    publish("sst/record/set", "ON", false);
    expect_heard("sst/record ON", NULL);
    publish("sst/focus/set", "7.25", false);
    expect_heard("sst/focus 7.25", NULL);
    publish("sst/focus/set", "nan", false);
    publish("sst/focus/set", "; reboot", false);
    publish("sst/record/set", "perhaps", false);
    publish("sst/focus/set", "auto", false);
    publish("sst/record/set", "off", false);
    for (int i = 0; i < PATIENCE; i++) {
        pthread_mutex_lock(&lock);
        done = service.records == 2;
        pthread_mutex_unlock(&lock);
        if (done)
            break;
        usleep(10000);
    }
    pthread_mutex_lock(&lock);
    assert_string_equal(service.record, "stop");
    assert_string_equal(service.focus, "null");
    assert_int_equal(service.records, 2); /* those that make no sense did not reach it */
    assert_int_equal(service.focuses, 2);
    pthread_mutex_unlock(&lock);
}

/* At most one each picture_s, and we are a viewer only while one is due. */
static void pictures_come_at_most_so_often(void **state)
{
    static const char jpeg[] = "JPEG";
    int64_t start, took = 0;
    int looks = 0, idle = 0, n = 0;

    (void)state;
    cfg.mqtt.picture_s = 0.5;
    start_broker("allow_anonymous true");
    subscribe();
    open_mqtt();
    expect_connected();
    start = sst_clock_now_ns();
    for (; took < INT64_C(2500000000) || ((n < 3 || looks < 100) && took < INT64_C(60000000000)); looks++) {
        if (sst_slot_clients(slot)) {
            uint8_t *data = malloc(sizeof(jpeg));

            memcpy(data, jpeg, sizeof(jpeg));
            assert_int_equal(sst_slot_put(slot, data, sizeof(jpeg) - 1, 1, 1, 1), 0);
        } else {
            idle++;
        }
        usleep(20000);
        n = heard("sst/picture JPEG", NULL);
        took = sst_clock_now_ns() - start;
    }
    if (n < 3 || n > took / 500000000 + 1 || idle < 20)
        fail_msg("%d pictures in %.1f s, not viewing %d of %d times", n, (double)took * 1e-9, idle, looks);
}

/* Killed: the broker says so in our place. */
static void the_last_will(void **state)
{
    (void)state;
    start_broker("allow_anonymous true");
    subscribe();
    open_mqtt();
    expect_heard("sst/available online", NULL);
    end(&program);
    expect_heard("sst/available offline", NULL);
}

/* A service that ends is offline; one that was started again counts its events from 1, and all are published. */
static void the_service_may_go_and_come(void **state)
{
    (void)state;
    start_broker("allow_anonymous true");
    subscribe();
    for (int i = 0; i < 3; i++)
        motion(true);
    open_mqtt();
    expect_count("sst/event/motion", 3);
    expect_heard("sst/available online", NULL);
    sst_events_shut(api.events);
    sst_http_close(http);
    expect_heard("sst/available offline", NULL);
    sst_events_destroy(api.events);
    assert_int_equal(sst_events_create(&api.events, 64), 0);
    usleep(2500000); /* a restart takes longer than the tolerance of its recognition */
    pthread_mutex_lock(&lock);
    service.start_ns = sst_clock_now_ns();
    pthread_mutex_unlock(&lock);
    for (int i = 0; i < 4; i++)
        motion(false);
    open_service();
    expect_count("sst/available online", 2);
    expect_count("sst/event/motion", 7);
}

/* Without its password we do not connect: not before somebody listens at the new broker, as an event is told once. */
static void events_without_a_broker_are_kept(void **state)
{
    const char *path = cfg.mqtt.password_file;

    (void)state;
    strcpy(cfg.mqtt.password_file, test_path("password"));
    strcpy(cfg.mqtt.user, "me");
    assert_int_equal(sst_file_write(path, "secret", 6), 0);
    start_broker("allow_anonymous true");
    open_mqtt();
    expect_connected();
    assert_int_equal(unlink(path), 0);
    end(&broker);
    usleep(500000);
    motion(true);
    start_broker("allow_anonymous true");
    subscribe();
    assert_int_equal(sst_file_write(path, "secret", 6), 0);
    expect_heard("sst/event/motion", NULL);
    expect_heard("sst/zone/gate/motion ON", NULL);
    assert_int_equal(connects(), 2);
}

static void a_broker_that_hangs_delays_no_end(void **state)
{
    const int64_t start = sst_clock_now_ns();
    int64_t before;

    (void)state;
    start_broker("allow_anonymous true");
    open_mqtt();
    expect_connected();
    usleep(300000);
    kill(broker, SIGSTOP);
    assert_int_equal(waitpid(broker, NULL, WUNTRACED), broker);
    for (int i = 0; i < 2000; i++)
        motion(i & 1);
    usleep(500000);
    before = sst_clock_now_ns();
    close_mqtt();
    assert_quick(before, INT64_C(1200000000));
    assert_quick(start, INT64_C(10000000000));
}

/* A refusal is logged once, with the remedy; so is a broker that is not there. */
static void refusals_are_logged_once(void **state)
{
    static const char *const words[] = { "Check mqtt: user and password_file", "refused" };

    (void)state;
    start_broker("allow_anonymous false");
    for (int round = 0; round < 2; round++) {
        const char *text, *at;

        unlink(test_path("mqtt.log"));
        open_mqtt();
        for (int i = 0; i < PATIENCE && !strstr(read_text("mqtt.log"), words[round]); i++)
            usleep(10000);
        usleep(1500000); /* the second attempt comes after a second */
        assert_int_equal(connects(), 0);
        close_mqtt();
        text = read_text("mqtt.log");
        at = strstr(text, words[round]);
        if (!at || strchr(text, '\n') != text + strlen(text) - 1)
            fail_msg("not one line with '%s': %s", words[round], text);
        end(&broker);
    }
}

static void shell(const char *command)
{
    const pid_t pid = run((const char *const[]){ "sh", "-c", command, test_folder, NULL }, "shell.log");
    int ended;

    assert_int_equal(waitpid(pid, &ended, 0), pid);
    assert_int_equal(ended, 0);
}

/* A broker with a certificate and a password, as one that others can reach should have. */
static void a_broker_may_want_tls_and_a_password(void **state)
{
    char more[SST_PATH_MAX];

    (void)state;
    if (access("/usr/bin/openssl", X_OK)) {
        print_message("skipped: openssl is not installed\n");
        skip();
    }
    shell("cd $0 && openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=broker "
          "-addext subjectAltName=IP:127.0.0.1 -keyout key.pem -out cert.pem && mosquitto_passwd -c -b users me secret "
          "&& echo secret >good && echo wrong >bad");
    snprintf(more, sizeof(more),
             "allow_anonymous false\npassword_file %s/users\ncertfile %s/cert.pem\nkeyfile %s/key.pem", test_folder,
             test_folder, test_folder);
    start_broker(more);
    strcpy(cfg.mqtt.user, "me");
    for (int i = 0; i < 3; i++) {
        snprintf(cfg.mqtt.ca_file, sizeof(cfg.mqtt.ca_file), "%s",
                 i == 1 ? "/etc/ssl/certs/ca-certificates.crt" : test_path("cert.pem"));
        snprintf(cfg.mqtt.password_file, sizeof(cfg.mqtt.password_file), "%s", test_path(i == 0 ? "bad" : "good"));
        open_mqtt();
        if (i == 2)
            expect_connected();
        else
            usleep(400000);
        assert_int_equal(connects(), i == 2);
        close_mqtt();
    }
}

/* Something listens and never answers, also not to a TLS handshake: closing must not wait for it. */
static void closing_does_not_wait_for_an_answer(void **state)
{
    const struct sockaddr_in a = here(port);
    const int s = socket(AF_INET, SOCK_STREAM, 0);
    int64_t before;

    (void)state;
    assert_int_equal(bind(s, (const struct sockaddr *)&a, sizeof(a)), 0);
    assert_int_equal(listen(s, 4), 0);
    for (int tls = 0; tls < 2; tls++) {
        if (tls) {
            assert_int_equal(sst_file_write(test_path("ca"), "", 0), 0);
            strcpy(cfg.mqtt.ca_file, access("/etc/ssl/certs/ca-certificates.crt", R_OK)
                                         ? test_path("ca")
                                         : "/etc/ssl/certs/ca-certificates.crt");
        }
        open_mqtt();
        usleep(300000);
        before = sst_clock_now_ns();
        close_mqtt();
        assert_quick(before, INT64_C(1500000000));
    }
    close(s);
}

#define MQTT_TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        MQTT_TEST(state_and_events_are_published),
        MQTT_TEST(home_assistant_finds_the_array),
        MQTT_TEST(visits_reach_home_assistant),
        MQTT_TEST(zones_come_and_go),
        MQTT_TEST(connection_follows_the_configuration),
        MQTT_TEST(commands_reach_the_service),
        MQTT_TEST(pictures_come_at_most_so_often),
        MQTT_TEST(the_last_will),
        MQTT_TEST(events_without_a_broker_are_kept),
        MQTT_TEST(a_broker_that_hangs_delays_no_end),
        MQTT_TEST(the_service_may_go_and_come),
        MQTT_TEST(refusals_are_logged_once),
        MQTT_TEST(a_broker_may_want_tls_and_a_password),
        MQTT_TEST(closing_does_not_wait_for_an_answer),
    };

    if (!WITH_MQTT || access(BROKER, X_OK) || access("/usr/bin/mosquitto_sub", X_OK)) {
        puts(WITH_MQTT ? "mosquitto or mosquitto-clients is not installed" : "built without MQTT");
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* sst-mqtt between a fake service and a real broker: messages, commands, last will, reconnecting, brokers that refuse
 * or hang. Visits: mqtt_visits.c. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/mqtt_session.h"

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

/* One message announces all entities; each names topics that are published. */
static void home_assistant_finds_the_array(void **state)
{
    static const char *const ids[][2] = { { "state", "sensor" },
                                          { "problem", "binary_sensor" },
                                          { "rate", "sensor" },
                                          { "record", "switch" },
                                          { "picture", "camera" },
                                          { "latency", "sensor" },
                                          { "removed", "sensor" },
                                          { "free", "sensor" },
                                          { "camera_r0c1", "binary_sensor" },
                                          { "storage", "sensor" },
                                          { "live_rate", "sensor" },
                                          { "zone_gate", "binary_sensor" },
                                          { "focus", "number" },
                                          { "visits", "event" },
                                          { "visits_gate", "event" },
                                          { "cameras", "binary_sensor" } };
    json_t *device, *dev, *o;

    (void)state;
    start_broker("allow_anonymous true");
    strcpy(cfg.web.url, "https://cam.example/array/");
    open_mqtt();
    expect_connected();
    subscribe(); /* later: all of it is retained */
    device = expect_entity("sst", "camera_r0c1", "binary_sensor", true);
    dev = json_object_get(device, "dev");
    assert_string_equal(json_string_value(json_array_get(json_object_get(dev, "identifiers"), 0)), "sst");
    assert_string_equal(json_string_value(json_object_get(dev, "configuration_url")), "https://cam.example/array");
    assert_string_equal(json_string_value(json_object_get(json_object_get(device, "o"), "name")), "sstd");
    assert_string_equal(json_string_value(json_object_get(device, "availability_topic")), "sst/available");
    for (size_t i = 0; i < ARRAY_LEN(ids); i++) {
        const char *topic;
        char unique[64];

        print_message("%s\n", ids[i][0]);
        o = json_object_get(json_object_get(device, "cmps"), ids[i][0]);
        assert_string_equal(json_string_value(json_object_get(o, "p")), ids[i][1]);
        snprintf(unique, sizeof(unique), "sst_%s", ids[i][0]);
        assert_string_equal(json_string_value(json_object_get(o, "unique_id")), unique);
        topic = json_string_value(json_object_get(o, strcmp(ids[i][1], "camera") ? "state_topic" : "topic"));
        assert_non_null(topic);
        assert_int_equal(strncmp(topic, "sst/", 4), 0);
        if (!strcmp(ids[i][0], "problem"))
            assert_contains(json_string_value(json_object_get(o, "value_template")), "not value_json.too_slow");
        if (!strcmp(ids[i][0], "problem")) /* not of a loop of recordings that fills its quota */
            assert_non_null(strstr(json_string_value(json_object_get(o, "value_template")),
                                   "value_json.storage == 'LOW' and value_json.storage_limit == 'quota'"));
        if (!strcmp(ids[i][0], "record") || !strcmp(ids[i][0], "focus"))
            assert_contains(json_string_value(json_object_get(o, "command_topic")), "/set");
    }
    o = json_object_get(json_object_get(device, "cmps"), "snapshot");
    assert_string_equal(json_string_value(json_object_get(o, "p")), "button");
    assert_string_equal(json_string_value(json_object_get(o, "command_topic")), "sst/snapshot/set");
    json_decref(device);
    assert_int_equal(heard("homeassistant/sensor", NULL), 0);
}

static void configure(void)
{
    write_config();
    sst_events_emit(api.events, SST_EVENT_INFO, "reload", NULL, "configuration applied");
}

/* Announcements follow the configuration, after a reload and after a restart with another one. Entities of earlier
 * versions are marked before the device comes, and their topics emptied after it. */
static void zones_come_and_go(void **state)
{
    static const char gate[] = "homeassistant/binary_sensor/sst/zone_gate/config ";
    json_t *device;
    char *text;

    (void)state;
    start_broker("allow_anonymous true");
    publish("homeassistant/binary_sensor/sst/zone_old/config", "{\"state_topic\": \"sst/zone/old/motion\"}", true);
    publish("homeassistant/binary_sensor/sst/zone_gate/config", "{\"of\": \"an earlier version\"}", true);
    publish("homeassistant/binary_sensor/other/zone_old/config", "{\"of\": \"another array\"}", true);
    publish("homeassistant/device/sst/config",
            "{\"cmps\": {\"zone_lane\": {\"p\": \"binary_sensor\", \"state_topic\": \"sst/zone/lane/motion\"}}}", true);
    publish("sst/zone/old/motion", "ON", true);
    publish("sst/zone/lane/motion", "ON", true);
    subscribe();
    open_mqtt();
    json_decref(expect_entity("sst", "zone_gate", "binary_sensor", true));
    expect_count("homeassistant/binary_sensor/sst/zone_old/config ", 2); /* the second is empty */
    expect_count("homeassistant/binary_sensor/sst/zone_gate/config ", 3);
    expect_count("homeassistant/binary_sensor/sst/zone_gate/config {\"migrate_discovery\":true}", 1);
    expect_heard("sst/zone/old/motion ", NULL);
    expect_count("sst/zone/lane/motion ", 2);
    /* Removed by its platform alone, then no longer named. */
    text = strstr(read_text("heard"), "\"zone_lane\":{\"p\":\"binary_sensor\"}");
    assert_non_null(text);
    device = announced("sst");
    assert_null(json_object_get(json_object_get(device, "cmps"), "zone_lane"));
    json_decref(device);
    /* Marker, device, empty topic: in this order. */
    text = strstr(read_text("heard"), "zone_gate/config {\"migrate");
    assert_non_null(text);
    text = strstr(text, "homeassistant/device/sst/config {");
    assert_non_null(text);
    text = strstr(text, gate);
    assert_non_null(text);
    assert_int_equal(text[strlen(gate)], '\n');
    assert_int_equal(heard("homeassistant/binary_sensor/other/zone_old/config ", NULL), 1);
    motion(true);
    expect_heard("sst/zone/gate/motion ON", NULL);

    strcpy(cfg.zone[0].name, "door");
    cfg.mqtt.picture_s = 0;
    configure();
    json_decref(expect_entity("sst", "zone_door", "binary_sensor", true));
    json_decref(expect_entity("sst", "zone_gate", "binary_sensor", false));
    json_decref(expect_entity("sst", "picture", "camera", false));
    expect_count("sst/zone/gate/motion ", 2); /* the second is empty */
    assert_int_equal(connects(), 1);
}

/* Is anything of a topic retained by the broker? */
static void nothing_is_retained(const char *below, const char *node)
{
    char number[16], line[256], device[256];
    pid_t pid;
    int ended;

    snprintf(number, sizeof(number), "%d", port);
    snprintf(line, sizeof(line), "%s/#", below);
    snprintf(device, sizeof(device), "homeassistant/device/%s/config", node);
    unlink(test_path("retained"));
    publish("end/of/retained", "yes", true);
    pid = run((const char *const[]){ "timeout", "60", "mosquitto_sub", "-h", "127.0.0.1", "-p", number, "-t", line, "-t",
                                     device, "-t", "end/of/retained", "-F", "%t %p", "--retained-only", "-C",
                                     "1", NULL }, /* they come in the order of these topics */
              "retained");
    assert_int_equal(waitpid(pid, &ended, 0), pid);
    assert_string_equal(read_text("retained"), "end/of/retained yes\n");
}

/* Another topic, another broker, none: without a restart, and without leftovers. */
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
    json_decref(expect_entity("sst", "zone_gate", "binary_sensor", true));
    expect_heard("sst/camera/r0c1/state streaming", NULL);
    strcpy(cfg.mqtt.topic, "roof/array");
    configure();
    expect_heard("roof/array/available online", NULL);
    json_decref(expect_entity("roof_array", "zone_gate", "binary_sensor", true));
    assert_null(announced("sst"));
    nothing_is_retained("sst", "sst");
    expect_heard("roof/array/camera/r0c1/state streaming", NULL);
    cfg.mqtt.enabled = false;
    configure();
    expect_count("roof/array/available ", 2); /* online, and empty */
    nothing_is_retained("roof/array", "roof_array");

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
    publish("sst/snapshot/set", "perhaps", false);
    publish("sst/snapshot/set", "ON", false);
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
    assert_int_equal(service.records, 2); /* senseless ones did not reach it */
    assert_int_equal(service.focuses, 2);
    assert_int_equal(service.snapshots, 1);
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
    assert_quick(before, INT64_C(2000000000));
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
          "&& printf '\\357\\273\\277secret\\r\\n' >good && echo wrong >bad"); /* as Windows' editor writes it */
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        MQTT_TEST(state_and_events_are_published),
        MQTT_TEST(home_assistant_finds_the_array),
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

    if (mqtt_missing())
        return 77;
    return cmocka_run_group_tests(tests, NULL, NULL);
}

/* sst-mqtt: visits of the service as Home Assistant sees them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/mqtt_session.h"

static void visit(const char *name, bool active, const char *label, const char *zones)
{
    sst_events_emit(api.events, SST_EVENT_INFO, "visit",
                    json_pack("{s:s, s:s, s:b, s:s, s:o}", "visit", name, "page", "http://h:8090/#visit=x", "active",
                              active, "label", label, "zones", json_loads(zones, 0, NULL)),
                    "somebody is there");
}

/* Visits in a zone by label; the last visit with its picture and address; triggers. */
static void visits_reach_home_assistant(void **state)
{
    static const char *const ids[][2] = { { "visited_gate", "binary_sensor" },
                                          { "visit_gate", "sensor" },
                                          { "label_Pedestrian_gate", "binary_sensor" },
                                          { "last_visit", "sensor" },
                                          { "picture_gate", "image" },
                                          { "visit_picture", "image" },
                                          { "began_gate", "device_automation" },
                                          { "ended_anywhere_", "device_automation" } };
    json_t *device, *o;
    char line[2048];

    (void)state;
    start_broker("allow_anonymous true");
    cfg.mqtt.picture_s = 1;
    subscribe();
    sst_events_emit(api.events, SST_EVENT_INFO, "camera-back", NULL, "before there is a connection");
    open_mqtt();
    expect_heard("sst/event/camera-back {", NULL); /* events arrive now, too */
    for (size_t i = 0; i < ARRAY_LEN(ids); i++) {
        device = expect_entity("sst", ids[i][0], ids[i][1], true);
        o = json_object_get(json_object_get(device, "cmps"), ids[i][0]);
        if (!strcmp(ids[i][1], "image"))
            assert_string_equal(json_string_value(json_object_get(o, "content_type")), "image/jpeg");
        if (!strcmp(ids[i][0], "began_gate")) {
            assert_string_equal(json_string_value(json_object_get(o, "topic")), "sst/zone/gate/trigger");
            assert_string_equal(json_string_value(json_object_get(o, "payload")), "came");
            assert_string_equal(json_string_value(json_object_get(o, "subtype")), "gate");
        }
        json_decref(device);
    }
    expect_heard("sst/zone/gate/visited OFF", NULL);
    visit("a-1", true, "Pedestrian", "[]");
    expect_heard("sst/visit/trigger came", NULL);
    expect_heard("sst/visit {\"visit\":\"a-1\",\"page\":\"http://h:8090/#visit=x\"", NULL);
    visit("a-1", true, "Pedestrian", "[\"gate\", \"unknown\"]"); /* it enters the zone */
    expect_heard("sst/zone/gate/visited ON", NULL);
    expect_heard("sst/zone/gate/label/Pedestrian ON", NULL);
    expect_heard("sst/zone/gate/visit {", NULL);
    expect_heard("sst/zone/gate/picture PICTURE of a-1 0", NULL); /* the occluder */
    expect_heard("sst/visit/picture PICTURE of a-1 0", NULL);
    visit("b-2", true, "Car", "[\"gate\"]");
    expect_heard("sst/zone/gate/label/Car ON", NULL);
    visit("a-1", false, "Pedestrian", "[\"gate\"]");
    expect_heard("sst/visit/trigger gone", NULL);
    expect_count("sst/zone/gate/label/Pedestrian OFF", 2);         /* at first, and when it has gone */
    assert_int_equal(heard("sst/zone/gate/visited OFF", NULL), 1); /* the car is there */
    visit("b-2", false, "Car", "[\"gate\"]");
    expect_count("sst/zone/gate/visited OFF", 2);
    assert_int_equal(heard("sst/zone/gate/trigger came", NULL), 2);
    assert_int_equal(heard("sst/zone/gate/trigger gone", NULL), 2);
    assert_int_equal(heard("sst/visit/trigger came", NULL), 2);
    expect_heard("sst/zone/gate/event {", line); /* event entities */
    o = json_loads(strchr(line, '{'), 0, NULL);
    assert_string_equal(json_string_value(json_object_get(o, "event_type")), "visit_ended");
    assert_string_equal(json_string_value(json_object_get(o, "label")), "Car");
    json_decref(o);
    assert_int_equal(heard("sst/visit/event {", NULL), 4);
    visit("c-3", true, "Car", "[\"gate\"]"); /* and then the service is started anew */
    expect_count("sst/zone/gate/visited ON", 4);
    sst_events_emit(api.events, SST_EVENT_INFO, "start", NULL, "anew");
    expect_count("sst/zone/gate/visited OFF", 3);
    visit("../etc", true, "Car", "[\"gate\"]"); /* no name of a visit */
    visit("d-4", true, "Car", "[]");
    expect_heard("sst/visit {\"visit\":\"d-4\"", NULL);
    assert_int_equal(heard("sst/visit {\"visit\":\"../etc\"", NULL), 0);
}

/* A person behind leaves, with an unknown label. */
static void who_is_hidden_is_said_to_be(void **state)
{
    char line[2048];
    json_t *o;

    (void)state;
    start_broker("allow_anonymous true");
    subscribe();
    sst_events_emit(api.events, SST_EVENT_INFO, "camera-back", NULL, "before there is a connection");
    open_mqtt();
    expect_heard("sst/event/camera-back {", NULL);
    sst_events_emit(api.events, SST_EVENT_INFO, "visit",
                    json_pack("{s:s, s:s, s:b, s:b, s:s, s:[s]}", "visit", "e-5", "page", "http://h:8090/#visit=e-5",
                              "active", 1, "hidden", 1, "label", "", "zones", "gate"),
                    "Something came in gate, behind the foreground");
    expect_heard("sst/zone/gate/visited ON", NULL);
    for (int i = 0; i < 2; i++) {
        expect_heard(i ? "sst/zone/gate/visit {" : "sst/visit {\"visit\":\"e-5\"", line);
        o = json_loads(strchr(line, '{'), 0, NULL);
        assert_non_null(o);
        assert_true(json_is_true(json_object_get(o, "hidden")));
        json_decref(o);
    }
    expect_heard("sst/event/visit {", line);
    o = json_loads(strchr(line, '{'), 0, NULL);
    assert_true(json_is_true(json_object_get(json_object_get(o, "data"), "hidden")));
    assert_non_null(strstr(json_string_value(json_object_get(o, "message")), "behind the foreground"));
    json_decref(o);
}

/* A line has no motion and nobody in it; a crossing is a message, a trigger and a picture. */
static void lines_are_crossed(void **state)
{
    json_t *device, *o;
    char line[2048];

    (void)state;
    cfg.zones = 2;
    cfg.mqtt.picture_s = 1;
    start_broker("allow_anonymous true");
    subscribe();
    open_mqtt();
    device = expect_entity("sst", "crossed_drive", "sensor", true);
    assert_null(json_object_get(json_object_get(device, "cmps"), "zone_drive"));
    assert_null(json_object_get(json_object_get(device, "cmps"), "backward_drive"));
    o = json_object_get(json_object_get(device, "cmps"), "forward_drive");
    assert_string_equal(json_string_value(json_object_get(o, "topic")), "sst/zone/drive/trigger");
    assert_string_equal(json_string_value(json_object_get(o, "payload")), "forward");
    assert_string_equal(json_string_value(json_object_get(o, "type")), "crossed_forward");
    json_decref(device);
    visit("f-6", true, "Pedestrian", "[]");
    expect_heard("sst/visit {\"visit\":\"f-6\"", NULL);
    sst_events_emit(api.events, SST_EVENT_INFO, "line",
                    json_pack("{s:s, s:s, s:s, s:s, s:b}", "zone", "drive", "direction", "forward", "visit", "f-6",
                              "label", "Pedestrian", "hidden", 1),
                    "Pedestrian crossed drive forward");
    expect_heard("sst/event/line {", NULL);
    expect_heard("sst/zone/drive/crossed {\"zone\":\"drive\",\"direction\":\"forward\"", NULL);
    expect_heard("sst/zone/drive/trigger forward", NULL);
    expect_heard("sst/zone/drive/event {", line);
    assert_non_null(strstr(line, "\"event_type\":\"crossed_forward\""));
    expect_heard("sst/zone/drive/picture PICTURE of f-6 0", NULL);
    visit("f-6", false, "Pedestrian", "[\"drive\"]");
    expect_heard("sst/visit/trigger gone", NULL);
    assert_int_equal(heard("sst/zone/drive/visited", NULL), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        MQTT_TEST(visits_reach_home_assistant),
        MQTT_TEST(who_is_hidden_is_said_to_be),
        MQTT_TEST(lines_are_crossed),
    };

    if (mqtt_missing())
        return 77;
    return cmocka_run_group_tests(tests, NULL, NULL);
}

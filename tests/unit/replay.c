/* A recording is played: its sets come at their time and speed, moments are jumped to, clients do not disturb each
 * other. That pictures are made of its sets as live shows tests/sim/live.c; here they are those of the cameras. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/service/engine_internal.h"
#include "daemon/service/service_internal.h"
#include "daemon/storage/video_internal.h"
#include "tests/storage_bench.h"

#define MS ((int64_t)1000000)

struct player {
    struct bench b;
    struct service_replay *replay;
    char name[64];
    uint8_t *jpeg; /* of all frames; NULL: those of synthetic sets */
};

/* One picture for all cameras and times: nothing moves. */
static void be_still(struct player *p)
{
    struct sst_config *defaults = malloc(sizeof(*defaults));
    struct sst_image image = { 0 };
    struct bench *b = &p->b;

    synthetic_fini(&b->sets);
    b->sets.width = b->config->array.width = 96;
    b->sets.height = b->config->array.height = 72;
    b->sets.exact = true;
    assert_int_equal(sst_image_init(&image, 96, 72), 0);
    for (int c = 0; c < 3; c++)
        for (int y = 0; y < 72; y++)
            for (int x = 0; x < 96; x++)
                image.plane[c][(size_t)y * image.stride + x] =
                    (uint8_t)(synthetic_hash((uint64_t)(y / 4 * 96 + x / 4)) % 256);
    assert_int_equal(sst_image_encode_jpeg(&image, 90, &p->jpeg, &b->sets.bytes), 0);
    sst_image_fini(&image);
    synthetic_init(&b->sets);
    b->still = p->jpeg;
    assert_non_null(defaults);
    sst_config_defaults(defaults);
    b->config->live = defaults->live;
    b->config->web.views = 4;
    free(defaults);
}

/* Four seconds of sets at 10 Hz in a recording. */
static void open_player(struct player *p, bool still)
{
    const int64_t now_ns = sst_clock_now_ns();

    *p = (struct player){ 0 };
    bench_init(&p->b, SST_RECORD_OFF);
    if (still)
        be_still(p);
    p->b.config->storage.preroll_s = 4;
    bench_open_storage(&p->b);
    for (int i = 0; i <= 50; i++)
        bench_put(&p->b, now_ns - (50 - i) * 100 * MS);
    bench_wait_ready(&p->b);
    assert_int_equal(sst_storage_record(p->b.storage, 0, p->name), 0);
    bench_put(&p->b, sst_clock_now_ns());
    bench_wait(&p->b, "recording", "sets", 30);
    assert_int_equal(sst_storage_stop(p->b.storage), 0);
    usleep(1000);
    bench_put(&p->b, sst_clock_now_ns());
    bench_wait_inactive(&p->b);
    assert_int_equal(replay_open(&p->replay, p->b.storage, p->b.config), 0);
}

static void close_player(struct player *p)
{
    replay_stop(p->replay);
    assert_true(replay_join(p->replay, sst_clock_now_ns() + 60000 * MS));
    replay_close(p->replay);
    bench_fini(&p->b);
    free(p->jpeg);
}

/* @return the answer, to be released; NULL: refused with err, in `error` */
static json_t *ask(struct player *p, json_t *request, int err, char error[512])
{
    struct sst_api_answer out = { 0 };

    assert_non_null(request);
    assert_int_equal(replay_change(p->replay, request, &out), err);
    json_decref(request);
    snprintf(error, 512, "%s", out.error);
    assert_true(err ? out.error[0] != 0 && !out.body : out.body != NULL);
    return out.body;
}

static void refused(struct player *p, json_t *request, int err, const char *words)
{
    char error[512];

    assert_null(ask(p, request, err, error));
    if (!strstr(error, words))
        fail_msg("no '%s' in: %s", words, error);
}

static int64_t wall_of(const json_t *state, const char *key)
{
    int64_t wall_ns;

    assert_true(sst_clock_read(json_string_value(json_object_get(state, key)), &wall_ns));
    return wall_ns;
}

/* A command to the replay of a state. @return the state after it */
static json_t *order(struct player *p, json_t *state, json_t *more)
{
    char error[512];

    json_object_set(more, "replay", json_object_get(state, "replay"));
    json_decref(state);
    return ask(p, more, 0, error);
}

/* Until its first set is shown. */
static json_t *open_recording(struct player *p)
{
    char error[512];
    json_t *state = ask(p, json_pack("{s:s}", "recording", p->name), 0, error);

    for (int i = 0; i < 600 && json_is_null(json_object_get(state, "time")); i++) {
        usleep(20000);
        state = order(p, state, json_object());
    }
    assert_true(json_is_true(json_object_get(state, "open")));
    assert_string_equal(json_string_value(json_object_get(state, "recording")), p->name);
    return state;
}

/* Wait for the picture of a camera at a moment. */
static void expect_picture(struct player *p, int64_t wall_ns)
{
    const int64_t end_ns = sst_clock_now_ns() + 60000 * MS;
    struct live_engine *engine = replay_take(p->replay);
    const struct sst_jpeg *jpeg = NULL;
    struct sst_slot *slot;
    int64_t got_ns = 0;

    assert_non_null(engine);
    assert_int_equal(engine_outlet(engine, SST_PICTURE_CAMERA, "r0c1", &slot), 0);
    sst_slot_join(slot);
    while (llabs(got_ns - wall_ns) > MS) {
        assert_true(sst_clock_now_ns() < end_ns);
        jpeg = sst_slot_get(slot, 0);
        got_ns = jpeg ? jpeg->wall_ns : 0;
        sst_slot_jpeg_unref(jpeg);
        usleep(2000);
    }
    sst_slot_leave(slot);
    sst_slot_unref(slot);
    replay_release(p->replay);
}

static void moments_are_shown_and_played(void **state SST_UNUSED)
{
    struct player p;
    json_t *s;
    int64_t from_ns, to_ns, start_ns;
    char error[512];

    open_player(&p, false);
    assert_null(replay_take(p.replay));
    s = open_recording(&p);
    from_ns = wall_of(s, "from");
    to_ns = wall_of(s, "to");
    assert_in_range(to_ns - from_ns, 3000 * MS, 6000 * MS);
    assert_int_equal(wall_of(s, "time"), from_ns);
    expect_picture(&p, from_ns);

    s = order(&p, s, json_pack("{s:s}", "time", json_string_value(json_object_get(s, "to"))));
    assert_int_equal(wall_of(s, "time"), to_ns);
    expect_picture(&p, to_ns);
    s = order(&p, s, json_pack("{s:s}", "time", json_string_value(json_object_get(s, "from"))));
    expect_picture(&p, from_ns);

    /* Twice as fast, to the end, where it stops. */
    start_ns = sst_clock_now_ns();
    s = order(&p, s, json_pack("{s:b, s:f}", "playing", 1, "speed", 2.0));
    for (int i = 0; i < 3000 && json_is_true(json_object_get(s, "playing")); i++) {
        usleep(20000);
        s = order(&p, s, json_object());
    }
    assert_false(json_is_true(json_object_get(s, "playing")));
    assert_true(sst_clock_now_ns() - start_ns >= (to_ns - from_ns) / 2 - 200 * MS);
    assert_int_equal(wall_of(s, "time"), to_ns);
    expect_picture(&p, to_ns);

    /* A pause holds. */
    s = order(&p, s, json_pack("{s:s, s:b}", "time", json_string_value(json_object_get(s, "from")), "playing", 0));
    usleep(300000);
    s = order(&p, s, json_object());
    assert_int_equal(wall_of(s, "time"), from_ns);
    s = order(&p, s, json_pack("{s:b}", "close", 1));
    assert_true(json_is_null(json_object_get(s, "replay")));
    json_decref(s);
    for (int i = 0; i < 3000 && replay_take(p.replay); i++) {
        replay_release(p.replay);
        usleep(2000);
    }
    assert_null(replay_take(p.replay));

    /* Opened to be played, as the page does. */
    s = ask(&p, json_pack("{s:s, s:b}", "recording", p.name, "playing", 1), 0, error);
    assert_true(json_is_true(json_object_get(s, "playing")));
    for (int i = 0; i < 3000 && wall_of(s, "time") == from_ns; i++) {
        usleep(20000);
        s = order(&p, s, json_object());
    }
    assert_true(wall_of(s, "time") > from_ns);
    json_decref(s);
    close_player(&p);
}

/* Time of the main view's picture, with the digits of a state; 0: there is none. */
static int64_t picture_ns(struct sst_slot *slot)
{
    const struct sst_jpeg *jpeg = sst_slot_get(slot, 0);
    const int64_t wall_ns = jpeg ? jpeg->wall_ns / MS * MS : 0;

    sst_slot_jpeg_unref(jpeg);
    return wall_ns;
}

/* A client without control changes no view of others, and leaves some to them. */
static void check_views_of(struct live_engine *engine)
{
    struct sst_api_answer out = { 0 };
    json_t *none = json_object();
    char id[16] = "";

    for (int i = 0; i < 3; i++) {
        assert_int_equal(engine_view_create(engine, "guard", NULL, &out), 0);
        snprintf(id, sizeof(id), "%s", json_string_value(json_object_get(out.body, "id")));
        json_decref(out.body);
    }
    assert_int_equal(engine_view_create(engine, "guard", NULL, &out), -EOVERFLOW);
    assert_int_equal(engine_view_create(engine, "other", NULL, &out), 0);
    json_decref(out.body);
    assert_int_equal(engine_view_change(engine, "other", id, NULL, &out), -EPERM);
    assert_int_equal(engine_remove(engine, "other", id, NULL, &out), -EPERM);
    assert_int_equal(engine_view_change(engine, "other", "main", NULL, &out), -EPERM);
    assert_int_equal(engine_view_change(engine, "guard", id, none, &out), 0);
    json_decref(out.body);
    assert_int_equal(engine_view_change(engine, "", id, none, &out), 0);
    json_decref(out.body);
    json_decref(none);
}

/* The clock of a playing recording waits for the first picture, and each picture has the time of its set, also where
 * nothing moves. */
static void the_clock_waits_for_pictures(void **state SST_UNUSED)
{
    const int64_t end_ns = sst_clock_now_ns() + 120000 * MS;
    int64_t from_ns, to_ns, mid_ns, shown_ns = 0;
    struct sst_slot *slot;
    struct player p;
    char error[512], mid[SST_CLOCK_TEXT];
    json_t *s;

    assert_int_equal(setenv("SST_MODELS", "models", 1), 0);
    open_player(&p, true);
    s = ask(&p, json_pack("{s:s, s:b}", "recording", p.name, "playing", 1), 0, error);
    while (!json_is_true(json_object_get(s, "open")) || json_is_null(json_object_get(s, "time"))) {
        assert_true(sst_clock_now_ns() < end_ns);
        usleep(2000);
        s = order(&p, s, json_object());
    }
    from_ns = wall_of(s, "from");
    to_ns = wall_of(s, "to");
    assert_int_equal(engine_outlet(replay_take(p.replay), SST_PICTURE_VIEW, "main", &slot), 0);
    sst_slot_join(slot);
    while (!shown_ns) { /* whoever asks sees no later time before there is a picture */
        assert_true(sst_clock_now_ns() < end_ns);
        s = order(&p, s, json_object());
        shown_ns = picture_ns(slot);
        if (!shown_ns)
            assert_int_equal(wall_of(s, "time"), from_ns);
    }
    while (json_is_true(json_object_get(s, "playing")) || picture_ns(slot) != to_ns) {
        assert_true(sst_clock_now_ns() < end_ns);
        usleep(10000);
        assert_true(picture_ns(slot) >= from_ns);
        s = order(&p, s, json_object());
    }

    /* After a jump, too. */
    mid_ns = from_ns + (to_ns - from_ns) / 2;
    sst_clock_text(mid, mid_ns);
    s = order(&p, s, json_pack("{s:s, s:b}", "time", mid, "playing", 1));
    while (picture_ns(slot) == to_ns) {
        assert_true(sst_clock_now_ns() < end_ns);
        s = order(&p, s, json_object());
        if (picture_ns(slot) == to_ns) {
            assert_true(json_is_true(json_object_get(s, "computing")));
            assert_true(wall_of(s, "time") == to_ns || llabs(wall_of(s, "time") - mid_ns) < 100 * MS);
        }
    }
    assert_true(picture_ns(slot) - from_ns >= (to_ns - from_ns) / 2 - 100 * MS);
    json_decref(s);
    check_views_of(replay_take(p.replay));
    replay_release(p.replay);
    sst_slot_leave(slot);
    sst_slot_unref(slot);
    replay_release(p.replay);
    close_player(&p);
    assert_int_equal(unsetenv("SST_MODELS"), 0);
}

static void clients_do_not_disturb_each_other(void **state SST_UNUSED)
{
    struct sst_api_answer seen = { 0 };
    struct player p;
    json_t *s;

    open_player(&p, false);
    refused(&p, json_object(), -EINVAL, "give a recording or a time");
    refused(&p, json_pack("{s:s}", "recordings", "x"), -EINVAL, "recordings");
    refused(&p, json_pack("{s:s}", "time", "now"), -EINVAL, "time must be like");
    refused(&p, json_pack("{s:s, s:f}", "recording", p.name, "speed", 99.0), -EINVAL, "speed must be");
    refused(&p, json_pack("{s:s, s:i}", "recording", p.name, "playing", 1), -EINVAL, "true or false");
    refused(&p, json_pack("{s:s}", "recording", "2020-01-01T00-00-00Z"), -ENOENT, "none of that name");
    refused(&p, json_pack("{s:s}", "recording", "../x"), -ENOENT, "none of that name");
    refused(&p, json_pack("{s:s}", "time", "2020-01-01T00:00:00Z"), -ENOENT, "no recording has that moment");
    refused(&p, json_pack("{s:s}", "replay", "r0"), -ENOENT, "has ended");

    s = open_recording(&p);
    refused(&p, json_pack("{s:s}", "recording", p.name), -EBUSY, "another client plays");
    refused(&p, json_pack("{s:s, s:b}", "replay", "r0", "close", 1), -ENOENT, "has ended");
    assert_int_equal(replay_state(p.replay, &seen), 0);
    assert_true(json_is_null(json_object_get(seen.body, "replay"))); /* a client without control is refused */
    assert_true(json_is_true(json_object_get(seen.body, "open")));
    json_decref(seen.body);

    /* By a moment of it, which opens it anew without a gap. */
    s = order(&p, s, json_pack("{s:s}", "recording", p.name));
    json_decref(s);
    close_player(&p);
}

/* A see-through picture of a moment of the recording. @param jpeg  its bytes */
static void write_view(struct player *p, int64_t wall_ns, const char *jpeg)
{
    const struct video_line l = { .t_ns = 1, .wall_ns = wall_ns, .set = 7, .bytes = (int64_t)strlen(jpeg) };
    char path[SST_PATH_MAX], text[SST_VIDEO_LINE_MAX];
    size_t n;

    assert_int_equal(bench_recording(&p->b, 0, path), 1);
    n = video_write_line(text, &l);
    assert_int_equal(sst_file_write(in(path, SST_VIDEO_INDEX), text, n), 0);
    assert_int_equal(sst_file_write(in(path, SST_VIDEO_PICTURES), jpeg, strlen(jpeg)), 0);
}

/* Wait until a view shows these bytes, of a moment. */
static void expect_bytes(struct player *p, const char *id, int64_t wall_ns, const char *want)
{
    const int64_t end_ns = sst_clock_now_ns() + 60000 * MS;
    struct live_engine *engine = replay_take(p->replay);
    struct sst_slot *slot;
    bool found = false;

    assert_non_null(engine);
    assert_int_equal(engine_outlet(engine, SST_PICTURE_VIEW, id, &slot), 0);
    while (!found) {
        const struct sst_jpeg *jpeg = sst_slot_get(slot, 0);

        found = jpeg && jpeg->bytes == strlen(want) && !memcmp(jpeg->data, want, jpeg->bytes) && jpeg->wall_ns == wall_ns && jpeg->set == 7;
        sst_slot_jpeg_unref(jpeg);
        assert_true(sst_clock_now_ns() < end_ns);
        usleep(2000);
    }
    sst_slot_unref(slot);
    replay_release(p->replay);
}

/* Views show a recorded picture of the moment until theirs is computed: here never. */
static void recorded_pictures_come_first(void **state SST_UNUSED)
{
    struct sst_api_answer out = { 0 };
    char id[16], at[SST_CLOCK_TEXT];
    struct sst_slot *slot;
    struct player p;
    int64_t from_ns;
    json_t *s;

    open_player(&p, true);
    p.b.config->web.views = 4;
    snprintf(p.b.config->live.model, sizeof(p.b.config->live.model), "none.onnx");
    replay_configure(p.replay, p.b.config);
    s = open_recording(&p);
    from_ns = wall_of(s, "from");
    assert_int_equal(engine_outlet(replay_take(p.replay), SST_PICTURE_VIEW, "main", &slot), 0);
    assert_null(sst_slot_get(slot, 0));
    sst_slot_unref(slot);
    write_view(&p, from_ns + 1040 * MS, "first");
    sst_clock_text(at, from_ns + 1000 * MS);
    s = order(&p, s, json_pack("{s:s}", "time", at));
    expect_bytes(&p, "main", from_ns + 1040 * MS, "first");
    /* A view that comes later has it, too. */
    assert_int_equal(engine_view_create(replay_take(p.replay), "", NULL, &out), 0);
    snprintf(id, sizeof(id), "%s", json_string_value(json_object_get(out.body, "id")));
    json_decref(out.body);
    expect_bytes(&p, id, from_ns + 1040 * MS, "first");
    /* A moment far from it has none: the picture before stays. */
    sst_clock_text(at, from_ns + 2000 * MS);
    s = order(&p, s, json_pack("{s:s}", "time", at));
    expect_bytes(&p, "main", from_ns + 1040 * MS, "first");
    write_view(&p, from_ns + 2500 * MS, "second");
    sst_clock_text(at, from_ns + 2900 * MS);
    s = order(&p, s, json_pack("{s:s}", "time", at));
    expect_bytes(&p, id, from_ns + 2500 * MS, "second");
    json_decref(s);
    replay_release(p.replay);
    replay_release(p.replay);
    close_player(&p);
}

/* A recording deleted or damaged meanwhile ends nothing but itself. */
static void a_deleted_recording_ends(void **state SST_UNUSED)
{
    struct player p;
    json_t *s;
    char line[2 * SST_PATH_MAX];

    open_player(&p, false);
    s = open_recording(&p);
    snprintf(line, sizeof(line), "truncate -s 500 %s/recordings/%s/segments/*.mkv", dir, p.name);
    assert_int_equal(system(line), 0);
    s = order(&p, s, json_pack("{s:b, s:f}", "playing", 1, "speed", 16.0));
    assert_int_equal(sst_storage_delete(p.b.storage, p.name), 0);
    for (int i = 0; i < 3000 && json_is_true(json_object_get(s, "playing")); i++) {
        usleep(20000);
        s = order(&p, s, json_object());
    }
    assert_false(json_is_true(json_object_get(s, "playing")));
    json_decref(s);
    refused(&p, json_pack("{s:s}", "time", "2020-01-01T00:00:00Z"), -EBUSY, "another client plays");
    close_player(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(moments_are_shown_and_played),
        TEST(the_clock_waits_for_pictures),
        TEST(clients_do_not_disturb_each_other),
        TEST(recorded_pictures_come_first),
        TEST(a_deleted_recording_ends),
    };
    const int rc = begin_tests(WITH_AVFORMAT);

    return rc ? rc : cmocka_run_group_tests(tests, NULL, remove_all);
}

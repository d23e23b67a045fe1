/* Folder of a posed light field: the round trip, and a fault for every field. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/lightfield/lightfield.h"
#include "pipeline/posed/picture.h"
#include "pipeline/posed/posed_internal.h"
#include "tests/posed_model.h"

#define VIEWS 3

static void make(struct sst_posed *posed)
{
    static const char *const file[VIEWS] = { "0000.png", "0001.png", "0002.png" };

    assert_int_equal(sst_posed_init(posed, VIEWS), 0);
    posed->width = MODEL_WIDTH;
    posed->height = MODEL_HEIGHT;
    posed->channels = 3;
    posed->bits = 8;
    posed->metric = true;
    posed->up[1] = -1;
    posed->geographic = true;
    posed->latitude = 48.25;
    posed->longitude = -0.1;
    posed->altitude_m = 310;
    posed->kelvin_scale = 0.04;
    posed->kelvin_offset = -3;
    posed->samples = (struct sst_samples){ 10, 20000 };
    posed->median_px = 0.5;
    strcpy(posed->source, "a test");
    for (int k = 0; k < VIEWS; k++) {
        struct sst_posed_view *v = &posed->view[k];

        snprintf(v->name, sizeof(v->name), "Bl\xc3\xa4tter %d.png", k);
        strcpy(v->file, file[k]);
        v->camera.fx = 70 + k;
        v->camera.fy = 71;
        v->camera.cx = 1 / 3.0;
        v->camera.cy = 20;
        if (k == 2)
            continue; /* not placed */
        v->camera.known = true;
        v->camera.lens = k ? 8 : 5;
        v->camera.k[0] = -0.1;
        v->camera.k[7] = k ? 0.01 : 0;
        strcpy(v->camera.name, "north");
        truth_rotation(v->camera.rotation, (const double[3]){ 0.1, -0.2, 0.3 * k });
        v->camera.position_mm[0] = 1e5 / 7 * k;
        v->moment = k;
        v->time_s = 0.1 * k;
    }
    posed->points = calloc(2, sizeof(*posed->points));
    assert_non_null(posed->points);
    posed->point_count = 2;
    posed->points[1] = (struct sst_posed_point){ { 1 / 3.0, -1e6, 1e-9 }, 7 };
}

/* A light field in test_folder/lf. */
static void write_folder(const struct sst_posed *posed)
{
    struct sst_outdir out;

    assert_int_equal(sst_outdir_open(&out, test_path("lf"), true), 0);
    assert_int_equal(sst_path_make_dir(test_path("%s/views", sst_path_base(out.temporary))), 0);
    for (int k = 0; k < VIEWS; k++)
        put_picture(test_path("%s/views/%s", sst_path_base(out.temporary), posed->view[k].file), k);
    assert_int_equal(sst_outdir_end(&out, sst_posed_write(posed, out.temporary)), 0);
}

static void assert_same(const struct sst_posed *a, const struct sst_posed *b)
{
    assert_int_equal(a->count, b->count);
    assert_memory_equal(a->up, b->up, sizeof(a->up));
    assert_string_equal(a->source, b->source);
    assert_true(a->metric == b->metric && a->geographic == b->geographic && a->latitude == b->latitude &&
                a->longitude == b->longitude && a->altitude_m == b->altitude_m && a->kelvin_scale == b->kelvin_scale &&
                a->kelvin_offset == b->kelvin_offset && a->samples.black == b->samples.black &&
                a->samples.white == b->samples.white && a->median_px == b->median_px);
    for (int k = 0; k < a->count; k++) {
        const struct sst_posed_view *p = &a->view[k], *q = &b->view[k];

        assert_string_equal(p->name, q->name);
        assert_string_equal(p->file, q->file);
        assert_int_equal(p->moment, q->moment);
        assert_true(isnan(p->time_s) ? isnan(q->time_s) : p->time_s == q->time_s);
        assert_memory_equal(&p->camera, &q->camera, sizeof(p->camera));
    }
    assert_int_equal(a->point_count, b->point_count);
    for (int i = 0; i < a->point_count; i++) {
        assert_memory_equal(a->points[i].at_mm, b->points[i].at_mm, sizeof(a->points[i].at_mm));
        assert_int_equal(a->points[i].views, b->points[i].views);
    }
}

static void a_folder_is_read_as_it_was_written(void **state SST_UNUSED)
{
    struct sst_posed posed, again, third;
    struct points_file before;
    const struct sst_deep *borrowed[2];
    struct sst_deep picture;
    struct rlimit usual, few;

    make(&posed);
    write_folder(&posed);
    assert_true(sst_posed_is(test_path("lf")));
    assert_false(sst_posed_is(test_path("none")));
    assert_int_equal(sst_posed_load(&again, test_path("lf")), 0);
    assert_same(&posed, &again);
    assert_int_equal(strlen(again.view[1].sha256), 64);
    assert_int_equal(sst_posed_picture(&picture, &again, test_path("lf"), 1), 0);
    assert_int_equal(picture.channels, 3);
    assert_int_equal(sst_map_u16_row(&picture.plane[1], 3)[5], 20);
    sst_deep_fini(&picture);

    /* Pictures that are kept are read once; too many are not kept. */
    sst_posed_keep(&again, 1);
    assert_null(again.kept);
    assert_int_equal(getrlimit(RLIMIT_AS, &usual), 0);
    few = usual;
    few.rlim_cur = 4 * 2 * MODEL_WIDTH * MODEL_HEIGHT; /* a channel of one view is a quarter */
    assert_int_equal(setrlimit(RLIMIT_AS, &few), 0);
    sst_posed_keep(&again, 1e6);
    assert_int_equal(setrlimit(RLIMIT_AS, &usual), 0);
    assert_null(again.kept);
    sst_posed_keep(&again, 1e6);
    for (int i = 0; i < 2; i++) {
        struct sst_deep own = { 0 };

        assert_int_equal(sst_posed_borrow(&borrowed[i], &own, &again, test_path("lf"), 1), 0);
        assert_int_equal(own.width, 0);
    }
    assert_ptr_equal(borrowed[0], borrowed[1]);
    assert_int_equal(sst_map_u16_row(&borrowed[1]->plane[1], 3)[5], 20);

    /* New poses with other points: the old points' file goes. */
    assert_int_equal(posed_read_json(&third, &before, test_path("lf/lightfield.json")), 0);
    sst_posed_fini(&third);
    assert_true(sst_path_exists(test_path("lf/%s", before.name)));
    again.view[2].camera.known = true;
    again.points[0].views = 99;
    assert_int_equal(sst_posed_save(&again, test_path("lf")), 0);
    assert_int_equal(sst_posed_load(&third, test_path("lf")), 0);
    assert_same(&again, &third);
    assert_false(sst_path_exists(test_path("lf/%s", before.name)));
    sst_posed_fini(&third);

    /* Points with their sights; as many as the points say. */
    again.sights = calloc(3, sizeof(*again.sights));
    assert_non_null(again.sights);
    again.sight_count = 3;
    again.points[0].views = 1;
    again.points[1].views = 2;
    again.sights[2] = (struct sst_posed_sight){ 1, -0.25f, 7.5f };
    assert_int_equal(sst_posed_save(&again, test_path("lf")), 0);
    assert_int_equal(sst_posed_load(&third, test_path("lf")), 0);
    assert_same(&again, &third);
    assert_int_equal(third.sight_count, 3);
    assert_memory_equal(third.sights, again.sights, 3 * sizeof(*again.sights));
    sst_posed_fini(&third);
    again.points[1].views = 3;
    assert_int_equal(sst_posed_save(&again, test_path("lf")), -EINVAL);
    again.points[1].views = 2;
    again.sights[0].view = again.count;
    assert_int_equal(sst_posed_save(&again, test_path("lf")), -EINVAL);
    sst_posed_fini(&posed);
    sst_posed_fini(&again);
}

static void changed_files_are_refused(void **state SST_UNUSED)
{
    struct sst_posed posed, again;
    struct sst_deep picture;
    struct points_file points;

    make(&posed);
    write_folder(&posed);
    assert_int_equal(sst_posed_load(&again, test_path("lf")), 0);
    put_picture(test_path("lf/views/0001.png"), 9);
    assert_int_equal(sst_posed_picture(&picture, &again, test_path("lf"), 1), -EBADMSG);
    assert_int_equal(sst_path_exists(test_path("lf/views/0002.png")), true);
    (void)remove(test_path("lf/views/0002.png"));
    assert_int_equal(sst_posed_picture(&picture, &again, test_path("lf"), 2), -ENOENT);
    sst_posed_fini(&again);
    assert_int_equal(posed_read_json(&again, &points, test_path("lf/lightfield.json")), 0);
    sst_posed_fini(&again);
    assert_int_equal(sst_file_write(test_path("lf/%s", points.name), "SSTPTS1\n", 8), 0);
    assert_int_equal(sst_posed_load(&again, test_path("lf")), -EBADMSG);
    (void)remove(test_path("lf/%s", points.name));
    assert_int_equal(sst_posed_load(&again, test_path("lf")), -ENOENT);
    sst_posed_fini(&posed);
}

static void middle_and_forward_are_of_the_placed_views(void **state SST_UNUSED)
{
    struct sst_posed posed;
    double forward[3];

    assert_int_equal(sst_posed_init(&posed, 0), -EINVAL);
    assert_int_equal(sst_posed_init(&posed, SST_POSED_MAX_VIEWS + 1), -EINVAL);
    assert_int_equal(sst_posed_init(&posed, 5), 0);
    assert_int_equal(sst_posed_middle(&posed), -1);
    for (int k = 0; k < 4; k++) {
        posed.view[k].camera.known = true;
        posed.view[k].camera.position_mm[0] = 100.0 * k * k; /* mean 350: view 2 is 50 away, view 3 550 */
    }
    assert_int_equal(sst_posed_placed(&posed), 4);
    assert_int_equal(sst_posed_middle(&posed), 2);
    sst_posed_forward(&posed, forward);
    assert_true(forward[0] == 0 && forward[1] == 0 && forward[2] == 1);
    /* The nearest one looks backwards. */
    posed.view[2].camera.rotation[0] = posed.view[2].camera.rotation[8] = -1;
    assert_int_equal(sst_posed_middle(&posed), 1);
    sst_posed_fini(&posed);
}

/* --- faults ------------------------------------------------------------------------------------------------------- */

/* A member "views/0/rotation/3" of lightfield.json, or its parent. */
static json_t *find(json_t *root, char *path, const char **last)
{
    char *save, *part = strtok_r(path, "/", &save), *next;

    for (; (next = strtok_r(NULL, "/", &save)); part = next)
        root = json_is_array(root) ? json_array_get(root, (size_t)atoi(part)) : json_object_get(root, part);
    *last = part;
    return root;
}

/* Load the folder with one member replaced by a value, or removed with NULL; it is refused with these words. */
static void assert_refused(const char *member, const char *value, const char *words)
{
    char path[128], text[SST_LOG_MAX] = "", file[SST_PATH_MAX];
    struct sst_posed posed;
    const char *last;
    json_error_t e;
    json_t *root, *at, *v = value ? json_loads(value, JSON_DECODE_ANY, &e) : NULL;
    char *saved;

    snprintf(file, sizeof(file), "%s", test_path("lf/lightfield.json"));
    root = json_load_file(file, 0, &e);
    saved = json_dumps(root, 0);
    snprintf(path, sizeof(path), "%s", member);
    at = find(root, path, &last);
    assert_non_null(at);
    if (json_is_array(at))
        assert_int_equal(json_array_set_new(at, (size_t)atoi(last), v), 0);
    else if (v)
        assert_int_equal(json_object_set_new(at, last, v), 0);
    else
        assert_int_equal(json_object_del(at, last), 0);
    assert_int_equal(json_dump_file(root, file, 0), 0);
    sst_log_hold_errors(text);
    if (sst_posed_load(&posed, test_path("lf")) != -EBADMSG)
        fail_msg("%s = %s is accepted", member, value);
    sst_log_hold_errors(NULL);
    if (!strstr(text, words) || !strstr(text, "lightfield.json"))
        fail_msg("%s = %s: no '%s' in: %s", member, value, words, text);
    assert_int_equal(sst_file_write(file, saved, strlen(saved)), 0);
    free(saved);
    json_decref(root);
}

static void every_field_is_checked(void **state SST_UNUSED)
{
    static const char *const faults[][3] = {
        { "format", "\"x\"", "format" },
        { "version", "4", "newer" },
        { "version", "2.5", "version" },
        { "kind", "\"plain\"", "kind" },
        { "width", "0", "width" },
        { "height", "40000", "height" },
        { "channels", "2", "channels" },
        { "bits", "12", "bits" },
        { "metric", "1", "metric" },
        { "source", "7", "source" },
        { "history", NULL, "history is missing" },
        { "samples", "[5, 5]", "samples" },
        { "up", "[0, 2, 0]", "up" },
        { "up", "[0, 1]", "up" },
        { "geographic/latitude", "91", "geographic" },
        { "geographic/height", "1", "geographic.height" },
        { "kelvin", "[1e12, 0]", "kelvin" },
        { "median_px", "-1", "median_px" },
        { "unheard", "1", "unheard" },
        { "points/count", "3", "points" },
        { "points/file", "\"../x\"", "points.file" },
        { "points", "[]", "points" },
        { "views", "[]", "views" },
        { "views", "{}", "views" },
        { "views/1", "5", "views[1]" },
        { "views/1/name", "\"\"", "name is empty" },
        { "views/1/name", "\"Bl\xc3\xa4tter 0.png\"", "name is the same" },
        { "views/1/file", "\"0000.png\"", "file is the same" },
        { "views/1/file", "\"a/b.png\"", "plain file name" },
        { "views/1/sha256", "\"12\"", "views[1].sha256" },
        { "views/1/lens/fx", "0", "lens" },
        { "views/1/lens/fx", "1e9", "focal" },
        { "views/1/lens/k", "[1, 2, 3]", "coefficients" },
        { "views/1/lens/k", "[\"1\", 0, 0, 0, 0]", "views[1].lens.k" },
        { "views/1/lens/z", "0", "views[1].lens.z" },
        { "views/1/lens", NULL, "views[1].lens is missing" },
        { "views/1/rotation", NULL, "views[1].rotation" },
        { "views/1/rotation/0", "2", "rotation" },
        { "views/1/rotation/0", "null", "views[1].rotation" },
        { "views/1/rotation", "[-1, 0, 0, 0, 1, 0, 0, 0, 1]", "rotation" },
        { "views/1/position_mm", "[0, 0, 1e13]", "1e12" },
        { "views/1/moment", "-1", "moment" },
        { "views/1/time_s", "1e12", "time_s" },
        { "views/1/colour", "1", "views[1].colour" },
    };
    struct sst_lightfield lf;
    struct sst_posed posed;

    make(&posed);
    write_folder(&posed);
    sst_posed_fini(&posed);
    for (size_t i = 0; i < ARRAY_LEN(faults); i++)
        assert_refused(faults[i][0], faults[i][1], faults[i][2]);
    assert_int_equal(sst_posed_load(&posed, test_path("lf")), 0);
    sst_posed_fini(&posed);
    assert_int_equal(sst_lightfield_load(&lf, test_path("lf"), 0, 1), -EBADMSG);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_folder_is_read_as_it_was_written),
        cmocka_unit_test(changed_files_are_refused),
        cmocka_unit_test(middle_and_forward_are_of_the_placed_views),
        cmocka_unit_test(every_field_is_checked),
    };

    sst_log_set_level(SST_LOG_ERROR);
    return cmocka_run_group_tests(tests, test_folder_create, test_folder_remove);
}

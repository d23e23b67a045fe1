/* Kalibr's camchain.yaml: pinhole cameras cam0, cam1 ...; T_cn_cnm1 takes points (metres) from the camera before into
 * this one; pixel centres on integers; radtan is k1 k2 p1 p2. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/yaml.h"
#include "pipeline/camera/format_parts.h"
#include "pipeline/camera/numbers.h"

#define METRE_MM 1000.0

/* 4 x 4 as a list of four lists; the last row is 0 0 0 1. */
static bool read_transform(struct sst_yaml *doc, const struct sst_yaml_node *node, double R[9], double T[3])
{
    double row[4];
    int i = 0;

    if (node->type != SST_YAML_LIST || node->count != 4) {
        sst_yaml_fault(doc, node, "must be four lists of four numbers");
        return false;
    }
    for (const struct sst_yaml_node *n = node->first; n; n = n->next, i++) {
        if (n->type != SST_YAML_LIST) {
            sst_yaml_fault(doc, n, "must be four lists of four numbers");
            return false;
        }
        if (!sst_yaml_doubles(doc, n, -SST_CALIB_LARGEST, SST_CALIB_LARGEST, row, 4))
            return false;
        if (i < 3) {
            memcpy(R + 3 * i, row, 3 * sizeof(double));
            T[i] = row[3];
        } else if (row[0] != 0 || row[1] != 0 || row[2] != 0 || row[3] != 1) {
            sst_yaml_fault(doc, n, "must end with the row 0, 0, 0, 1");
            return false;
        }
    }
    return true;
}

static void read_lens(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_calib_camera *cam)
{
    static const char *const models[] = { "radtan", "none", "equidistant", "fov", "equi" };
    bool plain = true;
    struct sst_yaml_node *model_at = sst_yaml_need(doc, map, "distortion_model");
    const struct sst_yaml_node *list = sst_yaml_get(map, "distortion_coeffs");
    double d[4] = { 0 };
    int model;

    if (!sst_yaml_choice(doc, model_at, models, ARRAY_LEN(models), &model))
        return;
    for (const struct sst_yaml_node *n = model == 1 && list ? list->first : NULL; n; n = n->next)
        plain &= strtod(n->text, NULL) == 0;
    if (!plain)
        sst_yaml_fault(doc, list, "are not 0, but distortion_model is none; correct one of them");
    if (model == 1)
        return;
    if (model > 1) {
        sst_yaml_fault(doc, model_at,
                       "is %s, a fisheye model; cameras here are pinholes with OpenCV's distortion, so "
                       "calibrate again with radtan or with sst",
                       model_at->text);
        return;
    }
    if (!list || list->type != SST_YAML_LIST || list->count != 4) {
        sst_yaml_fault(doc, list ? list : map, "lacks the four distortion_coeffs k1, k2, p1, p2 of radtan");
        return;
    }
    if (sst_yaml_doubles(doc, list, -SST_CALIB_LARGEST, SST_CALIB_LARGEST, d, 4))
        (void)sst_loose_lens(cam, d, 4);
}

static void read_place(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_loose_camera *c)
{
    (void)sst_yaml_int(doc, sst_yaml_get(map, "row"), 0, SST_MAX_VIEWS - 1, &c->row);
    (void)sst_yaml_int(doc, sst_yaml_get(map, "col"), 0, SST_MAX_VIEWS - 1, &c->col);
}

/* Pose from the previous camera's: X_n = R X_before + T, before = (Rb, Tb) from the first camera. */
static void chain(double pose_R[9], double pose_T[3], const double R[9], const double T[3])
{
    double t[3];

    for (int i = 0; i < 3; i++) {
        t[i] = T[i];
        for (int l = 0; l < 3; l++)
            t[i] += R[3 * i + l] * pose_T[l];
    }
    sst_numbers_mul3(R, pose_R, pose_R);
    memcpy(pose_T, t, sizeof(t));
}

static void read_camera(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_loose_camera *c)
{
    struct sst_yaml_node *model = sst_yaml_need(doc, map, "camera_model"),
                         *size_at = sst_yaml_need(doc, map, "resolution"),
                         *intrinsics = sst_yaml_need(doc, map, "intrinsics");
    double v[4], size[2];

    if (model && strcmp(model->text, "pinhole") != 0) {
        sst_yaml_fault(doc, model, "is %.40s; only pinhole is supported, so calibrate again with it or with sst",
                       model->text); /* its intrinsics mean something else */
    } else if (intrinsics && (intrinsics->type != SST_YAML_LIST || intrinsics->count != 4)) {
        sst_yaml_fault(doc, intrinsics, "must be the list fu, fv, pu, pv");
    } else if (sst_yaml_doubles(doc, intrinsics, -SST_CALIB_LARGEST, SST_CALIB_LARGEST, v, 4)) {
        c->cam.fx = v[0];
        c->cam.fy = v[1];
        c->cam.cx = v[2];
        c->cam.cy = v[3];
    }
    if (sst_yaml_doubles(doc, size_at, 1, SST_IMAGE_MAX_SIDE, size, 2)) {
        c->width = (int)size[0];
        c->height = (int)size[1];
    }
    read_lens(doc, map, &c->cam);
    read_place(doc, map, c);
}

/* A camera of the file, in the order of the numbers. */
struct link {
    long number;
    struct sst_yaml_node *map;
};

static int by_number(const void *a, const void *b)
{
    const struct link *p = a, *q = b;

    return (p->number > q->number) - (p->number < q->number);
}

/* The keys "cam0", "cam1" ...; other mappings that look like cameras are faults. @return how many, -EBADMSG: too many
 */
static int find_cameras(struct sst_yaml *doc, struct sst_yaml_node *root, struct link out[SST_MAX_VIEWS],
                        const char *name)
{
    int n = 0;

    for (struct sst_yaml_node *c = root->first; c; c = c->next) {
        char *end = NULL;
        const bool cam = !strncmp(c->key, "cam", 3) && isdigit((unsigned char)c->key[3]);
        const long number = cam ? strtol(c->key + 3, &end, 10) : 0;

        if (cam && !*end && n == SST_MAX_VIEWS) {
            sst_log_error("%s has more than %d cameras, the maximum", name, SST_MAX_VIEWS);
            return -EBADMSG;
        }
        if (cam && !*end)
            out[n++] = (struct link){ number, c };
        else if (sst_yaml_get(c, "intrinsics") || sst_yaml_get(c, "distortion_coeffs"))
            sst_yaml_fault(doc, c, "is a camera that is not named cam0, cam1 ...; rename it");
    }
    qsort(out, (size_t)n, sizeof(*out), by_number);
    return n;
}

/* Each transform is from the camera of the number before: without it the chain is broken. */
static bool follows(struct sst_yaml *doc, const struct link *link, int i, const struct sst_yaml_node *to)
{
    const long before = link[i].number - 1;

    if (i == 0 && !to)
        return true;
    if (i == 0 && before < 0)
        sst_yaml_fault(doc, to, "of the first camera has no camera to start from; remove it");
    else if (i > 0 && link[i - 1].number == before + 1)
        sst_yaml_fault(doc, link[i].map, "has the number of %.20s; keep one of them", link[i - 1].map->key);
    else if (i == 0 || link[i - 1].number != before)
        sst_yaml_fault(doc, link[i].map,
                       "follows cam%ld, which is missing; use the whole chain, or calibrate again without it", before);
    else if (!to)
        sst_yaml_fault(doc, link[i].map,
                       "lacks T_cn_cnm1, the transform from the previous camera; calibrate them together");
    else
        return true;
    return false;
}

/* Read the cameras in the order of their numbers. @return -EBADMSG if there are too many, logged */
static int read_cameras(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_loose *loose, double unit_mm,
                        const char *name)
{
    static const char *const own[] = { "camera_model", "distortion_model", NULL };
    double R[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, T[3] = { 0 }, one_R[9], one_T[3];
    struct link link[SST_MAX_VIEWS];
    const int n = find_cameras(doc, root, link, name);

    sst_loose_refuse_lenses(doc, root, own);
    for (int i = 0; i < n; i++) {
        struct sst_yaml_node *map = link[i].map, *to;
        struct sst_loose_camera *c = sst_loose_add(loose, map->key, name);
        const char *fault;

        if (!c)
            return -EBADMSG;
        if (map->type != SST_YAML_MAP) {
            sst_yaml_fault(doc, map, "needs keys such as intrinsics and resolution");
            continue;
        }
        read_camera(doc, map, c);
        to = sst_yaml_get(map, "T_cn_cnm1");
        if (follows(doc, link, i, to) && to && read_transform(doc, to, one_R, one_T)) {
            struct sst_loose_camera step = *c;

            fault = sst_loose_pose(&step, one_R, one_T, 1);
            if (fault) {
                sst_yaml_fault(doc, to, "cannot be used: %s", fault);
                continue;
            }
            chain(R, T, step.cam.rotation, one_T); /* use the exact rotation, or errors accumulate along the chain */
        }
        (void)sst_loose_pose(c, R, T, unit_mm);
    }
    return n < 0 ? n : 0;
}

int sst_kalibr_parse(struct sst_calib *out, const char *text, size_t size, const char *name,
                     const struct sst_calib_format_config *cfg)
{
    struct sst_loose *loose = sst_loose_create();
    struct sst_yaml *doc = NULL;
    struct sst_yaml_node *root;
    int err = loose ? sst_yaml_parse_foreign(&doc, text, size, name) : -ENOMEM, faults;

    if (!err) {
        root = sst_yaml_root(doc);
        sst_yaml_know_tree(root);
        err = root ? read_cameras(doc, root, loose, cfg->unit_mm > 0 ? cfg->unit_mm : METRE_MM, name) : 0;
        faults = sst_yaml_finish(doc);
        err = err ? err : faults;
    }
    err = err ? err : sst_loose_assemble(out, loose, cfg, name, "Kalibr");
    sst_yaml_destroy(doc);
    free(loose);
    return err;
}

int sst_kalibr_read(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg)
{
    return sst_calib_read_file(out, path, cfg, sst_kalibr_parse);
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

/* T_cn_cnm1: X_b = R_b R_a^T X_a + (t_b - R_b R_a^T t_a). */
static void put_step(FILE *f, const struct sst_calib_camera *a, const struct sst_calib_camera *b)
{
    double turn[9], way[3];

    sst_rotation_between(b->rotation, a->rotation, turn);
    for (int l = 0; l < 3; l++)
        way[l] = (a->position_mm[l] - b->position_mm[l]) / METRE_MM;
    sst_numbers_apply3(b->rotation, way, way);
    fputs("  T_cn_cnm1:\n", f);
    for (int i = 0; i < 3; i++) {
        fputs("  - [", f);
        sst_put_numbers(f, (const double[]){ turn[3 * i], turn[3 * i + 1], turn[3 * i + 2], way[i] }, 4);
        fputs("]\n", f);
    }
    fputs("  - [0, 0, 0, 1]\n", f);
}

static void put_camera(FILE *f, const struct sst_calib *calib, int view, int before, int n)
{
    const struct sst_calib_camera *c = &calib->camera[view];
    const int row = view / calib->cols, col = view % calib->cols;

    fprintf(f, "cam%d:\n", n);
    if (before >= 0)
        put_step(f, &calib->camera[before], c);
    fputs("  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: [", f);
    sst_put_numbers(f, c->k, 4);
    fputs("]\n  distortion_model: radtan\n  intrinsics: [", f);
    sst_put_numbers(f, (const double[]){ c->fx, c->fy, c->cx, c->cy }, 4);
    fprintf(f, "]\n  resolution: [%d, %d]\n  rostopic: /cam_%02d_%02d/image_raw\n  row: %d\n  col: %d\n", calib->width,
            calib->height, row, col, row, col);
}

int sst_kalibr_write(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg)
{
    struct sst_outfile out;
    struct sst_calib simple;
    int err = sst_calib_reduce(&simple, calib, 4, cfg->lossy, "Kalibr"), before = -1, n = 0;

    if (err)
        return err;
    err = sst_outfile_open(&out, path);
    if (!err) {
        for (int k = sst_calib_next(&simple, 0); k >= 0; k = sst_calib_next(&simple, k + 1)) {
            put_camera(out.stream, &simple, k, before, n++);
            before = k;
        }
        err = sst_outfile_commit(&out);
    }
    sst_calib_fini(&simple);
    return err;
}

/* Kalibr's camchain.yaml: pinhole cameras cam0, cam1 ...; T_cn_cnm1 takes points (metres) from the camera before into
 * this one; pixel centres on integers; radtan is k1 k2 p1 p2. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/yaml.h"
#include "pipeline/camera/format_parts.h"

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
    struct sst_yaml_node *model_at = sst_yaml_need(doc, map, "distortion_model");
    const struct sst_yaml_node *list = sst_yaml_get(map, "distortion_coeffs");
    double d[4] = { 0 };
    int model;

    if (!sst_yaml_choice(doc, model_at, models, ARRAY_LEN(models), &model) || model == 1)
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

/* Pose from that of the previous camera: X_n = R X_before + T, before = (Rb, Tb) from the first camera. */
static void chain(double pose_R[9], double pose_T[3], const double R[9], const double T[3])
{
    double r[9], t[3];

    for (int i = 0; i < 3; i++) {
        t[i] = T[i];
        for (int l = 0; l < 3; l++)
            t[i] += R[3 * i + l] * pose_T[l];
        for (int j = 0; j < 3; j++) {
            r[3 * i + j] = 0;
            for (int l = 0; l < 3; l++)
                r[3 * i + j] += R[3 * i + l] * pose_R[3 * l + j];
        }
    }
    memcpy(pose_R, r, sizeof(r));
    memcpy(pose_T, t, sizeof(t));
}

static void read_camera(struct sst_yaml *doc, struct sst_yaml_node *map, struct sst_loose_camera *c)
{
    struct sst_yaml_node *model = sst_yaml_need(doc, map, "camera_model"),
                         *size_at = sst_yaml_need(doc, map, "resolution"),
                         *intrinsics = sst_yaml_need(doc, map, "intrinsics");
    double v[4], size[2];

    if (model && strcmp(model->text, "pinhole") != 0)
        sst_yaml_fault(doc, model, "is %.40s; only pinhole cameras are supported", model->text);
    if (intrinsics && (intrinsics->type != SST_YAML_LIST || intrinsics->count != 4)) {
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

/* Read "cam0", "cam1" ... in this order, ignoring all else in the file. @return -EBADMSG if there are too many,
 * logged */
static int read_cameras(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_loose *loose, double unit_mm,
                        const char *name)
{
    double R[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, T[3] = { 0 }, one_R[9], one_T[3];

    for (int i = 0;; i++) {
        struct sst_loose_camera *c;
        struct sst_yaml_node *map, *to;
        const char *fault;
        char key[16];

        snprintf(key, sizeof(key), "cam%d", i);
        map = sst_yaml_get(root, key);
        if (!map)
            return 0;
        c = sst_loose_add(loose, key, name);
        if (!c)
            return -EBADMSG;
        if (map->type != SST_YAML_MAP) {
            sst_yaml_fault(doc, map, "needs keys such as intrinsics and resolution");
            continue;
        }
        read_camera(doc, map, c);
        to = sst_yaml_get(map, "T_cn_cnm1");
        if (i > 0 && !to)
            sst_yaml_fault(doc, map,
                           "lacks T_cn_cnm1, the transform from the previous camera; calibrate them together");
        if (i > 0 && to && read_transform(doc, to, one_R, one_T)) {
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
}

int sst_kalibr_parse(struct sst_calib *out, const char *text, size_t size, const char *name,
                     const struct sst_calib_format_config *cfg)
{
    struct sst_loose *loose = sst_loose_create();
    struct sst_yaml *doc = NULL;
    struct sst_yaml_node *root;
    int err = loose ? sst_yaml_parse(&doc, text, size, name) : -ENOMEM, faults;

    if (!err) {
        root = sst_yaml_root(doc);
        sst_yaml_know_tree(root);
        err = root ? read_cameras(doc, root, loose, cfg->unit_mm > 0 ? cfg->unit_mm : METRE_MM, name) : 0;
        faults = sst_yaml_finish(doc);
        err = err ? err : faults;
    }
    if (!err)
        err = sst_loose_assemble(out, loose, cfg, name, "Kalibr");
    sst_yaml_destroy(doc);
    free(loose);
    return err;
}

int sst_kalibr_read(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg)
{
    return sst_calib_read_file(out, path, SST_YAML_MAX_BYTES, cfg, sst_kalibr_parse);
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

/* T_cn_cnm1: X_b = R_b R_a^T X_a + (t_b - R_b R_a^T t_a). */
static void put_step(FILE *f, const struct sst_calib_camera *a, const struct sst_calib_camera *b)
{
    double turn[9], way[3];

    sst_rotation_between(b->rotation, a->rotation, turn);
    for (int l = 0; l < 3; l++)
        way[l] = (a->position_mm[l] - b->position_mm[l]) / METRE_MM;
    fputs("  T_cn_cnm1:\n", f);
    for (int i = 0; i < 3; i++) {
        double row[4] = { turn[3 * i], turn[3 * i + 1], turn[3 * i + 2], 0 };

        for (int l = 0; l < 3; l++)
            row[3] += b->rotation[3 * i + l] * way[l];
        fputs("  - [", f);
        sst_put_numbers(f, row, 4);
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

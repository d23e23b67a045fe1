/* Export to programs that use camera poses: COLMAP and nerfstudio. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/camera/format.h"
#include "pipeline/lightfield/export_poses.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define METRE_MM 1000.0
#define COEFFICIENTS 5 /* of nerfstudio's lens */
#define HALF_PX  0.5 /* their pixel centres are at halves, ours on integers */

/* --- cameras ------------------------------------------------------------------------------------------------------ */

static int check_known(const struct sst_lightfield *lf, const struct sst_calib *calib)
{
    if (calib->rows != lf->rows || calib->cols != lf->cols) {
        sst_log_error("the light field has %d x %d views and its calibration %d x %d; rectify the capture again",
                      lf->rows, lf->cols, calib->rows, calib->cols);
        return -EBADMSG;
    }
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        if (lf->views[k].present && !calib->camera[k].known) {
            sst_log_error("the view of row %d, column %d has no camera in the light field's calibration; rectify the "
                          "capture again",
                          k / lf->cols, k % lf->cols);
            return -EBADMSG;
        }
    }
    return 0;
}

/* Parallel views have disparities above 0 only. */
static int check_infinity(const struct sst_lightfield *lf, const char *dir)
{
    const bool ranged = lf->range_min_px < lf->range_max_px;

    if (!lf->infinity_known && ranged && lf->range_min_px < 0) {
        sst_log_error(
            "%s has disparities down to %.2f px, so its views converge (parallel ones have none below 0), and "
            "it is not known where; add --focus-mm Z, the distance at which the disparity is 0, or "
            "--infinity-px D, the disparity of what is infinitely far",
            dir, lf->range_min_px);
        return -EBADMSG;
    }
    if (!lf->infinity_known)
        sst_log_warning("it is not known whether the views of %s are parallel; they are exported so: right if what is "
                        "infinitely far has the disparity 0, else add --focus-mm or --infinity-px",
                        dir);
    else if (ranged && lf->range_min_px < lf->infinity_px - 1) {
        sst_log_error("%s has disparities down to %.2f px, behind infinity at %.2f px; correct --focus-mm, "
                      "--infinity-px or the range",
                      dir, lf->range_min_px, lf->infinity_px);
        return -EBADMSG;
    }
    return 0;
}

/* Views share one rotation and one focal length. */
static int rectified_cameras(struct sst_calib *out, const struct sst_lightfield *lf, const char *dir)
{
    const double focal = lf->focal_px, spacing = lf->spacing_mm;

    if (!(focal > 0) || !(spacing > 0)) {
        sst_log_error("the light field's %s is unknown, so its cameras have no poses; add %s",
                      focal > 0 ? "camera spacing" : "focal length",
                      focal > 0 ? "--spacing-mm" : "--focal-px (and --spacing-mm)");
        return -EBADMSG;
    }
    if (check_infinity(lf, dir))
        return -EBADMSG;
    if (sst_calib_init(out, lf->rows, lf->cols))
        return -ENOMEM;
    out->width = lf->width;
    out->height = lf->height;
    out->reference = lf->ref_view;
    out->rig = lf->infinity_px == 0; /* one camera stepped over the grid would do */
    for (int k = 0; k < lf->rows * lf->cols; k++)
        (void)sst_lightfield_camera(&out->camera[k], lf, k);
    return 0;
}

int export_cameras(struct sst_calib *out, const struct sst_lightfield *lf, const char *dir)
{
    struct sst_calib made;
    int err;

    if (!lf->calibration) {
        err = rectified_cameras(&made, lf, dir);
    } else {
        err = check_known(lf, lf->calibration);
        err = err ? err : sst_calib_copy(&made, lf->calibration);
    }
    if (err == -ENOMEM)
        sst_log_error("not enough memory to export the light field");
    if (err)
        return err;
    for (int k = 0; k < made.rows * made.cols; k++)
        made.camera[k].known = lf->views[k].present; /* cameras without a picture are not exported */
    if (!made.camera[made.reference].known)
        made.reference = lf->ref_view;
    *out = made;
    return 0;
}

/* --- COLMAP ------------------------------------------------------------------------------------------------------- */

static void put(FILE *f, const double *v, int n)
{
    for (int i = 0; i < n; i++)
        fprintf(f, " %.17g", v[i]);
}

/* Quaternion (w first) and translation in metres of X_b = R X_a + t, from camera a's axes into b's; a NULL: from the
 * rig's. */
static void get_pose(double q[4], double t[3], const struct sst_calib_camera *a, const struct sst_calib_camera *b)
{
    double r[9], v[3], turn, half;

    if (a)
        sst_rotation_between(b->rotation, a->rotation, r);
    else
        memcpy(r, b->rotation, sizeof(r));
    for (int i = 0; i < 3; i++) {
        t[i] = 0;
        for (int j = 0; j < 3; j++)
            t[i] += b->rotation[3 * i + j] * ((a ? a->position_mm[j] : 0) - b->position_mm[j]) / METRE_MM;
    }
    sst_rotation_to_vector(r, v);
    turn = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    half = turn < 1e-4 ? 0.5 - turn * turn / 48 : sin(turn / 2) / turn;
    q[0] = cos(turn / 2);
    for (int i = 0; i < 3; i++)
        q[i + 1] = half * v[i];
}

static void put_pose(FILE *f, const struct sst_calib_camera *a, const struct sst_calib_camera *b)
{
    double q[4], t[3];

    get_pose(q, t, a, b);
    put(f, q, 4);
    put(f, t, 3);
}

/* A model with the numbers that COLMAP's database gives to the files: images and cameras count from 1 in the order of
 * the names. A single camera at many poses stays a single COLMAP camera. The rig and frame of an array are made
 * after one of each for every image, where the files' names differ in the camera only; else these stay. */
struct colmap_model {
    const struct sst_calib *calib;
    const char (*name)[SST_EXPORT_NAME];
    int images, view[SST_EXPORT_VIEWS]; /* images in the order of their names */
    int number[SST_EXPORT_VIEWS];       /* of a view's image; 0: none */
    bool lenses;                     /* the extractor has one camera model for all */
    bool one_rig;                    /* an array as one rig with one frame */
    const struct sst_export_cameras *scene; /* points and sights */
    int sights;
    int *point_of, *number_of; /* [sights]: its point, and its number in its view */
};

/* Of the part of a file's name that says the camera. */
static int camera_bytes(const char *name)
{
    return (int)strcspn(name, ".");
}

static void model_init(struct colmap_model *m, const struct sst_export_cameras *cameras)
{
    const struct sst_calib *calib = cameras->calib;
    const char(*name)[SST_EXPORT_NAME] = cameras->name;

    *m = (struct colmap_model){ .calib = calib, .name = name, .scene = cameras };
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        int at = m->images;

        if (!calib->camera[k].known)
            continue;
        for (; at > 0 && strcmp(name[m->view[at - 1]], name[k]) > 0; at--)
            m->view[at] = m->view[at - 1];
        m->view[at] = k;
        m->images++;
        m->lenses |= calib->camera[k].lens;
    }
    m->one_rig = cameras->array && !calib->rig;
    for (int i = 0; i < m->images; i++) {
        m->number[m->view[i]] = i + 1;
        m->one_rig &= !strcmp(name[m->view[i]] + camera_bytes(name[m->view[i]]),
                              name[m->view[0]] + camera_bytes(name[m->view[0]]));
    }
}

/* Numbers of the sights among their views'. */
static int number_sights(struct colmap_model *m)
{
    int count[SST_EXPORT_VIEWS] = { 0 };

    for (int i = 0; i < m->scene->points; i++)
        m->sights += m->scene->point[i].sights;
    m->point_of = malloc((size_t)m->sights * sizeof(*m->point_of) + 1);
    m->number_of = malloc((size_t)m->sights * sizeof(*m->number_of) + 1);
    if (!m->point_of || !m->number_of) {
        sst_log_error("not enough memory to export the light field");
        return -ENOMEM;
    }
    for (int i = 0, s = 0; i < m->scene->points; i++) {
        for (const int end = s + m->scene->point[i].sights; s < end; s++) {
            m->point_of[s] = i;
            m->number_of[s] = count[m->scene->sight[s].view]++;
        }
    }
    return 0;
}

static const char *camera_model(const struct colmap_model *m)
{
    return m->lenses ? "FULL_OPENCV" : "PINHOLE";
}

static int camera_number(const struct colmap_model *m, int view)
{
    return m->calib->rig ? 1 : m->number[view];
}

static void put_cameras(FILE *f, const struct colmap_model *m)
{
    fputs("# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n", f);
    for (int i = 0; i < m->images; i++) {
        const struct sst_calib_camera *c = &m->calib->camera[m->view[i]];

        if (m->calib->rig && m->view[i] != m->calib->reference)
            continue;
        fprintf(f, "%d %s %d %d", camera_number(m, m->view[i]), camera_model(m), m->calib->width, m->calib->height);
        put(f, (const double[]){ c->fx, c->fy, c->cx + HALF_PX, c->cy + HALF_PX }, 4);
        put(f, c->k, m->lenses ? SST_LENS_MAX : 0);
        putc('\n', f);
    }
}

/* Points of a view's picture. */
static void put_sights(FILE *f, const struct colmap_model *m, int view)
{
    const struct sst_export_sight *sight = m->scene->sight;
    bool first = true;

    for (int s = 0; s < m->sights; s++) {
        if (sight[s].view != view)
            continue;
        fprintf(f, "%s%.9g %.9g %d", first ? "" : " ", sight[s].x + HALF_PX, sight[s].y + HALF_PX, m->point_of[s] + 1);
        first = false;
    }
}

static void put_images(FILE *f, const struct colmap_model *m)
{
    fputs("# Image list with two lines of data per image:\n"
          "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n#   POINTS2D[] as (X, Y, POINT3D_ID)\n",
          f);
    for (int i = 0; i < m->images; i++) {
        fprintf(f, "%d", i + 1);
        put_pose(f, NULL, &m->calib->camera[m->view[i]]);
        fprintf(f, " %d %s\n", camera_number(m, m->view[i]), m->name[m->view[i]]);
        put_sights(f, m, m->view[i]);
        putc('\n', f);
    }
}

static void put_points(FILE *f, const struct colmap_model *m)
{
    const struct sst_export_sight *sight = m->scene->sight;

    fputs("# 3D point list with one line of data per point:\n"
          "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n",
          f);
    for (int i = 0, s = 0; i < m->scene->points; i++) {
        const struct sst_export_point *p = &m->scene->point[i];

        fprintf(f, "%d", i + 1);
        put(f, (const double[]){ p->at_mm[0] / METRE_MM, p->at_mm[1] / METRE_MM, p->at_mm[2] / METRE_MM }, 3);
        fprintf(f, " %d %d %d %.6g", p->rgb[0], p->rgb[1], p->rgb[2], p->error_px);
        for (const int end = s + p->sights; s < end; s++)
            fprintf(f, " %d %d", m->number[sight[s].view], m->number_of[s]);
        putc('\n', f);
    }
}

/* An array becomes one rig of many cameras with one frame; a moved camera becomes a rig of one with many frames. */
static void put_rigs(FILE *f, const struct colmap_model *m)
{
    const struct sst_calib *calib = m->calib;

    fputs("# Rig calib list with one line of data per calib:\n#   RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, "
          "SENSORS[] as (SENSOR_TYPE, SENSOR_ID, HAS_POSE, [QW, QX, QY, QZ, TX, TY, TZ])\n",
          f);
    if (!m->one_rig) {
        for (int i = 1; i <= (calib->rig ? 1 : m->images); i++)
            fprintf(f, "%d 1 CAMERA %d\n", i, i);
        return;
    }
    fprintf(f, "%d %d CAMERA %d", m->images + 1, m->images, m->number[calib->reference]);
    for (int i = 0; i < m->images; i++) {
        if (m->view[i] == calib->reference)
            continue;
        fprintf(f, " CAMERA %d 1", i + 1);
        put_pose(f, &calib->camera[calib->reference], &calib->camera[m->view[i]]);
    }
    putc('\n', f);
}

static void put_frames(FILE *f, const struct colmap_model *m)
{
    const struct sst_calib *calib = m->calib;

    fputs("# Frame list with one line of data per frame:\n#   FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, "
          "TZ], NUM_DATA_IDS, DATA_IDS[] as (SENSOR_TYPE, SENSOR_ID, DATA_ID)\n",
          f);
    if (m->one_rig) {
        fprintf(f, "%d %d", m->images + 1, m->images + 1);
        put_pose(f, NULL, &calib->camera[calib->reference]);
        fprintf(f, " %d", m->images);
        for (int i = 1; i <= m->images; i++)
            fprintf(f, " CAMERA %d %d", i, i);
        putc('\n', f);
        return;
    }
    for (int i = 0; i < m->images; i++) {
        const int camera = camera_number(m, m->view[i]);

        fprintf(f, "%d %d", i + 1, camera);
        put_pose(f, NULL, &calib->camera[m->view[i]]);
        fprintf(f, " 1 CAMERA %d %d\n", camera, i + 1);
    }
}

/* The names of a camera's images begin so. */
static void put_prefix(FILE *f, const char *name)
{
    fprintf(f, "{\"image_prefix\": \"%.*s\", ", camera_bytes(name), name);
}

/* For `colmap rig_configurator`, which must read the reference first. */
static void put_rig_config(FILE *f, const struct colmap_model *m)
{
    const struct sst_calib *calib = m->calib;
    double q[4], t[3];

    fputs("[{\"cameras\": [\n ", f);
    put_prefix(f, m->name[calib->reference]);
    fputs("\"ref_sensor\": true}", f);
    for (int i = 0; i < m->images; i++) {
        if (m->view[i] == calib->reference)
            continue;
        get_pose(q, t, &calib->camera[calib->reference], &calib->camera[m->view[i]]);
        fputs(",\n ", f);
        put_prefix(f, m->name[m->view[i]]);
        fprintf(f,
                "\"cam_from_rig_rotation\": [%.17g, %.17g, %.17g, %.17g], "
                "\"cam_from_rig_translation\": [%.17g, %.17g, %.17g]}",
                q[0], q[1], q[2], q[3], t[0], t[1], t[2]);
    }
    fputs("\n]}]\n", f);
}

/* Versions of COLMAP, and the names of their options. */
struct colmap_release {
    const char *versions, *extraction, *matching;
};

/* @param between  command after the extraction, a line, or "" */
static void put_commands(FILE *f, const struct colmap_model *m, const struct colmap_release *of, const char *between)
{
    fprintf(f,
            "\n# COLMAP %s\n"
            "colmap feature_extractor --database_path points.db --image_path images --ImageReader.camera_model %s%s "
            "--%s.num_threads 1 --%s.use_gpu 0\n"
            "%s"
            "colmap exhaustive_matcher --database_path points.db --%s.use_gpu 0\n"
            "mkdir points\n"
            "colmap point_triangulator --database_path points.db --image_path images --input_path sparse/0 "
            "--output_path points --clear_points 1\n",
            of->versions, camera_model(m), m->calib->rig ? " --ImageReader.single_camera 1" : "", of->extraction,
            of->extraction, between, of->matching);
}

static void put_readme(FILE *f, const struct colmap_model *m)
{
    static const struct colmap_release before = { "3.8 to 3.11", "SiftExtraction", "SiftMatching" };
    static const struct colmap_release since = { "3.12 and later", "FeatureExtraction", "FeatureMatching" };

    if (m->scene->points)
        fprintf(f, "A model with %d points in sparse/0, lengths in metres. To make others", m->scene->points);
    else
        fputs("A model without points in sparse/0, lengths in metres. To make points", f);
    fputs(" for its poses, run in this folder, with an\n"
          "empty database: one thread numbers the images in the order of their names, as the model does. Leave out "
          "use_gpu 0\n"
          "where COLMAP has CUDA.\n",
          f);
    put_commands(f, m, &before, "");
    put_commands(f, m, &since,
                 m->one_rig ? "colmap rig_configurator --database_path points.db --rig_config_path rig_config.json\n"
                            : "");
}

int sst_export_colmap(const struct sst_export_cameras *cameras, const char *dir)
{
    static const struct {
        const char *name;
        void (*put)(FILE *f, const struct colmap_model *m);
        bool one_rig; /* of an array only */
    } files[] = { { "sparse/0/cameras.txt", put_cameras, false },
                  { "sparse/0/images.txt", put_images, false },
                  { "sparse/0/points3D.txt", put_points, false },
                  { "sparse/0/rigs.txt", put_rigs, false },
                  { "sparse/0/frames.txt", put_frames, false },
                  { "rig_config.json", put_rig_config, true },
                  { "README.txt", put_readme, false } };
    struct colmap_model m;
    struct sst_outfile out;
    int err = make_folder(dir, "sparse");

    model_init(&m, cameras);
    err = err ? err : make_folder(dir, "sparse/0");
    err = err ? err : number_sights(&m);
    for (size_t i = 0; i < ARRAY_LEN(files) && !err; i++) {
        if (files[i].one_rig && !m.one_rig)
            continue;
        err = sst_outfile_open_in(&out, dir, files[i].name);
        if (err)
            break;
        files[i].put(out.stream, &m);
        err = sst_outfile_commit(&out);
    }
    free(m.point_of);
    free(m.number_of);
    return err;
}

/* --- nerfstudio --------------------------------------------------------------------------------------------------- */

/* World axes from the rig's: x right, y forward, z up. */
static const double world[3][3] = { { 1, 0, 0 }, { 0, 0, 1 }, { 0, -1, 0 } };

/* Rows of a matrix of 4 columns. */
static json_t *rows(const double *v, int n)
{
    json_t *list = json_array();

    for (int i = 0; i < n; i++)
        json_array_append_new(list, json_pack("[f, f, f, f]", v[4 * i], v[4 * i + 1], v[4 * i + 2], v[4 * i + 3]));
    return list;
}

/* Camera to world: W [R^T | c] diag(1, -1, -1, 1). */
static json_t *pose_matrix(const struct sst_calib_camera *c)
{
    static const double flip[3] = { 1, -1, -1 };
    double m[16] = { [15] = 1 };

    for (int i = 0; i < 3; i++) {
        for (int l = 0; l < 3; l++) {
            for (int j = 0; j < 3; j++)
                m[4 * i + j] += world[i][l] * c->rotation[3 * j + l] * flip[j];
            m[4 * i + 3] += world[i][l] * c->position_mm[l] / METRE_MM;
        }
    }
    return rows(m, 4);
}

static json_t *frame_to_json(const struct sst_calib *calib, int view, const char *name)
{
    const struct sst_calib_camera *c = &calib->camera[view];
    char path[SST_EXPORT_NAME + 8];

    snprintf(path, sizeof(path), "images/%s", name);
    return json_pack("{s:s, s:i, s:i, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:o}", "file_path", path, "w",
                     calib->width, "h", calib->height, "fl_x", c->fx, "fl_y", c->fy, "cx", c->cx + HALF_PX, "cy",
                     c->cy + HALF_PX, "k1", c->k[0], "k2", c->k[1], "k3", c->k[4], "k4", 0.0, "p1", c->k[2], "p2",
                     c->k[3], "transform_matrix", pose_matrix(c));
}

int sst_export_nerfstudio(const struct sst_export_cameras *cameras, const char *dir)
{
    const double applied[12] = { world[0][0], world[0][1], world[0][2], 0,           world[1][0], world[1][1],
                                 world[1][2], 0,           world[2][0], world[2][1], world[2][2], 0 };
    struct sst_calib fitted;
    json_t *frames, *root;
    char path[SST_PATH_MAX], *text = NULL;
    int err = sst_path_join(path, dir, "transforms.json");

    err = err ? err : sst_calib_reduce(&fitted, cameras->calib, COEFFICIENTS, cameras->lossy, "nerfstudio");
    if (err)
        return err;
    frames = json_array();
    for (int k = 0; k < fitted.rows * fitted.cols; k++) {
        if (fitted.camera[k].known)
            json_array_append_new(frames, frame_to_json(&fitted, k, cameras->name[k]));
    }
    sst_calib_fini(&fitted);
    root =
        json_pack("{s:s, s:o, s:o}", "camera_model", "OPENCV", "applied_transform", rows(applied, 3), "frames", frames);
    text = root ? json_dumps(root, JSON_INDENT(1) | JSON_REAL_PRECISION(17)) : NULL;
    json_decref(root);
    if (!text) {
        sst_log_error("not enough memory to export the light field");
        err = -ENOMEM;
    }
    err = err ? err : sst_file_write(path, text, strlen(text));
    free(text);
    return err;
}

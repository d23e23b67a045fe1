/* Export to programs that use camera poses: COLMAP and nerfstudio. */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/camera/format.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define METRE_MM 1000.0
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

/* Views share one rotation and one K; x_k = x - f B b_k / Z gives their centres. */
static int rectified_cameras(struct sst_calib *out, const struct sst_lightfield *lf,
                             const struct sst_export_config *cfg)
{
    const double focal = cfg->focal_px > 0 ? cfg->focal_px : lf->focal_px;
    const double spacing = cfg->spacing_mm > 0 ? cfg->spacing_mm : lf->spacing_mm;

    if (!(focal > 0) || !(spacing > 0)) {
        sst_log_error("the light field's %s is unknown, so its cameras have no poses; add %s",
                      focal > 0 ? "camera spacing" : "focal length",
                      focal > 0 ? "--spacing-mm" : "--focal-px (and --spacing-mm)");
        return -EBADMSG;
    }
    if (sst_calib_init(out, lf->rows, lf->cols))
        return -ENOMEM;
    out->width = lf->width;
    out->height = lf->height;
    out->reference = lf->ref_view;
    out->rig = true;
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        struct sst_calib_camera *c = &out->camera[k];

        c->known = lf->views[k].present;
        c->fx = c->fy = focal;
        c->cx = (lf->width - 1) / 2.0;
        c->cy = (lf->height - 1) / 2.0;
        c->position_mm[0] = lf->views[k].bx * spacing;
        c->position_mm[1] = lf->views[k].by * spacing;
    }
    return 0;
}

int export_cameras(struct sst_calib *out, const struct sst_lightfield *lf, const struct sst_export_config *cfg)
{
    struct sst_calib made;
    int err;

    if (!lf->calibration) {
        err = rectified_cameras(&made, lf, cfg);
    } else if (cfg->focal_px > 0 || cfg->spacing_mm > 0) {
        sst_log_error("the light field has a calibration; leave out --focal-px and --spacing-mm");
        err = -EINVAL;
    } else {
        err = check_known(lf, lf->calibration);
        if (!err)
            err = sst_calib_copy(&made, lf->calibration);
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
static void put_pose(FILE *f, const struct sst_calib_camera *a, const struct sst_calib_camera *b)
{
    double r[9], v[3], t[3] = { 0 }, q[4], turn, half;

    if (a)
        sst_rotation_between(b->rotation, a->rotation, r);
    else
        memcpy(r, b->rotation, sizeof(r));
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            t[i] += b->rotation[3 * i + j] * ((a ? a->position_mm[j] : 0) - b->position_mm[j]) / METRE_MM;
    }
    sst_rotation_to_vector(r, v);
    turn = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    half = turn < 1e-4 ? 0.5 - turn * turn / 48 : sin(turn / 2) / turn;
    q[0] = cos(turn / 2);
    for (int i = 0; i < 3; i++)
        q[i + 1] = half * v[i];
    put(f, q, 4);
    put(f, t, 3);
}

static void put_camera(FILE *f, const struct sst_calib *calib, int view, int id)
{
    const struct sst_calib_camera *c = &calib->camera[view];

    fprintf(f, "%d %s %d %d", id, c->lens ? "FULL_OPENCV" : "PINHOLE", calib->width, calib->height);
    put(f, (const double[]){ c->fx, c->fy, c->cx + HALF_PX, c->cy + HALF_PX }, 4);
    put(f, c->k, c->lens ? SST_LENS_MAX : 0);
    putc('\n', f);
}

/* A single camera at many poses stays a single COLMAP camera. */
static int camera_id(const struct sst_calib *calib, int view)
{
    return calib->rig ? 1 : view + 1;
}

static void put_cameras(FILE *f, const struct sst_calib *calib, const char (*name)[64] SST_UNUSED)
{
    fputs("# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n", f);
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        if (calib->camera[k].known && (!calib->rig || k == calib->reference))
            put_camera(f, calib, k, camera_id(calib, k));
    }
}

static void put_images(FILE *f, const struct sst_calib *calib, const char (*name)[64])
{
    fputs("# Image list with two lines of data per image:\n"
          "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n#   POINTS2D[] as (X, Y, POINT3D_ID)\n",
          f);
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        if (!calib->camera[k].known)
            continue;
        fprintf(f, "%d", k + 1);
        put_pose(f, NULL, &calib->camera[k]);
        fprintf(f, " %d %s\n\n", camera_id(calib, k), name[k]);
    }
}

static void put_points(FILE *f, const struct sst_calib *calib SST_UNUSED, const char (*name)[64] SST_UNUSED)
{
    fputs("# 3D point list with one line of data per point:\n"
          "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n",
          f);
}

/* An array becomes one rig of many cameras with one frame; a moved camera becomes a rig of one with many frames. */
static void put_rigs(FILE *f, const struct sst_calib *calib, const char (*name)[64] SST_UNUSED)
{
    int n = 0;

    for (int k = 0; k < calib->rows * calib->cols; k++)
        n += calib->camera[k].known;
    fputs("# Rig calib list with one line of data per calib:\n#   RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, "
          "SENSORS[] as (SENSOR_TYPE, SENSOR_ID, HAS_POSE, [QW, QX, QY, QZ, TX, TY, TZ])\n",
          f);
    fprintf(f, "1 %d CAMERA %d", calib->rig ? 1 : n, camera_id(calib, calib->reference));
    for (int k = 0; !calib->rig && k < calib->rows * calib->cols; k++) {
        if (!calib->camera[k].known || k == calib->reference)
            continue;
        fprintf(f, " CAMERA %d 1", k + 1);
        put_pose(f, &calib->camera[calib->reference], &calib->camera[k]);
    }
    putc('\n', f);
}

static void put_frames(FILE *f, const struct sst_calib *calib, const char (*name)[64] SST_UNUSED)
{
    int n = 0;

    fputs("# Frame list with one line of data per frame:\n#   FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, "
          "TZ], NUM_DATA_IDS, DATA_IDS[] as (SENSOR_TYPE, SENSOR_ID, DATA_ID)\n",
          f);
    for (int k = 0; k < calib->rows * calib->cols; k++)
        n += calib->camera[k].known;
    if (!calib->rig) {
        fputs("1 1", f);
        put_pose(f, NULL, &calib->camera[calib->reference]);
        fprintf(f, " %d", n);
    }
    for (int k = 0; k < calib->rows * calib->cols; k++) {
        if (!calib->camera[k].known)
            continue;
        if (calib->rig) {
            fprintf(f, "%d 1", k + 1);
            put_pose(f, NULL, &calib->camera[k]);
            fprintf(f, " 1");
        }
        fprintf(f, " CAMERA %d %d%s", camera_id(calib, k), k + 1, calib->rig ? "\n" : "");
    }
    fputs(calib->rig ? "" : "\n", f);
}

int colmap_write(const struct sst_calib *calib, const char (*name)[64], const char *dir)
{
    static const struct {
        const char *name;
        void (*put)(FILE *f, const struct sst_calib *calib, const char (*name)[64]);
    } files[] = { { "cameras.txt", put_cameras },
                  { "images.txt", put_images },
                  { "points3D.txt", put_points },
                  { "rigs.txt", put_rigs },
                  { "frames.txt", put_frames } };
    char model[SST_PATH_MAX], path[SST_PATH_MAX];
    struct sst_outfile out;
    int err = make_folder(dir, "sparse");

    if (!err)
        err = make_folder(dir, "sparse/0");
    if (!err)
        err = sst_path_join(model, dir, "sparse/0");
    for (size_t i = 0; i < ARRAY_LEN(files) && !err; i++) {
        err = sst_path_join(path, model, files[i].name);
        if (!err)
            err = sst_outfile_open(&out, path);
        if (err)
            break;
        files[i].put(out.stream, calib, name);
        err = sst_outfile_commit(&out);
    }
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
    char path[80];

    snprintf(path, sizeof(path), "images/%s", name);
    return json_pack("{s:s, s:i, s:i, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:o}", "file_path", path, "w",
                     calib->width, "h", calib->height, "fl_x", c->fx, "fl_y", c->fy, "cx", c->cx + HALF_PX, "cy",
                     c->cy + HALF_PX, "k1", c->k[0], "k2", c->k[1], "k3", c->k[4], "k4", 0.0, "p1", c->k[2], "p2",
                     c->k[3], "transform_matrix", pose_matrix(c));
}

int nerfstudio_write(const struct sst_calib *calib, const char (*name)[64], const char *dir)
{
    const double applied[12] = { world[0][0], world[0][1], world[0][2], 0,           world[1][0], world[1][1],
                                 world[1][2], 0,           world[2][0], world[2][1], world[2][2], 0 };
    json_t *frames = json_array(), *root;
    char path[SST_PATH_MAX], *text = NULL;
    int err = sst_path_join(path, dir, "transforms.json");

    for (int k = 0; k < calib->rows * calib->cols; k++) {
        if (calib->camera[k].known)
            json_array_append_new(frames, frame_to_json(calib, k, name[k]));
    }
    root =
        json_pack("{s:s, s:o, s:o}", "camera_model", "OPENCV", "applied_transform", rows(applied, 3), "frames", frames);
    text = root ? json_dumps(root, JSON_INDENT(1) | JSON_REAL_PRECISION(17)) : NULL;
    json_decref(root);
    if (!err && !text) {
        sst_log_error("not enough memory to export the light field");
        err = -ENOMEM;
    }
    if (!err)
        err = sst_file_write(path, text, strlen(text));
    free(text);
    return err;
}

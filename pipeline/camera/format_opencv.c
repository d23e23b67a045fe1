/* OpenCV's calibrations: a file of cv::FileStorage for each camera, ROS's camera_info of the same form, and the pair of
 * files of its stereo sample. Pixel centres on integers; X_camera = R X + T; lengths have no unit, so mm unless said.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <dirent.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "base/yaml.h"
#include "pipeline/camera/format_parts.h"
#include "pipeline/camera/numbers.h"

#define MOST_NUMBERS 16
#define NAMES        6

/* Synonyms used by different programs. */
static const char *const matrix_names[NAMES] = { "camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M" };
static const char *const lens_names[NAMES] = { "distortion_coefficients", "distCoeffs", "Distortion_Coefficients",
                                               "dist_coeffs", "D" };
static const char *const pair_names[4][NAMES] = {
    { "M1", "K1", "cameraMatrix1" }, { "D1", "distCoeffs1" }, { "M2", "K2", "cameraMatrix2" }, { "D2", "distCoeffs2" }
};
static const char *const endings[] = { ".yml", ".yaml", ".xml", ".json" };

static struct sst_yaml_node *get_any(struct sst_yaml_node *map, const char *const names[NAMES])
{
    struct sst_yaml_node *found = NULL;

    for (int i = 0; i < NAMES && names[i] && !found; i++)
        found = sst_yaml_get(map, names[i]);
    return found;
}

static bool add_numbers(struct sst_yaml *doc, const struct sst_yaml_node *node, double out[MOST_NUMBERS], int *n)
{
    if (node->type == SST_YAML_SCALAR) {
        if (*n == MOST_NUMBERS) {
            sst_yaml_fault(doc, node, "has more numbers than any matrix of a camera");
            return false;
        }
        return sst_yaml_double(doc, node, -SST_CALIB_LARGEST, SST_CALIB_LARGEST, &out[(*n)++]);
    }
    for (const struct sst_yaml_node *c = node->first; c; c = c->next) {
        if (!add_numbers(doc, c, out, n)) /* recursion is bounded by the document's depth limit */
            return false;
    }
    return true;
}

/* A matrix (rows, cols, data) or a list, possibly nested. @return number of values, -1: a fault was noted */
static int numbers(struct sst_yaml *doc, struct sst_yaml_node *node, double out[MOST_NUMBERS])
{
    struct sst_yaml_node *data = node;
    int rows = 0, cols = 0, n = 0;

    if (node->type == SST_YAML_MAP) {
        data = sst_yaml_need(doc, node, "data");
        if (!sst_yaml_int(doc, sst_yaml_need(doc, node, "rows"), 0, MOST_NUMBERS, &rows) ||
            !sst_yaml_int(doc, sst_yaml_need(doc, node, "cols"), 0, MOST_NUMBERS, &cols) || !data)
            return -1;
        if (data->type == SST_YAML_SCALAR && !*data->text)
            return 0; /* an empty matrix in XML */
    }
    if (data->type == SST_YAML_MAP) {
        sst_yaml_fault(doc, data, "must be a list of numbers");
        return -1;
    }
    if (!add_numbers(doc, data, out, &n))
        return -1;
    if (node->type == SST_YAML_MAP && n != rows * cols) {
        sst_yaml_fault(doc, data, "has %d numbers, not rows times cols", n);
        return -1;
    }
    return n;
}

static bool read_matrix(struct sst_yaml *doc, struct sst_yaml_node *node, struct sst_calib_camera *cam)
{
    double v[MOST_NUMBERS];
    const int n = numbers(doc, node, v);
    const char *fault = n == 9 ? sst_loose_matrix(cam, v) : "it is not a 3 x 3 matrix";

    if (n >= 0 && fault)
        sst_yaml_fault(doc, node, "cannot be used: %s", fault);
    return n == 9 && !fault;
}

static bool read_lens(struct sst_yaml *doc, struct sst_yaml_node *node, struct sst_calib_camera *cam)
{
    double v[MOST_NUMBERS];
    const int n = numbers(doc, node, v);
    const char *fault = n >= 0 ? sst_loose_lens(cam, v, n) : NULL;

    if (fault)
        sst_yaml_fault(doc, node, "cannot be used: %s", fault);
    return n >= 0 && !fault;
}

/* R (a matrix or a rotation vector) and T, if present. */
static void read_pose(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_loose_camera *c, double unit_mm)
{
    struct sst_yaml_node *r_at = sst_yaml_get(root, "R"), *t_at = sst_yaml_get(root, "T");
    double R[MOST_NUMBERS], T[MOST_NUMBERS];
    const char *fault = NULL;
    int n, m;

    if (!r_at || !t_at)
        return;
    n = numbers(doc, r_at, R);
    m = numbers(doc, t_at, T);
    if (n < 0 || m < 0)
        return;
    if (n == 3) {
        const double v[3] = { R[0], R[1], R[2] };

        if (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] > 100)
            fault = "turns by more than 10 rad; is it in degrees?";
        else
            sst_rotation_from_vector(v, R);
    } else if (n != 9) {
        fault = "is neither a 3 x 3 matrix nor a vector of 3";
    }
    if (!fault)
        fault = m == 3 ? sst_loose_pose(c, R, T, unit_mm) : "comes with a T that is not a vector of 3";
    if (fault)
        sst_yaml_fault(doc, r_at, "cannot be used: %s", fault);
}

static void read_size(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_loose_camera *c)
{
    static const char *const names[NAMES] = { "image_size", "imageSize", "size", "cameraResolution" };
    struct sst_yaml_node *size = get_any(root, names), *w = sst_yaml_get(root, "image_width");
    struct sst_yaml_node *h = sst_yaml_get(root, "image_height");
    double v[2];

    if (size && size->type == SST_YAML_LIST && sst_yaml_doubles(doc, size, 1, SST_IMAGE_MAX_SIDE, v, 2)) {
        c->width = (int)v[0];
        c->height = (int)v[1];
    }
    (void)sst_yaml_int(doc, w, 1, SST_IMAGE_MAX_SIDE, &c->width);
    (void)sst_yaml_int(doc, h, 1, SST_IMAGE_MAX_SIDE, &c->height);
}

static const char *const no_keys[] = { NULL };

/* Four coefficients belong to a pinhole, or to cv::fisheye, documented with K and D. */
static void doubt_four(struct sst_yaml *doc, const struct sst_yaml_node *root, const struct sst_yaml_node *matrix,
                       const struct sst_yaml_node *lens, struct sst_loose *loose)
{
    double v[MOST_NUMBERS];
    bool named = false;

    for (const struct sst_yaml_node *n = root->first; n; n = n->next)
        named |= !strcmp(n->key, "distortion_model") || !strcmp(n->key, "camera_model") || strstr(n->key, "fisheye");
    if (named || numbers(doc, (struct sst_yaml_node *)(uintptr_t)lens, v) != 4)
        return;
    if (matrix->key[0] == 'K' && lens->key[0] == 'D')
        sst_yaml_fault(doc, lens,
                       "has four coefficients, as a fisheye lens of OpenCV; if it is a pinhole, add `distortion_model: "
                       "plumb_bob`, else calibrate again as one");
    loose->four++;
}

static void read_camera(struct sst_yaml *doc, struct sst_yaml_node *root, struct sst_loose *loose,
                        struct sst_loose_camera *c, double unit_mm)
{
    struct sst_yaml_node *matrix = get_any(root, matrix_names), *lens = get_any(root, lens_names);
    struct sst_yaml_node *name = sst_yaml_get(root, "camera_name");

    sst_loose_refuse_lenses(doc, root, no_keys);
    if (!matrix)
        sst_yaml_fault(doc, root, "camera_matrix is missing; is it a calibration?");
    else
        (void)read_matrix(doc, matrix, &c->cam);
    if (!lens)
        sst_yaml_fault(doc, root,
                       "distortion_coefficients are missing; add an empty list for a lens without distortion");
    else if (read_lens(doc, lens, &c->cam) && matrix)
        doubt_four(doc, root, matrix, lens, loose);
    read_size(doc, root, c);
    read_pose(doc, root, c, unit_mm);
    (void)sst_yaml_int(doc, sst_yaml_get(root, "row"), 0, SST_MAX_VIEWS - 1, &c->row);
    (void)sst_yaml_int(doc, sst_yaml_get(root, "col"), 0, SST_MAX_VIEWS - 1, &c->col);
    if (name && name->type == SST_YAML_SCALAR && *name->text)
        snprintf(c->cam.name, sizeof(c->cam.name), "%s", name->text);
}

static int parse_yaml(struct sst_yaml **doc, const char *text, size_t size, const char *name)
{
    char *yaml = NULL;
    size_t yaml_size = 0;
    int err = sst_opencv_to_yaml(&yaml, &yaml_size, text, size, name);

    err = err ? err : sst_yaml_parse_foreign(doc, yaml, yaml_size, name);
    free(yaml);
    return err;
}

static int read_yaml(struct sst_yaml **doc, const char *path)
{
    uint8_t *data;
    size_t size;
    int err = sst_file_read_text(path, SST_CALIB_FILE_MAX, &data, &size);

    if (err)
        return err;
    err = parse_yaml(doc, (const char *)data, size, path);
    free(data);
    return err;
}

static double unit_of(const struct sst_calib_format_config *cfg)
{
    return cfg->unit_mm > 0 ? cfg->unit_mm : 1;
}

/* Read one camera from a document, which is freed. */
static int read_one(struct sst_loose *loose, struct sst_yaml *doc, const char *file,
                    const struct sst_calib_format_config *cfg)
{
    struct sst_yaml_node *root = sst_yaml_root(doc);
    char name[64];
    struct sst_loose_camera *c;
    int err;

    snprintf(name, sizeof(name), "%s", sst_path_base(file));
    if (strrchr(name, '.'))
        *strrchr(name, '.') = 0;
    c = sst_loose_add(loose, name, file);
    if (c && root) {
        sst_yaml_know_tree(root);
        sst_loose_place(c, name, cfg);
        read_camera(doc, root, loose, c, unit_of(cfg));
    }
    err = c ? sst_yaml_finish(doc) : -EBADMSG;
    sst_yaml_destroy(doc);
    return err;
}

int sst_opencv_parse(struct sst_calib *out, const char *text, size_t size, const char *name,
                     const struct sst_calib_format_config *cfg)
{
    struct sst_loose *loose = sst_loose_create();
    struct sst_yaml *doc;
    int err = loose ? parse_yaml(&doc, text, size, name) : -ENOMEM;

    err = err ? err : read_one(loose, doc, name, cfg);
    if (!err) {
        if (!cfg->rows) /* a single file is a single camera, whatever its position was */
            loose->camera[0].row = loose->camera[0].col = -1;
        err = sst_loose_assemble(out, loose, cfg, name, "OpenCV");
    }
    free(loose);
    return err;
}

static int is_ours(const struct dirent *e)
{
    for (size_t i = 0; i < ARRAY_LEN(endings); i++) {
        if (e->d_name[0] != '.' && sst_text_ends(e->d_name, endings[i]))
            return 1;
    }
    return 0;
}

static int read_folder(struct sst_loose *loose, const char *path, const struct sst_calib_format_config *cfg)
{
    struct dirent **entry = NULL;
    const int n = scandir(path, &entry, is_ours, alphasort);
    char file[SST_PATH_MAX];
    struct sst_yaml *doc;
    int err = 0;

    if (n < 0) {
        err = -errno;
        sst_log_error("cannot list %s: %s", path, strerror(-err));
    }
    for (int i = 0; i < n; i++) {
        err = err ? err : sst_path_join(file, path, entry[i]->d_name);
        err = err ? err : read_yaml(&doc, file);
        err = err ? err : read_one(loose, doc, file, cfg);
        free(entry[i]);
    }
    free(entry);
    return err;
}

int sst_opencv_read(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg)
{
    struct sst_loose *loose;
    int err;

    if (!sst_path_is_dir(path))
        return sst_calib_read_file(out, path, cfg, sst_opencv_parse);
    loose = sst_loose_create();
    if (!loose)
        return -ENOMEM;
    err = read_folder(loose, path, cfg);
    err = err ? err : sst_loose_assemble(out, loose, cfg, path, "OpenCV");
    free(loose);
    return err;
}

/* --- the stereo sample's pair of files ---------------------------------------------------------------------------- */

/* The file in a folder, or the sibling of one named *intrinsics* with the other word in its name. */
static int find_pair(char out[SST_PATH_MAX], const char *path, const char *word)
{
    static const char *const words[] = { "intrinsics", "extrinsics" };
    const char *base = sst_path_base(path), *at = NULL;
    char name[32];

    for (size_t i = 0; i < 2 && !at; i++)
        at = strstr(base, words[i]);
    if (at && !sst_path_is_dir(path) &&
        snprintf(out, SST_PATH_MAX, "%.*s%s%s", (int)(at - path), path, word, at + 10) < SST_PATH_MAX)
        return 0;
    for (size_t i = 0; i < ARRAY_LEN(endings) && sst_path_is_dir(path); i++) {
        snprintf(name, sizeof(name), "%s%s", word, endings[i]);
        if (!sst_path_join(out, path, name) && sst_path_exists(out))
            return 0;
    }
    sst_log_error(
        "%s is not a pair of intrinsics.yml and extrinsics.yml, as OpenCV's stereo sample writes; name their folder",
        path);
    return -ENOENT;
}

static int read_pair(struct sst_loose *loose, struct sst_yaml *in, struct sst_yaml *ex, const char *file,
                     const struct sst_calib_format_config *cfg)
{
    struct sst_yaml_node *root[2] = { sst_yaml_root(in), sst_yaml_root(ex) };
    const double eye[9] = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, none[3] = { 0 };
    int err, faults;

    for (int i = 0; i < 2; i++) {
        struct sst_loose_camera *c = sst_loose_add(loose, i ? "right" : "left", file);
        struct sst_yaml_node *matrix = get_any(root[0], pair_names[2 * i]),
                             *lens = get_any(root[0], pair_names[2 * i + 1]);

        if (!c)
            return -EBADMSG;
        if (!matrix || !lens)
            sst_yaml_fault(in, root[0], "M%d or D%d is missing; is it the stereo sample's intrinsics file?", i + 1,
                           i + 1);
        if (matrix && lens && read_matrix(in, matrix, &c->cam) && read_lens(in, lens, &c->cam))
            doubt_four(in, root[0], matrix, lens, loose);
        read_size(in, root[0], c);
        c->row = 0;
        c->col = i;
        if (i == 0)
            (void)sst_loose_pose(c, eye, none, 1);
        else
            read_pose(ex, root[1], c, unit_of(cfg));
    }
    for (int i = 0; i < 2 && root[i]; i++)
        sst_loose_refuse_lenses(i ? ex : in, root[i], no_keys);
    sst_yaml_know_tree(root[0]);
    sst_yaml_know_tree(root[1]);
    err = sst_yaml_finish(in);
    faults = sst_yaml_finish(ex);
    return err ? err : faults;
}

int sst_opencv_stereo_read(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg)
{
    struct sst_loose *loose = sst_loose_create();
    struct sst_yaml *in = NULL, *ex = NULL;
    char file[SST_PATH_MAX];
    int err = loose ? find_pair(file, path, "intrinsics") : -ENOMEM;

    err = err ? err : read_yaml(&in, file);
    err = err ? err : find_pair(file, path, "extrinsics");
    err = err ? err : read_yaml(&ex, file);
    err = err ? err : read_pair(loose, in, ex, path, cfg);
    err = err ? err : sst_loose_assemble(out, loose, cfg, path, "OpenCV");
    sst_yaml_destroy(in);
    sst_yaml_destroy(ex);
    free(loose);
    return err;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

static void put_matrix(FILE *f, const char *name, const double *v, int rows, int cols)
{
    fprintf(f, "%s: !!opencv-matrix\n   rows: %d\n   cols: %d\n   dt: d\n   data: [ ", name, rows, cols);
    sst_put_numbers(f, v, rows * cols);
    fputs(" ]\n", f);
}

static void put_lens(FILE *f, const struct sst_calib_camera *c, const char *matrix, const char *lens)
{
    put_matrix(f, matrix, (const double[]){ c->fx, 0, c->cx, 0, c->fy, c->cy, 0, 0, 1 }, 3, 3);
    put_matrix(f, lens, c->k, 1, c->lens ? c->lens : 5);
}

static void put_head(FILE *f, const struct sst_calib *calib)
{
    fprintf(f, "%%YAML:1.0\n---\nimage_width: %d\nimage_height: %d\n", calib->width, calib->height);
}

static void put_camera(FILE *f, const struct sst_calib *calib, int view)
{
    const struct sst_calib_camera *c = &calib->camera[view];
    double t[3];

    put_head(f, calib);
    fputs("camera_name: \"", f);
    for (const char *s = c->name; *s; s++) /* FileStorage has its own rules for everything else */
        putc(*s >= ' ' && *s < 0x7f && *s != '"' && *s != '\\' ? *s : '_', f);
    fprintf(f, "\"\nrow: %d\ncol: %d\n", view / calib->cols, view % calib->cols);
    put_lens(f, c, "camera_matrix", "distortion_coefficients");
    sst_camera_translation(c, 1, t);
    put_matrix(f, "R", c->rotation, 3, 3);
    put_matrix(f, "T", t, 3, 1);
}

int sst_opencv_write(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg)
{
    return sst_calib_write_each(calib, path, ".yml", cfg, put_camera);
}

static void put_intrinsics(FILE *f, const struct sst_calib *calib, const struct sst_calib_camera *a,
                           const struct sst_calib_camera *b)
{
    put_head(f, calib);
    put_lens(f, a, "M1", "D1");
    put_lens(f, b, "M2", "D2");
}

/* X_2 = R_2 R_1^T X_1 + R_2 (c_1 - c_2) */
static void put_extrinsics(FILE *f, const struct sst_calib *calib, const struct sst_calib_camera *a,
                           const struct sst_calib_camera *b)
{
    double R[9], T[3];

    sst_rotation_between(b->rotation, a->rotation, R);
    for (int i = 0; i < 3; i++)
        T[i] = a->position_mm[i] - b->position_mm[i];
    sst_numbers_apply3(b->rotation, T, T);
    put_head(f, calib);
    put_matrix(f, "R", R, 3, 3);
    put_matrix(f, "T", T, 3, 1);
}

int sst_opencv_stereo_write(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg)
{
    static const struct {
        const char *name;
        void (*put)(FILE *f, const struct sst_calib *calib, const struct sst_calib_camera *a,
                    const struct sst_calib_camera *b);
    } file[] = { { "intrinsics.yml", put_intrinsics }, { "extrinsics.yml", put_extrinsics } };
    const int a = sst_calib_next(calib, 0), b = sst_calib_next(calib, a + 1);
    const char *const inputs[] = { NULL };
    struct sst_outdir folder;
    struct sst_outfile out;
    int err;

    if (b < 0 || sst_calib_next(calib, b + 1) >= 0) {
        sst_log_error("OpenCV's stereo files hold two cameras, but there are %s; use the format opencv",
                      b < 0 ? "fewer" : "more");
        return -EINVAL;
    }
    err = sst_path_check_output(path, cfg->force, file[0].name, inputs);
    err = err ? err : sst_outdir_open(&folder, path, cfg->force);
    if (err)
        return err;
    for (int i = 0; i < 2 && !err; i++) {
        err = sst_outfile_open_in(&out, folder.temporary, file[i].name);
        if (!err) {
            file[i].put(out.stream, calib, &calib->camera[a], &calib->camera[b]);
            err = sst_outfile_commit(&out);
        }
    }
    return sst_outdir_end(&folder, err);
}

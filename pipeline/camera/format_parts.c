/* Grid of cameras from a tool's list of cameras, and helpers of all writers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/camera/format_parts.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "pipeline/camera/numbers.h"

struct sst_loose *sst_loose_create(void)
{
    struct sst_loose *loose = calloc(1, sizeof(*loose));

    if (!loose)
        sst_log_error("not enough memory to read a calibration");
    return loose;
}

struct sst_loose_camera *sst_loose_add(struct sst_loose *loose, const char *name, const char *file)
{
    struct sst_loose_camera *c = &loose->camera[loose->count];

    if (loose->count == SST_MAX_VIEWS) {
        sst_log_error("%s has more than %d cameras, the maximum", file, SST_MAX_VIEWS);
        return NULL;
    }
    loose->count++;
    *c = (struct sst_loose_camera){ .row = -1, .col = -1 };
    c->cam = (struct sst_calib_camera){ .known = true, .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 }, .gain = { 1, 1, 1 } };
    snprintf(c->cam.name, sizeof(c->cam.name), "%s", name);
    return c;
}

const char *sst_loose_matrix(struct sst_calib_camera *cam, const double K[9])
{
    if (K[1] != 0)
        return "the camera matrix has a skew, which is not supported";
    if (K[3] != 0 || K[6] != 0 || K[7] != 0 || K[8] != 1)
        return "the camera matrix is not of the form [fx 0 cx; 0 fy cy; 0 0 1]";
    cam->fx = K[0];
    cam->fy = K[4];
    cam->cx = K[2];
    cam->cy = K[5];
    return NULL;
}

const char *sst_loose_lens(struct sst_calib_camera *cam, const double *d, int n)
{
    if (n != 0 && n != 4 && n != 5 && n != 8 && n != 12 && n != 14)
        return "the number of distortion coefficients is not 0, 4, 5, 8, 12 or 14";
    for (int i = SST_LENS_MAX; i < n; i++) {
        if (d[i] != 0)
            return "the lens has thin-prism or tilt terms, which are not supported; calibrate with 8 coefficients";
    }
    cam->lens = n == 0 ? 0 : n <= 5 ? 5 : 8;
    for (int i = 0; i < SST_LENS_MAX; i++)
        cam->k[i] = i < n ? d[i] : 0;
    return NULL;
}

/* --- other lens models ---------------------------------------------------------------------------------------------
 */

/* Letters and digits alone, in lower case. */
static void squeeze(char out[40], const char *text)
{
    size_t n = 0;

    for (; *text && n < 39; text++) {
        if (isalnum((unsigned char)*text))
            out[n++] = (char)tolower((unsigned char)*text);
    }
    out[n] = 0;
}

static bool is_among(const char *word, const char *const *list)
{
    while (*list && strcmp(word, *list) != 0)
        list++;
    return *list;
}

static bool is_unset(const char *value)
{
    static const char *const words[] = { "", "false", "no", "off", "none", "null", NULL };
    char word[40], *end;

    squeeze(word, value);
    return is_among(word, words) || (strtod(value, &end) == 0 && end != value && !*end);
}

/* Names that other programs give to pinholes with OpenCV's distortion or a part of it. */
static const char *const pinholes[] = { "",
                                        "none",
                                        "pinhole",
                                        "perspective",
                                        "rectilinear",
                                        "standard",
                                        "normal",
                                        "rational",
                                        "rationalpolynomial",
                                        "plumbbob",
                                        "radtan",
                                        "radial",
                                        "radialtangential",
                                        "brown",
                                        "brownconrady",
                                        "thinprism",
                                        "tilted",
                                        "opencv",
                                        "opencv4",
                                        "opencv5",
                                        "opencv8",
                                        "opencvpinhole",
                                        NULL };

/* Whether a word names another model, where it may as well name a device or a board. */
static bool names_other(const char *word)
{
    static const char *const parts[] = { "fish",    "omni",         "equi",          "kannala",    "spher",
                                         "unified", "cylind",       "stereographic", "scaramuzza", "division",
                                         "panoram", "orthographic", "ftheta",        NULL };
    static const char *const words[] = { "mei", "ds",  "ucm",  "eucm", "fov",  "kb",
                                         "kb4", "kb8", "atan", "ocam", "cata", NULL };
    bool found = is_among(word, words);

    for (int i = 0; parts[i]; i++)
        found |= strstr(word, parts[i]) != NULL;
    return found;
}

bool sst_loose_other_lens(const char *key, const char *value, bool listed, char why[SST_LENS_WHY])
{
    static const char *const model[] = {
        "distortionmodel", "distortiontype",  "lensmodel",      "lenstype",  "cameramodel",
        "projection",      "projectionmodel", "projectiontype", "modeltype", NULL
    };
    static const char *const perhaps[] = { "model", "type", "cameratype", "lens", "distortion", NULL };
    static const char *const parameter[] = { "xi",        "alpha", "beta", "tau", "taux", "tauy",  "tilt",
                                             "skew",      "s1",    "s2",   "s3",  "s4",   "omega", "mirrorparameters",
                                             "thinprism", NULL };
    char k[40], v[40], one[40]; /* of a pair: xi_1, xi2 */

    squeeze(k, key);
    squeeze(v, value);
    squeeze(one, key);
    one[strcspn(one, "0123456789")] = 0;
    if (is_among(k, parameter) || is_among(one, parameter) || strstr(k, "fisheye") || strstr(k, "omnidir") || strstr(k, "thinprism") ||
        strstr(k, "tilted")) {
        snprintf(why, SST_LENS_WHY,
                 "is set (%.40s), which belongs to another lens model; cameras here are pinholes with OpenCV's "
                 "distortion, so calibrate again with it",
                 value);
        return !is_unset(value);
    }
    snprintf(why, SST_LENS_WHY,
             "is %.40s; only pinholes with OpenCV's distortion (plumb_bob, rational_polynomial) are supported, so "
             "calibrate again with it",
             value);
    return !listed && ((is_among(k, model) && !is_among(v, pinholes)) || (is_among(k, perhaps) && names_other(v)));
}

/* @param named  the node with the key of the values below it; NULL at the root */
static void refuse_lenses(struct sst_yaml *doc, const struct sst_yaml_node *node, const struct sst_yaml_node *named,
                          const char *const *except)
{
    static const char *const matrix[] = { "rows", "cols", "dt", "type_id", NULL };
    char why[SST_LENS_WHY];

    if (node->type == SST_YAML_SCALAR && named && sst_loose_other_lens(named->key, node->text, node != named, why))
        sst_yaml_fault(doc, named, "%s", why);
    for (const struct sst_yaml_node *n = node->first; n; n = n->next) { /* no deeper than SST_YAML_MAX_DEPTH */
        if (!n->key || !strcmp(n->key, "data"))
            refuse_lenses(doc, n, named, except);
        else if (!is_among(n->key, matrix) && !is_among(n->key, except))
            refuse_lenses(doc, n, n, except);
    }
}

void sst_loose_refuse_lenses(struct sst_yaml *doc, const struct sst_yaml_node *node, const char *const *except)
{
    refuse_lenses(doc, node, NULL, except);
}

/* --- numbers ------------------------------------------------------------------------------------------------------ */

static void cofactors(const double r[9], double c[9])
{
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const int a = (i + 1) % 3, b = (i + 2) % 3, p = (j + 1) % 3, q = (j + 2) % 3;

            c[3 * i + j] = r[3 * a + p] * r[3 * b + q] - r[3 * a + q] * r[3 * b + p];
        }
    }
}

/* The rotation nearest to a matrix that nearly is one: Newton's iteration for the polar factor, R <- (R + R^-T) / 2
 * (Higham 1986). @return false: it is not near one */
static bool nearest_rotation(const double in[9], double out[9])
{
    double r[9], c[9];

    memcpy(r, in, sizeof(r));
    for (int pass = 0; pass < 6; pass++) {
        double det;

        cofactors(r, c);
        det = r[0] * c[0] + r[1] * c[1] + r[2] * c[2];
        if (!(det > 0.5 && det < 2))
            return false;
        for (int i = 0; i < 9; i++)
            r[i] = 0.5 * (r[i] + c[i] / det);
    }
    for (int i = 0; i < 9; i++) {
        if (!(fabs(r[i] - in[i]) < 1e-3))
            return false;
    }
    memcpy(out, r, sizeof(r));
    return true;
}

const char *sst_loose_pose(struct sst_loose_camera *camera, const double R[9], const double T[3], double unit_mm)
{
    double *r = camera->cam.rotation;

    if (!nearest_rotation(R, r))
        return "R is not a rotation matrix";
    for (int i = 0; i < 3; i++)
        camera->cam.position_mm[i] = -(r[i] * T[0] + r[3 + i] * T[1] + r[6 + i] * T[2]) * unit_mm;
    camera->posed = true;
    return NULL;
}

/* At most three digits before `end`, which moves to their beginning. @return their value, -1 without any */
static int digits_before(const char *begin, const char **end)
{
    int value = 0, weight = 1;
    const char *p = *end;

    while (p > begin && isdigit((unsigned char)p[-1]) && weight <= 100) {
        value += weight * (*--p - '0');
        weight *= 10;
    }
    if (p == *end || (p > begin && isdigit((unsigned char)p[-1])))
        return -1;
    *end = p;
    return value;
}

void sst_loose_place(struct sst_loose_camera *camera, const char *name, const struct sst_calib_format_config *cfg)
{
    const char *p = name + strlen(name);
    const int c = digits_before(name, &p), r = c >= 0 && p > name && *--p == '_' ? digits_before(name, &p) : -1;

    if (r < 0 || cfg->plain_names)
        return;
    camera->row = r;
    camera->col = c;
}

/* --- the grid ----------------------------------------------------------------------------------------------------- */

/* True if every camera's position is known, all differ, and none is outside a given grid. */
static bool all_placed(const struct sst_loose *loose)
{
    for (int i = 0; i < loose->count; i++) {
        if (loose->camera[i].row < 0 || loose->camera[i].col < 0)
            return false;
    }
    return true;
}

static int find_grid(const struct sst_loose *loose, const struct sst_calib_format_config *cfg, const char *file,
                     int *rows, int *cols)
{
    int need_rows = 1, need_cols = 1;

    if (!all_placed(loose)) {
        *rows = cfg->rows;
        *cols = cfg->cols;
        if (loose->count == 1 && !cfg->rows)
            *rows = *cols = 1;
        if (*rows * *cols == loose->count)
            return 0;
        if (cfg->rows)
            sst_log_error("%s has %d cameras, which do not fill a grid of %d x %d; correct --grid", file, loose->count,
                          cfg->rows, cfg->cols);
        else
            sst_log_error("%s lists %d cameras without their places; add --grid ROWSxCOLUMNS, to be filled row by row",
                          file, loose->count);
        return -EINVAL;
    }
    for (int i = 0; i < loose->count; i++) {
        need_rows = sst_max_int(need_rows, loose->camera[i].row + 1);
        need_cols = sst_max_int(need_cols, loose->camera[i].col + 1);
    }
    *rows = cfg->rows ? cfg->rows : need_rows;
    *cols = cfg->cols ? cfg->cols : need_cols;
    if (need_rows <= *rows && need_cols <= *cols && need_rows <= SST_MAX_VIEWS && need_cols <= SST_MAX_VIEWS &&
        *rows * *cols <= SST_MAX_VIEWS) {
        if (!cfg->rows && 2 * loose->count < *rows * *cols)
            sst_log_warning("%s has %d cameras at places of a grid of %d x %d; add --plain-names and --grid if their "
                            "names are no places",
                            file, loose->count, *rows, *cols);
        return 0;
    }
    sst_log_error("%s names cameras up to row %d, column %d (from 0), beyond %s; add --plain-names if names in it are "
                  "no places",
                  file, need_rows - 1, need_cols - 1, cfg->rows ? "the --grid given" : "the maximum of 256 views");
    return -EINVAL;
}

static int set_size(struct sst_calib *out, const struct sst_loose_camera *c, const struct sst_calib_format_config *cfg,
                    const char *file)
{
    const int width = c->width ? c->width : cfg->width, height = c->height ? c->height : cfg->height;

    if (!width || !height) {
        sst_log_error("%s does not contain the picture size; add --size WIDTHxHEIGHT", file);
        return -EINVAL;
    }
    if ((cfg->width && (width != cfg->width || height != cfg->height)) ||
        (out->width && (width != out->width || height != out->height))) {
        sst_log_error("%s: camera %s has pictures of %d x %d pixels, %s of %d x %d; all must agree", file, c->cam.name,
                      width, height, cfg->width ? "--size is" : "others", cfg->width ? cfg->width : out->width,
                      cfg->width ? cfg->height : out->height);
        return -EBADMSG;
    }
    out->width = width;
    out->height = height;
    return 0;
}

static int place_cameras(struct sst_calib *out, const struct sst_loose *loose,
                         const struct sst_calib_format_config *cfg, const char *file)
{
    const bool placed = all_placed(loose);

    for (int i = 0; i < loose->count; i++) {
        const struct sst_loose_camera *c = &loose->camera[i];
        const int view = placed ? c->row * out->cols + c->col : i;
        const char *fault = sst_camera_fault(&c->cam);
        int err;

        if (fault || (!c->posed && loose->count > 1) || out->camera[view].known) {
            sst_log_error("%s: camera %s: %s", file, c->cam.name,
                          fault      ? fault
                          : c->posed ? "another one has the same place; rename one of them"
                                     : "its pose (R, T) is missing; calibrate the cameras together");
            return -EBADMSG;
        }
        err = set_size(out, c, cfg, file);
        if (err)
            return err;
        out->camera[view] = c->cam;
    }
    return 0;
}

/* The known camera nearest to the grid's reference view; ties: the lower index, as for light fields. */
static int nearest_known(const struct sst_calib *calib)
{
    const int row = calib->reference / calib->cols, col = calib->reference % calib->cols;
    int best = 0;
    long least = -1;

    for (int k = 0; k < calib->rows * calib->cols; k++) {
        const long dy = k / calib->cols - row, dx = k % calib->cols - col, d = dx * dx + dy * dy;

        if (calib->camera[k].known && (least < 0 || d < least)) {
            least = d;
            best = k;
        }
    }
    return best;
}

/* X' = R_ref (X - c_ref). With a reference already at the origin nothing changes, not even by rounding. */
static void rebase(struct sst_calib *calib)
{
    const struct sst_calib_camera ref = calib->camera[calib->reference];
    double moved = 0;

    for (int i = 0; i < 9; i++)
        moved += fabs(ref.rotation[i] - (i % 4 == 0));
    for (int i = 0; i < 3; i++)
        moved += fabs(ref.position_mm[i]);
    for (int k = 0; moved > 0 && k < calib->rows * calib->cols; k++) {
        struct sst_calib_camera *c = &calib->camera[k];
        double r[9];

        if (!c->known || k == calib->reference)
            continue;
        for (int i = 0; i < 3; i++)
            c->position_mm[i] -= ref.position_mm[i];
        sst_numbers_apply3(ref.rotation, c->position_mm, c->position_mm);
        sst_rotation_between(c->rotation, ref.rotation, r);
        memcpy(c->rotation, r, sizeof(r));
    }
    memcpy(calib->camera[calib->reference].rotation, (const double[]){ 1, 0, 0, 0, 1, 0, 0, 0, 1 }, 9 * sizeof(double));
    memset(calib->camera[calib->reference].position_mm, 0, 3 * sizeof(double));
}

int sst_loose_assemble(struct sst_calib *out, const struct sst_loose *loose, const struct sst_calib_format_config *cfg,
                       const char *file, const char *format)
{
    struct sst_calib made = { 0 };
    const char *fault;
    int rows, cols, err;

    if (loose->four)
        sst_log_warning(
            "%s: four distortion coefficients are taken for k1, k2, p1, p2 of a pinhole; a lens of "
            "cv::fisheye also has four: `distortion_model: plumb_bob` or `equidistant` in the file says which",
            file);
    if (!loose->count) {
        sst_log_error("%s holds no camera; is it a calibration?", file);
        return -EBADMSG;
    }
    err = find_grid(loose, cfg, file, &rows, &cols);
    if (err)
        return err;
    err = sst_calib_init(&made, rows, cols);
    if (err) {
        sst_log_error("%s: a grid of %d x %d is not possible", file, rows, cols);
        return err;
    }
    snprintf(made.source, sizeof(made.source), "%s (%s)", file, format);
    err = place_cameras(&made, loose, cfg, file);
    if (!err) {
        made.reference = nearest_known(&made);
        rebase(&made);
        fault = sst_calib_fault(&made);
        if (fault) {
            sst_log_error("%s: %s", file, fault);
            err = -EBADMSG;
        }
    }
    if (err)
        sst_calib_fini(&made);
    else
        *out = made;
    return err;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

void sst_camera_translation(const struct sst_calib_camera *cam, double unit_mm, double out[3])
{
    sst_numbers_apply3(cam->rotation, cam->position_mm, out);
    for (int i = 0; i < 3; i++)
        out[i] = (0 - out[i]) / unit_mm; /* no -0 */
}

int sst_calib_next(const struct sst_calib *calib, int view)
{
    while (view < calib->rows * calib->cols && !calib->camera[view].known)
        view++;
    return view < calib->rows * calib->cols ? view : -1;
}

static void put_number(FILE *f, double v)
{
    char text[40], *e;

    for (int digits = 15; digits <= 17; digits++) {
        snprintf(text, sizeof(text), "%.*g", digits, v);
        if (strtod(text, NULL) == v)
            break;
    }
    if (!strchr(text, '.')) { /* Python reads 0 as an integer, which libraries reject; YAML 1.1 reads 1e-05 as text */
        e = text + strcspn(text, "e");
        memmove(e + 2, e, strlen(e) + 1);
        memcpy(e, ".0", 2);
    }
    fputs(text, f);
}

void sst_put_numbers(FILE *f, const double *v, int n)
{
    for (int i = 0; i < n; i++) {
        fputs(i ? ", " : "", f);
        put_number(f, v[i]);
    }
}

int sst_utf8_character(const unsigned char *s, uint32_t *code)
{
    static const uint32_t least[] = { 0, 0, 0x80, 0x800, 0x10000 };
    const int n = s[0] < 0x80 ? 1 : s[0] >> 5 == 6 ? 2 : s[0] >> 4 == 14 ? 3 : s[0] >> 3 == 30 ? 4 : 0;
    uint32_t c = n <= 1 ? s[0] : s[0] & (0xffu >> (n + 1));

    *code = 0;
    for (int i = 1; i < n; i++) {
        if ((s[i] & 0xc0) != 0x80) /* also fails at the end of the text */
            return 0;
        c = c << 6 | (s[i] & 0x3f);
    }
    if (n == 0 || c < least[n] || c > 0x10ffff || (c >= 0xd800 && c < 0xe000))
        return 0;
    if (c < 0x20 || (c >= 0x7f && c < 0xa0) || c == 0xfffe || c == 0xffff)
        return 0;
    *code = c;
    return n;
}

int sst_calib_read_file(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg,
                        sst_calib_parse_fn *parse)
{
    uint8_t *data;
    size_t size;
    int err = sst_file_read_text(path, SST_CALIB_FILE_MAX, &data, &size);

    if (err)
        return err;
    err = parse(out, (const char *)data, size, path, cfg);
    free(data);
    return err;
}

static int write_folder(const struct sst_calib *calib, const char *path, const char *ending, bool force,
                        void (*put)(FILE *f, const struct sst_calib *calib, int view))
{
    char name[64];
    const char *const inputs[] = { NULL };
    const int first = sst_calib_next(calib, 0);
    struct sst_outdir folder;
    struct sst_outfile out;
    int err;

    snprintf(name, sizeof(name), "%02d_%02d%s", first / calib->cols, first % calib->cols, ending);
    err = sst_path_check_output(path, force, name, inputs);
    err = err ? err : sst_outdir_open(&folder, path, force);
    if (err)
        return err;
    for (int k = sst_calib_next(calib, 0); k >= 0 && !err; k = sst_calib_next(calib, k + 1)) {
        snprintf(name, sizeof(name), "%02d_%02d%s", k / calib->cols, k % calib->cols, ending);
        err = sst_outfile_open_in(&out, folder.temporary, name);
        if (err)
            break;
        put(out.stream, calib, k);
        err = sst_outfile_commit(&out);
    }
    return sst_outdir_end(&folder, err);
}

int sst_calib_write_each(const struct sst_calib *calib, const char *path, const char *ending,
                         const struct sst_calib_format_config *cfg,
                         void (*put)(FILE *f, const struct sst_calib *calib, int view))
{
    const int first = sst_calib_next(calib, 0);
    struct sst_outfile out;
    int err;

    if (!sst_text_ends(path, ending))
        return write_folder(calib, path, ending, cfg->force, put);
    if (sst_calib_next(calib, first + 1) >= 0) {
        sst_log_error("%s names the file of one camera, but there are more; name a folder without %s", path, ending);
        return -EINVAL;
    }
    err = sst_outfile_open(&out, path);
    if (err)
        return err;
    put(out.stream, calib, first);
    return sst_outfile_commit(&out);
}

/* Imports of posed light fields: the source's format by its content, then its model, pictures and folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/import/import.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"
#include "pipeline/posed/import/import_internal.h"

#define LOOKS_AHEAD 0.5 /* share of the observations that are in front of their cameras, at least */

#define KNOWN_FORMATS                                                                                                   \
    "COLMAP (cameras.txt or .bin), AOS (M3x4), nerfstudio (transforms.json), OpenSfM (reconstruction.json), ODM "       \
    "(geo.txt), LLFF (poses_bounds.npy) or mrcal (*.cameramodel)"

/* --- the format --------------------------------------------------------------------------------------------------- */

static bool has(char path[SST_PATH_MAX], const char *dir, const char *name)
{
    return !sst_path_join(path, dir, name) && sst_path_exists(path) && !sst_path_is_dir(path);
}

static read_model_fn *reader_of_json(const json_t *root)
{
    if (json_is_array(root))
        return json_object_get(json_array_get(root, 0), "shots") ? read_opensfm : NULL;
    if (json_object_get(root, "frames"))
        return read_nerfstudio;
    if (json_object_get(root, "images"))
        return read_aos;
    return NULL;
}

/* Lines of a geo.txt without its first one, the reference system: a picture's name and its place. */
static bool lists_places(const char *text)
{
    char name[256], value[3][32];
    double v;

    if (sscanf(text, "%255s %31s %31s %31s", name, value[0], value[1], value[2]) != 4 || !strchr(name, '.'))
        return false;
    for (int i = 0; i < 3; i++) {
        char end;

        if (sscanf(value[i], "%lf%c", &v, &end) != 1)
            return false;
    }
    return true;
}

/* First words of a file. @return NULL also where it cannot be read, which is logged */
static read_model_fn *reader_of_file(const char *path, bool *failed)
{
    const char *name = sst_path_base(path);
    read_model_fn *reader = NULL;
    json_t *root;
    uint8_t *data;
    size_t size, at = 0;

    if (!strncmp(name, "cameras.", 8) || !strncmp(name, "images.", 7) || !strncmp(name, "points3D.", 9))
        return read_colmap;
    *failed = sst_file_read(path, MODEL_BYTES, &data, &size) != 0;
    if (*failed)
        return NULL;
    while (at < size && strchr(" \t\r\n\xEF\xBB\xBF", data[at]))
        at++;
    if (size > 6 && !memcmp(data, "\x93NUMPY", 6)) {
        reader = read_llff;
    } else if (sst_text_ends(path, ".cameramodel") || strstr((const char *)data, "LENSMODEL_")) {
        reader = read_mrcal;
    } else if (at < size && (data[at] == '{' || data[at] == '[')) {
        *failed = model_json(&root, path) != 0;
        if (!*failed) {
            reader = reader_of_json(root);
            json_decref(root);
        }
    } else if (!strncmp((const char *)data + at, "EPSG:", 5) || !strncmp((const char *)data + at, "+proj=", 6) ||
               !strncmp((const char *)data + at, "WGS84", 5) || sst_text_ends(path, "geo.txt") ||
               lists_places((const char *)data + at)) {
        reader = read_geo;
    }
    free(data);
    return reader;
}

static bool holds(const char *dir, const char *end)
{
    struct dirent *e;
    bool found = false;
    DIR *d = opendir(dir);

    while (d && !found && (e = readdir(d)))
        found = e->d_name[0] != '.' && sst_text_ends(e->d_name, end);
    if (d)
        closedir(d);
    return found;
}

static read_model_fn *reader_of_folder(char path[SST_PATH_MAX], const char *dir, bool *failed)
{
    static const char *const models[] = { "", "sparse/0", "sparse", "0", "poses" };
    static const char *const files[] = { "transforms.json", "reconstruction.json", "opensfm/reconstruction.json", "geo.txt",
                                         "poses_bounds.npy" };
    char file[SST_PATH_MAX];

    for (size_t i = 0; i < ARRAY_LEN(models); i++) {
        if (!sst_path_join(path, dir, models[i][0] ? models[i] : NULL) &&
            (has(file, path, "cameras.bin") || has(file, path, "cameras.txt")))
            return read_colmap;
    }
    for (size_t i = 0; i < ARRAY_LEN(files); i++) {
        if (has(path, dir, files[i]))
            return reader_of_file(path, failed);
    }
    for (size_t i = 0; i < ARRAY_LEN(models); i += ARRAY_LEN(models) - 1) {
        if (sst_path_join(path, dir, models[i][0] ? models[i] : NULL))
            continue;
        if (holds(path, ".cameramodel"))
            return read_mrcal;
        if (holds(path, ".json"))
            return read_aos;
    }
    return NULL;
}

read_model_fn *model_reader(char path[SST_PATH_MAX], const char *source)
{
    read_model_fn *reader = NULL;
    bool failed = false;

    if (sst_path_is_dir(source) && has(path, source, "lightfield.json")) {
        sst_log_error("%s is a light field already; name the poses of its pictures, or their folder", source);
        return NULL;
    }
    if (sst_path_is_dir(source)) {
        reader = reader_of_folder(path, source, &failed);
    } else if (!sst_path_exists(source)) {
        sst_log_error("there is no %s; name a file or folder with poses", source);
        return NULL;
    } else {
        failed = sst_path_join(path, source, NULL) != 0;
        reader = failed ? NULL : reader_of_file(source, &failed);
        if (reader == read_colmap) { /* of its three files */
            char *slash = strrchr(path, '/');

            snprintf(slash ? slash + (slash == path) : path, 2, "%s", slash ? "" : ".");
        }
    }
    if (!reader && !failed)
        sst_log_error("%s has no poses in a format that is known: " KNOWN_FORMATS, source);
    return reader;
}

/* --- the import --------------------------------------------------------------------------------------------------- */

static void model_fini(struct model *m)
{
    free(m->view);
    free(m->points);
}

static int check_config(const struct sst_posed_import_config *cfg)
{
    const char *const inputs[] = { cfg->source, cfg->pictures, NULL };

    if ((cfg->focal_px > 0) + (cfg->fov_deg > 0) + (cfg->lens != NULL) > 1) {
        sst_log_error("--focal, --fov and --lens say the same; give one");
        return -EINVAL;
    }
    return sst_path_check_output(cfg->out, cfg->force, "lightfield.json", inputs);
}

/* Do several cameras stand where the first one does? */
static bool one_place(const struct model *m)
{
    int placed = 0, first = -1;

    for (int k = 0; k < m->count; k++) {
        const struct sst_calib_camera *c = &m->view[k].camera;

        if (!c->known)
            continue;
        first = placed++ ? first : k;
        for (int i = 0; i < 3; i++) {
            if (fabs(c->position_mm[i] - m->view[first].camera.position_mm[i]) > 1e-9)
                return false;
        }
    }
    return placed > 1;
}

static int check_model(const struct model *m)
{
    if (!m->count)
        return model_fault(m, "", "it has no pose of any picture");
    if (one_place(m))
        return model_fault(m, "", "all poses are at one place; light fields need cameras at different ones, so lengths may "
                                  "be missing");
    if ((double)m->ahead < LOOKS_AHEAD * (double)(m->ahead + m->behind)) {
        sst_log_error("%s: the cameras look away from the points that they see (%lld of %lld are behind them); the axes "
                      "of the poses are not those of %s",
                      m->path, (long long)m->behind, (long long)(m->ahead + m->behind), m->format);
        return -EBADMSG;
    }
    return 0;
}

int sst_posed_import(const struct sst_posed_import_config *cfg)
{
    struct model m = { .cfg = cfg, .path = cfg->source, .unit_mm = METRE_MM, .median_px = (double)NAN };
    char path[SST_PATH_MAX];
    read_model_fn *read;
    int err = check_config(cfg);

    if (err)
        return err;
    read = model_reader(path, cfg->source);
    if (!read)
        return sst_path_exists(cfg->source) ? -EBADMSG : -ENOENT;
    err = read(&m, path);
    err = err ? err : check_model(&m);
    err = err ? err : pictures_find(&m, path);
    err = err ? err : model_write(&m);
    model_fini(&m);
    return err;
}

int sst_posed_import_pictures(const struct sst_posed_import_config *cfg)
{
    struct model m = { .cfg = cfg, .path = cfg->source, .format = "pictures", .unit_mm = METRE_MM, .median_px = (double)NAN };
    int err = check_config(cfg);

    if (err)
        return err;
    if (!sst_path_is_dir(cfg->source)) {
        sst_log_error("%s is not a folder; name the folder of the pictures", cfg->source);
        return -ENOENT;
    }
    err = pictures_list(&m, cfg->source);
    err = err ? err : model_write(&m);
    model_fini(&m);
    return err;
}

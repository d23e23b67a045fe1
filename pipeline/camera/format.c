/* The table of formats, and their detection by content. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/camera/format.h"

#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "base/text.h"
#include "pipeline/camera/format_parts.h"
#include "pipeline/lightfield/calibrated.h"

/* A calib.yaml, or a light field that has one. */
static int read_ours(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg SST_UNUSED)
{
    char inside[SST_PATH_MAX];
    int err;

    if (!sst_path_is_dir(path))
        return sst_calib_read(out, path);
    err = sst_path_join(inside, path, SST_CALIBRATION_FILE);
    return err ? err : sst_calib_read(out, inside);
}

static int write_ours(const struct sst_calib *calib, const char *path,
                      const struct sst_calib_format_config *cfg SST_UNUSED)
{
    return sst_calib_write(calib, path);
}

enum {
    SST = 0,
    OPENCV = 1,
    STEREO = 2,
    KALIBR = 3,
    MULTICAL = 4,
    MRCAL = 5,
};

#define LIGHT_AND_QUALITY "light, quality, noise, range, reference, rig"

static const struct sst_calib_format formats[] = {
    [SST] = { "sst", "calib.yaml, or a light field with a calibration", "", read_ours, write_ours },
    [OPENCV] = { "opencv", "a folder of rr_cc.yml (or .xml, .json), or one of these for one camera", LIGHT_AND_QUALITY,
                 sst_opencv_read, sst_opencv_write },
    [STEREO] = { "opencv-stereo", "a folder with intrinsics.yml and extrinsics.yml, of two cameras",
                 LIGHT_AND_QUALITY ", names, the grid", sst_opencv_stereo_read, sst_opencv_stereo_write },
    [KALIBR] = { "kalibr", "camchain.yaml", LIGHT_AND_QUALITY ", names, k3 to k6 of the lenses", sst_kalibr_read,
                 sst_kalibr_write },
    [MULTICAL] = { "multical", "calibration.json", LIGHT_AND_QUALITY ", names", sst_multical_read, sst_multical_write },
    [MRCAL] = { "mrcal", "a folder of rr_cc.cameramodel, or one for one camera; written only",
                LIGHT_AND_QUALITY ", names", NULL, sst_mrcal_write },
};

const struct sst_calib_format *sst_calib_format_find(const char *name)
{
    for (size_t i = 0; i < ARRAY_LEN(formats); i++) {
        if (!strcmp(formats[i].name, name))
            return &formats[i];
    }
    sst_log_error("unknown calibration format `%.40s`; choose sst, opencv, opencv-stereo, kalibr, multical or mrcal",
                  name);
    return NULL;
}

/* Words that only occur in one format's files, the most specific first. */
static const struct {
    const char *word;
    int format;
} signs[] = {
    { "sst-calib", SST },    { "lensmodel", MRCAL },      { "camera_poses", MULTICAL },    { "\"cameras\"", MULTICAL },
    { "T_cn_cnm1", KALIBR }, { "cam0:", KALIBR },         { "distortion_coeffs", KALIBR }, { "\nM1:", STEREO },
    { "<M1 ", STEREO },      { "\"M1\":", STEREO },       { "cameraMatrix1", STEREO },     { "opencv-matrix", OPENCV },
    { "%YAML", OPENCV },     { "camera_matrix", OPENCV }, { "cameraMatrix", OPENCV },      { "opencv_storage", OPENCV },
};

static const struct sst_calib_format *of_folder(const char *path)
{
    static const char *const names[] = { "intrinsics.yml", "intrinsics.yaml", "intrinsics.xml", "intrinsics.json" };
    char file[SST_PATH_MAX];

    if (!sst_path_join(file, path, SST_CALIBRATION_FILE) && sst_path_exists(file))
        return &formats[SST];
    if (!sst_path_join(file, path, "lightfield.json") && sst_path_exists(file)) {
        sst_log_error("%s is a light field without a calibration: its views are taken to be rectified", path);
        return NULL;
    }
    for (size_t i = 0; i < ARRAY_LEN(names); i++) {
        if (!sst_path_join(file, path, names[i]) && sst_path_exists(file))
            return &formats[STEREO];
    }
    return &formats[OPENCV];
}

const struct sst_calib_format *sst_calib_format_of(const char *path)
{
    const struct sst_calib_format *found = NULL;
    uint8_t *data;
    size_t size;

    if (sst_path_is_dir(path))
        return of_folder(path);
    if (sst_file_read_text(path, SST_CALIB_FILE_MAX, &data, &size))
        return NULL;
    for (size_t i = 0; i < ARRAY_LEN(signs) && !found; i++) {
        if (strstr((const char *)data, signs[i].word)) /* a NUL follows the data */
            found = &formats[signs[i].format];
    }
    free(data);
    if (!found)
        sst_log_error("%s is not in a known calibration format; name its format with --from", path);
    return found;
}

const struct sst_calib_format *sst_calib_format_for(const char *path)
{
    static const struct {
        const char *ending;
        int format;
    } endings[] = {
        { ".cameramodel", MRCAL }, { ".json", MULTICAL }, { ".yml", OPENCV }, { ".yaml", SST }, { "/", OPENCV }
    };

    if (strstr(sst_path_base(path), "camchain"))
        return &formats[KALIBR];
    for (size_t i = 0; i < ARRAY_LEN(endings); i++) {
        if (sst_text_ends(path, endings[i].ending))
            return &formats[endings[i].format];
    }
    if (!strchr(sst_path_base(path), '.'))
        return &formats[OPENCV];
    sst_log_error("the name %s does not imply a calibration format; name the format with --to", path);
    return NULL;
}

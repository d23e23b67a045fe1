/* pipeline/camera/format_parts.h - helpers shared by the readers and writers of calibration files. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_CAMERA_FORMAT_PARTS_H
#define SST_PIPELINE_CAMERA_FORMAT_PARTS_H

#include <stdio.h>

#include "base/yaml.h"
#include "pipeline/camera/format.h"

#define SST_LENS_WHY 200

/** Cameras as a file lists them: with or without a grid position. */
struct sst_loose_camera {
    int row, col;      /* -1: unknown */
    int width, height; /* 0: unknown */
    bool posed;
    struct sst_calib_camera cam; /* in the file's axes */
};

struct sst_loose {
    int count, four; /* four: cameras with four coefficients that no lens model is named for */
    struct sst_loose_camera camera[SST_MAX_VIEWS];
};

/** Release with free(). @return NULL: out of memory (logged) */
struct sst_loose *sst_loose_create(void);

/** Append an empty camera without position and pose. @return NULL: too many (logged) */
struct sst_loose_camera *sst_loose_add(struct sst_loose *loose, const char *name, const char *file);

/* Fill a camera from other tools' numbers. @return NULL, or a clause naming the fault */
const char *sst_loose_matrix(struct sst_calib_camera *cam, const double K[9]);
/**
 * Whether a value of a file beside a camera's matrix and coefficients gives it another lens than a pinhole with
 * OpenCV's distortion, or changes where it projects to: the name of another model under a key such as distortion_model,
 * or a parameter or flag of one, such as xi or fisheye_model, that is set. Case and underlines do not count.
 * @param listed  the value is an element of a list
 * @return whether it does; `why` is then a clause that follows the key
 */
bool sst_loose_other_lens(const char *key, const char *value, bool listed, char why[SST_LENS_WHY]);

/** Note a fault for every such value at or below a node. @param except  keys that the caller reads, ends in NULL */
void sst_loose_refuse_lenses(struct sst_yaml *doc, const struct sst_yaml_node *node, const char *const *except);

/** OpenCV's coefficients: n is 0, 4, 5, 8, 12 or 14; the prism and tilt terms of the last two must be 0. */
const char *sst_loose_lens(struct sst_calib_camera *cam, const double *d, int n);
/** X_camera = R X_world + T, T in units of unit_mm. R may differ from a rotation by 1e-3: the nearest rotation is
 *  used. */
const char *sst_loose_pose(struct sst_loose_camera *camera, const double R[9], const double T[3], double unit_mm);

/** Set the place from a name that is or ends in "rr_cc"; another name leaves it. */
void sst_loose_place(struct sst_loose_camera *camera, const char *name, const struct sst_calib_format_config *cfg);

/**
 * Arrange them in a grid: by their positions, else in the given grid row by row; move the axes to the reference camera.
 * @return 0, -EBADMSG, -EINVAL (the requested grid or size does not fit), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_loose_assemble(struct sst_calib *out, const struct sst_loose *loose,
                                      const struct sst_calib_format_config *cfg, const char *file, const char *format);

/** T of X_camera = R X_world + T, in units of unit_mm. */
void sst_camera_translation(const struct sst_calib_camera *cam, double unit_mm, double out[3]);

/** The first known camera at or after a view; -1: none. */
int sst_calib_next(const struct sst_calib *calib, int view);

/** Write n numbers separated by ", ": each the shortest decimal with a point that parses back to the same value. */
void sst_put_numbers(FILE *f, const double *v, int n);

/** Bytes of the UTF-8 character at s (NUL-terminated); 0: none, a control character or not allowed in XML. @param code
 *  its code point; 0 if there is none */
int sst_utf8_character(const unsigned char *s, uint32_t *code);

typedef int sst_calib_parse_fn(struct sst_calib *out, const char *text, size_t size, const char *name,
                               const struct sst_calib_format_config *cfg);

/** Read a file by one of the parsers of format.h. @return as the parser and sst_file_read() */
SST_MUST_CHECK int sst_calib_read_file(struct sst_calib *out, const char *path,
                                       const struct sst_calib_format_config *cfg, sst_calib_parse_fn *parse);

/* Formats with their own source file. */
int sst_kalibr_read(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg);
int sst_kalibr_write(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg);
int sst_multical_read(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg);
int sst_multical_write(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg);
int sst_mrcal_write(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg);
int sst_opencv_read(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg);
int sst_opencv_write(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg);
int sst_opencv_stereo_read(struct sst_calib *out, const char *path, const struct sst_calib_format_config *cfg);
int sst_opencv_stereo_write(const struct sst_calib *calib, const char *path, const struct sst_calib_format_config *cfg);

/**
 * Convert a text of cv::FileStorage (YAML, XML or JSON) to YAML for base/yaml.h with the same line numbers. @param out
 * release with free()
 * @return 0, -EBADMSG (XML beyond what FileStorage writes), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_opencv_to_yaml(char **out, size_t *out_size, const char *text, size_t size, const char *name);

/** Write one file per camera: path/rr_cc<ending>, or, for one camera and a path with this ending, the path itself. */
SST_MUST_CHECK int sst_calib_write_each(const struct sst_calib *calib, const char *path, const char *ending,
                                        const struct sst_calib_format_config *cfg,
                                        void (*put)(FILE *f, const struct sst_calib *calib, int view));

#endif

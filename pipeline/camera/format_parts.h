/* pipeline/camera/format_parts.h - what readers and writers of calibration files share. Inside pipeline/camera only. */
#ifndef SST_PIPELINE_CAMERA_FORMAT_PARTS_H
#define SST_PIPELINE_CAMERA_FORMAT_PARTS_H

#include <stdio.h>

#include "pipeline/camera/format.h"

/** Cameras as a file lists them: with or without a place in a grid. */
struct sst_loose_camera {
    int row, col;      /* -1: unknown */
    int width, height; /* 0: unknown */
    bool posed;
    struct sst_calib_camera cam; /* in the file's world */
};

struct sst_loose {
    int count;
    struct sst_loose_camera camera[SST_MAX_VIEWS];
};

/** NULL: no memory (logged). To free with free(). */
struct sst_loose *sst_loose_create(void);

/** The next one, empty, at no place and nowhere; NULL (logged): there are too many. */
struct sst_loose_camera *sst_loose_add(struct sst_loose *loose, const char *name, const char *file);

/* Fill a camera from other tools' numbers. @return NULL, or a clause that says what is wrong */
const char *sst_loose_matrix(struct sst_calib_camera *cam, const double K[9]);
/** OpenCV's coefficients: n of 0, 4, 5, 8, 12, 14; the prism and tilt of the last two must be 0. */
const char *sst_loose_lens(struct sst_calib_camera *cam, const double *d, int n);
/** X_camera = R X_world + T, T in units of unit_mm. R may be off a rotation by 1e-3: the nearest one is taken. */
const char *sst_loose_pose(struct sst_loose_camera *camera, const double R[9], const double T[3], double unit_mm);

/** "rr_cc", alone or at the end of the name. */
bool sst_loose_place(const char *name, int *row, int *col);

/**
 * Put them into a grid: by their places, else the one given, row by row; move the axes to the reference camera.
 * @return 0, -EBADMSG, -EINVAL (the grid or size that was asked for does not fit), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_loose_assemble(struct sst_calib *out, const struct sst_loose *loose,
                                      const struct sst_calib_format_config *cfg, const char *file, const char *format);

/** T of X_camera = R X_world + T, in units of unit_mm. */
void sst_camera_translation(const struct sst_calib_camera *cam, double unit_mm, double out[3]);

/** The first known camera at or after a view; -1: none. */
int sst_calib_next(const struct sst_calib *calib, int view);

/** n numbers with ", " between: each the shortest decimal with a point that reads back as the same. */
void sst_put_numbers(FILE *f, const double *v, int n);

/** Bytes of the UTF-8 character at s, which ends with a NUL; 0: none, a control character or no character of XML.
 *  @param code  its number; 0 where there is none */
int sst_utf8_character(const unsigned char *s, uint32_t *code);

/* The formats that have a file of their own. */
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
 * A text of cv::FileStorage, YAML, XML or JSON, as YAML that base/yaml.h reads, line by line the same.
 * @param out  to free with free()
 * @return 0, -EBADMSG (XML beyond what FileStorage writes), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_opencv_to_yaml(char **out, size_t *out_size, const char *text, size_t size, const char *name);

/** One file per camera: path/rr_cc<ending>, or, where there is one camera and the path ends so, the path itself. */
SST_MUST_CHECK int sst_calib_write_each(const struct sst_calib *calib, const char *path, const char *ending,
                                        const struct sst_calib_format_config *cfg,
                                        void (*put)(FILE *f, const struct sst_calib *calib, int view));

#endif

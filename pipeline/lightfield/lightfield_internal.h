/* pipeline/lightfield/lightfield_internal.h - what the files of this folder share; code outside of it includes the
 * public headers. */
#ifndef SST_PIPELINE_LIGHTFIELD_LIGHTFIELD_INTERNAL_H
#define SST_PIPELINE_LIGHTFIELD_LIGHTFIELD_INTERNAL_H

#include "pipeline/camera/calib.h"
#include "pipeline/lightfield/import.h"
#include "pipeline/lightfield/lightfield.h"

/* --- export_parts: what the exports share. Inside pipeline/lightfield only. --- */

/** An export at work. */
struct export_job {
    struct sst_lightfield lf;
    const struct sst_export_config *cfg;
    const char *out; /* temporary folder */
};

/** Bytes of a view's file, whose hash is checked; data to free with free(). path is out, for messages. */
SST_MUST_CHECK int export_read_view(const struct export_job *job, int view, char path[SST_PATH_MAX], uint8_t **data,
                                    size_t *size);

/**
 * The cameras that made the views' files: the light field's calibration, or one pinhole in the rectified views' plane,
 * its principal point in the middle of the picture.
 * @return 0, -EBADMSG (focal length or spacing is unknown, or a view's camera), -ENOMEM; logged
 */
SST_MUST_CHECK int export_cameras(struct sst_calib *out, const struct sst_lightfield *lf,
                                  const struct sst_export_config *cfg);

/** "images/rr_cc.png" (or .jpg) of a view. */
void export_image_name(const struct export_job *job, int view, char out[64]);

/**
 * A COLMAP model as text in dir/sparse/0: cameras, images, points3D (empty), rigs and frames. COLMAP's convention:
 * the upper left pixel's centre is (0.5, 0.5); poses take points (metres) from the reference camera's axes into a
 * camera.
 * @param name  of view k's file below images/
 */
SST_MUST_CHECK int colmap_write(const struct sst_calib *calib, const char (*name)[64], const char *dir);

/**
 * nerfstudio's transforms.json in dir. Its convention: the upper left pixel's centre is (0.5, 0.5); matrices take
 * points (metres) from the camera (x right, y up, z back) into a world with z up, y forward (applied_transform says
 * so).
 */
SST_MUST_CHECK int nerfstudio_write(const struct sst_calib *calib, const char (*name)[64], const char *dir);

/* --- import_plan ---
 * what an import has found out before it copies. Inside pipeline/lightfield only.
 *
 * A format (import_<format>.c) looks at names and parameters only and fills the plan; import.c does what all formats
 * share: decoding, checking, hashing, copying, writing. */

#define SST_NAME_MAX 256

/** Regular files of a folder in the order of their names, hidden ones left out. */
struct name_list {
    char (*name)[SST_NAME_MAX];
    bool *used; /* set by whoever makes something of the file */
    int count;
};

/** Where the file of one view was found and what is known about it; by view of the grid. */
struct plan_view {
    int name;            /* index in names; -1: missing */
    int truth;           /* index in names of a PFM with its disparity; -1: none */
    double pos_x, pos_y; /* position of the camera in the source's unit, right and down positive */
    char expected[64];   /* what it should be called, for messages */
};

struct import_plan {
    const struct sst_import_config *cfg;
    struct name_list names;   /* of cfg->source */
    struct sst_lightfield lf; /* grid, spacing_mm and range where known */
    struct plan_view *views;  /* rows * cols, made by plan_set_grid() */
    double spacing;           /* nominal spacing in the unit of the positions, above 0 */
    double truth_scale;       /* factor from the source's disparity to ours */
    double focal_sides;       /* focal length in units of the longer side of an image; 0: unknown */
};

/** The formats: set grid, views, spacing; log what contradicts. */
SST_MUST_CHECK int plan_stanford(struct import_plan *plan);
SST_MUST_CHECK int plan_hci(struct import_plan *plan);
SST_MUST_CHECK int plan_folder(struct import_plan *plan);

/** Make the grid; refuses (logged) one that is too large or is not the one the user gave. */
SST_MUST_CHECK int plan_set_grid(struct import_plan *plan, int rows, int cols);

/** Name i is the file of view (row, col); refuses (logged) a second one. */
SST_MUST_CHECK int plan_place(struct import_plan *plan, int row, int col, int i);

SST_MUST_CHECK int names_read(struct name_list *names, const char *dir);
void names_fini(struct name_list *names);

/** Index of a name, or -1. */
int names_find(const struct name_list *names, const char *name);

/** Does the name end in .png, .jpg or .jpeg (any case)? */
bool name_is_image(const char *name);

/** Read digits: value and the rest, or NULL when there is none or it is above 99999. */
const char *parse_index(const char *s, int *value);

/** Sorted list of the different values in v[0..n); v is reordered. @return how many */
int distinct(int *v, int n);

/** Middle one of v[0..n), n at least 1, the mean of two for an even n; v is reordered. */
double median(double *v, int n);

/**
 * Value of `key` in an INI text ("key = number", sections ignored).
 * @return 1 and *value, 0 when the key is absent (*value stays), -EBADMSG when it is not a finite number (logged).
 */
SST_MUST_CHECK int params_number(const char *text, const char *path, const char *key, double *value);

/* --- store: lightfield.json to and from memory, and hashes. Inside pipeline/lightfield only. --- */

#define SST_LIGHTFIELD_VERSION 2                 /* the newest; a light field without a calibration is written as 1 */
#define SST_DISP_ABS_MAX_PX    32768.0           /* no disparity is larger than an image */
#define SST_RANGE_MAX_PX       1023.0            /* what 16 bits of 1/64 px hold, less the mark for unknown */
#define SST_VIEW_FILE_MAX      ((size_t)1 << 30) /* bytes of one view's file */

/** SHA-256 of a buffer as lower-case hex. */
void sha256_hex(char out[65], const uint8_t *data, size_t size);

/** May this be the name of a view's file? No slash, no dot in front, printable, 1 to 255 bytes. */
bool view_file_name_ok(const char *name);

/** Check that the numbers of a light field make sense, for reading and before writing. @return NULL or what is wrong
 *  (storage of the thread). */
const char *lightfield_fault(const struct sst_lightfield *lf);

/** lightfield.json of a light field; of a calibration it holds how it is used, calibration_sha256 set; hashes:
 * [views][65], for views whose own is empty. NULL: no memory. Free with free(). */
char *lightfield_to_json(const struct sst_lightfield *lf, char (*hashes)[65]);

/** Read lightfield.json strictly: every field present, of its type and in its range, none unknown. Of a calibrated one
 *  `rectified` is there but for its views, calibration is not.
 *  @return 0, -ENOENT, -EBADMSG, -ENOMEM, -EIO; logged with file and field. */
SST_MUST_CHECK int lightfield_read_json(struct sst_lightfield *lf, const char *path);

/** Read the calibration of a light field that has been read by lightfield_read_json() and has one.
 *  @return 0, -ENOENT, -EBADMSG (not the one it was made with), -ENOMEM, -EIO; logged. */
SST_MUST_CHECK int calibration_load(struct sst_lightfield *lf, const char *dir);

/** Undo sst_lightfield_calibrate(), but for the offsets: width and height are those of the raw frames again. */
void calibration_drop(struct sst_lightfield *lf);

/** Turn view's raw image into the rectified one, and make valid. @return 0, -EINVAL, -ENOMEM; logged. */
SST_MUST_CHECK int calibration_rectify_view(struct sst_lightfield *lf, int view);

#endif

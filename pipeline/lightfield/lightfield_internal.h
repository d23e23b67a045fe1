/* pipeline/lightfield/lightfield_internal.h - private declarations of this folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_LIGHTFIELD_LIGHTFIELD_INTERNAL_H
#define SST_PIPELINE_LIGHTFIELD_LIGHTFIELD_INTERNAL_H

#include "pipeline/camera/calib.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/lightfield/import.h"

/* --- exports --- */

/** A running export. */
struct export_job {
    struct sst_lightfield lf;
    const struct sst_export_config *cfg;
    const char *out; /* temporary folder */
};

/**
 * The cameras that took the views' files: the light field's calibration, or pinholes in the rectified views' plane:
 * one for all views that are parallel, one each where they converge, which moves principal points.
 * @return 0, -EBADMSG (focal length, spacing or infinity is unknown, or a view's camera), -ENOMEM; logged
 */
SST_MUST_CHECK int export_cameras(struct sst_calib *out, const struct sst_lightfield *lf, const char *dir);

/* --- imports: facts about the source before files are copied ---
 *
 * A format (import_<format>.c) reads names and parameters only and fills the plan; import.c does the common
 * work: decoding, checking, hashing, copying, writing. */

#define SST_NAME_MAX         256
#define HCI_FOCUS_INFINITE_M 1e9 /* focus_distance_m of parallel views: readers need a number */

/** Regular files of a folder in the order of their names, hidden ones left out. */
struct name_list {
    char (*name)[SST_NAME_MAX];
    bool *used; /* set by the format that uses the file */
    int count;
};

/** File of one view and its properties; indexed by view of the grid. */
struct import_view {
    int name;            /* index in names; -1: missing */
    int truth;           /* index in names of a PFM with its disparity; -1: none */
    double pos_x, pos_y; /* position of the camera in the source's unit, right and down positive */
    char expected[64];   /* expected file name, for messages */
};

struct import_plan {
    const struct sst_import_config *cfg;
    struct name_list names;    /* of cfg->source */
    struct sst_lightfield lf;  /* grid, spacing_mm and range where known */
    struct import_view *views; /* [rows * cols], allocated by import_set_grid() */
    double spacing;            /* nominal spacing in the unit of the positions, above 0 */
    double truth_scale;        /* factor from the source's disparity to ours */
    bool raw;                  /* views are raw files of still cameras, to be developed */
    double focal_sides;        /* focal length in units of the longer side of an image; 0: unknown */
    double focus_mm;           /* distance at which the views converge, with focal length and spacing; 0: unknown */
    double moved[2]; /* from the part's reference view to the whole grid's, in the source's unit */
    double centre[2];          /* where a converging camera has its principal point in the middle; NAN: the reference */
};

/** The formats: set grid, views and spacing; log contradictions. */
SST_MUST_CHECK int import_stanford(struct import_plan *plan);
SST_MUST_CHECK int import_hci(struct import_plan *plan);
SST_MUST_CHECK int import_folder(struct import_plan *plan);

/** Set the grid; rejects (logged) one that is too large or differs from the user's. */
SST_MUST_CHECK int import_set_grid(struct import_plan *plan, int rows, int cols);

/** Assign name i to view (row, col); rejects (logged) a second one. */
SST_MUST_CHECK int import_place(struct import_plan *plan, int row, int col, int i);

/** Reduce a planned grid to cfg->part. @return 0, -EINVAL (outside of the grid), -EBADMSG (without a view); logged */
SST_MUST_CHECK int import_take_part(struct import_plan *plan);

SST_MUST_CHECK int names_read(struct name_list *names, const char *dir);
void names_fini(struct name_list *names);

/** Index of a name, or -1. */
int names_find(const struct name_list *names, const char *name);


/** Parse digits into *value. @return the rest of s, or NULL (no digit, or above 99999) */
const char *parse_index(const char *s, int *value);

/** Reduce v[0..n) to its distinct values, sorted. @return their number */
int distinct(int *v, int n);

/**
 * Value of `key` in an INI text ("key = number", sections ignored).
 * @return 1 and *value, 0 when the key is absent (*value stays), -EBADMSG when it is not a finite number (logged).
 */
SST_MUST_CHECK int params_number(const char *text, const char *path, const char *key, double *value);

/** The principal point that our own exports add: off_centre_x_px, off_centre_y_px. @return as params_number() */
SST_MUST_CHECK int params_off_centre(struct sst_lightfield *lf, const char *text, const char *path);

/* --- correction --- */

struct sst_correction;

/** A view's picture made from its loaded one. */
struct remade {
    const char *what; /* to do so, for messages */
    bool keep;        /* the loaded one, in the view's `original`; a raw frame that is there stays */
    struct sst_image image;
    struct sst_map_u8 valid;
};

/** Black, with nothing valid, of the light field's size. @return 0, -ENOMEM */
SST_MUST_CHECK int remade_init(struct remade *made, const struct sst_lightfield *lf);

/** Put it in the place of the loaded one. @param err  of making it: logged, and it is freed @return err */
SST_MUST_CHECK int remade_take(struct sst_lightfield *lf, int view, struct remade *made, int err);

/** Resample a loaded picture that is not a raw frame. @param keep  its source, in the view's `original`
 *  @return 0, -ENOMEM, -EINVAL; logged */
SST_MUST_CHECK int correction_apply(struct sst_lightfield *lf, int view, const struct sst_correction *c, bool keep);

/** Make lf->correction part of the calibration's cameras: the rectification of raw frames corrects them, too. */
void correction_calibrate(struct sst_lightfield *lf);

/* --- store: lightfield.json and hashes --- */

#define SST_LIGHTFIELD_VERSION 2                 /* the newest; a light field without a calibration is written as 1 */
#define SST_DISP_ABS_MAX_PX    32768.0           /* no disparity is larger than an image */
#define SST_RANGE_MAX_PX       1023.0            /* of 16 bits of 1/64 px, without the value for unknown */
#define SST_VIEW_FILE_MAX      ((size_t)1 << 30) /* bytes of one view's file */

/** Create the folder dir/name; an existing one is fine. */
SST_MUST_CHECK int make_folder(const char *dir, const char *name);

/** Path of a view's file. */
SST_MUST_CHECK int view_path(char out[SST_PATH_MAX], const struct sst_lightfield *lf, int view, const char *dir);

/** File of a view in memory. */
struct view_file {
    char path[SST_PATH_MAX]; /* for messages */
    uint8_t *data;           /* free with free() */
    size_t size;
};

/** Read a view's file as it is. @param out  out; without data on failure */
SST_MUST_CHECK int view_file_read(struct view_file *out, const struct sst_lightfield *lf, int view, const char *dir);

/** Does a view's file have the light field's size? @return 0, -EBADMSG (logged) */
SST_MUST_CHECK int view_check_size(const struct sst_lightfield *lf, const char *path, int width, int height);

/** Read a view's file and check its hash. @param out  out; without data on failure */
SST_MUST_CHECK int read_view(struct view_file *out, const struct sst_lightfield *lf, int view, const char *dir);

/** SHA-256 of a file as lower-case hex. */
SST_MUST_CHECK int file_sha256(char out[65], const char *path);

/** True for a valid name of a view's file: no slash, no leading dot, printable, 1 to 255 bytes. */
bool view_file_name_ok(const char *name);

/** Validate a light field after reading and before writing. @return NULL, or the fault (thread-local storage) */
const char *lightfield_fault(const struct sst_lightfield *lf);

/** Text of lightfield.json; of a calibration it holds how it is used and the hash of its file.
 *  @param hashes  [views][65], for views without one @return NULL: no memory. Free with free(). */
char *lightfield_to_json(const struct sst_lightfield *lf, char (*hashes)[65], const char *calibration_sha256);

/** Read lightfield.json strictly: every field present, of its type and in its range, none unknown. For a calibrated
 * one, `rectified` is set except for its views, and `calibration` is NULL.
 *  @return 0, -ENOENT, -EBADMSG, -ENOMEM, -EIO; logged with file and field. */
SST_MUST_CHECK int lightfield_read_json(struct sst_lightfield *lf, const char *path);

/** Load the calibration that lightfield_read_json() found.
 *  @return 0, -ENOENT, -EBADMSG (differs from the one it was made with), -ENOMEM, -EIO; logged. */
SST_MUST_CHECK int calibration_load(struct sst_lightfield *lf, const char *dir);

/** Set where infinity and the principal point are from lf->rectified. */
void rectified_geometry(struct sst_lightfield *lf);

/** Undo sst_lightfield_calibrate() except for the offsets; restores the raw frames' width and height. */
void calibration_drop(struct sst_lightfield *lf);


#endif

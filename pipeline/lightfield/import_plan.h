/* pipeline/lightfield/import_plan.h - what an import has found out before it copies. Inside pipeline/lightfield only.
 *
 * A format (import_<format>.c) looks at names and parameters only and fills the plan; import.c does what all formats
 * share: decoding, checking, hashing, copying, writing. */
#ifndef SST_PIPELINE_LIGHTFIELD_IMPORT_PLAN_H
#define SST_PIPELINE_LIGHTFIELD_IMPORT_PLAN_H

#include "pipeline/lightfield/import.h"

#define SST_NAME_MAX 256

/** Regular files of a folder in the order of their names, hidden ones left out. */
struct sst_names {
    char (*name)[SST_NAME_MAX];
    bool *used; /* set by whoever makes something of the file */
    int count;
};

/** Where the file of one view was found and what is known about it; by view of the grid. */
struct sst_plan_view {
    int name;                  /* index in names; -1: missing */
    int truth;                 /* index in names of a PFM with its disparity; -1: none */
    double pos_x, pos_y;       /* position of the camera in the source's unit, right and down positive */
    char expected[64];         /* what it should be called, for messages */
};

struct sst_import_plan {
    const struct sst_import_config *cfg;
    struct sst_names names;      /* of cfg->source */
    struct sst_lightfield lf;    /* grid, spacing_mm and range where known */
    struct sst_plan_view *views; /* rows * cols, made by sst_plan_set_grid() */
    double spacing;              /* nominal spacing in the unit of the positions, above 0 */
    double truth_scale;          /* factor from the source's disparity to ours */
    double focal_sides;          /* focal length in units of the longer side of an image; 0: unknown */
};

/** The formats: set grid, views, spacing; log what contradicts. */
SST_MUST_CHECK int sst_plan_stanford(struct sst_import_plan *plan);
SST_MUST_CHECK int sst_plan_hci(struct sst_import_plan *plan);
SST_MUST_CHECK int sst_plan_folder(struct sst_import_plan *plan);

/** Make the grid; refuses (logged) one that is too large or is not the one the user gave. */
SST_MUST_CHECK int sst_plan_set_grid(struct sst_import_plan *plan, int rows, int cols);

/** Name i is the file of view (row, col); refuses (logged) a second one. */
SST_MUST_CHECK int sst_plan_place(struct sst_import_plan *plan, int row, int col, int i);

SST_MUST_CHECK int sst_names_read(struct sst_names *names, const char *dir);
void sst_names_fini(struct sst_names *names);

/** Index of a name, or -1. */
int sst_names_find(const struct sst_names *names, const char *name);

/** Does the name end in .png, .jpg or .jpeg (any case)? */
bool sst_name_is_image(const char *name);

/** Read digits: value and the rest, or NULL when there is none or it is above 99999. */
const char *sst_parse_index(const char *s, int *value);

/** Sorted list of the different values in v[0..n); v is reordered. @return how many */
int sst_distinct(int *v, int n);

/** Middle one of v[0..n), n at least 1, the mean of two for an even n; v is reordered. */
double sst_median(double *v, int n);

/**
 * Value of `key` in an INI text ("key = number", sections ignored).
 * @return 1 and *value, 0 when the key is absent (*value stays), -EBADMSG when it is not a finite number (logged).
 */
SST_MUST_CHECK int sst_params_number(const char *text, const char *path, const char *key, double *value);

#endif

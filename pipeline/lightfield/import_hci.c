/* The format of the HCI 4D light field benchmark: input_CamNNN.png, index = row * columns + column of a grid that is
 * 9x9 unless parameters.cfg says otherwise, row 0 at the top, column 0 at the left; parameters.cfg (INI), with
 * focus_distance_m where the views converge, as seen from the middle of the grid (0, as our own export writes it:
 * unknown); true
 * disparity in gt_disp_lowres.pfm (view rows/2, columns/2) or gt_disp_lowres_CamNNN.pfm (every view).
 *
 * HCI's disparity is positive in front of the focus plane, in pixels per camera step, and a point at x in a view is at
 * x - d in the next view to the right: the same convention as ours. A sub-set of the views (a window, or every second)
 * is ranked; its disparity is converted where the step is not 1. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define PREFIX "input_Cam"

struct grid {
    int rows, cols;   /* of the whole set */
    int n_row, n_col; /* of present views */
    int row[SST_MAX_VIEWS], col[SST_MAX_VIEWS];
    char *params; /* text of parameters.cfg, or NULL */
    char params_path[SST_PATH_MAX];
};

/* NNN of PREFIX NNN .ext, or -1. */
static int index_of(const char *name)
{
    const char *end;
    int index;

    if (strncmp(name, PREFIX, strlen(PREFIX)) || !sst_image_is_picture(name))
        return -1;
    end = parse_index(name + strlen(PREFIX), &index);
    return end && *end == '.' ? index : -1;
}

static int number(const struct grid *g, const char *key, double *value)
{
    return g->params ? params_number(g->params, g->params_path, key, value) : 0;
}

static int read_params(struct import_plan *plan, struct grid *g)
{
    const int i = names_find(&plan->names, "parameters.cfg");
    double rows = 9, cols = 9, focal_mm = 0, sensor_mm = 0, focus_m = 0;
    uint8_t *text;
    size_t size;
    int err;

    if (i >= 0) {
        plan->names.used[i] = true;
        err = sst_path_join(g->params_path, plan->cfg->source, "parameters.cfg");
        err = err ? err : sst_file_read_text(g->params_path, 1 << 20, &text, &size);
        if (err)
            return err;
        g->params = (char *)text;
    }
    if ((err = number(g, "num_cams_y", &rows)) < 0 || (err = number(g, "num_cams_x", &cols)) < 0 ||
        (err = number(g, "focal_length_mm", &focal_mm)) < 0 || (err = number(g, "sensor_size_mm", &sensor_mm)) < 0 ||
        (err = number(g, "baseline_mm", &plan->lf.spacing_mm)) < 0 ||
        (err = number(g, "focus_distance_m", &focus_m)) < 0 ||
        (err = number(g, "disp_min", &plan->lf.range_min_px)) < 0 ||
        (err = number(g, "disp_max", &plan->lf.range_max_px)) < 0)
        return err;
    err = g->params ? params_off_centre(&plan->lf, g->params, g->params_path) : 0;
    if (err < 0)
        return err;
    if (!err) {
        plan->centre[0] = (cols - 1) / 2;
        plan->centre[1] = (rows - 1) / 2;
    }
    if (focus_m < 0) {
        sst_log_error("%s: focus_distance_m is %g, behind the cameras; correct it", g->params_path, focus_m);
        return -EBADMSG;
    }
    if (!(rows >= 1 && rows <= SST_MAX_VIEWS && cols >= 1 && cols <= SST_MAX_VIEWS)) {
        sst_log_error("%s: num_cams_y %g and num_cams_x %g are outside 1..%d", g->params_path, rows, cols,
                      SST_MAX_VIEWS);
        return -EBADMSG;
    }
    g->rows = (int)rows;
    g->cols = (int)cols;
    if (focal_mm > 0 && sensor_mm > 0)
        plan->focal_sides = focal_mm / sensor_mm;
    plan->focus_mm = focus_m >= HCI_FOCUS_INFINITE_M ? INFINITY : focus_m * 1000;
    return 0;
}

/* Rows and columns that occur. */
static int find_lines(struct import_plan *plan, struct grid *g)
{
    bool row_here[SST_MAX_VIEWS] = { false }, col_here[SST_MAX_VIEWS] = { false };
    int n = 0;

    for (int i = 0; i < plan->names.count; i++) {
        const int index = index_of(plan->names.name[i]);

        if (index < 0)
            continue;
        if (index >= g->rows * g->cols) {
            sst_log_error("%s/%s does not fit a grid of %dx%d; set num_cams_x and num_cams_y in parameters.cfg",
                          plan->cfg->source, plan->names.name[i], g->rows, g->cols);
            return -EBADMSG;
        }
        row_here[index / g->cols] = col_here[index % g->cols] = true;
        n++;
    }
    if (!n) {
        sst_log_error("%s has no image named like " PREFIX "040.png; is it another format?", plan->cfg->source);
        return -EBADMSG;
    }
    for (int l = 0; l < SST_MAX_VIEWS; l++) {
        if (row_here[l])
            g->row[g->n_row++] = l;
        if (col_here[l])
            g->col[g->n_col++] = l;
    }
    return 0;
}

/* Steps between neighbours of the sub-set, by the columns (by the rows where there is one column only). */
static double median_step(const struct grid *g)
{
    const int n = g->n_col > 1 ? g->n_col : g->n_row, *line = g->n_col > 1 ? g->col : g->row;
    double d[SST_MAX_VIEWS];

    for (int l = 0; l + 1 < n; l++)
        d[l] = line[l + 1] - line[l];
    return n > 1 ? sst_stats_median(d, n - 1) : 1.0;
}

static int truth_of(const struct import_plan *plan, const struct grid *g, int index)
{
    char name[64];
    int i;

    snprintf(name, sizeof(name), "gt_disp_lowres_Cam%03d.pfm", index);
    i = names_find(&plan->names, name);
    if (i < 0 && index == g->rows / 2 * g->cols + g->cols / 2)
        i = names_find(&plan->names, "gt_disp_lowres.pfm");
    return i;
}

/* Cameras off their grid position, as our own export records them. */
static int read_offset(const struct grid *g, int index, struct import_view *v)
{
    char key[32];
    int err;

    snprintf(key, sizeof(key), "offset_x_%03d", index);
    err = number(g, key, &v->pos_x);
    snprintf(key, sizeof(key), "offset_y_%03d", index);
    if (err >= 0)
        err = number(g, key, &v->pos_y);
    return err < 0 ? err : 0;
}

static int place_all(struct import_plan *plan, const struct grid *g)
{
    int err = import_set_grid(plan, g->n_row, g->n_col);

    for (int k = 0; !err && k < g->n_row * g->n_col; k++) {
        struct import_view *v = &plan->views[k];
        const int row = g->row[k / g->n_col], col = g->col[k % g->n_col], index = row * g->cols + col;

        snprintf(v->expected, sizeof(v->expected), PREFIX "%03d.png", index);
        v->pos_x = col;
        v->pos_y = row;
        v->truth = truth_of(plan, g, index);
        if (v->truth >= 0)
            plan->names.used[v->truth] = true;
        err = read_offset(g, index, v);
    }
    for (int i = 0; !err && i < plan->names.count; i++) {
        const int index = index_of(plan->names.name[i]);
        int row = 0, col = 0;

        if (index < 0)
            continue;
        while (g->row[row] != index / g->cols)
            row++;
        while (g->col[col] != index % g->cols)
            col++;
        err = import_place(plan, row, col, i);
    }
    return err;
}

int import_hci(struct import_plan *plan)
{
    struct grid g = { 0 };
    struct sst_lightfield params;
    int err = read_params(plan, &g);

    params = plan->lf; /* import_set_grid() resets it */
    err = err ? err : find_lines(plan, &g);
    err = err ? err : place_all(plan, &g);
    if (!err) {
        plan->spacing = plan->truth_scale = median_step(&g);
        plan->lf.range_min_px = params.range_min_px * plan->spacing;
        plan->lf.range_max_px = params.range_max_px * plan->spacing;
        plan->lf.spacing_mm = params.spacing_mm * plan->spacing;
        memcpy(plan->lf.off_centre_px, params.off_centre_px, sizeof(params.off_centre_px));
    }
    free(g.params);
    return err;
}

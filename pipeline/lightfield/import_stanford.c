/* The format of the Stanford archive: each image name holds its camera's position.
 *
 *     out_09_12_-822.674438_-3293.216797_.png               prefix _ row _ column _ y _ x [_ ...] . extension
 *     Original Camera_10_15_92.307692_-61.538462_30_36.jpg
 *
 * Positions count. In the data of the gantry (chess) and of a renderer with the same names (shop), x grows to
 * the right and y grows DOWN, as seen from behind the cameras: matching neighbours there with
 * x_k = x - d * (position - reference) / spacing gives the near parts the larger disparity, on both axes. The row and
 * column numbers only identify which images share a line of the grid; they run either way (rows go upwards in both
 * sets, columns go to the left in shop) and may be a sub-set (0, 3, 6 ...), so lines are ranked by their median
 * position. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/stats.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define POSITION_MAX 1e9 /* in the unit of the names */
#define MAX_TOKENS   32

struct entry {
    int name, row, col; /* row, col as in the name */
    double x, y;
};

/* The rows or columns: numbers as in the names, from top to bottom or left to right. */
struct lines {
    int count;
    int number[SST_MAX_VIEWS];
    double position[SST_MAX_VIEWS]; /* median */
};

static bool parse_position(const char *s, double *v)
{
    char *end;

    if (!isdigit((unsigned char)*s) && *s != '-' && *s != '+' && *s != '.')
        return false;
    *v = strtod(s, &end);
    return end != s && !*end && fabs(*v) <= POSITION_MAX;
}

static bool parse_at(char *const *token, struct entry *e, bool with_point)
{
    const char *row_end = parse_index(token[0], &e->row), *col_end = parse_index(token[1], &e->col);

    return row_end && !*row_end && col_end && !*col_end && parse_position(token[2], &e->y) &&
           parse_position(token[3], &e->x) && (!with_point || (strchr(token[2], '.') && strchr(token[3], '.')));
}

/* Two whole numbers and two positions in a row of tokens; positions with a decimal point are preferred, since the
 * prefix may contain numbers as well. */
static bool parse_name(const char *name, struct entry *e)
{
    char text[SST_NAME_MAX], *token[MAX_TOKENS];
    int n = 0;

    snprintf(text, sizeof(text), "%.*s", (int)(strrchr(name, '.') - name), name);
    for (char *p = text; p && n < MAX_TOKENS; n++) {
        token[n] = p;
        p = strchr(p, '_');
        if (p)
            *p++ = 0;
    }
    for (int with_point = 1; with_point >= 0; with_point--) {
        for (int i = 0; i + 4 <= n; i++) {
            if (parse_at(token + i, e, with_point))
                return true;
        }
    }
    return false;
}

/* Median position of each line, then the lines in the order of position. Two lines at one place contradict the grid. */
static int make_lines(struct lines *lines, const struct entry *e, int n, bool rows, const char *source)
{
    double *v = malloc((size_t)n * sizeof(*v));
    int *numbers = malloc((size_t)n * sizeof(*numbers)), err = -ENOMEM;

    if (!v || !numbers)
        goto out;
    for (int i = 0; i < n; i++)
        numbers[i] = rows ? e[i].row : e[i].col;
    lines->count = distinct(numbers, n);
    err = -EBADMSG;
    if (lines->count > SST_MAX_VIEWS) {
        sst_log_error("%s has images of %d %s; at most %d views are accepted", source, lines->count,
                      rows ? "rows" : "columns", SST_MAX_VIEWS);
        goto out;
    }
    for (int l = 0; l < lines->count; l++) {
        int m = 0, at = l;
        double position;

        for (int i = 0; i < n; i++) {
            if ((rows ? e[i].row : e[i].col) == numbers[l])
                v[m++] = rows ? e[i].y : e[i].x;
        }
        position = sst_stats_median(v, m);
        for (; at > 0 && lines->position[at - 1] > position; at--) {
            lines->position[at] = lines->position[at - 1];
            lines->number[at] = lines->number[at - 1];
        }
        lines->position[at] = position;
        lines->number[at] = numbers[l];
    }
    for (int l = 1; l < lines->count; l++) {
        if (!(lines->position[l] > lines->position[l - 1])) {
            sst_log_error("%s: %s %d and %d of the file names have the same position %g; correct the names", source,
                          rows ? "rows" : "columns", lines->number[l - 1], lines->number[l], lines->position[l]);
            goto out;
        }
    }
    err = 0;

out:
    free(v);
    free(numbers);
    return err;
}

static int line_of(const struct lines *lines, int number)
{
    int l = 0;

    while (lines->number[l] != number)
        l++;
    return l;
}

/* Median distance of neighbours along the columns' axis, or the rows' where there is one column only: the unit of all
 * offsets on both axes, so that a ray has one disparity. */
static double nominal_spacing(const struct import_plan *plan)
{
    const int rows = plan->lf.rows, cols = plan->lf.cols, step = cols > 1 ? 1 : cols;
    double d[SST_MAX_VIEWS];
    int n = 0;

    for (int k = 0; k + step < rows * cols; k++) {
        const struct import_view *a = &plan->views[k], *b = &plan->views[k + step];

        if (a->name >= 0 && b->name >= 0 && (cols == 1 || k % cols + 1 < cols))
            d[n++] = cols > 1 ? b->pos_x - a->pos_x : b->pos_y - a->pos_y;
    }
    return n ? sst_stats_median(d, n) : 1.0;
}

static int place_all(struct import_plan *plan, const struct entry *e, int n)
{
    struct lines rows = { 0 }, cols = { 0 };
    int err = make_lines(&rows, e, n, true, plan->cfg->source);

    err = err ? err : make_lines(&cols, e, n, false, plan->cfg->source);
    err = err ? err : import_set_grid(plan, rows.count, cols.count);
    if (err)
        return err;
    for (int k = 0; k < rows.count * cols.count; k++)
        snprintf(plan->views[k].expected, sizeof(plan->views[k].expected), "*_%02d_%02d_*", rows.number[k / cols.count],
                 cols.number[k % cols.count]);
    for (int i = 0; !err && i < n; i++) {
        const int row = line_of(&rows, e[i].row), col = line_of(&cols, e[i].col);

        err = import_place(plan, row, col, e[i].name);
        plan->views[row * cols.count + col].pos_x = e[i].x;
        plan->views[row * cols.count + col].pos_y = e[i].y;
    }
    return err;
}

/* Read the file that our own export adds for values that names cannot hold: the nominal spacing, which is not exactly
 * the median of measured ones, whether positions are in millimetres, the range, and where infinity is. */
static int read_extra(struct import_plan *plan)
{
    const int i = names_find(&plan->names, "positions.cfg");
    char path[SST_PATH_MAX];
    struct sst_lightfield *lf = &plan->lf;
    const char *t;
    uint8_t *text;
    size_t size;
    int err;

    if (i < 0)
        return 0;
    plan->names.used[i] = true;
    err = sst_path_join(path, plan->cfg->source, "positions.cfg");
    err = err ? err : sst_file_read_text(path, 1 << 20, &text, &size);
    if (err)
        return err;
    t = (const char *)text;
    if ((err = params_number(t, path, "spacing", &plan->spacing)) >= 0 &&
        (err = params_number(t, path, "spacing_mm", &lf->spacing_mm)) >= 0 &&
        (err = params_number(t, path, "focal_px", &lf->focal_px)) >= 0 &&
        (err = params_number(t, path, "disp_min", &lf->range_min_px)) >= 0 &&
        (err = params_number(t, path, "disp_max", &lf->range_max_px)) >= 0 &&
        (err = params_off_centre(lf, t, path)) >= 0) {
        err = params_number(t, path, "infinity_px", &lf->infinity_px);
        lf->infinity_known = err > 0;
    }
    free(text);
    return err < 0 ? err : 0;
}

int import_stanford(struct import_plan *plan)
{
    const struct name_list *names = &plan->names;
    struct entry *e = calloc((size_t)names->count + 1, sizeof(*e));
    int n = 0, err;

    if (!e)
        return -ENOMEM;
    for (int i = 0; i < names->count; i++) {
        if (sst_image_is_picture(names->name[i]) && parse_name(names->name[i], &e[n]))
            e[n++].name = i;
    }
    if (!n) {
        sst_log_error("%s has no image named like out_09_12_-822.67_-3293.22_.png (row, column, y, x); is it another "
                      "format?",
                      plan->cfg->source);
        err = -EBADMSG;
    } else {
        err = place_all(plan, e, n);
    }
    free(e);
    if (err)
        return err;
    plan->spacing = nominal_spacing(plan);
    plan->lf.spacing_mm = plan->spacing; /* positions are in millimetres */
    return read_extra(plan);
}

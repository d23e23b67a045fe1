/* Small multiples: one picture per camera, in the array's grid, for each thing worth seeing of all of them. What is
 * drawn here bears an id, and the cards show it again, large. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/calibration/report/report_internal.h"

#define VECTORS      300   /* per camera, at most */
#define VECTORS_ALL  12000 /* of the page */
#define MEAN_CORNERS 8     /* of a region whose mean is drawn */
#define MANY_COLS    8     /* more do not fit two figures side by side */
#define LONGEST      20    /* units: longer arrows, those of outliers, are cut */
#define CELLS_MOST   (SST_UNCERTAINTY_ROWS * SST_UNCERTAINTY_COLS)

static const struct {
    const char *id, *title, *intro, *unit, *empty;
    bool coarse; /* regions of residuals; else cells of the uncertainty maps */
} kinds[SST_MAPS] = {
    { "seen", "Coverage: where corners were seen",
      "All detected corners, outliers included, of all frames. Where a picture is empty its lens is extrapolated.",
      "corners per cell", "none", false },
    { "rms", "Residual per region of the picture",
      "Colour: RMS per point of the used corners. Arrows: their mean, which is near 0 where only noise is "
      "left; arrows "
      "that agree between regions or cameras are an error of the model.",
      "px", "no corners", true },
    { "lens", "Uncertainty of the lens",
      "One sigma of where a direction is seen, the rotation that all directions share taken out.", "px", "unknown",
      false },
    { "carry", "Uncertainty of carrying a pixel to this view",
      "One sigma of carrying a pixel of the reference view to this one, at the working range (at infinity where no "
      "range is known): what blurs a rendering or shifts a disparity.",
      "px", "unknown", false },
    { "light", "Light lost towards the edges",
      "Fall-off of linear light against the principal point, as the calibration corrects it.", "%", "unknown", false },
};

/* Sizes that all tiles share. */
struct tile {
    double width, height, scale; /* units; units per px of the picture */
    double magnify, mean_magnify;
};

static double fitting(double units, double px, double scale)
{
    return calib_round_down(units / (fmax(px, 1e-9) * scale));
}

static struct tile tile_make(const struct calib_page *page)
{
    const struct sst_calib *calib = &page->report->solution->calib;
    const double rms = page->report->solution->rms_px;
    struct tile t = { .width = 160, .height = 160.0 * calib->height / calib->width, .scale = 160.0 / calib->width };
    double most = 0;

    for (int k = 0; k < page->figures->views; k++) {
        for (int i = 0; i < SST_REPORT_ROWS * SST_REPORT_COLS; i++) {
            const struct calib_region *r = &page->figures->camera[k].region[i / SST_REPORT_COLS][i % SST_REPORT_COLS];

            if (r->corners >= MEAN_CORNERS)
                most = fmax(most, hypot(r->mean[0], r->mean[1]));
        }
    }
    t.magnify = fitting(14, 3 * (rms > 0 ? rms : 0.1), t.scale);
    t.mean_magnify = most > 0 ? fitting(16, most, t.scale) : 0;
    *page->shown = (struct calib_shown){
        .magnify = t.magnify,
        .rule_px = fitting(36, t.magnify, t.scale),
        .mean_magnify = t.mean_magnify,
        .mean_rule_px = most > 0 ? fitting(36, t.mean_magnify, t.scale) : 0,
    };
    return t;
}

/* A rule in the lower left corner, as long as so many px are drawn. */
static void rule(FILE *out, const struct tile *t, const char *class, double px, double magnify)
{
    const double y = t->height - 5, length = px * magnify * t->scale;

    fprintf(out, "<path class=\"%s\" d=\"M5 %.4gv4m0 -2h%.4gm0 -2v4\"/>", class, y - 2, length);
}

/* --- what is in a tile -------------------------------------------------------------------------------------------- */

/* Values of one camera's map; NAN where there is none. @return their number */
static int values_of(double *values, const struct calib_page *page, enum calib_map kind, int view)
{
    const struct sst_solution *s = page->report->solution;
    const struct sst_calib_camera *c = &s->calib.camera[view];
    const struct calib_camera_figures *f = &page->figures->camera[view];
    const int rows = kinds[kind].coarse ? SST_REPORT_ROWS : SST_UNCERTAINTY_ROWS;
    const int cols = kinds[kind].coarse ? SST_REPORT_COLS : SST_UNCERTAINTY_COLS;

    for (int i = 0; i < rows * cols; i++) {
        const int row = i / cols, col = i % cols;
        const double x = (col + 0.5) / cols * s->calib.width - 0.5 - c->cx;
        const double y = (row + 0.5) / rows * s->calib.height - 0.5 - c->cy;
        const double half2 = ((double)s->calib.width * s->calib.width + (double)s->calib.height * s->calib.height) / 4;
        const double r2 = (x * x + y * y) / half2;

        values[i] = (double)NAN;
        if (kind == SST_MAP_SEEN && f->seen[row][col])
            values[i] = f->seen[row][col];
        else if (kind == SST_MAP_RMS)
            values[i] = f->region[row][col].rms_px;
        else if (kind == SST_MAP_LENS && s->lens_sigma)
            values[i] = (double)s->lens_sigma[view][row][col];
        else if (kind == SST_MAP_CARRY && s->carry_sigma)
            values[i] = (double)s->carry_sigma[view][s->calib.range_mm > 0][row][col];
        else if (kind == SST_MAP_LIGHT && page->report->light && c->known)
            values[i] = -100 * r2 * (c->falloff[0] + r2 * (c->falloff[1] + r2 * c->falloff[2]));
    }
    return rows * cols;
}

/* One residual as a segment from its corner, or the corner as a dot. */
static void segment(FILE *out, const struct tile *t, const struct sst_corner *c, const double e[2], bool dot)
{
    const double x = (c->x + 0.5) * t->scale, y = (c->y + 0.5) * t->scale;
    const double length = hypot(e[0], e[1]) * t->magnify * t->scale, cut = length > LONGEST ? LONGEST / length : 1;

    if (dot)
        fprintf(out, "M%.1f %.1fh0", x, y);
    else
        fprintf(out, "M%.1f %.1fl%.1f %.1f", x, y, cut * e[0] * t->magnify * t->scale,
                cut * e[1] * t->magnify * t->scale);
}

/* Some of a camera's residuals, evenly over their number: used corners, or outliers. */
static void residuals(const struct calib_page *page, const struct tile *t, int view, bool outliers, bool dots, int most)
{
    const struct calib_figures *f = page->figures;
    const struct sst_detections *all = page->report->detections;
    const int64_t total = outliers ? f->camera[view].outliers : f->camera[view].used;
    int64_t at = 0;

    for (int frame = 0; frame < all->frames; frame++) {
        const int i = f->detection[(size_t)frame * (size_t)f->views + (size_t)view];
        const struct sst_solve_view *v = i >= 0 ? &page->report->solution->view[i] : NULL;

        for (int j = 0; v && v->residual && j < all->detection[i].corners; j++) {
            const double *e = v->residual[j];

            if ((v->outlier && v->outlier[j]) != outliers || !isfinite(e[0]) || !isfinite(e[1]))
                continue;
            if (total <= most || (at + 1) * most / total > at * most / total)
                segment(page->out, t, &all->detection[i].corner[j], e, dots);
            at++;
        }
    }
}

static void draw_vectors(const struct calib_page *page, const struct tile *t, int view)
{
    const int known = page->figures->known > 0 ? page->figures->known : 1;
    const int most = sst_max_int(20, sst_min_int(VECTORS, VECTORS_ALL / known));
    FILE *out = page->out;

    fprintf(out, "<g id=\"vec%d\"><rect class=\"none\" width=\"160\" height=\"%.4g\"/><path class=\"vec\" d=\"M0 0",
            view, t->height);
    residuals(page, t, view, false, false, most);
    fputs("\"/><path class=\"dot\" d=\"M0 0", out);
    residuals(page, t, view, false, true, most);
    fputs("\"/>", out);
    if (page->figures->camera[view].outliers) {
        fputs("<path class=\"out\" d=\"M0 0", out);
        residuals(page, t, view, true, false, most);
        fputs("\"/>", out);
    }
    rule(out, t, "rule", page->shown->rule_px, t->magnify);
    fputs("</g>", out);
}

static void draw_means(const struct calib_page *page, const struct tile *t, int view)
{
    for (int pass = 0; pass < 2 && t->mean_magnify > 0; pass++) {
        fprintf(page->out, "<path class=\"mean%d\" d=\"M0 0", pass);
        for (int i = 0; i < SST_REPORT_ROWS * SST_REPORT_COLS; i++) {
            const int row = i / SST_REPORT_COLS, col = i % SST_REPORT_COLS;
            const struct calib_region *r = &page->figures->camera[view].region[row][col];

            if (r->corners < MEAN_CORNERS)
                continue;
            fprintf(page->out, "M%.1f %.1fl%.1f %.1f", (col + 0.5) * t->width / SST_REPORT_COLS,
                    (row + 0.5) * t->height / SST_REPORT_ROWS, r->mean[0] * t->mean_magnify * t->scale,
                    r->mean[1] * t->mean_magnify * t->scale);
        }
        fputs("\"/>", page->out);
        rule(page->out, t, pass ? "mean1" : "mean0", page->shown->mean_rule_px, t->mean_magnify);
    }
}

/* --- the grid ----------------------------------------------------------------------------------------------------- */

static void tile_open(const struct calib_page *page, const struct tile *t, int view)
{
    fprintf(page->out, "<a class=\"tile\" href=\"#cam%d\" title=\"", view);
    html_text(page->out, page->figures->camera[view].name);
    fprintf(page->out, "\"><svg viewBox=\"0 0 160 %.4g\">", t->height);
}

static void tile_close(const struct calib_page *page, int view, const char *value, const char *unit)
{
    fputs("</svg><b>", page->out);
    html_text(page->out, page->figures->camera[view].name);
    fprintf(page->out, "</b><span>%s %s</span></a>", value, strcmp(value, "unknown") ? unit : "");
}

/* The number under a camera's tile. */
static struct calib_number caption(const struct calib_page *page, enum calib_map kind, int view)
{
    const struct calib_camera_figures *f = &page->figures->camera[view];
    const struct sst_solution *s = page->report->solution;
    int64_t corners = 0;

    switch (kind) {
    case SST_MAP_SEEN:
        for (int i = 0; i < CELLS_MOST; i++)
            corners += f->seen[i / SST_UNCERTAINTY_COLS][i % SST_UNCERTAINTY_COLS];
        return calib_count(corners);
    case SST_MAP_RMS:
        return calib_figure(f->systematic_px);
    case SST_MAP_LENS:
        return calib_figure(f->lens_px);
    case SST_MAP_CARRY:
        return calib_figure(f->carry_px[s->calib.range_mm > 0]);
    default:
        return calib_number(s->calib.camera[view].known ? 100 * (s->calib.camera[view].gain[1] - 1) : (double)NAN, 2);
    }
}

static void grid_open(const struct calib_page *page)
{
    const int cols = page->report->detections->cols;

    fprintf(page->out,
            "<div class=\"scroll\"><div class=\"tiles%s\" "
            "style=\"grid-template-columns:repeat(%d,minmax(30px,1fr));max-width:%dpx\">\n",
            cols > 10 ? " many" : "", cols, 260 * cols);
}

static bool hole(const struct calib_page *page, int view)
{
    if (page->figures->camera[view].expected)
        return false;
    fputs("<div class=\"hole\"></div>", page->out);
    return true;
}

static void vectors(const struct calib_page *page, const struct tile *t)
{
    FILE *out = page->out;

    fputs("<figure><h3>Residuals</h3>\n", out);
    grid_open(page);
    for (int k = 0; k < page->figures->views; k++) {
        const struct sst_calib_camera *c = &page->report->solution->calib.camera[k];

        if (hole(page, k))
            continue;
        tile_open(page, t, k);
        draw_vectors(page, t, k);
        tile_close(page, k, SST_FIGURE(c->known && c->rms_px > 0 ? c->rms_px : (double)NAN), "px RMS");
    }
    fprintf(
        out,
        "</div></div>\n<figcaption>Measured minus predicted corners, magnified %s times; the rule in the lower left "
        "corner is %s px long. <b class=\"usable\">Orange</b>: outliers, left out, their lines cut. Up to %d residuals "
        "of a camera "
        "are drawn, evenly taken from all frames. Below: RMS per point over all used corners of the "
        "camera.</figcaption></figure>\n",
        SST_NUM(t->magnify, 1), SST_NUM(page->shown->rule_px, 1),
        sst_max_int(20, sst_min_int(VECTORS, VECTORS_ALL / sst_max_int(page->figures->known, 1))));
}

static void map_caption(const struct calib_page *page, const struct tile *t, enum calib_map kind)
{
    static const char *const below[] = { "number of corners", "systematic part of the residuals",
                                         "RMS over the known part of the picture",
                                         "RMS over the known part of the picture", "gain of green less 1" };

    fprintf(page->out, "<figcaption>%s", kinds[kind].intro);
    if (kind == SST_MAP_RMS && t->mean_magnify > 0)
        fprintf(page->out, " Arrows are magnified %s times; the rule is %s px long.", SST_NUM(t->mean_magnify, 1),
                SST_NUM(page->shown->mean_rule_px, 1));
    fprintf(page->out, " Below: %s.</figcaption></figure>\n", below[kind]);
}

/* One kind of map for all cameras, if any of them has values. @param values  [views][CELLS_MOST] */
static void map(const struct calib_page *page, const struct tile *t, enum calib_map kind, double *values)
{
    static const char *const units[] = { "corners", "px", "px", "px", "%" };
    const int rows = kinds[kind].coarse ? SST_REPORT_ROWS : SST_UNCERTAINTY_ROWS;
    const int cols = kinds[kind].coarse ? SST_REPORT_COLS : SST_UNCERTAINTY_COLS, cells = rows * cols;
    struct calib_scale scale;
    bool any = false;

    for (int k = 0; k < page->figures->views; k++)
        values_of(values + (size_t)k * (size_t)cells, page, kind, k);
    for (size_t i = 0; i < (size_t)page->figures->views * (size_t)cells; i++)
        any = any || (isfinite(values[i]) && (kind != SST_MAP_LIGHT || values[i] != 0)); /* 0: nothing to correct */
    if (!any)
        return;
    scale = calib_scale_fit(values, (size_t)page->figures->views * (size_t)cells);
    if (kind == SST_MAP_SEEN)
        scale.hi = fmax(scale.hi, SST_LEVELS);
    page->shown->scale[kind] = scale;
    fprintf(page->out, "<figure><h3>%s</h3>\n", kinds[kind].title);
    grid_open(page);
    for (int k = 0; k < page->figures->views; k++) {
        if (hole(page, k))
            continue;
        tile_open(page, t, k);
        fprintf(page->out, "<g id=\"%s%d\"><rect class=\"none\" width=\"160\" height=\"%.4g\"/>", kinds[kind].id, k,
                t->height);
        svg_cells(page->out, values + (size_t)k * (size_t)cells, cols, rows, t->width, t->height, scale);
        if (kind == SST_MAP_RMS)
            draw_means(page, t, k);
        fputs("</g>", page->out);
        tile_close(page, k, caption(page, kind, k).text, units[kind]);
    }
    fputs("</div></div>\n", page->out);
    html_legend(page->out, scale, kinds[kind].unit, kinds[kind].empty);
    map_caption(page, t, kind);
}

int calib_page_cameras(const struct calib_page *page)
{
    const struct tile t = tile_make(page);
    double *values = malloc((size_t)page->figures->views * CELLS_MOST * sizeof(*values));

    if (!values)
        return -ENOMEM;
    html_section(page->out, "cameras", "Cameras",
                 "One picture per camera, placed as in the array seen from behind it. Choose one to see it large. "
                 "All figures share one colour map: dark is little, yellow is much.");
    fprintf(page->out, "<div%s>\n", page->report->detections->cols <= MANY_COLS ? " class=\"two\"" : "");
    vectors(page, &t);
    for (int kind = 0; kind < SST_MAPS; kind++)
        map(page, &t, (enum calib_map)kind, values);
    fputs("</div>\n</section>\n", page->out);
    free(values);
    return 0;
}

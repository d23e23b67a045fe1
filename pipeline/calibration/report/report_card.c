/* Each camera large, and as a line of a table. */
#include <math.h>

#include "pipeline/calibration/report/report_internal.h"

#define DEG (180 / M_PI)

/* Rotation against the reference camera as a vector, degrees. */
static void turned(const struct sst_calib *calib, int view, double out_deg[3])
{
    sst_rotation_to_vector(calib->camera[view].rotation, out_deg);
    for (int i = 0; i < 3; i++)
        out_deg[i] *= DEG;
}

static void card_facts(const struct calib_page *page, int view)
{
    const struct sst_calib *calib = &page->report->solution->calib;
    const struct sst_calib_camera *c = &calib->camera[view];
    const struct calib_camera_figures *f = &page->figures->camera[view];
    FILE *out = page->out;
    double deg[3];

    turned(calib, view, deg);
    fprintf(out,
            "<p><b>%s px</b> RMS per point over %s used corners in %s pictures; %s outliers; systematic part of the "
            "residuals %s px; ",
            SST_NUM0(c->rms_px, 3), SST_COUNT(c->corners), SST_COUNT(f->frames), SST_COUNT(f->outliers),
            SST_FIGURE(f->systematic_px));
    if (view == calib->reference)
        fputs("this is the reference view.</p>\n", out);
    else
        fprintf(out,
                "expected error of carrying a pixel here from the reference view: %s px at the working range, %s px at "
                "infinity.</p>\n",
                SST_NUM0(c->sigma_px, 2), SST_NUM(f->carry_px[0], 2));
    fputs(f->lacking[0] ? "<p>Its coverage lacks: " : "<p>Its coverage lacks nothing", out);
    html_text(out, f->lacking);
    fputs(".</p>\n", out);
    if (!c->known)
        return;
    fprintf(out,
            "<p class=\"soft\">focal length %s, %s px; principal point %s, %s px; position %s, %s, %s mm; rotation %s, "
            "%s, %s degrees",
            SST_NUM(c->fx, 7), SST_NUM(c->fy, 7), SST_NUM(c->cx, 6), SST_NUM(c->cy, 6), SST_NUM(c->position_mm[0], 5),
            SST_NUM(c->position_mm[1], 5), SST_NUM(c->position_mm[2], 5), SST_NUM(deg[0], 4), SST_NUM(deg[1], 4),
            SST_NUM(deg[2], 4));
    if (page->report->light)
        fprintf(out, "; gain of red, green, blue %s, %s, %s", SST_NUM(c->gain[0], 4), SST_NUM(c->gain[1], 4),
                SST_NUM(c->gain[2], 4));
    fputs("</p>\n", out);
}

static int next_camera(const struct calib_page *page, int view, int step)
{
    const int views = page->figures->views;

    for (int i = 1; i < views; i++) {
        const int k = (view + i * step % views + views) % views;

        if (page->figures->camera[k].expected)
            return k;
    }
    return view;
}

static void card_map(const struct calib_page *page, int view, const char *id, const char *title, const char *caption)
{
    const struct sst_calib *calib = &page->report->solution->calib;

    fprintf(
        page->out,
        "<figure><figcaption>%s: %s</figcaption><svg viewBox=\"0 0 160 %.4g\"><use href=\"#%s%d\"/></svg></figure>\n",
        title, caption, 160.0 * calib->height / calib->width, id, view);
}

static void card_maps(const struct calib_page *page, int view)
{
    static const struct {
        const char *id, *title, *unit;
    } maps[SST_MAPS] = { { "seen", "Coverage", "corners per cell" },
                         { "rms", "Residual per region", "px RMS" },
                         { "lens", "Uncertainty of the lens", "px" },
                         { "carry", "Uncertainty of carrying a pixel here", "px" },
                         { "light", "Light lost", "%" } };
    const struct calib_shown *shown = page->shown;
    char caption[160];

    snprintf(caption, sizeof(caption), "magnified %s times, the rule is %s px", SST_NUM(shown->magnify, 1),
             SST_NUM(shown->rule_px, 1));
    card_map(page, view, "vec", "Residuals", caption);
    for (int i = 0; i < SST_MAPS; i++) {
        const struct calib_scale *scale = &shown->scale[i];
        int used;

        if (!(scale->hi > 0))
            continue;
        used = snprintf(caption, sizeof(caption), "dark %.4g, yellow %.4g %s", scale->lo,
                        scale->lo + (scale->hi - scale->lo) * (SST_LEVELS - 1) / SST_LEVELS, maps[i].unit);
        if (i == SST_MAP_RMS && shown->mean_magnify > 0)
            snprintf(caption + used, sizeof(caption) - (size_t)used, "; means magnified %s times, the rule is %s px",
                     SST_NUM(shown->mean_magnify, 1), SST_NUM(shown->mean_rule_px, 1));
        card_map(page, view, maps[i].id, maps[i].title, caption);
    }
}

static void card(const struct calib_page *page, int view)
{
    FILE *out = page->out;

    fprintf(out,
            "<section class=\"card\" id=\"cam%d\"><nav><a href=\"#cameras\">\xE2\x9C\x95 close</a><a "
            "href=\"#cam%d\">\xE2\x86\x90 previous</a><a href=\"#cam%d\">next \xE2\x86\x92</a></nav><h2>",
            view, next_camera(page, view, -1), next_camera(page, view, 1));
    html_text(out, page->figures->camera[view].name);
    fprintf(out, " <span class=\"soft\">row %d, column %d%s</span></h2>\n", view / page->report->detections->cols,
            view % page->report->detections->cols,
            page->report->solution->calib.camera[view].known ? "" : "; not calibrated");
    card_facts(page, view);
    fputs("<div class=\"maps\">\n", out);
    card_maps(page, view);
    fputs("</div></section>\n", out);
}

void calib_page_cards(const struct calib_page *page)
{
    for (int k = 0; k < page->figures->views; k++) {
        if (page->figures->camera[k].expected)
            card(page, k);
    }
}

/* No minus before what is shown as 0. */
static double rounded(double value, double unit)
{
    return fabs(value) < unit / 2 ? 0 : value;
}

static void line(const struct calib_page *page, int view, int coefficients)
{
    const struct sst_calib *calib = &page->report->solution->calib;
    const struct sst_calib_camera *c = &calib->camera[view];
    const struct calib_camera_figures *f = &page->figures->camera[view];
    FILE *out = page->out;
    double deg[3];

    fprintf(out, "<tr><td><a href=\"#cam%d\">", view);
    html_text(out, f->name);
    fprintf(out, "</a></td><td class=\"n\">%d, %d</td>", view / calib->cols, view % calib->cols);
    if (!c->known) {
        fprintf(out, "<td colspan=\"%d\">not calibrated</td></tr>\n",
                14 + coefficients + (page->report->light != NULL));
        return;
    }
    turned(calib, view, deg);
    fprintf(out,
            "<td class=\"n\">%s</td><td class=\"n\">%s</td><td class=\"n\">%s</td><td class=\"n\">%s</td>"
            "<td class=\"n\">%s</td><td class=\"n\">%s</td>",
            SST_NUM0(c->rms_px, 3), SST_COUNT(c->corners), SST_COUNT(f->outliers), SST_NUM(f->systematic_px, 2),
            view == calib->reference ? "reference" : SST_NUM0(c->sigma_px, 2), SST_NUM(f->lens_px, 2));
    fprintf(out, "<td class=\"n\">%.2f</td><td class=\"n\">%.2f</td><td class=\"n\">%.2f</td><td class=\"n\">%.2f</td>",
            c->fx, c->fy, c->cx, c->cy);
    for (int i = 0; i < 3; i++)
        fprintf(out, "<td class=\"n\">%.3f</td>", rounded(c->position_mm[i], 1e-3));
    fprintf(out, "<td class=\"n\">%.4f, %.4f, %.4f</td>", rounded(deg[0], 1e-4), rounded(deg[1], 1e-4),
            rounded(deg[2], 1e-4));
    if (page->report->light)
        fprintf(out, "<td class=\"n\">%.3f, %.3f, %.3f</td>", c->gain[0], c->gain[1], c->gain[2]);
    for (int i = 0; i < coefficients; i++)
        fprintf(out, "<td class=\"n\">%.5f</td>", c->k[i]);
    fputs("</tr>\n", out);
}

void calib_page_table(const struct calib_page *page)
{
    static const char *const k[] = { "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6" };
    const struct sst_calib *calib = &page->report->solution->calib;
    int coefficients = 0;

    for (int view = 0; view < page->figures->views; view++) {
        if (calib->camera[view].known)
            coefficients = sst_max_int(coefficients, calib->camera[view].lens);
    }
    html_section(page->out, "table", "Table of cameras",
                 "RMS per point and corners: over those that the solution used. Sigma: expected error of carrying a "
                 "pixel from the reference view at the working range; lens: of where a direction is seen; both RMS "
                 "over the picture. Position: centre of projection, and rotation (axis times angle), in the axes "
                 "of the reference camera: x right, y down, z forward. Focal length and principal point in px.");
    fputs(
        "<div class=\"scroll\"><table class=\"tight\"><tr><th>camera</th><th class=\"n\">row, col</th><th class=\"n\">"
        "RMS px</th><th class=\"n\">corners</th><th class=\"n\">outliers</th><th class=\"n\">system. px</th>"
        "<th class=\"n\">sigma px</th><th class=\"n\">lens px</th><th class=\"n\">fx</th><th class=\"n\">fy</th>"
        "<th class=\"n\">cx</th><th class=\"n\">cy</th><th class=\"n\">x mm</th><th class=\"n\">y mm</th>"
        "<th class=\"n\">z mm</th><th class=\"n\">rotation, degrees</th>",
        page->out);
    for (int i = 0; i < coefficients; i++)
        fprintf(page->out, "<th class=\"n\">%s</th>", k[i]);
    fputs("</tr>\n", page->out);
    for (int view = 0; view < page->figures->views; view++) {
        if (page->figures->camera[view].expected)
            line(page, view, coefficients);
    }
    fputs("</table></div>\n</section>\n", page->out);
}

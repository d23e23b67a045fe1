/* Plan of the array: its centres against a regular lattice; and against what a rig's drives reported. */
#include <math.h>

#include "pipeline/calibration/report/report_internal.h"

#define WIDTH 560.0
#define EDGE  46.0

/* Where the plan's drawing has a place of the array. */
struct plan {
    double scale, x0, y0, height; /* units per mm; mm at the drawing's origin */
    double magnify, rule_mm;
    struct calib_scale colour;
    bool flat; /* nothing to colour */
};

static struct plan plan_make(const struct calib_page *page, const double (*off_mm)[2])
{
    const struct calib_figures *f = page->figures;
    double lo[2] = { INFINITY, INFINITY }, hi[2] = { -INFINITY, -INFINITY }, out = 0, off = 0, size;
    struct plan p = { 0 };

    for (int k = 0; k < f->views; k++) {
        if (!isfinite(f->centre_mm[k][0]))
            continue;
        for (int i = 0; i < 2; i++) {
            lo[i] = fmin(lo[i], f->centre_mm[k][i]);
            hi[i] = fmax(hi[i], f->centre_mm[k][i]);
        }
        out = fmax(out, fabs(f->centre_mm[k][2]));
        if (isfinite(off_mm[k][0]))
            off = fmax(off, hypot(off_mm[k][0], off_mm[k][1]));
    }
    /* Tall arrays (one column) are drawn no higher than wide. */
    size = fmax(fmax(hi[0] - lo[0], hi[1] - lo[1]), 1e-6);
    p.scale = (WIDTH - 2 * EDGE) / size;
    p.x0 = (lo[0] + hi[0]) / 2 - size / 2 - EDGE / p.scale;
    p.y0 = lo[1] - EDGE / p.scale;
    p.height = (hi[1] - lo[1]) * p.scale + 2 * EDGE;
    p.magnify = off > 1e-9 ? calib_round_down(42 / (off * p.scale)) : 0;
    p.rule_mm = p.magnify > 0 ? calib_round_down(60 / (p.magnify * p.scale)) : 0;
    size = fmax(calib_round_down(fmax(out, 1e-3)), 1e-3);
    while (size < out)
        size = calib_round_down(size * 2.5 * (1 + 1e-9));
    p.flat = out < 1e-6;
    p.colour = (struct calib_scale){ -size, size };
    return p;
}

static void draw_camera(const struct calib_page *page, const struct plan *p, int view, const double off_mm[2])
{
    const double *at = page->figures->centre_mm[view], x = (at[0] - p->x0) * p->scale, y = (at[1] - p->y0) * p->scale;
    const bool reference = view == page->report->solution->calib.reference;

    fprintf(page->out, "<circle class=\"c%d\" cx=\"%.5g\" cy=\"%.5g\" r=\"%d\"%s><title>",
            calib_level(p->colour, at[2]), x, y, page->report->detections->cols > 10 ? 5 : 9,
            reference ? " stroke=\"currentColor\" stroke-width=\"2.5\"" : "");
    html_text(page->out, page->figures->camera[view].name);
    fprintf(page->out, ": %s, %s mm from the reference; %s mm out of the plane", SST_NUM(at[0], 5), SST_NUM(at[1], 5),
            SST_FIGURE(at[2]));
    if (isfinite(off_mm[0]))
        fprintf(page->out, "; off by %s, %s mm", SST_FIGURE(off_mm[0]), SST_FIGURE(off_mm[1]));
    fputs("</title></circle>", page->out);
    if (p->magnify > 0 && isfinite(off_mm[0]))
        fprintf(page->out, "<path class=\"off\" d=\"M%.5g %.5gl%.4g %.4g\"/>", x, y, off_mm[0] * p->magnify * p->scale,
                off_mm[1] * p->magnify * p->scale);
    if (page->report->detections->cols <= 10)
        fprintf(page->out,
                "<text x=\"%.5g\" y=\"%.5g\" font-size=\"10\" text-anchor=\"middle\" class=\"soft\">%02d_%02d"
                "</text>",
                x, y + 22, view / page->report->detections->cols, view % page->report->detections->cols);
}

static void draw_plan(const struct calib_page *page, const struct plan *p, const double (*off_mm)[2])
{
    fprintf(page->out, "<svg viewBox=\"0 0 %.4g %.5g\" style=\"max-width:640px\">", WIDTH, p->height + 22);
    for (int k = 0; k < page->figures->views; k++) {
        if (isfinite(page->figures->centre_mm[k][0]))
            draw_camera(page, p, k, off_mm[k]);
    }
    if (p->magnify > 0)
        fprintf(page->out,
                "<path class=\"rule\" stroke-width=\"1.5\" d=\"M8 %.5gv6m0 -3h%.4gm0 -3v6\"/><text x=\"%.4g\" "
                "y=\"%.5g\" font-size=\"12\">%s mm off (magnified %s times)</text>",
                p->height + 5, p->rule_mm * p->magnify * p->scale, p->rule_mm * p->magnify * p->scale + 16,
                p->height + 12, SST_NUM(p->rule_mm, 1), SST_NUM(p->magnify, 1));
    fputs("</svg>\n", page->out);
    if (p->flat)
        fputs("<p class=\"legend\">All are in one plane.</p>\n", page->out);
    else
        html_legend(page->out, p->colour, "mm out of the mean plane, positive towards the scene", NULL);
}

/* Angles of the cameras against the common axes: how far they were from parallel. */
static void angles(const struct calib_page *page, double *mean_deg, double *most_deg, int *most)
{
    const struct sst_calib *calib = &page->report->solution->calib;
    const double *r = page->report->rectified->rotation;
    double sum = 0;
    int n = 0;

    *most = -1;
    *most_deg = *mean_deg = (double)NAN;
    for (int k = 0; k < page->figures->views; k++) {
        double m[9], v[3], deg;

        if (!calib->camera[k].known)
            continue;
        sst_rotation_between(r, calib->camera[k].rotation, m);
        sst_rotation_to_vector(m, v);
        deg = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) * 180 / M_PI;
        sum += deg;
        n++;
        if (*most < 0 || deg > *most_deg) {
            *most = k;
            *most_deg = deg;
        }
    }
    if (n)
        *mean_deg = sum / n;
}

static void facts(const struct calib_page *page)
{
    const struct sst_rectified *r = page->report->rectified;
    FILE *out = page->out;
    double turn[3], mean_deg, most_deg;
    int most;

    if (!r)
        return;
    sst_rotation_to_vector(r->rotation, turn);
    angles(page, &mean_deg, &most_deg, &most);
    fprintf(out, "<div class=\"scroll\"><table class=\"facts\">\n<tr><th>spacing</th><td>%s mm nominal",
            SST_NUM0(r->spacing_mm, 5));
    if (r->step_mm[0] > 0 && r->step_mm[1] > 0)
        fprintf(out, "; a column %s mm, a row %s mm, %s degrees off square", SST_NUM(r->step_mm[0], 5),
                SST_NUM(r->step_mm[1], 5), SST_NUM(r->skew_deg, 2));
    fputs("</td></tr>\n", out);
    fprintf(out, "<tr><th>off the lattice</th><td>%s mm RMS, %s mm at most</td></tr>\n", SST_FIGURE(r->lattice_rms_mm),
            SST_FIGURE(r->lattice_max_mm));
    fprintf(out, "<tr><th>out of the plane</th><td>%s mm RMS, %s mm at most</td></tr>\n", SST_FIGURE(r->out_rms_mm),
            SST_FIGURE(r->out_max_mm));
    fprintf(out,
            "<tr><th>common rotation</th><td>%s, %s, %s degrees (axis times angle) from the reference camera's "
            "axes</td></tr>\n",
            SST_NUM(turn[0] * 180 / M_PI, 3), SST_NUM(turn[1] * 180 / M_PI, 3), SST_NUM(turn[2] * 180 / M_PI, 3));
    fprintf(out, "<tr><th>cameras turned</th><td>against it by %s degrees on average", SST_NUM(mean_deg, 3));
    if (most >= 0) {
        fprintf(out, ", at most %s (", SST_NUM(most_deg, 3));
        html_text(out, page->figures->camera[most].name);
        fputs(")", out);
    }
    fprintf(out,
            "; rectifying removes that</td></tr>\n<tr><th>common focal length</th><td>%s px; views off the plane are "
            "exact at %s%s</td></tr>\n</table></div>\n",
            SST_NUM0(r->focal_px, 6), r->plane_mm > 0 ? SST_NUM(r->plane_mm, 4) : "infinity",
            r->plane_mm > 0 ? " mm" : "");
}

void calib_page_array(const struct calib_page *page)
{
    const struct calib_figures *f = page->figures;
    struct plan p;

    if (f->known < 2)
        return;
    p = plan_make(page, (const double(*)[2])f->lattice_mm);
    html_section(page->out, "array", "Array",
                 "Centres of the cameras in their plane, seen from behind: where they really are. A light field "
                 "keeps these places; the array need not be regular.");
    fputs("<div class=\"two\"><figure>", page->out);
    draw_plan(page, &p, (const double(*)[2])f->lattice_mm);
    fputs("<figcaption>Colour: out of the plane. Lines: from the place in the best regular lattice to the true one, "
          "magnified. Ring: the reference camera.</figcaption></figure>\n",
          page->out);
    facts(page);
    fputs("</div>\n</section>\n", page->out);
}

void calib_page_rig(const struct calib_page *page)
{
    const struct sst_solution *s = page->report->solution;
    double off_mm[SST_MAX_VIEWS][2];
    double largest = 0;
    struct plan p;
    int worst = -1;

    if (!s->drive_residual_mm || page->figures->known < 2)
        return;
    for (int k = 0; k < page->figures->views; k++) {
        const double *e = s->drive_residual_mm[k], size = sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
        const bool there = s->calib.camera[k].known && isfinite(size);

        off_mm[k][0] = there ? e[0] : (double)NAN;
        off_mm[k][1] = there ? e[1] : (double)NAN;
        if (there && size >= largest) {
            largest = size;
            worst = k;
        }
    }
    p = plan_make(page, (const double(*)[2])off_mm);
    html_section(page->out, "rig", "Rig",
                 "Solved positions against those that the drives reported, after the best rigid fit of the two.");
    fprintf(page->out,
            "<p><b>%s mm</b> RMS distance; scale %s (solved over drives: off 1 means a wrong um-per-count or a wrong "
            "board size); axes %s degrees off square.",
            SST_NUM(s->drive_rms_mm, 3), SST_NUM(s->drive_scale, 6), SST_NUM(s->drive_skew_deg, 2));
    if (worst >= 0) {
        fputs(" Farthest: ", page->out);
        html_text(page->out, page->figures->camera[worst].name);
        fprintf(page->out, ", %s mm.", SST_NUM(largest, 3));
    }
    fputs("</p>\n<figure>", page->out);
    draw_plan(page, &p, (const double(*)[2])off_mm);
    fputs("<figcaption>Lines: from where the drives said they were to where the pictures say, right and down, "
          "magnified.</figcaption></figure>\n</section>\n",
          page->out);
}

/* The page's first section: the verdict, the figures with their definitions, the bars, how the calibration was made. */
#include <math.h>

#include "pipeline/calibration/report/report_internal.h"

static void verdict(const struct calib_page *page)
{
    static const char *const kind[] = { "good", "usable", "bad" };
    static const char *const mark[] = { "\xE2\x9C\x93", "!", "\xE2\x9C\x95" };
    static const char *const means[] = {
        "Every bar that is judged is met: use it.",
        "It can be used where the points below do not matter:",
        "At least one figure is beyond what any use forgives:",
    };
    const struct calib_figures *f = page->figures;
    char reason[640];

    fprintf(page->out, "<div class=\"verdict %s\"><b class=\"word\">%s Verdict: %s</b><p>%s</p>", kind[f->verdict],
            mark[f->verdict], calib_verdict_word(f->verdict), means[f->verdict]);
    if (f->verdict != SST_CALIB_GOOD)
        fputs("<ul>", page->out);
    /* Most serious first. */
    for (int state = SST_BAR_FAILED; state >= SST_BAR_UNKNOWN; state--) {
        for (int i = 0; i < f->bars; i++) {
            if ((int)f->bar[i].state != state || !calib_bar_reason(&f->bar[i], reason))
                continue;
            fprintf(page->out, "<li><b class=\"%s\">%s</b> ", state == SST_BAR_FAILED ? "bad" : "usable",
                    calib_bar_word(f->bar[i].state));
            html_text(page->out, reason);
            fputs("</li>", page->out);
        }
    }
    if (f->verdict != SST_CALIB_GOOD)
        fputs("</ul>", page->out);
    fputs("</div>\n", page->out);
}

static void key_open(FILE *out, const char *name, const char *value, const char *unit)
{
    fprintf(out, "<div class=\"key\"><span class=\"name\">%s</span><b>", name);
    html_text(out, value);
    fprintf(out, "%s%s</b><span>", unit[0] ? " " : "", unit);
}

static void key_close(FILE *out)
{
    fputs("</span></div>\n", out);
}

static void key_errors(const struct calib_page *page)
{
    const struct sst_solution *s = page->report->solution;
    const struct calib_figures *f = page->figures;
    FILE *out = page->out;
    const double all = (double)s->corners + s->outliers;

    key_open(out, "Reprojection error", SST_NUM(s->rms_px, 3), "px");
    fprintf(out,
            "RMS per point over %s corners of %d camera%s in %d frames; both axes together: "
            "\xE2\x88\x9A(mean(dx\xC2\xB2+dy\xC2\xB2)). Corner noise of %s px per axis lets expect %s px.",
            SST_COUNT(s->corners), f->known, f->known == 1 ? "" : "s", f->used_frames, SST_NUM0(s->noise_px, 3),
            SST_NUM0(s->predicted_rms_px, 3));
    key_close(out);
    key_open(out, "Odd against even frames", isfinite(s->cross_px) ? SST_NUM(s->cross_px, 2) : "not done",
             isfinite(s->cross_px) ? "px" : "");
    fprintf(
        out,
        "RMS difference of where the two halves see the same direction, central 80 %% of the picture, worst camera. "
        "The uncertainties let expect %s px.",
        SST_NUM(s->cross_expected_px, 2));
    key_close(out);
    key_open(out, "Carried to another view",
             SST_NUM(f->worst_carry >= 0 ? s->calib.camera[f->worst_carry].sigma_px : (double)NAN, 2), "px");
    fprintf(
        out,
        "Expected error (one sigma) of carrying a pixel of the reference view to the worst other one at the working "
        "range of %s mm, RMS over the picture.",
        SST_NUM0(s->calib.range_mm, 4));
    key_close(out);
    key_open(out, "Outliers", SST_NUM(all > 0 ? 100 * s->outliers / all : (double)NAN, 2), "%");
    fprintf(out, "%s of %s corners contradict the rest and were left out.", SST_COUNT(s->outliers),
            SST_COUNT((int64_t)all));
    key_close(out);
}

static void key_worst(const struct calib_page *page)
{
    const struct sst_solution *s = page->report->solution;
    const struct calib_figures *f = page->figures;
    FILE *out = page->out;

    key_open(out, "Worst camera", f->worst_camera >= 0 ? f->camera[f->worst_camera].name : "unknown", "");
    if (f->worst_camera >= 0)
        fprintf(out, "%s px RMS per point over its %s corners.", SST_NUM(s->calib.camera[f->worst_camera].rms_px, 3),
                SST_COUNT(s->calib.camera[f->worst_camera].corners));
    key_close(out);
    key_open(out, "Worst frame", f->worst_frame >= 0 ? page->report->detections->frame_name[f->worst_frame] : "unknown",
             "");
    if (f->worst_frame >= 0)
        fprintf(out, "%s px RMS per point over its used corners in all cameras.",
                SST_NUM(s->frame[f->worst_frame].rms_px, 3));
    key_close(out);
    if (f->known < 2)
        return;
    if (s->weakest >= 0 && s->weakest < s->links) {
        const struct sst_solve_link *l = &s->link[s->weakest];

        fputs("<div class=\"key\"><span class=\"name\">Weakest link</span><b>", out);
        html_text(out, f->camera[l->a].name);
        fputs(" \xE2\x80\x93 ", out);
        html_text(out, f->camera[l->b].name);
        fprintf(out,
                "</b><span>%s corners in %s frames hold these two together: the fewest of the tree that the "
                "solution began with.",
                SST_COUNT(l->corners), SST_COUNT(l->frames));
        key_close(out);
    }
    key_open(out, "Neighbours line up to", SST_FIGURE(f->pair_p95_px), isfinite(f->pair_p95_px) ? "px" : "");
    fprintf(
        out,
        "in 95 %% of the regions of %s pair%s of neighbours: mean of how much their used corners disagree across the "
        "line between them (the rows of a rectified pair).",
        SST_COUNT(f->pairs), f->pairs == 1 ? "" : "s");
    key_close(out);
}

static void bars(const struct calib_page *page)
{
    static const char *const kind[] = { "soft", "good", "good", "usable", "bad" };
    static const char *const mark[] = { "?", "\xE2\x9C\x93\xE2\x9C\x93", "\xE2\x9C\x93", "!", "\xE2\x9C\x95" };
    FILE *out = page->out;

    fputs("<h3>Bars</h3>\n<div class=\"scroll\"><table class=\"bars\"><tr><th>figure</th><th class=\"n\">value</th><th "
          "class=\"n\">bar"
          "</th><th class=\"n\">easily</th><th></th><th>where</th></tr>\n",
          out);
    for (int i = 0; i < page->figures->bars; i++) {
        const struct calib_bar *b = &page->figures->bar[i];

        fprintf(out,
                "<tr><td>%s%s</td><td class=\"n\">%s %s</td><td class=\"n\">%g</td><td class=\"n\">%g</td>"
                "<td class=\"s %s\">%s %s</td><td>",
                b->what, b->judged ? "" : " <span class=\"soft\">(for information)</span>", calib_bar_value(b).text,
                isfinite(b->value) ? b->unit : "", b->pass, b->stretch, kind[b->state], mark[b->state],
                calib_bar_word(b->state));
        html_text(out, b->where);
        fputs("</td></tr>\n", out);
    }
    fputs("</table></div>\n", out);
}

static void fact_text(FILE *out, const char *name, const char *text)
{
    fprintf(out, "<tr><th>%s</th><td>", name);
    html_text(out, text[0] ? text : "unknown");
    fputs("</td></tr>\n", out);
}

static void pictures_fact(FILE *out, const struct sst_detections *all)
{
    static const char *const what[] = { "with the board", "without",     "with too few points",
                                        "blurred",        "with motion", "with another board" };
    const char *comma = "";

    fputs("<tr><th>pictures</th><td>", out);
    for (int i = 0; i < 6; i++) {
        if (!all->outcome[i])
            continue;
        fprintf(out, "%s%s %s", comma, SST_COUNT(all->outcome[i]), what[i]);
        comma = ", ";
    }
    if (!comma[0])
        fprintf(out, "%s with the board", SST_COUNT(all->count));
    fputs("</td></tr>\n", out);
}

static void facts(const struct calib_page *page)
{
    const struct sst_solution *s = page->report->solution;
    const struct sst_detections *all = page->report->detections;
    FILE *out = page->out;

    fputs("<h3>How it was made</h3>\n<div class=\"scroll\"><table class=\"facts\">\n", out);
    fact_text(out, "source", s->calib.source);
    fact_text(out, "board", s->calib.board);
    fprintf(out,
            "<tr><th>board's warp</th><td>%s mm across, %s mm down: height of its middle over its edges</td></tr>\n",
            SST_NUM(s->warp_mm[0], 2), SST_NUM(s->warp_mm[1], 2));
    fprintf(out, "<tr><th>lens model</th><td>%d coefficients (OpenCV's order)", s->lens);
    if (s->held_out_px[0] > 0 && s->held_out_px[1] > 0)
        fprintf(out, "; RMS per point on frames held out: %s px with 5, %s px with 8", SST_NUM(s->held_out_px[0], 4),
                SST_NUM(s->held_out_px[1], 4));
    fputs("</td></tr>\n", out);
    pictures_fact(out, all);
    fprintf(out, "<tr><th>corner noise</th><td>%s px per axis</td></tr>\n", SST_NUM0(s->noise_px, 3));
    fprintf(out, "<tr><th>working range</th><td>%s mm: median depth of the boards</td></tr>\n",
            SST_NUM0(s->calib.range_mm, 4));
    fprintf(out,
            "<tr><th>adjustment</th><td>%s unknowns from %s measurements, %s iterations, %s s; reciprocal "
            "condition number %s</td></tr>\n",
            SST_COUNT(s->states), SST_COUNT(s->measurements), SST_COUNT(s->iterations), SST_NUM0(s->seconds, 2),
            SST_NUM0(s->rcond, 2));
    fputs("</table></div>\n", out);
}

void calib_page_summary(const struct calib_page *page)
{
    fputs("<section id=\"summary\">\n", page->out);
    verdict(page);
    fputs("<div class=\"keys\">\n", page->out);
    key_errors(page);
    key_worst(page);
    fputs("</div>\n", page->out);
    bars(page);
    facts(page);
    fputs("</section>\n", page->out);
}

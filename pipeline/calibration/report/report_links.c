/* Which cameras hold together by how many corners. */
#include <math.h>
#include <stdlib.h>

#include "pipeline/calibration/report/report_internal.h"

#define CELL     100.0 /* of the drawing, per camera */
#define THIN     12    /* links listed */
#define DRAW_ALL 90    /* more links are thinned to those of neighbours and of the tree */

static double centre(int index)
{
    return (index + 0.5) * CELL;
}

static bool drawn(const struct sst_solution *s, const struct sst_solve_link *l)
{
    const int cols = s->calib.cols;
    const int down = abs(l->b / cols - l->a / cols), right = abs(l->b % cols - l->a % cols);

    return l->tree || s->links <= DRAW_ALL || (down <= 1 && right <= 1);
}

/* Links of neighbours are straight, others bowed so that they pass by the cameras between. */
static void draw_link(const struct calib_page *page, int index, int most)
{
    const struct sst_solution *s = page->report->solution;
    const struct sst_solve_link *l = &s->link[index];
    const double x0 = centre(l->a % s->calib.cols), y0 = centre(l->a / s->calib.cols);
    const double dx = centre(l->b % s->calib.cols) - x0, dy = centre(l->b / s->calib.cols) - y0;
    const double width = 1 + 11 * sqrt((double)l->corners / most), bow = hypot(dx, dy) > 1.5 * CELL ? 0.16 : 0;

    fprintf(page->out, "<path class=\"%s\" stroke-width=\"%.3g\" d=\"M%.4g %.4gq%.4g %.4g %.4g %.4g\"><title>",
            index == s->weakest ? "weak"
            : l->tree           ? "tree"
                                : "link",
            width, x0, y0, dx / 2 - bow * dy, dy / 2 + bow * dx, dx, dy);
    html_text(page->out, page->figures->camera[l->a].name);
    fputs(" \xE2\x80\x93 ", page->out);
    html_text(page->out, page->figures->camera[l->b].name);
    fprintf(page->out, ": %s corners in %s frames%s</title></path>\n", SST_COUNT(l->corners), SST_COUNT(l->frames),
            l->tree ? ", part of the tree" : "");
}

static void draw_links(const struct calib_page *page, int most)
{
    const struct sst_solution *s = page->report->solution;

    for (int pass = 0; pass < 3; pass++) { /* the weakest on top of the tree on top of the rest */
        for (int i = 0; i < s->links; i++) {
            if (drawn(s, &s->link[i]) && pass == (i == s->weakest ? 2 : s->link[i].tree ? 1 : 0))
                draw_link(page, i, most);
        }
    }
}

static void draw_nodes(const struct calib_page *page)
{
    const struct sst_calib *calib = &page->report->solution->calib;

    for (int k = 0; k < page->figures->views; k++) {
        if (!page->figures->camera[k].expected)
            continue;
        fprintf(page->out, "<circle class=\"node\" cx=\"%.4g\" cy=\"%.4g\" r=\"21\" stroke-width=\"%d\"%s><title>",
                centre(k % calib->cols), centre(k / calib->cols), k == calib->reference ? 4 : 1,
                calib->camera[k].known ? "" : " stroke-dasharray=\"4 3\"");
        html_text(page->out, page->figures->camera[k].name);
        fprintf(page->out,
                "</title></circle><text x=\"%.4g\" y=\"%.4g\" font-size=\"11\" text-anchor=\"middle\">%02d_%02d"
                "</text>\n",
                centre(k % calib->cols), centre(k / calib->cols) + 4, k / calib->cols, k % calib->cols);
    }
}

static void caption(const struct calib_page *page, int most, int shown)
{
    const struct sst_solution *s = page->report->solution;
    FILE *out = page->out;

    fprintf(out,
            "<figcaption>A link joins two cameras that see the board in the same frame; its width grows with the "
            "root of the corners that both see, up to %s. Blue: the tree that the solution began with. Grey: other "
            "links, which tie the joint solution further. Thick ring: the reference camera.",
            SST_COUNT(most));
    if (shown < s->links)
        fprintf(out, " Of %s links %s are drawn: those of the tree and of neighbours.", SST_COUNT(s->links),
                SST_COUNT(shown));
    if (s->weakest >= 0 && s->weakest < s->links) {
        const struct sst_solve_link *l = &s->link[s->weakest];

        fputs(" <b class=\"usable\">Orange</b>: the weakest link of the tree, <b>", out);
        html_text(out, page->figures->camera[l->a].name);
        fputs(" \xE2\x80\x93 ", out);
        html_text(out, page->figures->camera[l->b].name);
        fprintf(out, "</b>, %s corners in %s frames.", SST_COUNT(l->corners), SST_COUNT(l->frames));
    }
    fputs("</figcaption></figure>\n", out);
}

/* The next link of the tree by corners after `last`; ties by index. -1: no more. */
static int next_thin(const struct sst_solution *s, int last)
{
    int best = -1;

    for (int i = 0; i < s->links; i++) {
        const struct sst_solve_link *l = &s->link[i];

        if (!l->tree ||
            (last >= 0 && (l->corners < s->link[last].corners || (l->corners == s->link[last].corners && i <= last))))
            continue;
        if (best < 0 || l->corners < s->link[best].corners)
            best = i;
    }
    return best;
}

static void thin_links(const struct calib_page *page)
{
    const struct sst_solution *s = page->report->solution;
    FILE *out = page->out;
    int at = next_thin(s, -1);

    fputs("<div><h3>Thinnest links of the tree</h3>\n<div class=\"scroll\"><table class=\"tight\"><tr><th>cameras</th>"
          "<th class=\"n\">corners of both</th><th class=\"n\">frames of both</th></tr>\n",
          out);
    for (int i = 0; i < THIN && at >= 0; i++, at = next_thin(s, at)) {
        fputs("<tr><td>", out);
        html_text(out, page->figures->camera[s->link[at].a].name);
        fputs(" \xE2\x80\x93 ", out);
        html_text(out, page->figures->camera[s->link[at].b].name);
        fprintf(out, "</td><td class=\"n\">%s</td><td class=\"n\">%s</td></tr>\n", SST_COUNT(s->link[at].corners),
                SST_COUNT(s->link[at].frames));
    }
    fputs("</table></div></div>\n", out);
}

void calib_page_links(const struct calib_page *page)
{
    const struct sst_solution *s = page->report->solution;
    const double width = s->calib.cols * CELL, height = s->calib.rows * CELL;
    int most = 1, shown = 0;

    if (page->figures->known < 2)
        return;
    for (int i = 0; i < s->links; i++) {
        most = sst_max_int(most, s->link[i].corners);
        shown += drawn(s, &s->link[i]);
    }
    html_section(page->out, "links", "Links",
                 "What holds the array together. A camera with thin links is known only through the few corners "
                 "that it shares: more frames that it sees together with its neighbours help.");
    fprintf(page->out, "<div class=\"two\"><figure><svg viewBox=\"0 0 %.5g %.5g\" style=\"max-width:%.0fpx\">\n", width,
            height, fmin(1200, fmax(320, width * 1.2)));
    draw_links(page, most);
    draw_nodes(page);
    fputs("</svg>\n", page->out);
    caption(page, most, shown);
    thin_links(page);
    fputs("</div>\n</section>\n", page->out);
}

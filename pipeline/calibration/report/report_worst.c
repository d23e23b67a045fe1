/* The worst pictures with their corners drawn on them, and the list of outliers. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/calibration/report/report_internal.h"
#include "pipeline/image/codec.h"

#define SHOWN_PX 1100 /* wider cut-outs are halved */
#define QUALITY  80
#define LONGEST  0.1 /* of the drawing: longer lines are cut */

/* The part of a picture around the board, px. */
struct cut {
    int x, y, width, height;
};

static struct cut cut_around(const struct sst_detections *all, const struct sst_detection *d)
{
    double lo[2] = { all->width, all->height }, hi[2] = { 0, 0 }, margin;
    const double size[2] = { all->width, all->height };
    int from[2], to[2];

    for (int i = 0; i < d->corners; i++) {
        const double at[2] = { d->corner[i].x, d->corner[i].y };

        for (int a = 0; a < 2; a++) {
            lo[a] = fmin(lo[a], at[a]);
            hi[a] = fmax(hi[a], at[a]);
        }
    }
    margin = 0.15 * fmax(hi[0] - lo[0], hi[1] - lo[1]) + 8;
    for (int a = 0; a < 2; a++) {
        from[a] = (int)sst_clamp_double(lo[a] - margin, 0, size[a] - 1);
        to[a] = (int)sst_clamp_double(hi[a] + margin + 1, from[a] + 1, size[a]);
    }
    return (struct cut){ from[0], from[1], to[0] - from[0], to[1] - from[1] };
}

/* Cut out, and halve until it is small enough to be shown. */
static int cut_out(struct sst_image *out, const struct sst_image *in, struct cut cut)
{
    int err = sst_image_init(out, cut.width, cut.height);

    for (int c = 0; c < 3 && !err; c++) {
        for (int y = 0; y < cut.height; y++)
            memcpy(sst_image_row(out, c, y), sst_image_row(in, c, cut.y + y) + cut.x, (size_t)cut.width);
    }
    while (!err && out->width > SHOWN_PX) {
        struct sst_image half;

        err = sst_image_halve(&half, out);
        if (err)
            break;
        sst_image_fini(out);
        *out = half;
    }
    return err;
}

/* The picture as an element of the drawing; nothing where it is not to be had. @return whether it is there */
static bool picture(const struct calib_page *page, const struct sst_detection *d, struct cut cut)
{
    const struct sst_calib_report *r = page->report;
    struct sst_image whole = { 0 }, part = { 0 };
    uint8_t *jpeg = NULL;
    size_t size = 0;
    bool shown = false;

    if (!r->picture || r->picture(r->arg, d->view, d->frame, &whole))
        return false;
    if (whole.width != r->detections->width || whole.height != r->detections->height) {
        sst_log_warning("the picture of camera %s, frame %s, has %dx%d pixels, its corners are of %dx%d; the report "
                        "leaves it out",
                        page->figures->camera[d->view].name, r->detections->frame_name[d->frame], whole.width,
                        whole.height, r->detections->width, r->detections->height);
        goto out;
    }
    if (cut_out(&part, &whole, cut) || sst_image_encode_jpeg(&part, QUALITY, &jpeg, &size)) {
        sst_log_warning("no memory for a picture of the report; it is left out");
        goto out;
    }
    fprintf(page->out, "<image width=\"%d\" height=\"%d\" href=\"data:image/jpeg;base64,", cut.width, cut.height);
    encode_base64(page->out, jpeg, size);
    fputs("\"/>", page->out);
    shown = true;

out:
    free(jpeg);
    sst_image_fini(&part);
    sst_image_fini(&whole);
    return shown;
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Such that nearly all residuals are a few per cent of the drawing long. @return 1: all are 0; 0: no memory */
static double magnification(const struct sst_detection *d, const struct sst_solve_view *v, double width)
{
    double *length = malloc((size_t)sst_max_int(d->corners, 1) * sizeof(*length)), most;
    int n = 0;

    if (!length)
        return 0;
    for (int i = 0; i < d->corners; i++) {
        const double l = hypot(v->residual[i][0], v->residual[i][1]);

        if (isfinite(l))
            length[n++] = l;
    }
    qsort(length, (size_t)n, sizeof(*length), by_size);
    most = n ? length[(n - 1) * 9 / 10] : 0;
    free(length);
    return most > 0 ? fmax(1, calib_round_down(0.04 * width / most)) : 1;
}

/* Rings at measured corners and lines to predicted ones, in the colour of used ones or of outliers. */
static void corners(const struct calib_page *page, int index, struct cut cut, double magnify, bool outliers)
{
    const struct sst_detection *d = &page->report->detections->detection[index];
    const struct sst_solve_view *v = &page->report->solution->view[index];
    const double r = cut.width / 110.0;

    for (int pass = 0; pass < 2; pass++) { /* a dark rim keeps the marks apart from any picture */
        fprintf(page->out, "<path fill=\"none\" stroke=\"%s\" stroke-width=\"%.3g\" d=\"M0 0",
                pass == 0  ? "#000"
                : outliers ? "#ff8a4a"
                           : "#5fd0ff",
                r * (pass ? 0.35 : 0.8));
        for (int i = 0; i < d->corners; i++) {
            const double x = d->corner[i].x - cut.x + 0.5, y = d->corner[i].y - cut.y + 0.5, *e = v->residual[i];

            const double length = hypot(e[0], e[1]) * magnify, most = LONGEST * cut.width;
            const double by = length > most ? -magnify * most / length : -magnify;

            if ((v->outlier && v->outlier[i]) != outliers || !isfinite(e[0]) || !isfinite(e[1]))
                continue;
            fprintf(page->out, "M%.2f %.2fa%.3g %.3g 0 1 0 %.3g 0a%.3g %.3g 0 1 0 %.3g 0M%.2f %.2fl%.2f %.2f", x - r, y,
                    r, r, 2 * r, r, r, -2 * r, x, y, by * e[0], by * e[1]);
        }
        fputs("\"/>", page->out);
    }
}

static void show(const struct calib_page *page, const struct calib_far *far)
{
    const struct sst_detections *all = page->report->detections;
    const struct sst_detection *d = &all->detection[far->detection];
    const struct sst_solve_view *v = &page->report->solution->view[far->detection];
    const struct cut cut = cut_around(all, d);
    const double magnify = magnification(d, v, cut.width);
    bool shown;

    fprintf(page->out,
            "<figure><svg class=\"shot\" viewBox=\"0 0 %d %d\"><rect class=\"none\" width=\"%d\" height=\"%d\"/>",
            cut.width, cut.height, cut.width, cut.height);
    shown = picture(page, d, cut);
    corners(page, far->detection, cut, magnify, false);
    if (v->outliers)
        corners(page, far->detection, cut, magnify, true);
    fputs("</svg><figcaption><b>", page->out);
    html_text(page->out, page->figures->camera[d->view].name);
    fputs(", frame ", page->out);
    html_text(page->out, all->frame_name[d->frame]);
    fprintf(page->out,
            "</b>: half of its %d corners are off by more than %s px, %d of them are outliers; lines "
            "magnified %s times.%s"
            "</figcaption></figure>\n",
            d->corners, SST_FIGURE(far->px), v->outliers, SST_NUM(magnify, 1),
            shown ? "" : " The picture itself is not available.");
}

static void list(const struct calib_page *page)
{
    const struct calib_figures *f = page->figures;
    const struct sst_detections *all = page->report->detections;
    FILE *out = page->out;

    fprintf(out, "<h3>Outliers</h3>\n<p>%s corner%s left out. ", SST_COUNT(page->report->solution->outliers),
            page->report->solution->outliers == 1 ? " was" : "s were");
    if (!f->listed) {
        fputs("</p>\n", out);
        return;
    }
    fprintf(out,
            "%s; x and y are measured minus predicted.</p>\n<div class=\"scroll\"><table "
            "class=\"tight\"><tr><th>camera</th><th>frame</th><th class=\"n\">corner</th><th class=\"n\">off by, px"
            "</th><th class=\"n\">x</th><th class=\"n\">y</th></tr>\n",
            f->listed < f->outliers ? "The farthest" : "All of them, the farthest first");
    for (int i = 0; i < f->listed; i++) {
        const struct sst_detection *d = &all->detection[f->outlier[i].detection];
        const double *e = page->report->solution->view[f->outlier[i].detection].residual[f->outlier[i].corner];

        fprintf(out, "<tr><td><a href=\"#cam%d\">", d->view);
        html_text(out, f->camera[d->view].name);
        fputs("</a></td><td>", out);
        html_text(out, all->frame_name[d->frame]);
        fprintf(out,
                "</td><td class=\"n\">%d</td><td class=\"n\">%s</td><td class=\"n\">%s</td><td class=\"n\">%s</td>"
                "</tr>\n",
                d->corner[f->outlier[i].corner].id, SST_NUM(f->outlier[i].px, 3), SST_NUM(e[0], 3), SST_NUM(e[1], 3));
    }
    fputs("</table></div>\n", out);
}

void calib_page_worst(const struct calib_page *page)
{
    if (!page->figures->worst_count)
        return;
    html_section(page->out, "worst", "Worst pictures",
                 "The worst picture of each of the three worst frames, by the median distance between measured and "
                 "predicted corners. Rings: corners as measured; lines: towards where the solution predicts them. "
                 "Longer ones are cut. Blue ones were used, orange ones are outliers.");
    fputs("<div class=\"two three\">\n", page->out);
    for (int i = 0; i < page->figures->worst_count; i++)
        show(page, &page->figures->worst[i]);
    fputs("</div>\n", page->out);
    list(page);
    fputs("</section>\n", page->out);
}

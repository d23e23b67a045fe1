/* Pieces of the report's drawings: one colour map, its legend, cells of a map. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/calibration/report/report_internal.h"

#define STEPS 4096 /* of the search for a quantile */

double calib_round_down(double v)
{
    const double power = pow(10, floor(log10(v) + 1e-9)), lead = v / power;

    return (lead < 2 - 1e-9 ? 1 : lead < 5 - 1e-9 ? 2 : 5) * power;
}

static double largest(const double *values, size_t n)
{
    double most = 0;

    for (size_t i = 0; i < n; i++) {
        if (isfinite(values[i]) && values[i] > most)
            most = values[i];
    }
    return most;
}

/* Next width of ten levels that is pleasant to read, at or above v > 0. */
static double round_up(double v)
{
    static const double lead[] = { 1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10 };
    const double power = pow(10, floor(log10(v)));
    size_t i = 0;

    while (i < ARRAY_LEN(lead) - 1 && lead[i] * power < v * (1 - 1e-9))
        i++;
    return lead[i] * power;
}

struct calib_scale calib_scale_fit(const double *values, size_t n)
{
    const double most = largest(values, n);
    size_t count[STEPS] = { 0 }, all = 0, below = 0;
    double median = 0, high = 0;

    if (!(most > 0))
        return (struct calib_scale){ 0, 1 };
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(values[i]))
            continue;
        count[(int)sst_clamp_double(values[i] / most * STEPS, 0, STEPS - 1)]++;
        all++;
    }
    for (int i = 0; i < STEPS; i++) {
        const double before = (double)below / (double)all, share = (double)(below += count[i]) / (double)all;

        if (before < 0.5 && share >= 0.5)
            median = most * (i + 1) / STEPS;
        if (before < 0.95 && share >= 0.95)
            high = most * (i + 1) / STEPS;
    }
    return (struct calib_scale){ 0, SST_LEVELS * round_up(fmax(high, 1.7 * median) / SST_LEVELS) };
}

int calib_level(struct calib_scale scale, double value)
{
    if (!isfinite(value))
        return -1;
    return (int)sst_clamp_double(floor((value - scale.lo) / (scale.hi - scale.lo) * SST_LEVELS), 0, SST_LEVELS - 1);
}

void svg_cells(FILE *out, const double *values, int cols, int rows, double width, double height,
               struct calib_scale scale)
{
    const double w = width / cols, h = height / rows;

    fputs("<g shape-rendering=\"crispEdges\">", out); /* no seams between cells */
    for (int level = 0; level < SST_LEVELS; level++) {
        bool open = false;

        for (int i = 0; i < rows * cols; i++) {
            int run = 0;

            while (i % cols + run < cols && calib_level(scale, values[i + run]) == level)
                run++;
            if (!run)
                continue;
            if (!open)
                fprintf(out, "<path class=\"c%d\" d=\"", level);
            open = true;
            fprintf(out, "M%.6g %.6gh%.6gv%.6gh%.6gz", i % cols * w, i / cols * h, run * w, h, -run * w);
            i += run - 1;
        }
        if (open)
            fputs("\"/>", out);
    }
    fputs("</g>", out);
}

void html_legend(FILE *out, struct calib_scale scale, const char *unit, const char *empty)
{
    const double step = (scale.hi - scale.lo) / SST_LEVELS;

    fputs("<p class=\"legend\">", out);
    for (int i = 0; i < SST_LEVELS; i++)
        fprintf(out, "<span><i class=\"b%d\"></i>%.4g%s</span>", i,
                fabs(scale.lo + i * step) < 1e-9 * step ? 0 : scale.lo + i * step,
                i == SST_LEVELS - 1 ? " and more" : "");
    fprintf(out, "<span class=\"unit\">%s (lower end of each colour)</span>", unit);
    if (empty)
        fprintf(out, "<span><i class=\"none\"></i>%s</span>", empty);
    fputs("</p>\n", out);
}

void html_section(FILE *out, const char *id, const char *title, const char *intro)
{
    fprintf(out, "<section id=\"%s\">\n<h2>%s</h2>\n<p>%s</p>\n", id, title, intro);
}

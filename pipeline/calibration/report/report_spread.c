/* All residuals together: their histogram against the noise found, and whether their directions are random. */
#include <math.h>

#include "pipeline/calibration/report/report_internal.h"

#define LEFT   52.0
#define WIDTH  640.0
#define HEIGHT 240.0

static double bin_expected(const struct calib_figures *f, int bin)
{
    const double a = (bin * 10.0 / SST_REPORT_BINS - 5) / sqrt(2),
                 b = ((bin + 1) * 10.0 / SST_REPORT_BINS - 5) / sqrt(2);

    return (erf(b) - erf(a)) / 2 * (double)f->samples;
}

static void histogram_axis(FILE *out, double noise_px)
{
    fprintf(out, "<path class=\"rule\" d=\"M%.4g %.4gh%.4g\"/>", LEFT, HEIGHT, WIDTH);
    for (int i = -5; i <= 5; i++)
        fprintf(out, "<text x=\"%.4g\" y=\"%.4g\" font-size=\"12\" text-anchor=\"middle\">%s</text>",
                LEFT + (i + 5) * WIDTH / 10, HEIGHT + 17, i == 0 ? "0" : SST_NUM(i * noise_px, 2));
    fprintf(out,
            "<text x=\"%.4g\" y=\"%.4g\" font-size=\"12\" text-anchor=\"middle\" class=\"soft\">residual of one axis, "
            "px</text>",
            LEFT + WIDTH / 2, HEIGHT + 36);
}

static void histogram(const struct calib_page *page)
{
    const struct calib_figures *f = page->figures;
    const double noise = page->report->solution->noise_px, pitch = WIDTH / SST_REPORT_BINS;
    double most = 0;
    FILE *out = page->out;

    for (int i = 0; i < SST_REPORT_BINS; i++)
        most = fmax(most, fmax((double)f->bin[i], bin_expected(f, i)));
    fprintf(out, "<figure><svg viewBox=\"0 -10 %.4g %.4g\" style=\"max-width:%.0fpx\">", LEFT + WIDTH + 30, HEIGHT + 52,
            LEFT + WIDTH + 30);
    for (int i = 0; i < SST_REPORT_BINS; i++) {
        const double height = (double)f->bin[i] / most * HEIGHT;

        fprintf(out, "<rect class=\"bar\" x=\"%.5g\" y=\"%.5g\" width=\"%.4g\" height=\"%.5g\"/>",
                LEFT + i * pitch + 0.5, HEIGHT - height, pitch - 1, height);
    }
    fputs("<path class=\"curve\" d=\"", out);
    for (int i = 0; i < SST_REPORT_BINS; i++)
        fprintf(out, "%c%.5g %.5g", i ? 'L' : 'M', LEFT + (i + 0.5) * pitch,
                HEIGHT - bin_expected(f, i) / most * HEIGHT);
    fputs("\"/>", out);
    histogram_axis(out, noise);
    fprintf(
        out,
        "</svg><figcaption>Blue: %s residuals of the used corners, x and y each, times the corner's weight; %s are "
        "beyond the ends. <b class=\"usable\">Orange</b>: the normal distribution of the corner noise, %s px. Within "
        "one, two and three times the noise are %s, %s and %s %% (normal: 68.3, 95.4 and 99.7 %%). A narrower peak "
        "with wider feet means that pictures of different quality are mixed.</figcaption></figure>\n",
        SST_COUNT(f->samples), SST_COUNT(f->below + f->above), SST_NUM(noise, 3),
        SST_NUM(100.0 * (double)f->within[0] / (double)f->samples, 3),
        SST_NUM(100.0 * (double)f->within[1] / (double)f->samples, 3),
        SST_NUM(100.0 * (double)f->within[2] / (double)f->samples, 3));
}

static void directions(const struct calib_page *page)
{
    const struct calib_figures *f = page->figures;
    const double z = f->direction_z;
    double worst;
    FILE *out = page->out;

    fputs("<div><h3>Do the residuals point in random directions?</h3>\n<p>", out);
    if (!isfinite(z)) {
        fputs("Unknown: no region of a picture has enough corners to tell.</p></div>\n", out);
        return;
    }
    worst = f->camera[f->systematic_camera].systematic_px;
    fprintf(out,
            "<b>%s</b> Where only noise is left they do; where the model is wrong, those of a region agree. Of %s "
            "regions (%d \xC3\x97 %d per camera, with 8 corners and more) %s prefer a direction more than chance would "
            "let one in a thousand; all together the test gives %s (standard normal if random: within \xC2\xB1"
            "3). The systematic part is %s px over all cameras (RMS of the regions' means, less what random residuals "
            "leave), most of all %s px at camera ",
            z < 3           ? "Yes."
            : worst < 0.02  ? "Not quite, but what they have in common is too small to matter."
            : worst <= 0.05 ? "Not quite: a small part of them is systematic."
                            : "No: a part of them is systematic.",
            SST_COUNT(f->regions), SST_REPORT_COLS, SST_REPORT_ROWS, SST_COUNT(f->regions_off), SST_NUM(z, 2),
            SST_FIGURE(f->systematic_px), SST_FIGURE(worst));
    html_text(out, f->camera[f->systematic_camera].name);
    fputs(".</p></div>\n", out);
}

void calib_page_spread(const struct calib_page *page)
{
    html_section(page->out, "spread", "Residuals", "Is what is left over just noise?");
    fputs("<div class=\"two\">\n", page->out);
    if (page->figures->samples)
        histogram(page);
    else
        fputs("<p>No histogram: the corner noise is unknown.</p>\n", page->out);
    directions(page);
    fputs("</div>\n</section>\n", page->out);
}

/* Frames: RMS of each as a bar, and of each picture as a cell of a map. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "pipeline/calibration/report/report_internal.h"

#define COLUMNS 400 /* of the map at most: more frames share one */
#define LEFT    44.0
#define WIDTH   1000.0
#define HEIGHT  150.0

static double largest_rms(const struct calib_page *page)
{
    const struct sst_solve_frame *frame = page->report->solution->frame;
    const int worst = page->figures->worst_frame;

    return worst >= 0 && frame[worst].rms_px > 0 ? frame[worst].rms_px : 1;
}

static void axis(FILE *out, double most, double step)
{
    for (double v = 0; v <= most * (1 + 1e-9); v += step) {
        const double y = HEIGHT - v / most * HEIGHT;

        fprintf(out,
                "<path class=\"axis\" d=\"M%.4g %.5gH%.5g\"/><text x=\"%.4g\" y=\"%.5g\" font-size=\"11\" "
                "text-anchor=\"end\" class=\"soft\">%s</text>",
                LEFT, y, LEFT + WIDTH, LEFT - 5, y + 4, SST_NUM(v, 2));
    }
}

static void one_bar(const struct calib_page *page, int frame, double most)
{
    const struct sst_solve_frame *f = &page->report->solution->frame[frame];
    const int frames = page->report->detections->frames;
    const double pitch = WIDTH / frames, x = LEFT + frame * pitch, height = f->rms_px / most * HEIGHT;

    if (!f->known || !isfinite(f->rms_px))
        return;
    fprintf(page->out, "<rect class=\"%s\" x=\"%.5g\" y=\"%.5g\" width=\"%.4g\" height=\"%.5g\"><title>",
            frame == page->figures->worst_frame ? "hot" : "bar", x, HEIGHT - height, fmin(pitch * 0.86, 40), height);
    html_text(page->out, page->report->detections->frame_name[frame]);
    fprintf(page->out, ": %s px</title></rect>", SST_NUM(f->rms_px, 3));
}

static void bars(const struct calib_page *page)
{
    const double largest = largest_rms(page), step = calib_round_down(largest / 3);
    const double most = ceil(largest / step) * step, rms = page->report->solution->rms_px;
    const int frames = page->report->detections->frames;
    FILE *out = page->out;

    fprintf(out,
            "<figure><h3>RMS of each frame</h3>\n<div class=\"scroll\"><svg viewBox=\"0 -8 %.0f %.0f\" "
            "style=\"min-width:560px\">",
            LEFT + WIDTH + 4, HEIGHT + 34);
    axis(out, most, step);
    for (int i = 0; i < frames; i++)
        one_bar(page, i, most);
    if (isfinite(rms) && rms > 0 && rms < most)
        fprintf(out, "<path class=\"rule\" stroke-dasharray=\"5 4\" d=\"M%.4g %.5gH%.5g\"/>", LEFT,
                HEIGHT - rms / most * HEIGHT, LEFT + WIDTH);
    fprintf(out,
            "<text x=\"%.4g\" y=\"%.4g\" font-size=\"11\" class=\"soft\">first frame</text><text x=\"%.5g\" y=\"%.4g\" "
            "font-size=\"11\" text-anchor=\"end\" class=\"soft\">last of %d</text></svg></div>\n",
            LEFT, HEIGHT + 16, LEFT + WIDTH, HEIGHT + 16, frames);
    fputs("<figcaption>RMS per point in px over the used corners of all cameras; dashed: over all frames; "
          "<b class=\"usable\">orange</b>: the worst",
          out);
    if (page->figures->worst_frame >= 0) {
        fputs(", ", out);
        html_text(out, page->report->detections->frame_name[page->figures->worst_frame]);
    }
    fputs(". A frame well above the rest was taken in motion, or its board bent.</figcaption></figure>\n", out);
}

/* The largest RMS of a camera's pictures in the frames from first on. */
static double cell(const struct calib_page *page, int view, int first, int frames)
{
    const struct calib_figures *f = page->figures;
    double most = (double)NAN;

    for (int frame = first; frame < first + frames && frame < page->report->detections->frames; frame++) {
        const int i = f->detection[(size_t)frame * (size_t)f->views + (size_t)view];
        const double rms = i >= 0 ? page->report->solution->view[i].rms_px : (double)NAN;

        if (isfinite(rms) && !(most >= rms))
            most = rms;
    }
    return most;
}

static void draw_map(const struct calib_page *page, const double *values, int cols, int rows, int share)
{
    const struct calib_scale scale = calib_scale_fit(values, (size_t)cols * (size_t)rows);
    const double height = sst_clamp_double(floor(500.0 / rows), 2, 14), width = WIDTH / fmax(cols, 20) * cols;
    FILE *out = page->out;

    fprintf(out,
            "<figure><h3>RMS of each picture</h3>\n<div class=\"scroll\"><svg viewBox=\"0 0 %.0f %.4g\" "
            "style=\"min-width:560px\"><rect class=\"none\" x=\"%.4g\" width=\"%.5g\" height=\"%.4g\"/>"
            "<g transform=\"translate(%.4g 0)\">",
            LEFT + WIDTH + 4, rows * height + 2, LEFT, width, rows * height, LEFT);
    svg_cells(out, values, cols, rows, width, rows * height, scale);
    fputs("</g>", out);
    for (int row = 0, view = 0; view < page->figures->views; view++) {
        if (!page->figures->camera[view].expected)
            continue;
        if (row++ % (height < 9 ? 4 : 1))
            continue;
        fprintf(out, "<text x=\"%.4g\" y=\"%.5g\" font-size=\"9\" text-anchor=\"end\" class=\"soft\">%02d_%02d</text>",
                LEFT - 4, row * height - height / 2 + 3, view / page->report->detections->cols,
                view % page->report->detections->cols);
    }
    fputs("</svg></div>\n", out);
    html_legend(out, scale, "px", "board not seen");
    fputs("<figcaption>One line per camera (row_column), one column per ", out);
    if (share > 1)
        fprintf(out, "%d frames, of which the worst is shown", share);
    else
        fputs("frame", out);
    fputs(": RMS per point over the picture's used corners. A bright line is a camera, a bright column a frame to look "
          "into; a line that turns bright is a camera that moved.</figcaption></figure>\n",
          out);
}

int calib_page_frames(const struct calib_page *page)
{
    const struct calib_figures *f = page->figures;
    const int frames = page->report->detections->frames;
    const int share = (frames + COLUMNS - 1) / COLUMNS, cols = frames ? (frames + share - 1) / share : 0;
    double *values = malloc(((size_t)f->views * (size_t)cols + 1) * sizeof(*values));
    int rows = 0;

    if (!values)
        return -ENOMEM;
    html_section(page->out, "frames", "Frames", "A frame is one moment, seen by all cameras.");
    if (f->used_frames)
        bars(page);
    for (int view = 0; view < f->views; view++) {
        if (!f->camera[view].expected)
            continue;
        for (int col = 0; col < cols; col++)
            values[(size_t)rows * (size_t)cols + (size_t)col] = cell(page, view, col * share, share);
        rows++;
    }
    if (rows && cols)
        draw_map(page, values, cols, rows, share);
    fputs("</section>\n", page->out);
    free(values);
    return 0;
}

/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/calibration/board/print.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/calibration/board/opencv_boards.h"
#include "pipeline/image/codec.h"

#define MODULES_MAX 8

/* --- layout ------------------------------------------------------------------------------------------------------ */

static void add(struct sst_print *p, double x, double y, double width, double height)
{
    const int n = p->count++;

    p->rect[n].x = p->first_mm[0] + x;
    p->rect[n].y = p->first_mm[1] + y;
    p->rect[n].width = width;
    p->rect[n].height = height;
}

/* A marker as black runs, row by row; corner 0 of an upside-down marker is its lower right. */
static int add_marker(struct sst_print *p, const struct sst_board_marker *m, int dictionary, int border)
{
    const bool turned = m->corner[0][0] > m->corner[2][0];
    const double *from = m->corner[turned ? 2 : 0], side = fabs(m->corner[2][0] - m->corner[0][0]);
    uint8_t bits[MODULES_MAX * MODULES_MAX] = { 0 };
    int inner = 0, r = cv_dictionary(dictionary, &inner);
    const int total = inner + 2 * border;

    if (r >= 0)
        r = inner <= MODULES_MAX ? cv_marker_bits(bits, dictionary, m->number) : -EINVAL;
    if (r < 0)
        return r;
    for (int row = 0; row < total; row++) {
        int start = 0;

        for (int col = 0; col <= total; col++) {
            const int x = col - border, y = row - border;
            const int k = turned ? inner * inner - 1 - (y * inner + x) : y * inner + x;
            const bool white = col == total || (x >= 0 && y >= 0 && x < inner && y < inner && bits[k]);

            if (!white)
                continue;
            if (col > start)
                add(p, from[0] + side * start / total, from[1] + side * row / total, side * (col - start) / total,
                    side / total);
            start = col + 1;
        }
    }
    return 0;
}

static void add_squares(struct sst_print *p, const struct sst_board *b)
{
    for (int row = 0; row < b->rows; row++) {
        for (int col = row % 2; col < b->cols; col += 2)
            add(p, (col - 1) * b->square_mm, (row - 1) * b->square_mm, b->square_mm, b->square_mm);
    }
}

/* Small squares between the corners of tags. */
static void add_links(struct sst_print *p, const struct sst_board *b)
{
    const double gap = b->marker * b->square_mm, pitch = b->square_mm + gap;

    for (int row = 0; row <= b->rows; row++) {
        for (int col = 0; col <= b->cols; col++)
            add(p, col * pitch - gap, row * pitch - gap, gap, gap);
    }
}

static int add_markers(struct sst_print *p, const struct sst_board *b)
{
    struct sst_board_marker *m = malloc(((size_t)sst_board_markers(NULL, b, false) + 1) * sizeof(*m));
    int border, dictionary = sst_board_dictionary(b, &border), n, err = 0;

    if (!m)
        return -ENOMEM;
    n = sst_board_markers(m, b, false);
    for (int i = 0; i < n && !err; i++)
        err = add_marker(p, &m[i], dictionary, border);
    free(m);
    return err;
}

int sst_print_board(struct sst_print *out, const struct sst_board *b)
{
    const bool grid = b->kind == SST_BOARD_APRILGRID;
    const double gap = b->marker * b->square_mm, margin = grid ? fmax(gap, b->square_mm / 10) : b->square_mm / 2;
    struct sst_print p = { 0 };
    /* A row of n modules has at most n / 2 black runs, rounded up. */
    const size_t runs = (size_t)(MODULES_MAX + 4) * (MODULES_MAX + 4) / 2 + MODULES_MAX;
    const size_t most = (size_t)(b->cols + 1) * (size_t)(b->rows + 1) * (b->kind == SST_BOARD_CHESSBOARD ? 1 : runs);
    int err = 0;

    if (grid) {
        p.first_mm[0] = p.first_mm[1] = margin + gap;
        p.width_mm = 2 * margin + b->cols * (b->square_mm + gap) + gap;
        p.height_mm = 2 * margin + b->rows * (b->square_mm + gap) + gap;
    } else {
        p.first_mm[0] = p.first_mm[1] = margin + b->square_mm;
        p.width_mm = 2 * margin + b->cols * b->square_mm;
        p.height_mm = 2 * margin + b->rows * b->square_mm;
    }
    p.rect = malloc(most * sizeof(*p.rect));
    if (!p.rect)
        return -ENOMEM;
    if (grid)
        add_links(&p, b);
    else
        add_squares(&p, b);
    if (b->kind != SST_BOARD_CHESSBOARD)
        err = add_markers(&p, b);
    if (err)
        sst_print_fini(&p);
    else
        *out = p;
    return err;
}

void sst_print_fini(struct sst_print *print)
{
    free(print->rect);
    *print = (struct sst_print){ 0 };
}

/* --- files ------------------------------------------------------------------------------------------------------- */

int sst_print_write_svg(const struct sst_print *p, const char *title, const char *path)
{
    struct sst_outfile out;
    int err = sst_outfile_open(&out, path);

    if (err)
        return err;
    fprintf(out.stream,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.6gmm\" height=\"%.6gmm\" viewBox=\"0 0 %.6g %.6g\" "
            "shape-rendering=\"crispEdges\">\n<title>%s</title>\n<rect width=\"100%%\" height=\"100%%\" "
            "fill=\"#fff\"/>\n<path d=\"",
            p->width_mm, p->height_mm, p->width_mm, p->height_mm, title);
    for (int i = 0; i < p->count; i++)
        fprintf(out.stream, "M%.6g %.6gh%.6gv%.6gh%.6gz%s", p->rect[i].x, p->rect[i].y, p->rect[i].width,
                p->rect[i].height, -p->rect[i].width, i % 8 == 7 ? "\n" : "");
    fprintf(out.stream, "\"/>\n</svg>\n");
    return sst_outfile_commit(&out);
}

int sst_print_write_png(const struct sst_print *p, double dpi, const char *path)
{
    const double scale = dpi / 25.4, width = ceil(p->width_mm * scale), height = ceil(p->height_mm * scale);
    struct sst_map_u8 map = { 0 };
    int err = -EINVAL;

    if (width >= 1 && height >= 1 && width <= SST_IMAGE_MAX_SIDE && height <= SST_IMAGE_MAX_SIDE)
        err = sst_map_u8_init(&map, (int)width, (int)height);
    if (err) {
        sst_log_error("%s: a board of %.0f x %.0f mm at %.0f dots per inch is too large for a PNG; give a smaller "
                      "--dpi, or write an SVG",
                      path, p->width_mm, p->height_mm, dpi);
        return err;
    }
    memset(map.data, 255, map.stride * (size_t)map.height);
    for (int i = 0; i < p->count; i++) {
        const int x0 = (int)lround(p->rect[i].x * scale), x1 = (int)lround((p->rect[i].x + p->rect[i].width) * scale);
        const int y0 = (int)lround(p->rect[i].y * scale), y1 = (int)lround((p->rect[i].y + p->rect[i].height) * scale);

        for (int y = sst_max_int(y0, 0); y < sst_min_int(y1, map.height); y++)
            memset(sst_map_u8_row(&map, y) + x0, 0, (size_t)sst_max_int(sst_min_int(x1, map.width) - x0, 0));
    }
    err = sst_map_u8_write_png(&map, path, NULL);
    sst_map_u8_fini(&map);
    return err;
}

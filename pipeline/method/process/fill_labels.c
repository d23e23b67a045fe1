#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/method/process/process_internal.h"

#define DIRECTIONS 8

/* A pixel without a label, and the best that was found for it. */
struct gap {
    const struct sst_view *v;
    const struct sst_map_u8 *from; /* labels before any gap is filled */
    int x, y;
    uint32_t least; /* difference of colour << 16 | of disparity */
    uint8_t label;
};

static void consider(struct gap *g, int x, int y)
{
    const uint16_t d = sst_map_u16_row(&g->v->disp, g->y)[g->x], there = sst_map_u16_row(&g->v->disp, y)[x];
    uint32_t colour = 0, off;

    for (int c = 0; c < 3; c++)
        colour += (uint32_t)abs(sst_image_row(&g->v->image, c, g->y)[g->x] - sst_image_row(&g->v->image, c, y)[x]);
    off = colour << 16 | (uint32_t)abs(d - there);
    if (off < g->least) {
        g->least = off;
        g->label = sst_map_u8_row(g->from, y)[x];
    }
}

/* The most similar of the first labelled pixels in all directions; SST_LABEL_NONE: all are farther than the reach. */
static uint8_t find_similar(const struct sst_view *v, const struct sst_map_u8 *from, int x, int y)
{
    static const int8_t step[DIRECTIONS][2] = { { -1, 0 },  { 1, 0 },  { 0, -1 }, { 0, 1 },
                                                { -1, -1 }, { 1, -1 }, { -1, 1 }, { 1, 1 } };
    struct gap g = { v, from, x, y, UINT32_MAX, SST_LABEL_NONE };

    for (int k = 0; k < DIRECTIONS; k++) {
        const int dx = step[k][0], dy = step[k][1];
        int most = PROCESS_FILL_REACH;

        most = dx < 0 ? sst_min_int(most, x) : dx > 0 ? sst_min_int(most, from->width - 1 - x) : most;
        most = dy < 0 ? sst_min_int(most, y) : dy > 0 ? sst_min_int(most, from->height - 1 - y) : most;
        for (int i = 1; i <= most; i++) {
            if (sst_map_u8_row(from, y + i * dy)[x + i * dx] != SST_LABEL_NONE) {
                consider(&g, x + i * dx, y + i * dy);
                break;
            }
        }
    }
    return g.label;
}

/* Columns from .. end - 1 of row y have no label; those beside them have one, unless they are outside. */
static void fill_run(struct sst_view *v, const struct sst_map_u8 *labels, int from, int end, int y)
{
    const uint16_t *d = sst_map_u16_row(&v->disp, y);
    const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, y) : NULL, *label = sst_map_u8_row(labels, y);
    const int width = labels->width;

    for (int x = from; x < end; x++) {
        const bool left = from > 0 && (end == width || abs(d[x] - d[from - 1]) <= abs(d[x] - d[end]));
        uint8_t found = SST_LABEL_NONE;

        if (!valid || valid[x])
            found = find_similar(v, labels, x, y);
        if (found == SST_LABEL_NONE && (from > 0 || end < width))
            found = left ? label[from - 1] : label[end];
        sst_map_u8_row(&v->label, y)[x] = found;
    }
}

int process_fill_labels(struct sst_view *v)
{
    struct sst_map_u8 from = { 0 };
    const int err = sst_map_u8_init(&from, v->label.width, v->label.height);

    if (err)
        return err;
    memcpy(from.data, v->label.data, from.stride * (size_t)from.height);
    for (int y = 0; y < from.height; y++) {
        const uint8_t *label = sst_map_u8_row(&from, y);
        uint8_t *to = sst_map_u8_row(&v->label, y);

        for (int x = 0, end; x < from.width; x = end + 1) {
            for (end = x; end < from.width && label[end] == SST_LABEL_NONE; end++)
                ;
            if (end > x)
                fill_run(v, &from, x, end, y);
        }
        for (int x = 0; v->valid.data && x < from.width; x++)
            to[x] &= sst_map_u8_row(&v->valid, y)[x];
    }
    sst_map_u8_fini(&from);
    return 0;
}

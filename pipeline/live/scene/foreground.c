/* Foreground objects of the reference key, as connected components in front of the background model: a moving object
 * has one label, and the background that it uncovers has the label from before. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/live/scene/scene_internal.h"

/* Tolerance of the disparity of one surface from set to set: matching at half size is accurate to a cell. */
#define SAME_Q6 96
/* Disparity difference of neighbouring cells of one object. */
#define JOIN_Q6 128
/* A surface behind the background becomes the background when it was seen in this number of consecutive sets in which
 * the cell changed. A nearer one becomes background after this number of changes, or of sets without a change. */
#define FARTHER_SETS 2
#define NEARER_SETS  30
#define STILL_SETS   300
/* Maximum number of votes for the label of a background cell; it keeps the label from changing by a single vote. */
#define WEIGHT_MAX 40
/* Smaller components are disparity noise and get no label of their own. */
#define OBJECT_CELLS 24
/* Votes for an object's label, in quarters of a cell. Votes for the label of the background weigh less than others,
 * since the network labels too much background along outlines. */
#define VOTE            4
#define VOTE_BACKGROUND 1
#define VOTES_LEAST     64
/* Earlier votes for an object decay with every labelled set, as its cells change. */
#define KEPT_NUM 7
#define KEPT_DEN 8
/* Objects match from set to set at about the same disparity if their boxes, enlarged by half, overlap. */
#define OBJECT_Q6   256
#define OBJECTS_MAX 32 /* further ones, mostly noise, are not tracked */
/* An object of this number of cells asks for the network when it appears, and each time that its cells have doubled. */
#define ASK_CELLS 96

struct cell {
    uint16_t disp, other; /* of the background; of the other surface seen there. SST_DISP_NONE: unknown */
    uint8_t seen;         /* number of sets with `other` */
    uint8_t label, weight;
    uint8_t object; /* 1: part of an object now */
};

struct object {
    struct sst_rect at; /* cells */
    int disp_q6;        /* mean */
    int64_t cells, vote[SST_MAX_CLASSES + 1];
    int64_t asked; /* cells when the network last ran */
};

struct scene_foreground {
    int width, height, cols, rows;
    int view;          /* of the cells */
    struct cell *cell; /* [height][width] */
    uint16_t *still;   /* [rows][cols] sets since the tile changed */
    uint8_t *visited;  /* [height][width] */
    int32_t *stack;    /* [height * width] the cells of a component */
    struct object object[2][OBJECTS_MAX];
    int objects[2], now; /* of the last set and of this one: object[now] */
};

int scene_foreground_open(struct scene_foreground **out, int width, int height, int cols, int rows)
{
    struct scene_foreground *t = calloc(1, sizeof(*t));
    const size_t cells = (size_t)width * (size_t)height;

    if (!t)
        return -ENOMEM;
    t->width = width;
    t->height = height;
    t->cols = cols;
    t->rows = rows;
    t->cell = sst_mem_alloc(cells, sizeof(*t->cell));
    t->still = calloc((size_t)cols * (size_t)rows, sizeof(*t->still));
    t->visited = malloc(cells);
    t->stack = sst_mem_alloc_raw(cells, sizeof(*t->stack));
    if (!t->cell || !t->still || !t->visited || !t->stack) {
        scene_foreground_close(t);
        return -ENOMEM;
    }
    scene_foreground_reset(t);
    *out = t;
    return 0;
}

void scene_foreground_close(struct scene_foreground *t)
{
    if (!t)
        return;
    sst_mem_free(t->cell);
    sst_mem_free(t->stack);
    free(t->still);
    free(t->visited);
    free(t);
}

void scene_foreground_reset(struct scene_foreground *t)
{
    for (int i = 0; i < t->width * t->height; i++)
        t->cell[i] = (struct cell){ .disp = SST_DISP_NONE, .other = SST_DISP_NONE };
    t->objects[0] = t->objects[1] = 0;
}

/* --- the background ----------------------------------------------------------------------------------------------- */

static bool same(int a, int b)
{
    return abs(a - b) <= SAME_Q6;
}

static void become_background(struct cell *c, uint16_t disp, uint8_t label)
{
    *c = (struct cell){ .disp = disp, .other = SST_DISP_NONE, .label = label, .weight = label != SST_LABEL_NONE };
}

/* Vote for the label of a background cell: the label with most votes stays. */
static void vote(struct cell *c, uint8_t label)
{
    if (label == SST_LABEL_NONE)
        return;
    if (label == c->label)
        c->weight = (uint8_t)sst_min_int(c->weight + 1, WEIGHT_MAX);
    else if (c->weight)
        c->weight--;
    else
        c->label = label;
}

/* Update a changed cell: background, or in front of it. */
static void update_cell(struct cell *c, uint16_t disp, uint8_t label, bool confirmed)
{
    const bool farther = c->disp == SST_DISP_NONE || disp < c->disp;

    c->object = 0;
    if (disp == SST_DISP_NONE)
        return;
    if (c->disp != SST_DISP_NONE && same(disp, c->disp)) {
        c->seen = 0;
        vote(c, label);
        return;
    }
    c->seen = (uint8_t)(c->other != SST_DISP_NONE && same(disp, c->other) ? sst_min_int(c->seen + 1, UINT8_MAX) : 1);
    c->other = disp;
    if (c->disp == SST_DISP_NONE || (farther && confirmed && c->seen >= FARTHER_SETS) || c->seen >= NEARER_SETS)
        become_background(c, disp, label);
    else
        c->object = !farther;
}

/* Store the cells of a tile as background. */
static void settle(struct scene_foreground *t, const struct scene_maps *maps, int tile, uint8_t weight)
{
    const int x0 = tile % t->cols * SST_SCENE_CELLS, y0 = tile / t->cols * SST_SCENE_CELLS;
    const int x1 = sst_min_int(x0 + SST_SCENE_CELLS, t->width), y1 = sst_min_int(y0 + SST_SCENE_CELLS, t->height);

    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++) {
            struct cell *c = &t->cell[y * t->width + x];

            become_background(c, sst_map_u16_row(&maps->disp, y)[x], sst_map_u8_row(&maps->label, y)[x]);
            c->weight = c->label == SST_LABEL_NONE ? 0 : weight;
        }
    }
}

void scene_foreground_settle(struct scene_foreground *t, const struct scene_key *key, int tile)
{
    if (t->view == key->view)
        settle(t, &key->maps, tile, WEIGHT_MAX);
}

void scene_foreground_still(struct scene_foreground *t, const struct scene_key *key, const uint8_t *dirty)
{
    if (t->view != key->view)
        return;
    for (int i = 0; i < t->cols * t->rows; i++) {
        if (dirty[i])
            t->still[i] = 0;
        else if (t->still[i] < STILL_SETS && ++t->still[i] == STILL_SETS)
            settle(t, &key->maps, i, WEIGHT_MAX / 2);
    }
}

/* Compare changed cells with the background; background cells get its label. */
static void compare_all(struct scene_foreground *t, struct scene_maps *maps, const uint8_t *dirty, bool labelled)
{
    for (int y = 0; y < t->height; y++) {
        const uint8_t *tiles = dirty + y / SST_SCENE_CELLS * t->cols, *confirmed = sst_map_u8_row(&maps->confirmed, y);
        const uint16_t *disp = sst_map_u16_row(&maps->disp, y);
        uint8_t *label = sst_map_u8_row(&maps->label, y);
        struct cell *c = t->cell + (size_t)y * (size_t)t->width;

        for (int x = 0; x < t->width; x++) {
            if (!tiles[x / SST_SCENE_CELLS]) {
                x |= SST_SCENE_CELLS - 1;
                continue;
            }
            update_cell(&c[x], disp[x], labelled ? label[x] : SST_LABEL_NONE, confirmed[x]);
            if (!c[x].object && disp[x] != SST_DISP_NONE && same(disp[x], c[x].disp) && c[x].label != SST_LABEL_NONE)
                label[x] = c[x].label;
        }
    }
}

/* --- objects ------------------------------------------------------------------------------------------------------ */

/* Cells of a component on the stack. */
struct flood {
    struct scene_foreground *t;
    const struct scene_maps *maps;
    int count;
};

static void reach(struct flood *f, int x, int y, int disp)
{
    struct scene_foreground *t = f->t;
    const int i = y * t->width + x;

    if (x < 0 || y < 0 || x >= t->width || y >= t->height || t->visited[i] || !t->cell[i].object ||
        abs(sst_map_u16_row(&f->maps->disp, y)[x] - disp) > JOIN_Q6)
        return;
    t->visited[i] = 1;
    t->stack[f->count++] = i;
}

/* Collect the cells of the component around a cell in t->stack, and its box. */
static void gather(struct scene_foreground *t, const struct scene_maps *maps, int x, int y, struct object *out)
{
    struct flood f = { t, maps, 0 };
    int64_t sum = 0;

    *out = (struct object){ .at = { x, y, x + 1, y + 1 } };
    reach(&f, x, y, sst_map_u16_row(&maps->disp, y)[x]);
    for (int i = 0; i < f.count; i++) {
        const int cx = t->stack[i] % t->width, cy = t->stack[i] / t->width, d = sst_map_u16_row(&maps->disp, cy)[cx];

        sum += d;
        out->at.x0 = sst_min_int(out->at.x0, cx);
        out->at.x1 = sst_max_int(out->at.x1, cx + 1);
        out->at.y0 = sst_min_int(out->at.y0, cy);
        out->at.y1 = sst_max_int(out->at.y1, cy + 1);
        reach(&f, cx - 1, cy, d);
        reach(&f, cx + 1, cy, d);
        reach(&f, cx, cy - 1, d);
        reach(&f, cx, cy + 1, d);
    }
    out->cells = f.count;
    out->disp_q6 = (int)(sum / sst_max_int(f.count, 1));
}

static int64_t overlap(const struct object *a, const struct object *b)
{
    const int dx = (b->at.x1 - b->at.x0) / 2, dy = (b->at.y1 - b->at.y0) / 2;
    const int w = sst_min_int(a->at.x1, b->at.x1 + dx) - sst_max_int(a->at.x0, b->at.x0 - dx);
    const int h = sst_min_int(a->at.y1, b->at.y1 + dy) - sst_max_int(a->at.y0, b->at.y0 - dy);

    return w > 0 && h > 0 && abs(a->disp_q6 - b->disp_q6) <= OBJECT_Q6 ? (int64_t)w * h : 0;
}

/* Inherit the votes of earlier sets, in proportion to the overlap with the earlier object. */
static void remember(const struct scene_foreground *t, struct object *a, bool labelled)
{
    const int num = labelled ? KEPT_NUM : KEPT_DEN;
    const struct object *was = NULL;
    int64_t most = 0;

    for (int i = 0; i < t->objects[!t->now]; i++) {
        const int64_t area = overlap(a, &t->object[!t->now][i]);

        if (area > most) {
            most = area;
            was = &t->object[!t->now][i];
        }
    }
    a->asked = labelled ? a->cells : was ? was->asked : 0;
    for (int i = 0; was && i <= SST_MAX_CLASSES; i++)
        a->vote[i] += was->vote[i] * num / KEPT_DEN * (a->cells < was->cells ? a->cells : was->cells) / was->cells;
}

/* Count the network's votes in the changed cells of the component. */
static void count_votes(const struct scene_foreground *t, const struct scene_maps *maps, const uint8_t *dirty,
                        struct object *a)
{
    for (int i = 0; i < a->cells; i++) {
        const int x = t->stack[i] % t->width, y = t->stack[i] / t->width, l = sst_map_u8_row(&maps->label, y)[x];

        if (dirty[y / SST_SCENE_CELLS * t->cols + x / SST_SCENE_CELLS] && l <= SST_MAX_CLASSES)
            a->vote[l] += l == t->cell[t->stack[i]].label ? VOTE_BACKGROUND : VOTE;
    }
}

/* The label with more than half of the votes, or none. */
static uint8_t winner(const struct object *a)
{
    int64_t all = 0;
    int best = 1;

    for (int i = 1; i <= SST_MAX_CLASSES; i++) {
        all += a->vote[i];
        best = a->vote[i] > a->vote[best] ? i : best;
    }
    return (uint8_t)(all >= VOTES_LEAST && 2 * a->vote[best] > all ? best : SST_LABEL_NONE);
}

static void paint(const struct scene_foreground *t, struct scene_maps *maps, struct scene_candidates *c,
                  const uint8_t *dirty, const struct object *a, uint8_t label)
{
    for (int i = 0; i < a->cells; i++) {
        const int x = t->stack[i] % t->width, y = t->stack[i] / t->width;

        if (!dirty[y / SST_SCENE_CELLS * t->cols + x / SST_SCENE_CELLS])
            continue;
        sst_map_u8_row(&maps->label, y)[x] = label;
        c->mask[sst_map_u16_row(&maps->disp, y)[x] >> SST_SCENE_COLUMN_SHIFT] |= (uint64_t)1 << (label - 1);
    }
}

bool scene_foreground_label(struct scene_foreground *t, struct scene_key *key, struct scene_candidates *c,
                            const uint8_t *dirty, bool labelled)
{
    struct scene_maps *maps = &key->maps;
    bool ask = false;
    struct object piece;

    if (t->view != key->view)
        scene_foreground_reset(t);
    t->view = key->view;
    t->now = !t->now;
    t->objects[t->now] = 0;
    compare_all(t, maps, dirty, labelled);
    memset(t->visited, 0, (size_t)t->width * (size_t)t->height);
    for (int y = 0; y < t->height; y++) {
        const struct cell *row = t->cell + (size_t)y * (size_t)t->width;

        for (int x = 0; x < t->width; x++) {
            uint8_t label;

            if (!row[x].object || t->visited[y * t->width + x])
                continue;
            gather(t, maps, x, y, &piece);
            if (piece.cells < OBJECT_CELLS)
                continue;
            remember(t, &piece, labelled);
            if (labelled)
                count_votes(t, maps, dirty, &piece);
            ask |= piece.cells >= ASK_CELLS && piece.cells > 2 * piece.asked;
            label = winner(&piece);
            if (label != SST_LABEL_NONE)
                paint(t, maps, c, dirty, &piece, label);
            if (t->objects[t->now] < OBJECTS_MAX)
                t->object[t->now][t->objects[t->now]++] = piece;
        }
    }
    return ask;
}

static void mean_colours(const struct scene_foreground *t, const struct scene_maps *maps, const struct sst_image *image,
                         struct scene_piece *p)
{
    double sum[2][3] = { { 0 } };
    int64_t count[2] = { 0, 0 };

    for (int y = p->at.y0; y < p->at.y1; y++) {
        const int half = 2 * (y - p->at.y0) >= p->at.y1 - p->at.y0, py = sst_min_int(2 * y, image->height - 1);
        const uint16_t *disp = sst_map_u16_row(&maps->disp, y);

        for (int x = p->at.x0; x < p->at.x1; x++) {
            if (!t->cell[y * t->width + x].object || abs(disp[x] - p->disp_q6) > OBJECT_Q6)
                continue;
            for (int c = 0; c < 3; c++)
                sum[half][c] += sst_image_row(image, c, py)[sst_min_int(2 * x, image->width - 1)];
            count[half]++;
        }
    }
    for (int half = 0; half < 2; half++)
        for (int c = 0; c < 3; c++)
            p->colour[half][c] = (float)(sum[half][c] / (double)(count[half] ? count[half] : 1));
}

int scene_foreground_pieces(const struct scene_foreground *t, const struct scene_maps *maps,
                            const struct sst_image *image, struct scene_piece piece[SCENE_PIECES])
{
    const int count = sst_min_int(t->objects[t->now], SCENE_PIECES);

    for (int i = 0; i < count; i++) {
        const struct object *a = &t->object[t->now][i];

        piece[i] = (struct scene_piece){ .at = a->at, .disp_q6 = a->disp_q6, .cells = a->cells, .label = winner(a) };
        mean_colours(t, maps, image, &piece[i]);
    }
    return count;
}

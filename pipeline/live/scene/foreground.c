/* What stands before the background of the reference key, piece by piece: a thing that moves has one label, and what
 * it uncovers the label that was there before. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/live/scene/scene_internal.h"

/* Disparities of one surface, from set to set: matching at half size is good to a cell. */
#define SAME_Q6 96
/* Neighbouring cells of one thing. */
#define JOIN_Q6 128
/* What is farther than the background was hidden by it: it is the background when it was seen in so many sets, in a
 * row, in which the cell changed. What is nearer and stays for so many, or stands still for so many sets, is no thing
 * any more. */
#define FARTHER_SETS 2
#define NEARER_SETS  30
#define STILL_SETS   300
/* Votes for the label of a background cell: at most; a label with so many is not given up to one other vote. */
#define WEIGHT_MAX 40
/* Smaller pieces are noise of the disparities, and take no label of their own. */
#define THING_CELLS 24
/* Votes for a thing's label, in quarters of a cell. What the network says of the background there counts for less than
 * what else it says: outlines show more of it than there is. */
#define VOTE            4
#define VOTE_BACKGROUND 1
#define VOTES_LEAST     64
/* What a thing was taken for before counts for less by every set, as its cells come and go. */
#define KEPT_NUM 7
#define KEPT_DEN 8
/* It is the same thing at about the same disparity, where its place, enlarged by half its size, is met. */
#define THING_Q6   256
#define THINGS_MAX 32 /* more, which are noise mostly, are not remembered */

struct cell {
    uint16_t disp, other; /* of the background; what was seen there instead. SST_DISP_NONE: unknown */
    uint8_t seen;         /* in so many sets */
    uint8_t label, weight;
    uint8_t thing; /* 1: it is of a thing now */
};

struct thing {
    struct scene_rect at; /* cells */
    int disp_q6;          /* mean */
    int64_t cells, vote[SST_MAX_CLASSES + 1];
};

struct scene_foreground {
    int width, height, cols, rows;
    int view;          /* that the cells are of */
    struct cell *cell; /* [height][width] */
    uint16_t *still;   /* [rows][cols] sets since the tile changed */
    uint8_t *visited;  /* [height][width] */
    int32_t *stack;    /* [height * width] the cells of a piece */
    struct thing thing[2][THINGS_MAX];
    int things[2], now; /* of the last set, and of this one: thing[now] */
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
    t->things[0] = t->things[1] = 0;
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

/* A vote for the label of a background cell: the label with most of them stays. */
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

/* Is a changed cell the background, or before it? */
static void look(struct cell *c, uint16_t disp, uint8_t label, bool sure)
{
    const bool farther = c->disp == SST_DISP_NONE || disp < c->disp;

    c->thing = 0;
    if (disp == SST_DISP_NONE)
        return;
    if (c->disp != SST_DISP_NONE && same(disp, c->disp)) {
        c->seen = 0;
        vote(c, label);
        return;
    }
    c->seen = (uint8_t)(c->other != SST_DISP_NONE && same(disp, c->other) ? sst_min_int(c->seen + 1, UINT8_MAX) : 1);
    c->other = disp;
    if (c->disp == SST_DISP_NONE || (farther && sure && c->seen >= FARTHER_SETS) || c->seen >= NEARER_SETS)
        become_background(c, disp, label);
    else
        c->thing = !farther;
}

/* Cells of a tile are the background as they are. */
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

/* Changed cells against the background: what is the background takes its label. */
static void look_at_all(struct scene_foreground *t, struct scene_maps *maps, const uint8_t *dirty, bool labelled)
{
    for (int y = 0; y < t->height; y++) {
        const uint8_t *tiles = dirty + y / SST_SCENE_CELLS * t->cols, *sure = sst_map_u8_row(&maps->sure, y);
        const uint16_t *disp = sst_map_u16_row(&maps->disp, y);
        uint8_t *label = sst_map_u8_row(&maps->label, y);
        struct cell *c = t->cell + (size_t)y * (size_t)t->width;

        for (int x = 0; x < t->width; x++) {
            if (!tiles[x / SST_SCENE_CELLS]) {
                x |= SST_SCENE_CELLS - 1;
                continue;
            }
            look(&c[x], disp[x], labelled ? label[x] : SST_LABEL_NONE, sure[x]);
            if (!c[x].thing && disp[x] != SST_DISP_NONE && same(disp[x], c[x].disp) && c[x].label != SST_LABEL_NONE)
                label[x] = c[x].label;
        }
    }
}

/* --- things ------------------------------------------------------------------------------------------------------- */

static void reach(struct scene_foreground *t, const struct scene_maps *maps, int x, int y, int disp, int *count)
{
    const int i = y * t->width + x;

    if (x < 0 || y < 0 || x >= t->width || y >= t->height || t->visited[i] || !t->cell[i].thing ||
        abs(sst_map_u16_row(&maps->disp, y)[x] - disp) > JOIN_Q6)
        return;
    t->visited[i] = 1;
    t->stack[(*count)++] = i;
}

/* The cells of the piece around a cell, in t->stack, and where it is. */
static void gather(struct scene_foreground *t, const struct scene_maps *maps, int x, int y, struct thing *out)
{
    int64_t sum = 0;
    int count = 0;

    *out = (struct thing){ .at = { x, y, x + 1, y + 1 } };
    reach(t, maps, x, y, sst_map_u16_row(&maps->disp, y)[x], &count);
    for (int i = 0; i < count; i++) {
        const int cx = t->stack[i] % t->width, cy = t->stack[i] / t->width, d = sst_map_u16_row(&maps->disp, cy)[cx];

        sum += d;
        out->at.x0 = sst_min_int(out->at.x0, cx);
        out->at.x1 = sst_max_int(out->at.x1, cx + 1);
        out->at.y0 = sst_min_int(out->at.y0, cy);
        out->at.y1 = sst_max_int(out->at.y1, cy + 1);
        reach(t, maps, cx - 1, cy, d, &count);
        reach(t, maps, cx + 1, cy, d, &count);
        reach(t, maps, cx, cy - 1, d, &count);
        reach(t, maps, cx, cy + 1, d, &count);
    }
    out->cells = count;
    out->disp_q6 = (int)(sum / sst_max_int(count, 1));
}

static int64_t overlap(const struct thing *a, const struct thing *b)
{
    const int dx = (b->at.x1 - b->at.x0) / 2, dy = (b->at.y1 - b->at.y0) / 2;
    const int w = sst_min_int(a->at.x1, b->at.x1 + dx) - sst_max_int(a->at.x0, b->at.x0 - dx);
    const int h = sst_min_int(a->at.y1, b->at.y1 + dy) - sst_max_int(a->at.y0, b->at.y0 - dy);

    return w > 0 && h > 0 && abs(a->disp_q6 - b->disp_q6) <= THING_Q6 ? (int64_t)w * h : 0;
}

/* What it was taken for in the sets before: as much as its share of the thing that it was. */
static void remember(const struct scene_foreground *t, struct thing *a)
{
    const struct thing *was = NULL;
    int64_t most = 0;

    for (int i = 0; i < t->things[!t->now]; i++) {
        const int64_t area = overlap(a, &t->thing[!t->now][i]);

        if (area > most) {
            most = area;
            was = &t->thing[!t->now][i];
        }
    }
    for (int i = 0; was && i <= SST_MAX_CLASSES; i++)
        a->vote[i] += was->vote[i] * KEPT_NUM / KEPT_DEN * (a->cells < was->cells ? a->cells : was->cells) / was->cells;
}

/* The network's votes for the changed cells of the piece. */
static void count_votes(const struct scene_foreground *t, const struct scene_maps *maps, const uint8_t *dirty,
                        struct thing *a)
{
    for (int i = 0; i < a->cells; i++) {
        const int x = t->stack[i] % t->width, y = t->stack[i] / t->width, l = sst_map_u8_row(&maps->label, y)[x];

        if (dirty[y / SST_SCENE_CELLS * t->cols + x / SST_SCENE_CELLS] && l <= SST_MAX_CLASSES)
            a->vote[l] += l == t->cell[t->stack[i]].label ? VOTE_BACKGROUND : VOTE;
    }
}

/* The label of more than half of the votes; none: there is none. */
static uint8_t winner(const struct thing *a)
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
                  const uint8_t *dirty, const struct thing *a, uint8_t label)
{
    for (int i = 0; i < a->cells; i++) {
        const int x = t->stack[i] % t->width, y = t->stack[i] / t->width;

        if (!dirty[y / SST_SCENE_CELLS * t->cols + x / SST_SCENE_CELLS])
            continue;
        sst_map_u8_row(&maps->label, y)[x] = label;
        c->mask[sst_map_u16_row(&maps->disp, y)[x] >> SST_SCENE_COLUMN_SHIFT] |= (uint64_t)1 << (label - 1);
    }
}

void scene_foreground_label(struct scene_foreground *t, struct scene_key *key, struct scene_candidates *c, const uint8_t *dirty,
                        bool labelled)
{
    struct scene_maps *maps = &key->maps;
    struct thing piece;

    if (t->view != key->view)
        scene_foreground_reset(t);
    t->view = key->view;
    t->now = !t->now;
    t->things[t->now] = 0;
    look_at_all(t, maps, dirty, labelled);
    memset(t->visited, 0, (size_t)t->width * (size_t)t->height);
    for (int y = 0; y < t->height; y++) {
        const struct cell *row = t->cell + (size_t)y * (size_t)t->width;

        for (int x = 0; x < t->width; x++) {
            uint8_t label;

            if (!row[x].thing || t->visited[y * t->width + x])
                continue;
            gather(t, maps, x, y, &piece);
            if (piece.cells < THING_CELLS)
                continue;
            remember(t, &piece);
            if (labelled)
                count_votes(t, maps, dirty, &piece);
            label = winner(&piece);
            if (label != SST_LABEL_NONE)
                paint(t, maps, c, dirty, &piece, label);
            if (t->things[t->now] < THINGS_MAX)
                t->thing[t->now][t->things[t->now]++] = piece;
        }
    }
}

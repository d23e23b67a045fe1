/* Memory of surfaces seen a moment ago behind moving objects.
 *
 * Every pixel holds the colour and the surface that were last seen there, and since when. A pixel that is seen now
 * either confirms its memory or changes it. A pixel that is not seen shows its memory, unless a contradiction comes
 * from the neighbourhood (most of the nearest pixels that are seen now have just changed, or show another surface that
 * came since: a person came or left), from the reference camera (it shows the same surface there, and that is being
 * removed), or from time (the cameras' tiles changed there, and it was not seen again). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/live/picture/picture_internal.h"

#define SAME_Q6        80 /* disparities of one surface in two sets: maps of half size jump by a pixel */
#define SAME_LEVELS    60 /* colours of one surface in two sets, sum of R, G, B */
#define STRONG         (4 * SST_RENDER_SUPPORT) /* rays that agree and need no confirmation by earlier sets */
#define SUPPORT_MOST   (12 * SST_RENDER_SUPPORT)
#define MOVER_MS       900  /* in which a surface that came in front, or is new, must be seen again */
#define SETTLED_MS     3000 /* a surface that has been there for this long stays for ... */
#define LONG_MS        20000
#define AGREED_SUPPORT (8 * SST_RENDER_SUPPORT) /* rays that all agree on a colour count like so many of the maps */
#define LEAST          12                       /* support without which a pixel counts as not seen */
#define BAND           4                        /* rows of a job, as high as the finest cells */
#define CELL_SHIFT     2
#define AGE_MOST_MS    60000
#define VOTERS         8 /* pixels that decide */

static const struct picture_pixel nothing = { .disp = SST_DISP_NONE };

struct merge {
    struct picture_memory *m;
    const struct picture_merge *in;
    uint32_t now_ms, dt_ms;
};

/* --- set-up ------------------------------------------------------------------------------------------------------- */

static int half(int side)
{
    return (side + 1) / 2;
}

int picture_memory_init(struct picture_memory *m, int width, int height)
{
    int cols = (width + 3) >> CELL_SHIFT, rows = (height + 3) >> CELL_SHIFT;
    size_t cells = 0;

    *m = (struct picture_memory){ .width = width, .height = height };
    for (int i = 0; i < PICTURE_VOTE_LEVELS; i++, cols = half(cols), rows = half(rows)) {
        m->cols[i] = cols;
        m->rows[i] = rows;
        cells += (size_t)cols * (size_t)rows;
    }
    m->pixel = sst_mem_alloc_raw((size_t)width * (size_t)height, sizeof(*m->pixel));
    m->votes = sst_mem_alloc_raw(cells, sizeof(*m->votes));
    if (!m->pixel || !m->votes) {
        picture_memory_fini(m);
        return -ENOMEM;
    }
    for (int i = 0; i < PICTURE_VOTE_LEVELS; i++)
        m->level[i] = i ? m->level[i - 1] + (size_t)m->cols[i - 1] * (size_t)m->rows[i - 1] : m->votes;
    picture_memory_forget(m);
    return 0;
}

void picture_memory_fini(struct picture_memory *m)
{
    sst_mem_free(m->pixel);
    sst_mem_free(m->votes);
    *m = (struct picture_memory){ 0 };
}

void picture_memory_forget(struct picture_memory *m)
{
    for (size_t i = 0; i < (size_t)m->width * (size_t)m->height; i++)
        m->pixel[i] = nothing;
    m->started = false;
}

void picture_memory_copy(struct picture_memory *m, const struct picture_memory *from)
{
    memcpy(m->pixel, from->pixel, (size_t)m->width * (size_t)m->height * sizeof(*m->pixel));
    m->started = from->started;
    m->start_ns = from->start_ns;
    m->last_ns = from->last_ns;
}

/* --- pixels seen now ---------------------------------------------------------------------------------------------- */

static int colour_distance(const struct picture_pixel *p, const uint8_t rgb[3])
{
    return abs(p->rgb[0] - rgb[0]) + abs(p->rgb[1] - rgb[1]) + abs(p->rgb[2] - rgb[2]);
}

static void replace(struct picture_pixel *p, const uint8_t rgb[3], uint16_t disp, int support, uint32_t now_ms)
{
    *p = (struct picture_pixel){ .rgb = { rgb[0], rgb[1], rgb[2] },
                                 .support = (uint8_t)sst_min_int(support, SUPPORT_MOST),
                                 .disp = disp,
                                 .seen_ms = now_ms,
                                 .since_ms = now_ms };
}

/* The same surface again: the mean over sets, each by the rays that agreed. */
static void confirm(struct picture_pixel *p, const uint8_t rgb[3], uint16_t disp, int support, uint32_t now_ms)
{
    const int sum = p->support + support;

    for (int c = 0; c < 3 && sum; c++)
        p->rgb[c] = (uint8_t)((p->rgb[c] * p->support + rgb[c] * support + sum / 2) / sum);
    if (sum)
        p->disp = (uint16_t)((p->disp * p->support + disp * support) / sum);
    else
        p->disp = disp;
    p->support = (uint8_t)sst_min_int(sum, SUPPORT_MOST);
    p->seen_ms = now_ms;
    p->doubt_ms = 0;
}

static bool is_same(const struct picture_pixel *p, const uint8_t rgb[3], uint16_t disp)
{
    return p->disp != SST_DISP_NONE && abs(p->disp - disp) <= SAME_Q6 && colour_distance(p, rgb) <= SAME_LEVELS;
}

enum vote {
    VOTE_NONE = 0,
    VOTE_SAME = 1,
    VOTE_CHANGED = 2,
    VOTE_WEAK = 3, /* the neighbourhood decides */
    VOTE_CAME = 4, /* changed, by a nearer surface */
};

/* A pixel that is seen: @return its vote on the neighbourhood */
static enum vote see(const struct merge *g, struct picture_pixel *p, uint8_t rgb[3], uint16_t disp, int support)
{
    const bool known = p->disp != SST_DISP_NONE, nearer = known && support >= STRONG && disp > p->disp + SAME_Q6;

    if (is_same(p, rgb, disp)) {
        confirm(p, rgb, disp, support, g->now_ms);
        if (support < STRONG)
            memcpy(rgb, p->rgb, 3);
        return VOTE_SAME;
    }
    if (known && support < STRONG && 2 * support < p->support && g->now_ms - p->seen_ms < MOVER_MS)
        return VOTE_WEAK;
    replace(p, rgb, disp, support, g->now_ms);
    return nearer ? VOTE_CAME : known ? VOTE_CHANGED : VOTE_NONE;
}

/* Has a pixel's surface come lately, as people and the wall behind them do? */
static bool is_new(const struct picture_pixel *p)
{
    return p->seen_ms - p->since_ms < SETTLED_MS;
}

/* Fill holes with the colours on which rays agree at one disparity. In sets without maps, pixels that the last maps
 * showed are holes where their surface is new: it may have moved since. */
static void fill_behind(const struct merge *g, int y)
{
    const struct picture_merge *in = g->in;
    const struct picture_behind *b = in->behind;
    const struct picture_cell *cell = b->cell + (size_t)(y / SST_RENDER_CELL_HEIGHT) * (size_t)b->cols;
    const uint8_t *agreed = sst_map_u8_row(&b->agreed, y);
    uint8_t *weight = sst_map_u8_row(in->weight, y), *support = sst_map_u8_row(in->support, y);
    const uint8_t *red = sst_image_row(&b->image, 0, y), *green = sst_image_row(&b->image, 1, y),
                  *blue = sst_image_row(&b->image, 2, y);
    const struct picture_pixel *pixel = g->m->pixel + (size_t)y * (size_t)g->m->width;
    const uint8_t *seen = b->late ? sst_map_u8_row(&b->seen, y) : weight;

    for (int x = 0; x < g->m->width; x++) {
        const bool has = seen[x] >= PICTURE_SEEN_WEIGHT && !(b->late && is_new(&pixel[x]));

        if (has || !agreed[x] || agreed[x] < b->least[picture_behind_colour(red[x], green[x], blue[x])])
            continue;
        for (int c = 0; c < 3; c++)
            sst_image_row(in->image, c, y)[x] = sst_image_row(&b->image, c, y)[x];
        weight[x] = 255;
        support[x] = (uint8_t)sst_min_int(agreed[x] * AGREED_SUPPORT / 255, STRONG - 1);
        sst_map_u16_row(in->surface, y)[x] = sst_disp_q6(in->lf, b->plane_px[cell[x / SST_RENDER_CELL_WIDTH].plane]);
    }
}

static void count_vote(const struct merge *g, const struct picture_pixel *p, enum vote vote, struct picture_votes *cell)
{
    cell->weak = (uint16_t)(cell->weak + (vote == VOTE_WEAK));
    if (vote == VOTE_WEAK)
        return;
    cell->same = (uint16_t)(cell->same + (vote == VOTE_SAME));
    cell->changed = (uint16_t)(cell->changed + (vote == VOTE_CHANGED || vote == VOTE_CAME));
    cell->came = (uint16_t)(cell->came + (vote == VOTE_CAME));
    cell->came_disp += vote == VOTE_CAME ? p->disp : 0;
    cell->seen++;
    cell->disp += p->disp;
    cell->age_ms += g->now_ms - p->since_ms < AGE_MOST_MS ? g->now_ms - p->since_ms : AGE_MOST_MS;
}

static void see_row(const struct merge *g, int y, struct picture_votes *cells)
{
    const struct picture_merge *in = g->in;
    const uint16_t *surface = sst_map_u16_row(in->surface, y);
    const uint8_t *support = sst_map_u8_row(in->support, y);
    uint8_t *weight = sst_map_u8_row(in->weight, y), *kind = sst_map_u8_row(in->kind, y);
    struct picture_pixel *pixel = g->m->pixel + (size_t)y * (size_t)g->m->width;
    uint8_t *out[3] = { sst_image_row(in->image, 0, y), sst_image_row(in->image, 1, y),
                        sst_image_row(in->image, 2, y) };

    for (int x = 0; x < g->m->width; x++) {
        uint8_t rgb[3] = { out[0][x], out[1][x], out[2][x] };
        enum vote vote;

        if (support[x] < LEAST && !is_same(&pixel[x], rgb, surface[x]))
            weight[x] = 0;
        kind[x] = PICTURE_FILLED;
        if (weight[x] < PICTURE_SEEN_WEIGHT || surface[x] == SST_DISP_NONE)
            continue;
        vote = see(g, &pixel[x], rgb, surface[x], support[x]);
        kind[x] = vote == VOTE_WEAK ? PICTURE_UNKNOWN : PICTURE_SEEN;
        for (int c = 0; c < 3; c++)
            out[c][x] = rgb[c];
        count_vote(g, &pixel[x], vote, &cells[x >> CELL_SHIFT]);
    }
}

static int see_band(void *arg, int index, int worker SST_UNUSED)
{
    const struct merge *g = arg;
    struct picture_votes *cells = g->m->level[0] + (size_t)index * (size_t)g->m->cols[0];

    memset(cells, 0, (size_t)g->m->cols[0] * sizeof(*cells));
    for (int y = index * BAND; y < sst_min_int((index + 1) * BAND, g->m->height); y++) {
        if (g->in->behind)
            fill_behind(g, y);
        see_row(g, y, cells);
    }
    return 0;
}

/* --- votes of the neighbourhood ----------------------------------------------------------------------------------- */

static void sum_votes(const struct picture_memory *m, int level)
{
    const int cols = m->cols[level - 1], rows = m->rows[level - 1];
    struct picture_votes *to = m->level[level];

    memset(to, 0, (size_t)m->cols[level] * (size_t)m->rows[level] * sizeof(*to));
    for (int y = 0; y < rows; y++) {
        const struct picture_votes *from = m->level[level - 1] + (size_t)y * (size_t)cols;

        for (int x = 0; x < cols; x++) {
            struct picture_votes *v = &to[(size_t)(y / 2) * (size_t)m->cols[level] + (size_t)(x / 2)];

            v->same = (uint16_t)(v->same + from[x].same);
            v->changed = (uint16_t)(v->changed + from[x].changed);
            v->came = (uint16_t)(v->came + from[x].came);
            v->came_disp += from[x].came_disp;
            v->weak = (uint16_t)(v->weak + from[x].weak);
            v->seen = (uint16_t)(v->seen + from[x].seen);
            v->disp += from[x].disp;
            v->age_ms += from[x].age_ms;
        }
    }
}

/* Do the pixels of a cell that are seen show something else than a pixel holds: have most of them just changed, or do
 * they show a surface at another distance that came after the pixel was last seen? */
static bool shows_other(const struct merge *g, const struct picture_votes *v, const struct picture_pixel *p)
{
    const bool newer = v->age_ms / v->seen < g->now_ms - p->seen_ms;

    return v->changed > v->same || (newer && abs((int)(v->disp / v->seen) - p->disp) > SAME_Q6);
}

/* Do most of the nearest pixels that are seen now contradict what a pixel holds? */
static bool is_contradicted(const struct merge *g, const struct picture_pixel *p, int x, int y)
{
    const struct picture_memory *m = g->m;

    for (int level = 0; level < PICTURE_VOTE_LEVELS; level++) {
        const int col = x >> (CELL_SHIFT + level), row = y >> (CELL_SHIFT + level);
        int seen = 0, other = 0;

        for (int r = sst_max_int(row - 1, 0); r <= sst_min_int(row + 1, m->rows[level] - 1); r++) {
            for (int c = sst_max_int(col - 1, 0); c <= sst_min_int(col + 1, m->cols[level] - 1); c++) {
                const struct picture_votes *v = &m->level[level][(size_t)r * (size_t)m->cols[level] + (size_t)c];

                seen += v->seen;
                other += v->seen && shows_other(g, v, p) ? v->seen : 0;
            }
        }
        if (seen >= VOTERS)
            return 2 * other > seen;
    }
    return false;
}

/* Have most of the nearest pixels that are seen now another surface than before, though few rays say so? */
static bool has_come(const struct picture_memory *m, int x, int y)
{
    const int col = x >> CELL_SHIFT, row = y >> CELL_SHIFT;
    int same = 0, other = 0;

    for (int r = sst_max_int(row - 1, 0); r <= sst_min_int(row + 1, m->rows[0] - 1); r++) {
        for (int c = sst_max_int(col - 1, 0); c <= sst_min_int(col + 1, m->cols[0] - 1); c++) {
            const struct picture_votes *v = &m->level[0][(size_t)r * (size_t)m->cols[0] + (size_t)c];

            same += v->same;
            other += v->changed + v->weak;
        }
    }
    return other > same;
}

/* --- pixels not seen now ------------------------------------------------------------------------------------------ */

/* Has any of some views changed where it would see what the pixel holds? */
static bool views_changed(const struct picture_merge *in, const struct picture_pixel *p, int x, int y)
{
    const double d = sst_disp_px(in->lf, p->disp);

    for (int i = 0; i < in->views; i++) {
        const struct sst_view *v = &in->lf->views[in->view[i]];
        const double px = x - d * v->bx, py = y - d * v->by;

        if (px >= 0 && py >= 0 && px < in->lf->width && py < in->lf->height &&
            in->stamp[in->view[i]][(int)py / in->tile * in->tile_cols + (int)px / in->tile] > in->serial)
            return true;
    }
    return false;
}

/* The reference camera shows a removed surface here, and it is the one in memory. */
static bool is_removed(const struct picture_merge *in, const struct picture_pixel *p, int x, int y)
{
    uint16_t disp;

    if (p->disp > in->cut_q6)
        return true;
    if (!in->lead || !in->lead->disp.data)
        return false;
    disp = sst_map_u16_row(&in->lead->disp, y)[x];
    if (disp == SST_DISP_NONE || abs(disp - p->disp) > SAME_Q6)
        return false;
    return (in->remove_label && in->lead->label.data && sst_map_u8_row(&in->lead->label, y)[x] == in->remove_label) ||
           (in->removed && in->removed->data && sst_map_u8_row(in->removed, y)[x]);
}

/* Pixels that are seldom rendered are seldom seen again. */
static uint32_t lifetime_ms(const struct picture_merge *in, const struct picture_pixel *p, int x, int y)
{
    const struct picture_behind *b = in->behind;
    const int at = b ? y / SST_RENDER_CELL_HEIGHT * b->cols + x / SST_RENDER_CELL_WIDTH : 0;

    if (!is_new(p))
        return LONG_MS;
    return b ? MOVER_MS * (uint32_t)picture_behind_slowness(b, at) : MOVER_MS;
}

/* A pixel that is not seen, and nothing has changed around it: does it keep what it holds? */
static bool stays(const struct merge *g, struct picture_pixel *p, int x, int y)
{
    if (is_removed(g->in, p, x, y))
        return false;
    if (!g->dt_ms || !views_changed(g->in, p, x, y))
        return true;
    p->doubt_ms = (uint16_t)sst_min_int((int)(p->doubt_ms + g->dt_ms), UINT16_MAX);
    return p->doubt_ms < lifetime_ms(g->in, p, x, y);
}

/* A pixel that few rays show otherwise than its memory: something came where most pixels around it have changed, too.
 * Else the rays use the memory up. */
static void decide(const struct merge *g, struct picture_pixel *p, int x, int y)
{
    const struct picture_merge *in = g->in;
    const int support = sst_map_u8_row(in->support, y)[x];
    uint8_t *at[3] = { sst_image_row(in->image, 0, y) + x, sst_image_row(in->image, 1, y) + x,
                       sst_image_row(in->image, 2, y) + x };

    if (has_come(g->m, x, y)) {
        replace(p, (uint8_t[3]){ *at[0], *at[1], *at[2] }, sst_map_u16_row(in->surface, y)[x], support, g->now_ms);
        return;
    }
    p->support = (uint8_t)(p->support - support);
    for (int c = 0; c < 3; c++)
        *at[c] = p->rgb[c];
}

/* Mix the memory of a pixel into it, as far as it lacks weight. */
static void show(const struct picture_merge *in, const struct picture_pixel *p, int x, int y)
{
    uint8_t *weight = sst_map_u8_row(in->weight, y) + x;

    for (int c = 0; c < 3; c++) {
        uint8_t *to = sst_image_row(in->image, c, y) + x;

        *to = (uint8_t)((*to * *weight + p->rgb[c] * (255 - *weight) + 127) / 255);
    }
    *weight = 255;
}

/* The pixels of a finest cell that are not seen. */
static void remember_cell(const struct merge *g, int x0, int y0)
{
    const struct picture_merge *in = g->in;
    const int x1 = sst_min_int(x0 + (1 << CELL_SHIFT), g->m->width), y1 = sst_min_int(y0 + BAND, g->m->height);

    for (int y = y0; y < y1; y++) {
        struct picture_pixel *pixel = g->m->pixel + (size_t)y * (size_t)g->m->width;
        const uint8_t *seen = in->behind && in->behind->late ? sst_map_u8_row(&in->behind->seen, y) : NULL;
        uint8_t *kind = sst_map_u8_row(in->kind, y);

        for (int x = x0; x < x1; x++) {
            if (kind[x] != PICTURE_FILLED) {
                if (kind[x] == PICTURE_UNKNOWN)
                    decide(g, &pixel[x], x, y);
                kind[x] = PICTURE_SEEN;
                continue;
            }
            if (pixel[x].disp == SST_DISP_NONE)
                continue;
            if (seen && seen[x] >= PICTURE_SEEN_WEIGHT &&
                (!is_new(&pixel[x]) || !is_contradicted(g, &pixel[x], x, y))) { /* the next maps tell */
                kind[x] = PICTURE_REMEMBERED;
                show(in, &pixel[x], x, y);
                continue;
            }
            if (is_contradicted(g, &pixel[x], x, y) || !stays(g, &pixel[x], x, y)) {
                pixel[x] = nothing;
            } else {
                kind[x] = PICTURE_REMEMBERED;
                show(in, &pixel[x], x, y);
            }
        }
    }
}

static int remember_band(void *arg, int index, int worker SST_UNUSED)
{
    const struct merge *g = arg;

    for (int x = 0; x < g->m->width; x += 1 << CELL_SHIFT)
        remember_cell(g, x, index * BAND);
    return 0;
}

int picture_memory_merge(struct picture_memory *m, const struct picture_merge *in)
{
    const int bands = (m->height + BAND - 1) / BAND;
    struct merge g = { .m = m, .in = in };
    int err;

    if (!m->started) {
        m->start_ns = m->last_ns = in->t_ns;
        m->started = true;
    }
    g.now_ms = (uint32_t)((in->t_ns - m->start_ns) / 1000000);
    g.dt_ms = (uint32_t)((in->t_ns > m->last_ns ? in->t_ns - m->last_ns : 0) / 1000000);
    m->last_ns = in->t_ns;
    err = sst_parallel_for(bands, in->threads, see_band, &g);
    for (int level = 1; level < PICTURE_VOTE_LEVELS; level++)
        sum_votes(m, level);
    return err ? err : sst_parallel_for(bands, in->threads, remember_band, &g);
}

double picture_memory_age_s(const struct picture_memory *m, int x, int y)
{
    const struct picture_pixel *p = &m->pixel[(size_t)y * (size_t)m->width + (size_t)x];

    return (double)((m->last_ns - m->start_ns) / 1000000 - p->seen_ms) / 1e3;
}

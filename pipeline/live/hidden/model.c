/* Background model of a view: some colours for every cell, of random moments in the last minutes. A leaf that swings
 * shows colours that its place has had before; a person brings new ones. The score of a cell is its difference from the
 * most similar colour, above the cell's background noise level (noise, and leaves between the remembered moments). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/hidden/hidden_internal.h"

#define LEARN_NS INT64_C(500000000) /* between two rounds, each of which renews a colour of one cell in PHASES, ... */
/* ... but of most cells in one round of this many: a standing person must not be learnt before the report */
#define SLOWLY     4
#define BEGIN      240 /* rounds at the beginning, when nothing is known: of all cells */
#define ROUNDS     6   /* at most that many at once, after a pause */
#define PHASES     8
#define BESIDE     3                   /* cells */
#define USUAL_NS   INT64_C(2000000000) /* the usual difference follows by 1/32 in this time */
#define GAIN_STEP  6                   /* cells between samples of brightness */
#define GAIN_BINS  256
#define GAIN_LEAST 24  /* levels of a cell that it is measured on */
#define GAIN_RANGE 4.0 /* more than that: another scene */
#define GAIN_SAME  0.01

static uint32_t mix(uint32_t h)
{
    h ^= h >> 16;
    h *= 0x7FEB352Du;
    h ^= h >> 15;
    h *= 0x846CA68Bu;
    return h ^ (h >> 16);
}

int hidden_model_init(struct hidden_model *m, int width, int height, int step)
{
    int err = sst_image_init(&m->now, width, height);

    for (int i = 0; i < HIDDEN_SLOTS && !err; i++)
        err = sst_image_init(&m->slot[i], width, height);
    err = err ? err : sst_map_u16_init(&m->usual, width, height);
    err = err ? err : sst_map_u8_init(&m->score, width, height);
    m->tile = HIDDEN_TILE / step;
    m->tiles_x = (width + m->tile - 1) / m->tile;
    m->tiles_y = (height + m->tile - 1) / m->tile;
    m->hot = calloc((size_t)m->tiles_x * (size_t)m->tiles_y, 1);
    m->gain = 1;
    return err || m->hot ? err : -ENOMEM;
}

void hidden_model_fini(struct hidden_model *m)
{
    sst_image_fini(&m->now);
    for (int i = 0; i < HIDDEN_SLOTS; i++)
        sst_image_fini(&m->slot[i]);
    sst_map_u16_fini(&m->usual);
    sst_map_u8_fini(&m->score);
    free(m->hot);
    *m = (struct hidden_model){ 0 };
}

/* --- pictures to cells ---------------------------------------------------------------------------------------------
 */

/* Means of 2x2 px. */
static void halve_row(uint8_t *restrict out, const uint8_t *restrict a, const uint8_t *restrict b, int n)
{
    for (int x = 0; x < n; x++)
        out[x] = (uint8_t)((a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1] + 2) >> 2);
}

/* Cells of a rectangle, of step x step px each. */
struct shrunk {
    const struct sst_rect *r;
    int step;
};

/* Means of step x step px, of row y of a rectangle of cells. */
static void shrink_row(struct hidden_model *m, const struct sst_image *in, int channel, int y,
                       const struct shrunk *part)
{
    uint8_t *out = sst_image_row(&m->now, channel, y);
    const int x1 = part->r->x1, step = part->step;
    int x0 = part->r->x0;

    if (step == 1) {
        memcpy(out + x0, sst_image_row(in, channel, y) + x0, (size_t)(x1 - x0));
        return;
    }
    if (step == 2) {
        const uint8_t *low = sst_image_row(in, channel, sst_min_int(2 * y + 1, in->height - 1));
        const int whole = sst_min_int(x1, in->width / 2);

        halve_row(out + x0, sst_image_row(in, channel, 2 * y) + 2 * (size_t)x0, low + 2 * (size_t)x0, whole - x0);
        x0 = whole; /* half a cell is left of an odd width */
    }
    for (int x = x0; x < x1; x++) {
        int sum = step * step / 2;

        for (int v = 0; v < step; v++) {
            const uint8_t *row = sst_image_row(in, channel, sst_min_int(y * step + v, in->height - 1));

            for (int u = 0; u < step; u++)
                sum += row[sst_min_int(x * step + u, in->width - 1)];
        }
        out[x] = (uint8_t)(sum / (step * step));
    }
}

static void shrink(struct hidden_model *m, const struct sst_image *image, const struct sst_rect *r, int step)
{
    const struct shrunk part = { r, step };

    for (int c = 0; c < 3; c++)
        for (int y = r->y0; y < r->y1; y++)
            shrink_row(m, image, c, y, &part);
}

/* Brightness of the changed tiles against a remembered colour: the median of the ratios of single cells. */
static double measure_gain(const struct hidden_model *m, const uint8_t *changed)
{
    int count[GAIN_BINS] = { 0 }, all = 0, sum = 0;

    for (int y = GAIN_STEP / 2; y < m->now.height; y += GAIN_STEP) {
        for (int x = GAIN_STEP / 2; x < m->now.width; x += GAIN_STEP) {
            const int slot = (int)(mix((uint32_t)(y * 1024 + x)) % HIDDEN_SLOTS);
            const int was = sst_image_row(&m->slot[slot], 1, y)[x], is = sst_image_row(&m->now, 1, y)[x];

            if ((changed && !changed[y / m->tile * m->tiles_x + x / m->tile]) || was < GAIN_LEAST || was > 250 ||
                is > 250)
                continue;
            count[sst_min_int(is * 64 / was, GAIN_BINS - 1)]++;
            all++;
        }
    }
    if (all < 64)
        return 1;
    for (int i = 0; i < GAIN_BINS; i++) {
        if (2 * (sum + count[i]) > all)
            return (i + (all / 2.0 - sum) / count[i]) / 64;
        sum += count[i];
    }
    return GAIN_RANGE;
}

static void scale(struct hidden_model *m, const struct sst_rect *r, double gain)
{
    uint8_t level[256];

    for (int i = 0; i < 256; i++)
        level[i] = (uint8_t)sst_min_int((int)(i / gain + 0.5), 255);
    for (int c = 0; c < 3; c++) {
        for (int y = r->y0; y < r->y1; y++) {
            uint8_t *row = sst_image_row(&m->now, c, y);

            for (int x = r->x0; x < r->x1; x++)
                row[x] = level[row[x]];
        }
    }
}

/* --- differences ----------------------------------------------------------------------------------------------------
 */

/* Scores of a rectangle of cells, a run of tiles of which `tile` is the first. */
static void compare(struct hidden_model *m, int tile, const struct sst_rect *r, bool learns)
{
    const struct sst_kernels *kernels = sst_kernels_get();
    const int tiles = (r->x1 - r->x0 + m->tile - 1) / m->tile;

    memset(m->hot + tile, 0, (size_t)tiles);
    for (int y = r->y0; y < r->y1; y++) {
        uint8_t *score = sst_map_u8_row(&m->score, y) + r->x0;
        struct sst_score_cells c;

        for (int k = 0; k < 3; k++) {
            c.now[k] = sst_image_row(&m->now, k, y) + r->x0;
            for (int i = 0; i < HIDDEN_SLOTS; i++)
                c.slot[i][k] = sst_image_row(&m->slot[i], k, y) + r->x0;
        }
        kernels->cell_score(score, sst_map_u16_row(&m->usual, y) + r->x0, &c, learns, (size_t)(r->x1 - r->x0));
        for (int i = 0; i < tiles; i++) {
            const int x1 = sst_min_int((i + 1) * m->tile, r->x1 - r->x0);
            uint8_t any = 0;

            for (int x = i * m->tile; x < x1; x++)
                any |= score[x];
            m->hot[tile + i] |= any;
        }
    }
}

/* --- learning -------------------------------------------------------------------------------------------------------
 */

static bool is_in(int x, int y, const struct sst_rect *rect, int rects)
{
    for (int i = 0; i < rects; i++)
        if (x >= rect[i].x0 && x < rect[i].x1 && y >= rect[i].y0 && y < rect[i].y1)
            return true;
    return false;
}

bool hidden_overlaps(const struct sst_rect *r, const struct sst_rect *keep, int keeps)
{
    for (int i = 0; i < keeps; i++)
        if (r->x0 < keep[i].x1 && keep[i].x0 < r->x1 && r->y0 < keep[i].y1 && keep[i].y0 < r->y1)
            return true;
    return false;
}

/* Renew one colour of every PHASES-th cell: lifetimes of a colour are exponential, so some are minutes old. In about
 * every second row the colour comes from a cell beside it, which a leaf may swing to. */
static void learn(struct hidden_model *m, const struct hidden_rects *r)
{
    const int phase = (int)(m->rounds % PHASES), width = m->now.width, height = m->now.height;
    const uint32_t cycle = m->rounds / PHASES;

    for (int y = 0; y < height; y++) {
        const uint32_t random = mix(m->rounds * 4096u + (uint32_t)y), beside = random >> 24 & 1;
        const struct sst_image *slot = &m->slot[random % HIDDEN_SLOTS];
        const int dx = beside ? (int)(random >> 8 & 0xFF) % (2 * BESIDE + 1) - BESIDE : 0;
        const int dy = beside ? (int)(random >> 16 & 0xFF) % (2 * BESIDE + 1) - BESIDE : 0;
        const int from = sst_clamp_int(y + dy, 0, height - 1);

        for (int x = (phase + 3 * y) % PHASES; x < width; x += PHASES) {
            if (m->rounds >= BEGIN && ((uint32_t)(x / PHASES + y) + cycle) % SLOWLY && !is_in(x, y, r->wake, r->wakes))
                continue;
            if (r->keeps && is_in(x, y, r->keep, r->keeps))
                continue;
            for (int c = 0; c < 3; c++)
                sst_image_row(slot, c, y)[x] = sst_image_row(&m->now, c, from)[sst_clamp_int(x + dx, 0, width - 1)];
        }
    }
    m->rounds++;
}

static void fill(struct hidden_model *m)
{
    for (int i = 0; i < HIDDEN_SLOTS; i++)
        for (int c = 0; c < 3; c++)
            memcpy(m->slot[i].plane[c], m->now.plane[c], m->now.stride * (size_t)m->now.height);
    for (int y = 0; y < m->usual.height; y++) {
        for (int x = 0; x < m->usual.width; x++)
            sst_map_u16_row(&m->usual, y)[x] = 16 * 256;
        memset(sst_map_u8_row(&m->score, y), 0, (size_t)m->score.width);
    }
    m->filled = true;
    m->gain = 1;
    m->rounds = 0;
}

/* --- a set ----------------------------------------------------------------------------------------------------------
 */

static struct sst_rect tile_rect(const struct hidden_model *m, int tile)
{
    const int x = tile % m->tiles_x * m->tile, y = tile / m->tiles_x * m->tile;

    return (struct sst_rect){ x, y, sst_min_int(x + m->tile, m->now.width), sst_min_int(y + m->tile, m->now.height) };
}

/* Read the changed tiles. Brightness is measured where most tiles changed, as light changes them all. */
static void read_tiles(struct hidden_model *m, const struct sst_image *image, const uint8_t *changed, int step)
{
    const int tiles = m->tiles_x * m->tiles_y;
    int read = 0;

    for (int i = 0, end; i < tiles; i = end) {
        struct sst_rect r = tile_rect(m, i);

        for (end = i; (end == i || end % m->tiles_x) && (!changed || changed[end] || !m->filled); end++)
            r.x1 = tile_rect(m, end).x1;
        if (end > i)
            shrink(m, image, &r, step);
        read += end - i;
        end = sst_max_int(end, i + 1);
    }
    if (!m->filled) {
        fill(m);
        return;
    }
    if (2 * read >= tiles) {
        const double gain = measure_gain(m, changed);

        if (gain >= GAIN_RANGE || gain <= 1 / GAIN_RANGE) {
            const struct sst_rect all = { 0, 0, m->now.width, m->now.height };

            shrink(m, image, &all, step);
            fill(m);
            return;
        }
        m->gain = fabs(gain - 1) < GAIN_SAME ? 1 : gain;
    }
    for (int i = 0; i < tiles && (m->gain < 1 || m->gain > 1); i++) {
        const struct sst_rect r = tile_rect(m, i);

        if (!changed || changed[i])
            scale(m, &r, m->gain);
    }
}

void hidden_model_update(struct hidden_model *m, const struct hidden_picture *picture, int64_t t_ns,
                         const struct hidden_rects *rects)
{
    const uint8_t *changed = picture->changed;
    const bool usual = m->rounds < BEGIN || t_ns - m->usual_ns >= USUAL_NS || t_ns < m->usual_ns;
    const int tiles = m->tiles_x * m->tiles_y;

    if (!m->filled || !changed || memchr(changed, 1, (size_t)tiles))
        read_tiles(m, picture->image, changed, picture->step);
    for (int i = 0, end; i < tiles; i = end) {
        struct sst_rect r = tile_rect(m, i), next = r;
        const bool learns = usual && !hidden_overlaps(&r, rects->keep, rects->keeps);

        end = i + 1;
        if (changed && !changed[i] && !m->hot[i])
            continue;
        for (; end % m->tiles_x && (!changed || changed[end] || m->hot[end]); end++) {
            next = tile_rect(m, end);
            if (learns != (usual && !hidden_overlaps(&next, rects->keep, rects->keeps)))
                break;
            r.x1 = next.x1;
        }
        compare(m, i, &r, learns);
    }
    if (usual)
        m->usual_ns = t_ns;
    m->learnt_ns = m->learnt_ns && t_ns - m->learnt_ns < ROUNDS * LEARN_NS ? m->learnt_ns : t_ns - LEARN_NS;
    for (; t_ns - m->learnt_ns >= LEARN_NS; m->learnt_ns += LEARN_NS)
        learn(m, rects);
}

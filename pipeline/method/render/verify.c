/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/render/verify.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/kernels/verify_ref.h"
#include "pipeline/method/render/render_internal.h"

#define AGREED_GAIN  24  /* in sst_render_plan.agreed, so that its 8 bits cover what occurs */
#define FRONT_SIGMAS 0.5 /* in front: nearer than the focus by this many sigma_d */
/* Votes for a colour are sums in 16 bits. */
#define ALL_VOTES (65535 / (SST_AGREE_MODE / 2))
/* Cells that are processed together; rows hold a pixel on both sides, in whole blocks of 64. */
#define RUN_CELLS 5
#define STRIDE    ((RUN_CELLS + 1) * SST_RENDER_CELL_WIDTH)
_Static_assert(STRIDE <= SST_BLEND_MAX && STRIDE % 64 == 0, "a run is one call of the kernels");

#define RARITY_GAIN  15.0
#define RARITY_FLOOR 0.02
#define SIDE         16 /* bins of a colour */
_Static_assert(SIDE *SIDE *SIDE == SST_AGREE_BINS, "4 bits a colour");

/* --- how rare colours are ----------------------------------------------------------------------------------------- */

static int64_t count_colours(float *count, const struct sst_view *v, int step)
{
    int64_t n = 0;

    for (int y = step / 2; y < v->image.height; y += step) {
        const uint8_t *r = sst_image_row(&v->image, 0, y), *g = sst_image_row(&v->image, 1, y);
        const uint8_t *b = sst_image_row(&v->image, 2, y);
        const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, y) : NULL;

        for (int x = step / 2; x < v->image.width; x += step) {
            if (valid && !valid[x])
                continue;
            count[(r[x] >> 4) << 8 | (g[x] >> 4) << 4 | b[x] >> 4] += 1;
            n++;
        }
    }
    return n;
}

/* (1 2 1) / 4 along one colour; the ends repeat. */
static void smooth(float *to, const float *from, int stride)
{
    for (int i = 0; i < SST_AGREE_BINS; i++) {
        const int at = i / stride % SIDE;
        const float before = from[at > 0 ? i - stride : i], after = from[at < SIDE - 1 ? i + stride : i];

        to[i] = 0.25f * (before + after) + 0.5f * from[i];
    }
}

void sst_rarity_count(uint8_t *rarity, const struct sst_lightfield *lf, const int *view, int views, int step)
{
    const double most = log(1 + RARITY_GAIN / RARITY_FLOOR);
    float count[SST_AGREE_BINS] = { 0 }, other[SST_AGREE_BINS];
    int64_t n = 0;

    for (int i = 0; i < views; i++) {
        if (lf->views[view[i]].image.plane[0])
            n += count_colours(count, &lf->views[view[i]], step);
    }
    smooth(other, count, 1);
    smooth(count, other, SIDE);
    smooth(other, count, SIDE * SIDE);
    for (int i = 0; i < SST_AGREE_BINS; i++) {
        const double share = n ? (double)other[i] * SST_AGREE_BINS / (double)n : 0;

        rarity[i] = (uint8_t)(255 * log(1 + RARITY_GAIN / (share + RARITY_FLOOR)) / most + 0.5);
    }
}

bool sst_rarity_differs(const uint8_t *was, const uint8_t *is, double tolerance)
{
    const double most = log(1 + RARITY_GAIN / RARITY_FLOOR);
    double off = 0, sum = 0;

    for (int i = 0; i < SST_AGREE_BINS; i++) {
        const double share = RARITY_GAIN / expm1(fmax(is[i], 0.5) / 255 * most) - RARITY_FLOOR;

        off += share * abs(is[i] - was[i]);
        sum += share * is[i];
    }
    return off > tolerance * sum;
}

/* --- memory ------------------------------------------------------------------------------------------------------- */

/* A row of all rays; a ring of three, by y modulo 3. */
struct row {
    uint8_t *colour; /* [views][3][STRIDE]; undefined where there is no ray */
    uint8_t *vote;   /* [views][STRIDE] 0: no ray */
    uint16_t *near;  /* [views][STRIDE] */
    float total[STRIDE];
    float unexplained[STRIDE]; /* unexplained rays that end in front, by aperture */
};

struct sst_verifier {
    size_t views;
    float all; /* their apertures */
    uint8_t *memory;
    struct row row[3];
    uint8_t mode[3][STRIDE];
    float weight[STRIDE];
    uint8_t needed[STRIDE]; /* pixels of the row that decide about a pixel left to votes */
    /* of the row of cells */
    float share[SST_RENDER_CELL_HEIGHT][SST_BLEND_MAX]; /* fraction left to votes by the maps */
};

int sst_verifier_create(struct sst_verifier **out, const struct sst_render_plan *p)
{
    const size_t n = (size_t)p->count * STRIDE;
    struct sst_verifier *v = calloc(1, sizeof(*v));

    if (!v)
        return -ENOMEM;
    v->views = (size_t)p->count;
    v->all = p->numbers.all;
    v->memory = sst_mem_alloc(3 * 6 * n, 1);
    if (!v->memory) {
        free(v);
        return -ENOMEM;
    }
    for (size_t i = 0; i < 3; i++) {
        v->row[i].near = (uint16_t *)(void *)(v->memory + i * 6 * n);
        v->row[i].colour = v->memory + i * 6 * n + 2 * n;
        v->row[i].vote = v->memory + i * 6 * n + 5 * n;
    }
    *out = v;
    return 0;
}

void sst_verifier_destroy(struct sst_verifier *v)
{
    if (!v)
        return;
    sst_mem_free(v->memory);
    free(v);
}

/* --- fraction left to votes --------------------------------------------------------------------------------------- */

/* Sums over the rays of a pixel, weighted by aperture. */
struct rays {
    float there; /* all */
    float front; /* that end in front of the focus, or have no disparity */
};

/* The largest stored disparity that does not end in front of the focus, by `sigmas` sigma_d. */
static int front_of(const struct sst_render_plan *p, double sigmas)
{
    const double limit_px = p->cfg.focus_px + sigmas * p->cfg.sigma_px;

    return (int)sst_clamp_double((limit_px - p->lf->disp_min_px) * SST_DISP_SCALE, -1, SST_DISP_NONE - 1);
}

/* Rays of a row of one cell. */
static void count_rays(struct rays *rays, const struct sst_render_plan *p, int x, int to, int y)
{
    const int nearest = front_of(p, FRONT_SIGMAS);

    memset(rays, 0, SST_RENDER_CELL_WIDTH * sizeof(*rays));
    for (int k = 0; k < p->count; k++) {
        const struct sst_render_tap *t = &p->tap[k];
        const int from = sst_max_int(x, t->x0), n = sst_min_int(to, t->x1) - from;
        const float aperture = (float)t->aperture;
        const uint16_t *disp;

        if (n <= 0 || y < t->y0 || y >= t->y1)
            continue;
        disp = sst_map_u16_row(&t->v->disp, y + t->ny) + from + t->nx;
        for (int i = 0; i < n; i++) {
            rays[from - x + i].there += aperture;
            rays[from - x + i].front += disp[i] > nearest ? aperture : 0;
        }
    }
}

struct sst_verify_numbers sst_verify_numbers(const struct sst_render_plan *p)
{
    const float most = (float)sst_min_int(ALL_VOTES / p->count, 255);
    struct sst_verify_numbers n = { 0, most / (255 * (1 + SST_VERIFY_DOUBT)), most, front_of(p, FRONT_SIGMAS),
                                    front_of(p, SST_END_SIGMAS) };

    for (int k = 0; k < p->count; k++)
        n.all += (float)p->tap[k].aperture;
    return n;
}

double sst_verify_open(const struct sst_render_plan *p, const struct sst_ray *ray, int count)
{
    const double limit_px = p->cfg.focus_px + FRONT_SIGMAS * p->cfg.sigma_px;
    struct rays rays = { 0, 0 };
    float assigned = 0;

    for (int i = 0; i < count; i++) {
        const float aperture = (float)ray[i].aperture;

        rays.there += aperture;
        rays.front += islessequal(ray[i].disp_px, limit_px) ? 0 : aperture;
        assigned += aperture * (float)(ray[i].w_depth * ray[i].w_label);
    }
    return (double)sst_verify_share(rays.there, rays.front, assigned);
}

/* True if more than SST_VERIFY_UNEXPLAINED_LOW of the rays of output pixel (x, y) are unexplained. */
static bool contradicted(const struct sst_verifier *v, const struct sst_render_plan *p, int x, int y)
{
    const int nearest = front_of(p, SST_END_SIGMAS);
    float unexplained = 0;

    for (int k = 0; k < p->count; k++) {
        const struct sst_render_tap *t = &p->tap[k];
        uint16_t disp;

        if (x < t->x0 || x >= t->x1 || y < t->y0 || y >= t->y1)
            continue;
        disp = sst_map_u16_row(&t->v->disp, y + t->ny)[x + t->nx];
        if (disp > nearest && (disp == SST_DISP_NONE || explainer_contradicts(p->explainer, k, x + t->nx, y + t->ny)))
            unexplained += (float)t->aperture;
    }
    return unexplained > SST_VERIFY_UNEXPLAINED_LOW * v->all;
}

/* True if a sample of the pixels left to votes finds enough for which that is so. */
static bool screen_cell(const struct sst_verifier *v, const struct sst_render_plan *p, int left, int x, int to, int y,
                        int end)
{
    int found = 0, n = 0;

    if (explainer_prepare(p->explainer))
        return false; /* no memory: as without verification */
    for (int row = y + SST_VERIFY_SCREEN_STEP / 2; row < end; row += SST_VERIFY_SCREEN_STEP) {
        for (int i = x + SST_VERIFY_SCREEN_STEP / 2; i < to; i += SST_VERIFY_SCREEN_STEP) {
            if (v->share[row - y][i - left] > 0) {
                found += contradicted(v, p, i, row);
                n++;
            }
        }
    }
    return SST_VERIFY_SCREEN_SHARE * found > n;
}

/* Compute the fractions left to votes in a cell. @return true if any is above 0 and the cell is worth the time */
static bool open_cell(struct sst_verifier *v, const struct sst_render_plan *p, float (*weight)[SST_BLEND_MAX], int left,
                      int x, int to, int y, int end)
{
    struct rays rays[SST_RENDER_CELL_WIDTH];
    float least = INFINITY;
    bool open = false;

    for (int row = y; row < end; row++) {
        for (int i = x; i < to; i++)
            least = fminf(least, weight[row - y][i - left]);
    }
    if (!(least < SST_VERIFY_ENOUGH * v->all))
        return false;
    for (int row = y; row < end; row++) {
        count_rays(rays, p, x, to, row);
        for (int i = x; i < to; i++) {
            const float share = sst_verify_share(rays[i - x].there, rays[i - x].front, weight[row - y][i - left]);

            v->share[row - y][i - left] = share;
            open = open || share > 0;
        }
    }
    return open && (!p->explainer || screen_cell(v, p, left, x, to, y, end));
}

/* --- votes -------------------------------------------------------------------------------------------------------- */

/* Add the doubt that follows from the maps' confidence to the weights of a tap's rays, output pixels x .. x+n-1 of row
 * y.
 * @return false: the view has no confidences, and nothing was added */
static bool add_doubt(float *weight, const struct sst_render_tap *t, int x, int n, int y)
{
    const float aperture = (float)t->aperture;
    const int from = sst_max_int(x, t->x0), to = sst_min_int(x + n, t->x1);
    const uint8_t *confidence;

    if (!t->v->confidence.data)
        return false;
    if (from >= to || y < t->y0 || y >= t->y1)
        return true;
    confidence = sst_map_u8_row(&t->v->confidence, y + t->ny) + from + t->nx;
    for (int i = 0; i < to - from; i++) {
        float *w = &weight[from - x + i];

        *w = *w < 0 ? *w : sst_verify_doubt(*w, aperture, confidence[i]);
    }
    return true;
}

/* Mark the pixels of a row within 3x3 pixels of one left to votes, in columns x .. to-1 of rows y .. end-1; the first
 * mark is that of column x-1. */
static void mark_needed(struct sst_verifier *v, int left, int x, int to, int row, int y, int end)
{
    memset(v->needed, 0, sizeof(v->needed));
    for (int near = sst_max_int(row - 1, y); near <= sst_min_int(row + 1, end - 1); near++) {
        for (int i = x; i < to; i++) {
            if (v->share[near - y][i - left] > 0)
                memset(v->needed + (i - x), 1, 3);
        }
    }
}

/* Count the unexplained rays of a tap that end in front, output pixels x .. x+n-1 of row y. */
static void count_unexplained(struct sst_verifier *v, struct row *r, const struct sst_render_plan *p, int k, int x,
                              int n, int y)
{
    const struct sst_render_tap *t = &p->tap[k];
    const int from = sst_max_int(x, t->x0), to = sst_min_int(x + n, t->x1), nearest = front_of(p, SST_END_SIGMAS);
    const uint16_t *disp;

    if (from >= to || y < t->y0 || y >= t->y1)
        return;
    disp = sst_map_u16_row(&t->v->disp, y + t->ny) + t->nx;
    for (int i = from; i < to; i++) {
        if (v->weight[i - x] < 0 || disp[i] <= nearest || !v->needed[i - x])
            continue;
        if (disp[i] == SST_DISP_NONE || explainer_contradicts(p->explainer, k, i + t->nx, y + t->ny))
            r->unexplained[i - x] += (float)t->aperture;
    }
}

/* Votes of row y, columns x .. to-1, which may lie a pixel outside the picture, and the similarity of each ray to the
 * colour with most votes. */
static void vote_row(struct sst_verifier *v, const struct sst_render_plan *p, int x, int to, int y)
{
    const struct sst_kernels *kernels = sst_kernels_get();
    struct row *r = &v->row[(y + 3) % 3]; /* the row above the picture is a row without rays */
    uint8_t *const mode[3] = { v->mode[0], v->mode[1], v->mode[2] };
    const size_t n = (size_t)(to - x), stride = (n + 63) / 64 * 64;

    memset(r->total, 0, sizeof(r->total));
    memset(r->unexplained, 0, sizeof(r->unexplained));
    for (size_t k = 0; k < v->views; k++) {
        const struct sst_render_tap *t = &p->tap[k];
        struct sst_voting voting = { p->rarity, 0, p->numbers.scale, p->numbers.most };
        uint8_t *colour = r->colour + k * 3 * stride, *vote = r->vote + k * stride;
        const struct sst_render_samples take = { { colour, colour + stride, colour + 2 * stride }, v->weight };

        for (size_t i = 0; i < stride; i++)
            v->weight[i] = -1;
        sst_render_plan_sample(&take, p, t, x, (int)n, y);
        if (p->explainer)
            count_unexplained(v, r, p, (int)k, x, (int)n, y);
        if (!add_doubt(v->weight, t, x, (int)n, y))
            voting.doubt = SST_VERIFY_DOUBT * (float)t->aperture;
        kernels->agree_votes(vote, (const uint8_t *const *)take.colour, v->weight, &voting, stride);
        for (size_t i = 0; i < n; i++)
            r->total[i] += vote[i];
    }
    kernels->agree_mode(mode, r->colour, r->vote, v->views, SST_VERIFY_CANDIDATES, stride);
    for (size_t k = 0; k < v->views; k++) {
        const uint8_t *colour = r->colour + k * 3 * stride;
        const uint8_t *const planes[3] = { colour, colour + stride, colour + 2 * stride };

        kernels->agree_near(r->near + k * stride, planes, (const uint8_t *const *)mode, r->vote + k * stride, stride);
    }
}

/* A pixel that the votes replaced shows what this share of all possible votes agrees on: rays of a common colour, as of
 * leaves, have fewer votes than those of a rare one. */
static void note_agreed(struct sst_map_u8 *agreed, int x, int y, float agree, float by)
{
    uint8_t *to = sst_map_u8_row(agreed, y) + x;

    if (by > 0.5F)
        *to = (uint8_t)(255 * fminf(agree, 1) + 0.5F);
}

/* Apply the votes to n pixels from x on of row y, using the rows above and below. */
static void finish_row(const struct sst_verifier *v, const struct sst_render_plan *p, const float *share, int x, int n,
                       int y, size_t stride, struct sst_image *out)
{
    const struct row *const rows[3] = { &v->row[(y + 2) % 3], &v->row[y % 3], &v->row[(y + 1) % 3] };
    float sums[4][STRIDE] = { { 0 } };
    float *const acc[4] = { sums[0], sums[1], sums[2], sums[3] };
    const float most = 9 * (float)p->count * p->numbers.most;

    for (size_t k = 0; k < v->views; k++) {
        const uint16_t *const near[3] = { rows[0]->near + k * stride, rows[1]->near + k * stride,
                                          rows[2]->near + k * stride };
        const uint8_t *colour = rows[1]->colour + k * 3 * stride + 1;
        const uint8_t *const planes[3] = { colour, colour + stride, colour + 2 * stride };

        sst_kernels_get()->agree_sum(acc, near, planes, rows[1]->vote + k * stride + 1, (size_t)n);
    }
    for (int i = 0; i < n; i++) {
        float total, by;

        if (!(share[i] > 0) || !(sums[3][i] > 0))
            continue;
        total = sst_verify_sum3(rows[0]->total + i, rows[1]->total + i, rows[2]->total + i);
        by = share[i] *
             sst_verify_ramp(sums[3][i] / (SST_AGREE_NEAR * total), SST_VERIFY_AGREE_LOW, SST_VERIFY_AGREE_HIGH);
        if (p->explainer) {
            const float open =
                sst_verify_sum3(rows[0]->unexplained + i, rows[1]->unexplained + i, rows[2]->unexplained + i);

            by *= sst_verify_ramp(open / (9 * v->all), SST_VERIFY_UNEXPLAINED_LOW, SST_VERIFY_UNEXPLAINED_HIGH);
        }
        if (p->agreed)
            note_agreed(p->agreed, x + i, y, AGREED_GAIN * sums[3][i] / (SST_AGREE_NEAR * most), by);
        for (int c = 0; c < 3; c++) {
            uint8_t *at = sst_image_row(out, c, y) + x + i;

            *at = sst_verify_mix(p->votes_only ? 1 : by, sums[c][i], sums[3][i], *at);
        }
    }
}

/* What the maps alone assign to the focus, before votes. */
static void note_assigned(const struct sst_verifier *v, struct sst_map_u8 *agreed, float (*weight)[SST_BLEND_MAX],
                          int x, int to, int y, int end)
{
    for (int row = y; row < end; row++) {
        for (int i = x; i < to; i++)
            sst_map_u8_row(agreed, row)[i] = (uint8_t)(255 * fminf(weight[row - y][i - x] / v->all, 1) + 0.5F);
    }
}

void sst_verify(struct sst_verifier *v, const struct sst_render_plan *p, float (*weight)[SST_BLEND_MAX], int x, int to,
                int y, int end, struct sst_image *out)
{
    const int left = x;

    if (p->agreed)
        note_assigned(v, p->agreed, weight, x, to, y, end);
    while (x < to) {
        int next, cells = 0;

        for (next = x; next < to && cells < RUN_CELLS; cells++, next = sst_min_int(next + SST_RENDER_CELL_WIDTH, to)) {
            if (!open_cell(v, p, weight, left, next, sst_min_int(next + SST_RENDER_CELL_WIDTH, to), y, end))
                break;
        }
        if (!cells) {
            x = sst_min_int(x + SST_RENDER_CELL_WIDTH, to);
            continue;
        }
        for (int row = y - 1; row <= end; row++) {
            mark_needed(v, left, x, next, row, y, end);
            vote_row(v, p, x - 1, next + 1, row);
            if (row > y)
                finish_row(v, p, v->share[row - 1 - y] + x - left, x, next - x, row - 1,
                           ((size_t)(next - x) + 2 + 63) / 64 * 64, out);
        }
        x = next;
    }
}

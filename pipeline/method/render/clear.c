#include "pipeline/method/render/render_internal.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"

#define TOLERANCE_Q6 48    /* 0.75 px: rays of one surface */
#define LEAST_VIEWS  2     /* that confirm a surface, ... */
#define LEAST_SHARE  4     /* ... and one in this many of the rays that arrive */
#define ENOUGH       16    /* rays of full weight for one pixel: the nearest views are the sharpest */
#define RIM_WEIGHT   0.02F /* of a ray next to something removed */
#define COLOUR_STEPS 2     /* of the robust mean: deviations with half the weight, levels per channel */
static const float half_weight[COLOUR_STEPS] = { 20, 10 };
#define ALIKE      4  /* levels: all weights would be at least 0.97 */
#define OWN_LEVELS 10 /* the viewpoint's own camera counts up to this deviation, and fades out up to twice as much */

/* What a view's pixel is. */
enum state { REMOVED = 0, RIM = 1, KEPT = 2 }; /* removed, or nothing is known; next to something removed; neither */

/* Pixels that a ray moves by on its way to the viewpoint. */
struct shift {
    int32_t dx, dy;
};

struct clear_view {
    const struct sst_render_tap *tap;
    float bx, by;     /* offset from the viewpoint */
    uint8_t *state;   /* [height][width] enum state */
    uint16_t *landed; /* [height][width] of the picture: stored disparity + 1 of the nearest ray; 0: none */
};

/* Working memory of one thread. */
struct scratch {
    struct shift *shift;             /* [bins] */
    uint8_t *row[3];                 /* [width + 2] removed pixels of three rows, in a ring */
    uint16_t *top, *arrived, *count; /* [width] nearest ray; rays that arrive; those of its surface */
    uint32_t *sum;                   /* [width] of their landed values */
};

struct clear {
    const struct sst_lightfield *lf;
    const struct sst_render_config *cfg;
    int width, height, bins, cut_q6; /* bins: stored disparities are below; cut: those above are removed */
    int count;
    struct clear_view view[SST_MAX_VIEWS]; /* nearest to the viewpoint first */
    struct scratch *scratch;               /* [threads] */
    struct sst_image *out;
    struct sst_map_u8 weight; /* of the picture's pixels: 255 is enough */
    struct sst_renderer *renderer;
    struct sst_mem_kept maps; /* state and landed of all views: the renderer's, from one picture to the next */
    void *rows;               /* owned: scratch */
};

/* --- rays of one view --------------------------------------------------------------------------------------------- */

/* Mark the pixels of a row that stand in front or are outside the rectified view. */
static void mark_removed(const struct clear *c, const struct clear_view *v, uint8_t *removed, int y)
{
    const struct sst_view *view = v->tap->v;
    const uint16_t *restrict disp = sst_map_u16_row(&view->disp, y);
    const struct sst_map_u8 *mask = c->cfg->remove ? &c->cfg->remove[v->tap->view] : NULL;
    const int w = c->width;

    for (int x = 0; x < w; x++)
        removed[x] = (disp[x] > c->cut_q6) & (disp[x] != SST_DISP_NONE);
    for (int x = 0; x < w && mask && mask->data; x++)
        removed[x] |= sst_map_u8_row(mask, y)[x] != 0;
    for (int x = 0; x < w && c->cfg->remove_label && view->label.data; x++)
        removed[x] |= sst_map_u8_row(&view->label, y)[x] == c->cfg->remove_label;
    for (int x = 0; x < w && view->valid.data; x++)
        removed[x] |= !sst_map_u8_row(&view->valid, y)[x];
}

static void set_states(const struct clear *c, const struct clear_view *v, const struct scratch *s)
{
    const int w = c->width;

    for (int i = 0; i < 3; i++)
        memset(s->row[i], 0, (size_t)w + 2);
    mark_removed(c, v, s->row[0] + 1, 0);
    for (int y = 0; y < c->height; y++) {
        const uint8_t *restrict above = s->row[(y + 2) % 3] + 1, *restrict at = s->row[y % 3] + 1;
        uint8_t *restrict below = s->row[(y + 1) % 3] + 1, *restrict state = v->state + (size_t)y * (size_t)w;
        const uint16_t *restrict disp = sst_map_u16_row(&v->tap->v->disp, y);

        if (y + 1 < c->height)
            mark_removed(c, v, below, y + 1);
        else
            memset(below, 0, (size_t)w);
        for (int x = 0; x < w; x++) {
            const int near =
                above[x - 1] | above[x] | above[x + 1] | at[x - 1] | at[x + 1] | below[x - 1] | below[x] | below[x + 1];

            state[x] = (uint8_t)(at[x] | (disp[x] >= c->bins) ? REMOVED : near ? RIM : KEPT);
        }
    }
}

static void set_shifts(const struct clear *c, const struct clear_view *v, struct shift *shift)
{
    for (int q = 0; q < c->bins; q++) {
        const double d = sst_disp_px(c->lf, (uint16_t)q);

        shift[q] = (struct shift){ (int32_t)floor(d * (double)v->bx + 0.5), (int32_t)floor(d * (double)v->by + 0.5) };
    }
}

/* All rays of one view go to the viewpoint; the nearest one at each pixel stays. */
static int land_view(void *arg, int index, int worker)
{
    const struct clear *c = arg;
    const struct clear_view *v = &c->view[index];
    const struct scratch *s = &c->scratch[worker];
    const unsigned w = (unsigned)c->width, h = (unsigned)c->height;

    set_states(c, v, s);
    set_shifts(c, v, s->shift);
    memset(v->landed, 0, (size_t)w * h * sizeof(*v->landed));
    for (unsigned y = 0; y < h; y++) {
        const uint16_t *disp = sst_map_u16_row(&v->tap->v->disp, (int)y);
        const uint8_t *state = v->state + (size_t)y * w;

        for (unsigned x = 0; x < w; x++) {
            struct shift by;
            unsigned tx, ty;

            if (!state[x])
                continue;
            by = s->shift[disp[x]];
            tx = x + (unsigned)by.dx;
            ty = y + (unsigned)by.dy;
            if (tx < w && ty < h) {
                uint16_t *to = &v->landed[(size_t)ty * w + tx];

                if (*to <= disp[x])
                    *to = (uint16_t)(disp[x] + 1);
            }
        }
    }
    return 0;
}

/* --- surface ------------------------------------------------------------------------------------------------------ */

static int needed(int arrived)
{
    return sst_max_int(LEAST_VIEWS, (arrived + LEAST_SHARE - 1) / LEAST_SHARE);
}

/* The nearest surface of every pixel of a row, without asking whether enough views confirm it. */
static void find_nearest(const struct clear *c, const struct scratch *s, int y)
{
    const size_t w = (size_t)c->width;
    uint16_t *restrict top = s->top, *restrict arrived = s->arrived, *restrict count = s->count;
    uint32_t *restrict sum = s->sum;

    memset(top, 0, w * sizeof(*top));
    memset(arrived, 0, w * sizeof(*arrived));
    memset(count, 0, w * sizeof(*count));
    memset(sum, 0, w * sizeof(*sum));
    for (int k = 0; k < c->count; k++) {
        const uint16_t *restrict landed = c->view[k].landed + (size_t)y * w;

        for (size_t x = 0; x < w; x++) {
            top[x] = landed[x] > top[x] ? landed[x] : top[x];
            arrived[x] = (uint16_t)(arrived[x] + (landed[x] != 0));
        }
    }
    for (int k = 0; k < c->count; k++) {
        const uint16_t *restrict landed = c->view[k].landed + (size_t)y * w;

        for (size_t x = 0; x < w; x++) {
            const uint16_t near = (uint16_t)(landed[x] && landed[x] + TOLERANCE_Q6 >= top[x]);

            count[x] = (uint16_t)(count[x] + near);
            sum[x] += near ? landed[x] : 0U;
        }
    }
}

/* The surface of pixel x behind those that too few views confirm; -1: there is none. Stored disparity. */
static float find_behind(const struct clear *c, const struct scratch *s, int x, int y)
{
    const size_t at = (size_t)y * (size_t)c->width + (size_t)x;
    int top = s->top[x];

    while (top) {
        int next = 0, count = 0;
        uint32_t sum = 0;

        for (int k = 0; k < c->count; k++) {
            const int landed = c->view[k].landed[at];
            const bool near = landed && landed <= top && landed + TOLERANCE_Q6 >= top;

            count += near;
            sum += near ? (uint32_t)landed : 0;
            next = landed < top && landed > next ? landed : next;
        }
        if (count >= needed(s->arrived[x]))
            return (float)sum / (float)count - 1;
        top = next;
    }
    return -1;
}

static float surface_at(const struct clear *c, const struct scratch *s, int x, int y)
{
    if (s->count[x] >= needed(s->arrived[x]))
        return (float)s->sum[x] / (float)s->count[x] - 1;
    return find_behind(c, s, x, y);
}

/* --- colour ------------------------------------------------------------------------------------------------------- */

/* Rays that see the surface of one pixel, the nearest views first. */
struct rays {
    int count, own; /* own: the ray of the camera at the viewpoint; -1: none of full weight */
    float total;    /* sum of weights */
    float weight[SST_MAX_VIEWS], colour[3][SST_MAX_VIEWS], agree[SST_MAX_VIEWS];
    int view[SST_MAX_VIEWS]; /* index in struct clear */
    float x[SST_MAX_VIEWS], y[SST_MAX_VIEWS];
};

static bool sample(float colour[3], const struct clear_view *v, float x, float y)
{
    const struct sst_image *img = &v->tap->v->image;
    const int x0 = (int)x, y0 = (int)y, xp = (int)((x - (float)x0) * 64 + 0.5F),
              yp = (int)((y - (float)y0) * 64 + 0.5F);

    if (v->tap->sampler) {
        uint8_t rgb[3], seen;

        sst_sampler_row(v->tap->sampler, (double)x, (double)y, 1, (uint8_t *const[3]){ rgb, rgb + 1, rgb + 2 }, &seen);
        for (int c = 0; c < 3; c++)
            colour[c] = rgb[c];
        return seen;
    }
    for (int c = 0; c < 3; c++) {
        const uint8_t *top = img->plane[c] + (size_t)y0 * img->stride + x0;
        const uint8_t *bottom = yp ? top + img->stride : top;
        const int right = xp != 0;
        const int upper = 64 * top[0] + xp * (top[right] - top[0]);
        const int lower = 64 * bottom[0] + xp * (bottom[right] - bottom[0]);

        colour[c] = (float)(64 * upper + yp * (lower - upper)) * (1.0F / 4096);
    }
    return true;
}

/* Does a view see the surface of disparity d (px; stored: q6)? Appends its ray. */
static bool gather(const struct clear *c, struct rays *rays, int k, int px, int py, float d, float q6)
{
    const struct clear_view *v = &c->view[k];
    const float x = (float)px - d * v->bx, y = (float)py - d * v->by;
    float colour[3];
    int nx, ny;
    enum state state;

    if (!(x >= 0 && y >= 0 && x <= (float)(c->width - 1) && y <= (float)(c->height - 1)))
        return false;
    nx = (int)(x + 0.5F);
    ny = (int)(y + 0.5F);
    state = v->state[(size_t)ny * (size_t)c->width + (size_t)nx];
    if (!state || fabsf((float)sst_map_u16_row(&v->tap->v->disp, ny)[nx] - q6) > TOLERANCE_Q6 ||
        !sample(colour, v, x, y))
        return false;
    for (int i = 0; i < 3; i++)
        rays->colour[i][rays->count] = colour[i];
    rays->x[rays->count] = x;
    rays->y[rays->count] = y;
    rays->weight[rays->count] = state == KEPT ? 1 : RIM_WEIGHT;
    rays->view[rays->count] = k;
    if (state == KEPT && v->bx * v->bx + v->by * v->by < 1e-12F)
        rays->own = rays->count;
    rays->total += rays->weight[rays->count++];
    return state == KEPT;
}

static void gather_all(const struct clear *c, struct rays *rays, int x, int y, float q6)
{
    const float d = (float)(c->lf->disp_min_px + (double)q6 / SST_DISP_SCALE);
    const int enough = c->cfg->rays ? c->cfg->rays : ENOUGH;
    int whole = 0;

    rays->count = 0;
    rays->own = -1;
    rays->total = 0;
    for (int k = 0; k < c->count && whole < enough; k++)
        whole += gather(c, rays, k, x, y, d, q6);
}

static void mean_colour(const struct rays *rays, const float *agree, float mean[3])
{
    float sum[3] = { 0 }, total = 0;

    for (int i = 0; i < rays->count; i++) {
        const float w = agree ? rays->weight[i] * agree[i] : rays->weight[i];

        for (int c = 0; c < 3; c++)
            sum[c] += w * rays->colour[c][i];
        total += w;
    }
    for (int c = 0; c < 3; c++)
        mean[c] = sum[c] / total;
}

/* Sum of a ray's deviations in R, G and B. */
static float deviation(const struct rays *rays, int i, const float mean[3])
{
    return fabsf(rays->colour[0][i] - mean[0]) + fabsf(rays->colour[1][i] - mean[1]) +
           fabsf(rays->colour[2][i] - mean[2]);
}

static float largest_deviation(const struct rays *rays, const float mean[3])
{
    float largest = 0;

    for (int i = 0; i < rays->count; i++)
        if (deviation(rays, i, mean) > largest)
            largest = deviation(rays, i, mean);
    return largest;
}

/* Colour of the rays that agree. Their agreement is left in rays->agree; where no ray deviates it is 1. */
static void blend_rays(struct rays *rays, float colour[3])
{
    mean_colour(rays, NULL, colour);
    for (int i = 0; i < rays->count; i++)
        rays->agree[i] = 1;
    if (largest_deviation(rays, colour) <= 3 * ALIKE)
        return;
    for (int step = 0; step < COLOUR_STEPS; step++) {
        const float scale = 1 / (3 * half_weight[step]);

        for (int i = 0; i < rays->count; i++) {
            const float t = deviation(rays, i, colour) * scale, t2 = t * t;

            rays->agree[i] = 1 / (1 + t2 * t2);
        }
        mean_colour(rays, rays->agree, colour);
    }
}

/* Share of the viewpoint's own camera in the colour. */
static float own_share(const struct rays *rays, const float colour[3])
{
    if (rays->own < 0)
        return 0;
    return fminf(fmaxf(2 - deviation(rays, rays->own, colour) / (3 * OWN_LEVELS), 0), 1);
}

/* Weight of a pixel, 0..255, from the weight of its rays: 1 is enough. */
static uint8_t pixel_weight(float total)
{
    const float t = fminf(total, 1);

    return (uint8_t)(255 * t * t + 0.5F);
}

/* For the caller's merge: the surface of a pixel, and how many rays agree on its colour. */
static void note_surface(const struct clear *c, const struct rays *rays, int x, int y, float q6)
{
    const struct sst_render_merge *to = c->cfg->merge;
    float agree = 0;

    for (int i = 0; i < rays->count; i++)
        agree += rays->weight[i] * rays->agree[i];
    sst_map_u16_row(to->surface, y)[x] = (uint16_t)(rays->count ? (unsigned)(q6 + 0.5F) : SST_DISP_NONE);
    sst_map_u8_row(to->support, y)[x] = (uint8_t)fminf(SST_RENDER_SUPPORT * agree + 0.5F, 255);
}

static int colour_row(void *arg, int y, int worker)
{
    const struct clear *c = arg;
    const struct scratch *s = &c->scratch[worker];
    struct rays rays;

    find_nearest(c, s, y);
    for (int x = 0; x < c->width; x++) {
        const float q6 = surface_at(c, s, x, y);
        float colour[3] = { 0 };
        float own;

        rays.count = 0;
        rays.total = 0;
        if (q6 >= 0)
            gather_all(c, &rays, x, y, q6);
        sst_map_u8_row(&c->weight, y)[x] = pixel_weight(rays.total);
        if (rays.count)
            blend_rays(&rays, colour);
        if (c->cfg->merge)
            note_surface(c, &rays, x, y, q6);
        if (!rays.count)
            continue;
        own = own_share(&rays, colour);
        for (int i = 0; i < 3; i++) {
            const float v = own > 0 ? colour[i] + own * (rays.colour[i][rays.own] - colour[i]) : colour[i];

            sst_image_row(c->out, i, y)[x] = (uint8_t)(v + 0.5F);
        }
    }
    return 0;
}

/* --- a picture ---------------------------------------------------------------------------------------------------- */

static double distance(const struct clear_view *v)
{
    return hypot((double)v->bx, (double)v->by);
}

static void add_view(struct clear *c, const struct sst_render_tap *t)
{
    struct clear_view v = { .tap = t,
                            .bx = (float)(t->v->bx - c->cfg->view_bx),
                            .by = (float)(t->v->by - c->cfg->view_by) };
    int at = c->count++;

    for (; at > 0 && distance(&c->view[at - 1]) > distance(&v); at--)
        c->view[at] = c->view[at - 1];
    c->view[at] = v;
}

static int allocate(struct clear *c, int threads)
{
    const size_t w = (size_t)c->width, n = sst_mem_stride(w * (size_t)c->height, 3);
    const size_t bins = sst_mem_stride((size_t)c->bins, sizeof(struct shift)), row = sst_mem_stride(w + 2, 4);
    uint8_t *maps, *rows;

    pthread_mutex_lock(&c->renderer->lock);
    c->maps = c->renderer->spare;
    c->renderer->spare = (struct sst_mem_kept){ 0 };
    pthread_mutex_unlock(&c->renderer->lock);
    c->scratch = calloc((size_t)threads, sizeof(*c->scratch));
    maps = sst_mem_keep(&c->maps, (size_t)c->count, n);
    c->rows = rows = sst_mem_alloc_raw((size_t)threads, bins + 7 * row);
    if (!c->scratch || !maps || !rows)
        return -ENOMEM;
    for (int k = 0; k < c->count; k++) {
        c->view[k].landed = (uint16_t *)(void *)(maps + (size_t)k * n);
        c->view[k].state = maps + (size_t)k * n + 2 * w * (size_t)c->height;
    }
    for (int i = 0; i < threads; i++, rows += bins + 7 * row) {
        uint8_t *at = rows + bins;

        c->scratch[i].shift = (struct shift *)(void *)rows;
        for (int j = 0; j < 3; j++, at += row)
            c->scratch[i].row[j] = at;
        c->scratch[i].top = (uint16_t *)(void *)at;
        c->scratch[i].arrived = (uint16_t *)(void *)(at + row);
        c->scratch[i].count = (uint16_t *)(void *)(at + 2 * row);
        c->scratch[i].sum = (uint32_t *)(void *)(at + 3 * row);
    }
    return 0;
}

/* Stored value of the cut; what is above it is removed. */
static int cut_q6(const struct sst_lightfield *lf, double cut_px)
{
    return (int)sst_clamp_double((cut_px - lf->disp_min_px) * SST_DISP_SCALE, -1, SST_DISP_NONE);
}

static void clear_fini(struct clear *c)
{
    if (c->maps.data) {
        pthread_mutex_lock(&c->renderer->lock);
        if (!c->renderer->spare.data) {
            c->renderer->spare = c->maps;
            c->maps = (struct sst_mem_kept){ 0 };
        }
        pthread_mutex_unlock(&c->renderer->lock);
    }
    sst_mem_kept_fini(&c->maps);
    free(c->scratch);
    sst_mem_free(c->rows);
}

/* Between the views there are rays for every viewpoint; outside there are not. */
static int check_viewpoint(const struct sst_render_config *cfg, const struct sst_render_plan *p)
{
    double x[2] = { INFINITY, -INFINITY }, y[2] = { INFINITY, -INFINITY };

    for (int i = 0; i < p->count; i++) {
        x[0] = fmin(x[0], p->tap[i].v->bx);
        x[1] = fmax(x[1], p->tap[i].v->bx);
        y[0] = fmin(y[0], p->tap[i].v->by);
        y[1] = fmax(y[1], p->tap[i].v->by);
    }
    if (cfg->view_bx > x[0] - 1e-6 && cfg->view_bx < x[1] + 1e-6 && cfg->view_by > y[0] - 1e-6 &&
        cfg->view_by < y[1] + 1e-6)
        return 0;
    sst_log_error("the viewpoint (%g, %g) lies outside the views; choose one in %g..%g, %g..%g spacings", cfg->view_bx,
                  cfg->view_by, x[0], x[1], y[0], y[1]);
    return -ERANGE;
}

static int check_config(const struct sst_render_config *cfg, const struct sst_render_plan *p)
{
    if (isnan(cfg->cut_px) || cfg->remove_label < 0 || cfg->remove_label > 255) {
        sst_log_error("render: the cut %g or the label to remove, %d, is invalid", cfg->cut_px, cfg->remove_label);
        return -EINVAL;
    }
    for (int i = 0; i < p->count; i++) {
        if (!p->tap[i].v->disp.data) {
            sst_log_error("view %d has no disparity map: run `sst process` on this light field first", p->tap[i].view);
            return -ENODATA;
        }
    }
    return check_viewpoint(cfg, p);
}

/* Views, samplers of raw frames and limits are those of plain refocusing on the middle of the scene. */
static int plan_views(struct sst_render_plan *p, struct sst_renderer *r, const struct sst_render_config *cfg)
{
    struct sst_render_config plain = *cfg;
    double lo = 0, hi = 0;

    plain.method = SST_RENDER_REFOCUS;
    plain.focus_px = sst_renderer_disparities(r, &lo, &hi) ? (lo + hi) / 2 : 0;
    if (cfg->cut_px < lo) {
        sst_log_error("the cut %g px removes everything; choose one in %.2f..%.2f", cfg->cut_px, lo, hi);
        return -ERANGE;
    }
    return sst_render_plan_init(p, r, &plain);
}

/* Stored disparities are below: live counts are samples, so that some may exceed them. */
static int count_bins(const struct sst_renderer *r)
{
    const bool known = r->lf->range_min_px < r->lf->range_max_px;

    return sst_max_int(r->histogram.bins,
                       known ? sst_min_int(sst_disp_q6(r->lf, r->lf->range_max_px) + 1, SST_DISP_NONE) : 0);
}

/* Send all rays to the viewpoint. */
static int clear_init(struct clear *c, const struct sst_render_plan *p, struct sst_renderer *r,
                      const struct sst_render_config *cfg, int threads)
{
    int err = check_config(cfg, p);

    *c = (struct clear){ 0 };
    if (err)
        return err;
    *c = (struct clear){ .renderer = r,
                         .lf = p->lf,
                         .cfg = cfg,
                         .width = p->lf->width,
                         .height = p->lf->height,
                         .bins = count_bins(r),
                         .cut_q6 = cut_q6(p->lf, cfg->cut_px) };
    for (int i = 0; i < p->count; i++)
        add_view(c, &p->tap[i]);
    err = allocate(c, threads);
    return err ? err : sst_parallel_for(c->count, threads, land_view, c);
}

static void mark_valid(struct sst_map_u8 *valid, const struct sst_map_u8 *weight)
{
    bool any = false;

    for (int y = 0; y < weight->height; y++) {
        const uint8_t *from = sst_map_u8_row(weight, y);
        uint8_t *to = sst_map_u8_row(valid, y);

        for (int x = 0; x < weight->width; x++) {
            to[x] = 4 * from[x] >= 255 ? CLEAR_SEEN : CLEAR_FILLED;
            any |= from[x] != 0;
        }
    }
    for (int y = 0; y < weight->height && !any; y++)
        memset(sst_map_u8_row(valid, y), CLEAR_UNKNOWN, (size_t)weight->width);
}

static int render_clear(struct clear *c, struct sst_image *out, struct sst_map_u8 *valid, int threads)
{
    void *levels = sst_mem_alloc_raw(clear_fill_bytes(c->width, c->height), 1);
    int err = levels ? sst_map_u8_init(&c->weight, c->width, c->height) : -ENOMEM;

    c->out = out;
    for (int i = 0; i < 3; i++)
        memset(out->plane[i], 0, out->stride * (size_t)out->height);
    if (!err)
        err = sst_parallel_for(c->height, threads, colour_row, c);
    if (!err && c->cfg->merge)
        err = c->cfg->merge->merge(c->cfg->merge->arg, out, &c->weight);
    if (!err)
        err = clear_fill(out, &c->weight, levels, threads);
    if (!err && valid)
        mark_valid(valid, &c->weight);
    sst_mem_free(levels);
    sst_map_u8_fini(&c->weight);
    return err;
}

int clear_render(struct sst_renderer *r, const struct sst_render_config *cfg, struct sst_image *out,
                 struct sst_map_u8 *valid)
{
    const int threads = sst_thread_count(cfg->threads);
    struct sst_render_plan plan;
    struct clear c;
    int err = plan_views(&plan, r, cfg);

    if (err)
        return err;
    err = clear_init(&c, &plan, r, cfg, threads);
    if (!err)
        err = render_clear(&c, out, valid, threads);
    if (err == -ENOMEM)
        sst_log_error("not enough memory for a clear picture of %d views of %d x %d", c.count, c.width, c.height);
    clear_fini(&c);
    sst_render_plan_fini(&plan);
    return err;
}

/* --- one pixel explained ------------------------------------------------------------------------------------------ */

static void describe(const struct clear *c, struct rays *rays, struct sst_ray *out)
{
    float colour[3], total = 0, own;

    blend_rays(rays, colour);
    own = own_share(rays, colour);
    for (int i = 0; i < rays->count; i++)
        total += rays->weight[i] * rays->agree[i];
    for (int i = 0; i < rays->count; i++) {
        const struct clear_view *v = &c->view[rays->view[i]];
        const int x = (int)(rays->x[i] + 0.5F), y = (int)(rays->y[i] + 0.5F);

        out[i] = (struct sst_ray){ .view = v->tap->view,
                                   .x = (double)rays->x[i],
                                   .y = (double)rays->y[i],
                                   .disp_px = sst_disp_px(c->lf, sst_map_u16_row(&v->tap->v->disp, y)[x]),
                                   .aperture = 1,
                                   .w_depth = (double)rays->weight[i],
                                   .w_label = (double)rays->agree[i] };
        if (v->tap->v->label.data)
            out[i].label = sst_map_u8_row(&v->tap->v->label, y)[x];
        out[i].share = (double)((1 - own) * rays->weight[i] * rays->agree[i] / total + (i == rays->own ? own : 0));
        for (int k = 0; k < 3; k++)
            out[i].colour[k] = (double)rays->colour[k][i];
    }
}

int clear_rays(struct sst_renderer *r, const struct sst_render_config *cfg, int x, int y, struct sst_ray *rays,
               int *count)
{
    const int threads = sst_thread_count(cfg->threads);
    struct sst_render_plan plan;
    struct rays found = { 0 };
    struct clear c;
    int err = plan_views(&plan, r, cfg);

    if (err)
        return err;
    err = clear_init(&c, &plan, r, cfg, threads);
    if (!err) {
        float q6;

        find_nearest(&c, &c.scratch[0], y);
        q6 = surface_at(&c, &c.scratch[0], x, y);
        if (q6 >= 0)
            gather_all(&c, &found, x, y, q6);
        if (found.count)
            describe(&c, &found, rays);
        *count = found.count;
    }
    clear_fini(&c);
    sst_render_plan_fini(&plan);
    return err;
}

/* Searches of several moments: scores of the moments on one ground are summed along straight paths. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "pipeline/posed/find/find_internal.h"

#define CELL_M       0.05 /* smallest side of a cell of the ground */
#define CELLS_MOST   16e6
#define CLIP         25.0 /* spreads that a moment adds at most */
#define PERSON_M     0.5
#define FINE         4    /* steps of the fine velocities within one of the coarse ones */
#define CUT          2.5  /* spreads beyond which sums do not count for mean and spread */
#define CUT_ROUNDS   3
#define FINDS_MOST   4096

/* Cells of the ground: place of cell (i, j) is corner + i along[0] + j along[1], moved along -normal to the surface. */
struct ground {
    double corner_mm[3], along[2][3], normal[3]; /* vectors of a cell's side */
    double cell_m;
    int width, height;
};

struct velocity {
    double x, y; /* cells a second */
};

/* A path in work: place at the middle moment, cells, and velocity. */
struct path {
    double x, y;
    struct velocity v;
    struct sst_blob blob; /* in cells */
};

struct walk {
    struct find_search moment[SST_FIND_MOMENTS]; /* of equal cameras and surfaces */
    double time_s[SST_FIND_MOMENTS];             /* since the middle one */
    int count, middle, threads;
    const struct sst_find_config *cfg;
    struct ground ground;
    struct sst_map_f32 z[SST_FIND_MOMENTS]; /* of cells: scores, clipped; 0: not covered */
    struct sst_map_f32 best;                /* largest sum over the velocities; NAN: too few moments cover the cell */
    int *chosen;                            /* [cells] its velocity */
    struct velocity *velocity;              /* [velocities], the first is 0 */
    int velocities;
    double mean, spread, threshold; /* of the background's `best`; threshold in spreads */
    struct sst_finds *out;
    struct path *path; /* [out->count] */
    struct sst_rect area; /* cells in work */
};

/* --- ground ------------------------------------------------------------------------------------------------------- */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Axes on the ground: east and north where places are geographic, else the picture's right and top. */
static void set_axes(struct ground *g, const struct find_search *s)
{
    const double east[3] = { 1, 0, 0 }, *n = s->surface->normal;
    const double *right = s->posed->geographic ? east : s->camera->rotation;
    const double off = dot(right, n);
    double length = 0;

    memcpy(g->normal, n, sizeof(g->normal));
    for (int i = 0; i < 3; i++) {
        g->along[0][i] = right[i] - off * n[i];
        length += g->along[0][i] * g->along[0][i];
    }
    for (int i = 0; i < 3; i++)
        g->along[0][i] /= sqrt(length);
    for (int i = 0; i < 3; i++)
        g->along[1][i] = n[(i + 1) % 3] * g->along[0][(i + 2) % 3] - n[(i + 2) % 3] * g->along[0][(i + 1) % 3];
}

/* Cells that cover every place of the virtual picture that some moment's score covers. */
static int lay_ground(struct walk *w)
{
    const struct find_search *s = &w->moment[w->middle];
    struct ground *g = &w->ground;
    double low[2] = { INFINITY, INFINITY }, high[2] = { -INFINITY, -INFINITY };

    set_axes(g, s);
    for (int y = 0; y < s->camera->height; y += 2) {
        for (int x = 0; x < s->camera->width; x += 2) {
            double at[3];
            bool covered = false;

            for (int m = 0; m < w->count && !covered; m++)
                covered = !isnan(sst_map_f32_row(&w->moment[m].maps->score, y)[x]);
            if (!covered || !find_place(s->camera, s->surface, x, y, at))
                continue;
            for (int i = 0; i < 2; i++) {
                low[i] = fmin(low[i], dot(at, g->along[i]) / 1000);
                high[i] = fmax(high[i], dot(at, g->along[i]) / 1000);
            }
        }
    }
    if (!(low[0] < high[0] && low[1] < high[1])) {
        sst_log_error("no moment's views cover the surface");
        return -ENODATA;
    }
    g->cell_m = fmax(fmax(s->pixel_m, CELL_M), sqrt((high[0] - low[0]) * (high[1] - low[1]) / CELLS_MOST));
    g->width = (int)((high[0] - low[0]) / g->cell_m) + 2;
    g->height = (int)((high[1] - low[1]) / g->cell_m) + 2;
    for (int i = 0; i < 3; i++) {
        g->corner_mm[i] = 1000 * (low[0] * g->along[0][i] + low[1] * g->along[1][i]) +
                          dot(s->camera->centre_mm, g->normal) * g->normal[i];
        g->along[0][i] *= 1000 * g->cell_m;
        g->along[1][i] *= 1000 * g->cell_m;
    }
    return 0;
}

/* Place on the surface of a cell. @return false: none */
static bool cell_place(const struct walk *w, double x, double y, double at_mm[3])
{
    const struct ground *g = &w->ground;
    double from[3], down[3], t;

    for (int i = 0; i < 3; i++) {
        from[i] = g->corner_mm[i] + x * g->along[0][i] + y * g->along[1][i];
        down[i] = -g->normal[i];
    }
    t = sst_surface_meet(w->moment[0].surface, from, down);
    for (int i = 0; i < 3; i++)
        at_mm[i] = isfinite(t) ? from[i] + t * down[i] : (double)NAN;
    return isfinite(t);
}

/* Pixel of the virtual picture of a place. @return false: behind it */
static bool picture_place(const struct walk *w, const double at_mm[3], double px[2])
{
    const struct sst_virtual *c = w->moment[0].camera;
    double d[3], z;

    for (int i = 0; i < 3; i++)
        d[i] = at_mm[i] - c->centre_mm[i];
    z = dot(c->rotation + 6, d);
    px[0] = c->fx * dot(c->rotation, d) / z + c->cx;
    px[1] = c->fy * dot(c->rotation + 3, d) / z + c->cy;
    return isgreater(z, 0);
}

/* Bilinear; NAN outside, and where a neighbour is. */
static double sample(const struct sst_map_f32 *map, double x, double y)
{
    const int x0 = (int)floor(x), y0 = (int)floor(y);
    const double fx = x - x0, fy = y - y0;
    const float *row, *next;

    if (!(x >= 0 && y >= 0 && x < map->width - 1 && y < map->height - 1))
        return NAN;
    row = sst_map_f32_row(map, y0) + x0;
    next = sst_map_f32_row(map, y0 + 1) + x0;
    return (1 - fy) * ((1 - fx) * (double)row[0] + fx * (double)row[1]) +
           fy * ((1 - fx) * (double)next[0] + fx * (double)next[1]);
}

/* Scores of the moments in a row of cells, means of four places in each; cells covered by half of the moments count. */
static int fill_row(void *arg, int y, int worker SST_UNUSED)
{
    struct walk *w = arg;

    for (int x = 0; x < w->ground.width; x++) {
        double at[4][2], place[3];
        int covered = 0;

        for (int k = 0; k < 4; k++) {
            if (!cell_place(w, x + 0.5 * (k % 2) - 0.25, y + 0.5 * (k / 2) - 0.25, place) ||
                !picture_place(w, place, at[k]))
                at[k][0] = at[k][1] = (double)NAN;
        }
        for (int m = 0; m < w->count; m++) {
            const struct sst_map_f32 *score = &w->moment[m].maps->score;
            double v = 0;

            for (int k = 0; k < 4; k++)
                v += isnan(at[k][0]) ? (double)NAN : sample(score, at[k][0], at[k][1]) / 4;
            covered += !isnan(v);
            sst_map_f32_row(&w->z[m], y)[x] = isnan(v) ? 0 : (float)fmin(fmax(v, -CLIP), CLIP);
        }
        sst_map_f32_row(&w->best, y)[x] = 2 * covered >= w->count ? 0 : NAN;
    }
    return 0;
}

/* --- sums along paths --------------------------------------------------------------------------------------------- */

/* Velocities up to the most, of which neighbours differ over the whole time by half a person at most; 0 is the first. */
static int choose_velocities(struct walk *w)
{
    const double whole_s = w->time_s[w->count - 1] - w->time_s[0];
    const double step = PERSON_M / 2 / whole_s, most = w->cfg->speed_m_s;
    const int side = (int)floor(most / step);

    w->velocity = calloc((size_t)(2 * side + 1) * (size_t)(2 * side + 1), sizeof(*w->velocity));
    if (!w->velocity)
        return -ENOMEM;
    w->velocities = 1;
    for (int j = -side; j <= side; j++) {
        for (int i = -side; i <= side; i++) {
            if ((i || j) && hypot(i, j) * step <= most)
                w->velocity[w->velocities++] =
                    (struct velocity){ i * step / w->ground.cell_m, j * step / w->ground.cell_m };
        }
    }
    return 0;
}

/* Scores of each moment along paths of one velocity, of a row of cells: their sum and the two highest. The highest
 * counts as much as the second: a glint of one moment is no path. */
struct sums {
    float *sum, *first, *second;
};

static void add_path(const struct walk *w, const struct sums *s, int y, struct velocity v)
{
    for (int m = 0; m < w->count; m++) {
        const int dx = (int)lround(v.x * w->time_s[m]), from_y = y + (int)lround(v.y * w->time_s[m]);
        const int x0 = sst_max_int(w->area.x0, -dx), x1 = sst_min_int(w->area.x1, w->ground.width - dx);
        const float *row;

        if (from_y < 0 || from_y >= w->ground.height)
            continue;
        row = sst_map_f32_row(&w->z[m], from_y) + dx;
        for (int x = x0; x < x1; x++) {
            const float lower = row[x] < s->first[x] ? row[x] : s->first[x];

            s->sum[x] += row[x];
            s->first[x] = row[x] > s->first[x] ? row[x] : s->first[x];
            s->second[x] = lower > s->second[x] ? lower : s->second[x];
        }
    }
}

static int best_row(void *arg, int i, int worker SST_UNUSED)
{
    struct walk *w = arg;
    const int y = w->area.y0 + i, width = w->ground.width;
    float *best = sst_map_f32_row(&w->best, y), *room = malloc(3 * (size_t)width * sizeof(*room));
    const struct sums s = { room, room + width, room + 2 * width };
    int *chosen = w->chosen + (size_t)y * (size_t)width;

    if (!room)
        return -ENOMEM;
    for (int k = 0; k < w->velocities; k++) {
        memset(room, 0, 3 * (size_t)width * sizeof(*room));
        add_path(w, &s, y, w->velocity[k]);
        for (int x = w->area.x0; x < w->area.x1; x++) {
            const float sum = s.sum[x] - s.first[x] + s.second[x];
            const bool more = !k || sum > best[x]; /* NAN stays */

            chosen[x] = more ? k : chosen[x];
            best[x] = isnan(best[x]) ? NAN : more ? sum : best[x];
        }
    }
    free(room);
    return 0;
}

static int best_sums(struct walk *w, struct sst_rect area)
{
    w->area = (struct sst_rect){ sst_max_int(area.x0, 0), sst_max_int(area.y0, 0),
                                 sst_min_int(area.x1, w->ground.width), sst_min_int(area.y1, w->ground.height) };
    return sst_parallel_for(w->area.y1 - w->area.y0, w->threads, best_row, w);
}

/* Mean and spread of the background's largest sums, sums beyond the cut left out. @return cells that count */
static double measure(struct walk *w)
{
    double cells = 0;

    for (int round = 0; round < CUT_ROUNDS + 1; round++) {
        const double reach = round ? CUT * w->spread : INFINITY;
        double n = 0, sum = 0, square = 0;

        for (int y = 0; y < w->ground.height; y++) {
            const float *row = sst_map_f32_row(&w->best, y);

            for (int x = 0; x < w->ground.width; x++) {
                const double v = (double)row[x] - w->mean;

                if (!isnan(v) && fabs(v) <= reach) {
                    n++;
                    sum += v;
                    square += v * v;
                }
            }
        }
        if (n > 0) {
            w->mean += sum / n;
            w->spread = sqrt(fmax(square / n - sum / n * (sum / n), 0));
        }
        cells = round ? cells : n;
    }
    return cells;
}

/* The largest sums in spreads, as the map of scores that the threshold is chosen by. */
static int score_sums(struct walk *w)
{
    struct find_search all = w->moment[w->middle];
    const double cells = measure(w);
    int err = sst_map_f32_init(&w->out->score, w->ground.width, w->ground.height);

    if (!err && !(cells > 0)) {
        sst_log_error("no place of the ground is seen by half of the moments; search those that look at the same place");
        err = -ENODATA;
    } else if (!err && !(w->spread > 0)) {
        sst_log_error("the scores of the moments are equal everywhere, so that nothing stands out");
        err = -ENODATA;
    }
    for (int y = 0; !err && y < w->ground.height; y++) {
        for (int x = 0; x < w->ground.width; x++)
            sst_map_f32_row(&w->out->score, y)[x] =
                (float)(((double)sst_map_f32_row(&w->best, y)[x] - w->mean) / w->spread);
    }
    w->out->hectares = cells * w->ground.cell_m * w->ground.cell_m / 1e4;
    all.maps = w->out;
    err = err ? err : find_choose_threshold(&all);
    w->threshold = all.threshold;
    return err;
}

/* --- paths -------------------------------------------------------------------------------------------------------- */

static double sum_at(const struct walk *w, double x, double y, struct velocity v)
{
    double sum = 0, first = 0, second = 0;

    for (int m = 0; m < w->count; m++) {
        const double s = sample(&w->z[m], x + v.x * w->time_s[m], y + v.y * w->time_s[m]), z = isnan(s) ? 0 : s;

        sum += z;
        second = fmax(second, fmin(z, first));
        first = fmax(first, z);
    }
    return sum - first + second;
}

/* Blob of the sums at one velocity that holds a cell. @return true: there is one of a find's size */
static int find_blob_at(const struct walk *w, struct path *p, bool *found)
{
    const int reach = (int)(w->cfg->most_m / w->ground.cell_m) + 1, side = 2 * reach + 1;
    const struct find_blob_config sizes = find_blob_sizes(w->cfg, w->threshold, w->ground.cell_m);
    struct find_blob_config any = sizes;
    struct sst_map_f32 map = { 0 };
    struct sst_blob *blob = NULL;
    int n = 0, err = sst_map_f32_init(&map, side, side);

    any.least_px = 1;
    any.most_px = INT32_MAX;
    for (int y = 0; !err && y < side; y++) {
        for (int x = 0; x < side; x++)
            sst_map_f32_row(&map, y)[x] =
                (float)((sum_at(w, p->x + x - reach, p->y + y - reach, p->v) - w->mean) / w->spread);
    }
    err = err ? err : find_blobs(&blob, &n, &map, 1, &any);
    *found = false;
    p->blob = (struct sst_blob){ .box = { (int)p->x, (int)p->y, (int)p->x + 1, (int)p->y + 1 } };
    for (int i = 0; i < n && !*found; i++) {
        const struct sst_rect b = blob[i].box;

        if (reach < b.x0 - 1 || reach > b.x1 || reach < b.y0 - 1 || reach > b.y1)
            continue;
        *found = blob[i].pixels >= sizes.least_px && blob[i].pixels <= sizes.most_px;
        p->blob = blob[i];
        p->blob.x += p->x - reach;
        p->blob.y += p->y - reach;
        p->blob.box = (struct sst_rect){ b.x0 + (int)p->x - reach, b.y0 + (int)p->y - reach, b.x1 + (int)p->x - reach,
                                         b.y1 + (int)p->y - reach };
        break;
    }
    free(blob);
    sst_map_f32_fini(&map);
    return err;
}

/* Mean sum over a blob's box, which one velocity moves. */
static double box_sum(const struct walk *w, struct sst_rect box, struct velocity v)
{
    double sum = 0;

    for (int y = box.y0; y < box.y1; y++) {
        for (int x = box.x0; x < box.x1; x++)
            sum += sum_at(w, x, y, v);
    }
    return sum;
}

/* The fine velocity around a coarse one; below half a person over the whole time it is 0. */
static void refine(const struct walk *w, struct path *p)
{
    const double whole_s = w->time_s[w->count - 1] - w->time_s[0];
    const double step = PERSON_M / 2 / whole_s / FINE / w->ground.cell_m;
    const struct velocity coarse = p->v;
    double best = -INFINITY;

    for (int j = -FINE; j <= FINE; j++) {
        for (int i = -FINE; i <= FINE; i++) {
            const struct velocity v = { coarse.x + i * step, coarse.y + j * step };
            const double sum = box_sum(w, p->blob.box, v);

            if (sum > best) {
                best = sum;
                p->v = v;
            }
        }
    }
    if (hypot(p->v.x, p->v.y) < step * FINE || hypot(p->v.x, p->v.y) * w->ground.cell_m > w->cfg->speed_m_s + 1e-9)
        p->v = hypot(p->v.x, p->v.y) < step * FINE ? (struct velocity){ 0, 0 } : coarse;
}

/* Scores along a path count for no other one. */
static int claim(struct walk *w, const struct path *p)
{
    const int margin = (int)(FIND_CLOSE_M / 2 / w->ground.cell_m);
    const int reach = (int)(w->cfg->speed_m_s / w->ground.cell_m *
                            fmax(-w->time_s[0], w->time_s[w->count - 1])) * 2 + 1;
    const struct sst_rect b = p->blob.box;
    const struct sst_rect near = { b.x0 - margin - reach, b.y0 - margin - reach, b.x1 + margin + reach,
                                   b.y1 + margin + reach };

    for (int m = 0; m < w->count; m++) {
        const int dx = (int)lround(p->v.x * w->time_s[m]), dy = (int)lround(p->v.y * w->time_s[m]);

        for (int y = sst_max_int(b.y0 - margin + dy, 0); y < sst_min_int(b.y1 + margin + dy, w->ground.height); y++) {
            for (int x = sst_max_int(b.x0 - margin + dx, 0); x < sst_min_int(b.x1 + margin + dx, w->ground.width); x++) {
                float *z = &sst_map_f32_row(&w->z[m], y)[x];

                *z = *z > 0 ? 0 : *z;
            }
        }
    }
    for (int y = sst_max_int(b.y0 - margin, 0); y < sst_min_int(b.y1 + margin, w->ground.height); y++) {
        for (int x = sst_max_int(b.x0 - margin, 0); x < sst_min_int(b.x1 + margin, w->ground.width); x++)
            sst_map_f32_row(&w->best, y)[x] = NAN; /* one find a place */
    }
    return best_sums(w, near);
}

/* The highest sum that is left. @return false: below the threshold */
static bool highest(const struct walk *w, struct path *p)
{
    double most = w->mean + w->threshold * w->spread;
    bool any = false;

    for (int y = 0; y < w->ground.height; y++) {
        const float *row = sst_map_f32_row(&w->best, y);

        for (int x = 0; x < w->ground.width; x++) {
            if (isgreaterequal((double)row[x], most)) {
                most = (double)row[x];
                *p = (struct path){ .x = x, .y = y, .v = w->velocity[w->chosen[(size_t)y * (size_t)w->ground.width +
                                                                              (size_t)x]] };
                any = true;
            }
        }
    }
    return any;
}

static int collect(struct walk *w)
{
    struct path p;
    int err = 0;

    w->path = calloc(FINDS_MOST, sizeof(*w->path));
    if (!w->path)
        return -ENOMEM;
    for (int i = 0; i < FINDS_MOST && !err && highest(w, &p); i++) {
        bool found;

        err = find_blob_at(w, &p, &found);
        if (!err && found) {
            refine(w, &p);
            w->path[w->out->count++] = p;
        }
        err = err ? err : claim(w, &p);
    }
    return err;
}

/* --- finds -------------------------------------------------------------------------------------------------------- */

/* The part of the virtual picture around a step's place that is of a find's size. */
static struct sst_rect around(const struct walk *w, const struct sst_find_step *step, double size_m)
{
    const double r = fmax(size_m / 2 / w->moment[0].pixel_m, 1);
    const struct sst_virtual *c = w->moment[0].camera;

    if (isnan(step->at_mm[0]) || !(fabs(step->x) < 1e6 && fabs(step->y) < 1e6))
        return (struct sst_rect){ 0, 0, 0, 0 };
    return (struct sst_rect){ sst_max_int((int)floor(step->x - r + 0.5), 0),
                              sst_max_int((int)floor(step->y - r + 0.5), 0),
                              sst_min_int((int)floor(step->x + r + 1.5), c->width),
                              sst_min_int((int)floor(step->y + r + 1.5), c->height) };
}

static void set_find(const struct walk *w, int i)
{
    const struct path *p = &w->path[i];
    const double cell_m = w->ground.cell_m;
    struct sst_found *f = &w->out->found[i];

    *f = (struct sst_found){ .blob = p->blob, .best = -1, .speed_m_s = hypot(p->v.x, p->v.y) * cell_m };
    f->heading_deg = f->speed_m_s > 0 ? fmod(atan2(p->v.x, p->v.y) * 180 / M_PI + 360, 360) : (double)NAN;
    f->size_m = 2 * sqrt(p->blob.pixels / M_PI) * cell_m;
    for (int m = 0; m < w->count; m++) {
        struct sst_find_step *step = &w->out->step[i * w->count + m];
        double px[2];

        *step = (struct sst_find_step){ .score = (double)NAN, .best = -1 };
        cell_place(w, p->blob.x + p->v.x * w->time_s[m], p->blob.y + p->v.y * w->time_s[m], step->at_mm);
        picture_place(w, step->at_mm, px);
        step->x = px[0];
        step->y = px[1];
        find_geographic(w->moment[m].posed, step->at_mm, &step->latitude, &step->longitude);
    }
}

/* The place and box of a find: its step at the middle moment, in the virtual picture. */
static void place_find(const struct walk *w, int i)
{
    struct sst_found *f = &w->out->found[i];
    const struct sst_find_step *step = &w->out->step[i * w->count + w->middle];
    const double px_per_cell = w->ground.cell_m / w->moment[0].pixel_m;

    memcpy(f->at_mm, step->at_mm, sizeof(f->at_mm));
    f->latitude = step->latitude;
    f->longitude = step->longitude;
    f->blob.x = step->x;
    f->blob.y = step->y;
    f->blob.box = around(w, step, f->size_m);
    f->blob.pixels = (int)(f->blob.pixels * px_per_cell * px_per_cell + 0.5);
}

static void score_step(const struct walk *w, int i, int m)
{
    struct sst_find_step *step = &w->out->step[i * w->count + m];
    const struct sst_rect box = around(w, step, w->out->found[i].size_m);

    for (int y = box.y0; y < box.y1; y++) {
        for (int x = box.x0; x < box.x1; x++) {
            const double v = (double)sst_map_f32_row(&w->moment[m].maps->score, y)[x];

            step->score = isnan(step->score) || isgreater(v, step->score) ? v : step->score;
        }
    }
}

/* How a view of a moment shows the finds. */
static int show(struct walk *w, int m, int k, double *best)
{
    struct sst_map_f32 map = { 0 };
    const int err = find_resample(&w->moment[m], &map, k);

    for (int i = 0; i < w->out->count && !err; i++) {
        struct sst_find_step *step = &w->out->step[i * w->count + m];
        const struct sst_rect box = around(w, step, w->out->found[i].size_m);
        double sum = 0, n = 0, score;

        for (int y = box.y0; y < box.y1; y++) {
            for (int x = box.x0; x < box.x1; x++) {
                const double v = (double)sst_map_f32_row(&map, y)[x];

                sum += isnan(v) ? 0 : v;
                n += !isnan(v);
            }
        }
        if (n == 0 || 2 * n < (double)(box.x1 - box.x0) * (box.y1 - box.y0)) /* it does not look there */
            continue;
        score = sum / n / SCORE_STEPS - SCORE_LOWEST;
        step->seen++;
        step->views += score >= FIND_SHOWN;
        if (score > best[i]) {
            best[i] = score;
            step->best = k;
        }
    }
    sst_map_f32_fini(&map);
    return err;
}

/* Views of a moment that show the finds, and the best view of each; the best of all moments is the find's. */
static int show_moment(struct walk *w, int m, double *best, double *most)
{
    const struct sst_posed *posed = w->moment[m].posed;
    int err = 0;

    for (int i = 0; i < w->out->count; i++) {
        best[i] = -INFINITY;
        score_step(w, i, m);
    }
    for (int k = 0; k < posed->count && w->out->count && !err; k++) {
        if (posed->view[k].camera.known)
            err = show(w, m, k, best);
    }
    for (int i = 0; i < w->out->count && !err; i++) {
        struct sst_find_step *step = &w->out->step[i * w->count + m];
        struct sst_found *f = &w->out->found[i];
        double px[2] = { 0, 0 };

        f->views += step->views;
        f->seen += step->seen;
        if (!find_in_view(posed, step->best, step->at_mm, px))
            step->best = -1;
        step->best_x = px[0];
        step->best_y = px[1];
        if (step->best >= 0 && best[i] > most[i]) {
            most[i] = best[i];
            f->best = step->best;
            f->best_x = px[0];
            f->best_y = px[1];
            f->moment = m + 1;
        }
    }
    return err;
}

/* A path that fewer than half of the moments show, or one alone, is none. */
static bool keep(const struct walk *w, int i)
{
    int shown = 0;

    for (int m = 0; m < w->count; m++)
        shown += isgreaterequal(w->out->step[i * w->count + m].score, FIND_SHOWN);
    return shown >= sst_max_int((w->count + 1) / 2, 2) &&
           find_shown(w->cfg, w->out->found[i].views, w->out->found[i].seen);
}

static int judge(struct walk *w)
{
    struct sst_finds *out = w->out;
    const size_t n = (size_t)out->count;
    double *best = calloc(n + 1, sizeof(*best)), *most = calloc(n + 1, sizeof(*most));
    int kept = 0, err;

    out->found = calloc(n + 1, sizeof(*out->found));
    out->step = calloc(n * (size_t)w->count + 1, sizeof(*out->step));
    err = best && most && out->found && out->step ? 0 : -ENOMEM;
    for (int i = 0; i < out->count && !err; i++) {
        most[i] = -INFINITY;
        set_find(w, i);
    }
    for (int m = 0; m < w->count && !err; m++)
        err = show_moment(w, m, best, most);
    for (int i = 0; i < out->count && !err; i++) {
        if (!keep(w, i))
            continue;
        place_find(w, i);
        out->found[kept] = out->found[i];
        memmove(&out->step[kept++ * w->count], &out->step[i * w->count], (size_t)w->count * sizeof(*out->step));
    }
    out->count = kept;
    free(best);
    free(most);
    return err;
}

/* --- all ---------------------------------------------------------------------------------------------------------- */

static int check(const struct sst_find_scene scene[], int count, const struct sst_find_config *cfg)
{
    bool rising = count >= 2;

    for (int m = 1; m < count; m++)
        rising = rising && scene[m].time_s > scene[m - 1].time_s;
    if (!rising || count > SST_FIND_MOMENTS) {
        sst_log_error("a search of persons who walk is of 2 to %d moments of rising times", SST_FIND_MOMENTS);
        return -EINVAL;
    }
    if ((scene[count - 1].time_s - scene[0].time_s) * cfg->speed_m_s <= SST_FIND_PATH_M)
        return 0;
    sst_log_error("between the first and the last moment a person could walk %.0f m, and nobody walks straight for more "
                  "than %.0f m; search fewer moments, or at a lower speed",
                  (scene[count - 1].time_s - scene[0].time_s) * cfg->speed_m_s, SST_FIND_PATH_M);
    return -EINVAL;
}

/* "LF", or "moment 3 of LF" */
static const char *name_of(char text[300], const struct walk *w, int m)
{
    const struct find_search *s = &w->moment[m];

    if (strcmp(s->dir, w->moment[m ? 0 : 1].dir))
        snprintf(text, 300, "%s", s->dir);
    else
        snprintf(text, 300, "moment %d of %s", s->posed->view[0].moment, s->dir);
    return text;
}

/* Moments that show nothing of the ground in the picture add nothing. @return -ENODATA: one alone shows some; logged */
static int check_cover(const struct walk *w)
{
    char first[300], middle[300];
    int without = -1, n = 0;

    for (int m = w->count - 1; m >= 0; m--) {
        if (!(w->moment[m].maps->hectares > 0)) {
            without = m;
            n++;
        }
    }
    if (!n)
        return 0;
    name_of(first, w, without);
    name_of(middle, w, w->middle);
    if (w->count - n > 1) {
        sst_log_warning("%s shows nothing of the ground in the picture of %s, and %d of %d moments do not; they add nothing",
                        first, middle, n, w->count);
        return 0;
    }
    sst_log_error("%s shows nothing of the ground in the picture of %s; moments that are searched together have poses in "
                  "the same axes and look at the same place: import them as one light field by --moments, or search each alone",
                  first, middle);
    return -ENODATA;
}

static int sum_moments(struct walk *w)
{
    int err = lay_ground(w);

    for (int m = 0; m < w->count && !err; m++)
        err = sst_map_f32_init(&w->z[m], w->ground.width, w->ground.height);
    err = err ? err : sst_map_f32_init(&w->best, w->ground.width, w->ground.height);
    w->chosen = err ? NULL : calloc((size_t)w->ground.width * (size_t)w->ground.height, sizeof(*w->chosen));
    if (!err && !w->chosen)
        err = -ENOMEM;
    err = err ? err : sst_parallel_for(w->ground.height, w->threads, fill_row, w);
    err = err ? err : choose_velocities(w);
    return err ? err : best_sums(w, (struct sst_rect){ 0, 0, w->ground.width, w->ground.height });
}

static void walk_fini(struct walk *w)
{
    for (int m = 0; m < w->count; m++)
        sst_map_f32_fini(&w->z[m]);
    sst_map_f32_fini(&w->best);
    free(w->chosen);
    free(w->velocity);
    free(w->path);
}

int sst_posed_find_walkers(struct sst_finds *out, const struct sst_find_scene scene[], int count,
                           const struct sst_find_config *cfg)
{
    struct walk w = { .count = count, .middle = count / 2, .cfg = cfg, .out = out };
    int err = check(scene, count, cfg);

    *out = (struct sst_finds){ 0 };
    if (err)
        return err;
    out->each = calloc((size_t)count, sizeof(*out->each));
    if (!out->each) {
        sst_log_error("not enough memory for a search");
        return -ENOMEM;
    }
    out->moments = count;
    out->middle = w.middle;
    w.threads = sst_thread_count(cfg->threads);
    for (int m = 0; m < count; m++) {
        w.moment[m] = find_search_of(&out->each[m], &scene[m], cfg);
        w.moment[m].kept_bytes /= (size_t)count;
        w.time_s[m] = scene[m].time_s - scene[w.middle].time_s;
    }
    for (int m = 0; m < count && !err; m++)
        err = find_maps(&w.moment[m]);
    err = err ? err : check_cover(&w);
    out->channels = out->each[w.middle].channels;
    err = err ? err : sum_moments(&w);
    err = err ? err : score_sums(&w);
    err = err ? err : collect(&w);
    err = err ? err : judge(&w);
    for (int m = 0; m < count; m++) {
        const int ended = find_search_end(&w.moment[m], m == w.middle ? err : 0);

        err = m == w.middle && err ? ended : err;
    }
    walk_fini(&w);
    if (err)
        sst_finds_fini(out);
    return err;
}

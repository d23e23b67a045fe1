/* Cells behind dense leaves: the maps miss most of the surfaces in the gaps, and the clear picture has holes there.
 * Rays that agree fill them (pipeline/method/render/verify.h), one plane at a time: the default focus behind the
 * foreground, and planes around it up to the cut. Every cell of the picture keeps the plane on which most of its rays
 * agreed; some cells are tried on another one in each set.
 *
 * A cell is rendered when its rays have changed: a third of the cells in a set, all within three, and of more than six
 * sets a second fewer, all within half a second. Until then nothing is seen there, and the memory fills it. Where
 * leaves move before a still scene, a third of these renderings is enough. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/live/picture/picture_internal.h"

#define STEP_PX      1.5       /* between planes: surfaces between two are off by 2 px in the outermost views */
#define BETTER       1.1       /* another plane must have this multiple of the agreement */
#define TURNS        3         /* a cell whose rays changed is rendered within this number of sets, ... */
#define TURN_NS      500000000 /* ... or within this time */
#define MOST_TURNS   10
#define CALM         3 /* renderings in a row without news: the cell has a third of the turns, ... */
#define CALM_TIMES   3
#define CHANGED      0.25 /* ... until this fraction of the pixels seen in it, or beside it, has changed */
#define CHANGED_PX   8    /* and at least this number of pixels */
#define RUN          5    /* cells beside each other have their turn together: votes are counted in runs of cells */
#define CELL_LEVEL   1    /* of votes: their cells are as high as the cells here */
#define EXPLORE      3    /* one cell in this many times as many is tried on another plane; at the start ... */
#define START_TRIED  4    /* ... one in this many in every set, until each was tried on all; until then ... */
#define START_TURNS  2    /* ... stale cells are rendered within this number of sets, so that no set takes long */
#define START_ROUNDS (START_TRIED * PICTURE_PLANES)
#define AGREED       48   /* of 255, from which rays that agree on a colour show it, ... */
#define AGREED_FRONT 58   /* ... one that is more frequent among removed than among seen pixels: leaves agree by chance */
#define COUNTED_STEP 4    /* distance of the columns and rows whose pixels are counted */

void picture_behind_fini(struct picture_behind *b)
{
    for (int i = 0; i < b->planned; i++)
        sst_render_plan_fini(&b->plan[i]);
    sst_image_fini(&b->image);
    sst_map_u8_fini(&b->agreed);
    sst_map_u8_fini(&b->seen);
    sst_image_fini(&b->trial);
    sst_map_u8_fini(&b->trial_agreed);
    free(b->cell);
    *b = (struct picture_behind){ 0 };
}

static int reserve(struct picture_behind *b, const struct sst_lightfield *lf)
{
    size_t cells;
    int err = 0;

    b->cols = (lf->width + SST_RENDER_CELL_WIDTH - 1) / SST_RENDER_CELL_WIDTH;
    b->rows = (lf->height + SST_RENDER_CELL_HEIGHT - 1) / SST_RENDER_CELL_HEIGHT;
    cells = (size_t)b->cols * (size_t)b->rows;
    if (!b->image.plane[0])
        err = sst_image_init(&b->image, lf->width, lf->height);
    if (!err && !b->trial.plane[0])
        err = sst_image_init(&b->trial, lf->width, lf->height);
    if (!err && !b->agreed.data)
        err = sst_map_u8_init(&b->agreed, lf->width, lf->height);
    if (!err && !b->seen.data)
        err = sst_map_u8_init(&b->seen, lf->width, lf->height);
    if (!err && !b->trial_agreed.data)
        err = sst_map_u8_init(&b->trial_agreed, lf->width, lf->height);
    if (!err && !b->cell)
        b->cell = calloc(cells, sizeof(*b->cell) + 2);
    b->wanted = b->cell ? (uint8_t *)(b->cell + cells) : NULL;
    b->changed = b->cell ? b->wanted + cells : NULL;
    return err || b->cell ? err : -ENOMEM;
}

/* --- planes ------------------------------------------------------------------------------------------------------- */

/* Is a plan for what is there now? */
static bool is_current(const struct picture_behind *b, const struct sst_live *live, double focus_px, double cut_px)
{
    return b->planned && same(b->focus_px, focus_px) && same(b->cut_px, cut_px) &&
           b->present_serial == live->present_serial && same(b->disp_min_px, live->lf.disp_min_px);
}

/* Planes: the focus, one behind it, and planes from before it to the cut. */
static int choose_planes(double plane_px[PICTURE_PLANES], const struct sst_live *live, double cut_px)
{
    const double focus_px = live->focus.focus_px;
    int n = 0;

    plane_px[n++] = focus_px;
    if (focus_px - STEP_PX >= live->min_px)
        plane_px[n++] = focus_px - STEP_PX;
    for (int i = 1; n < PICTURE_PLANES && focus_px + i * STEP_PX < fmin(cut_px, live->max_px); i++)
        plane_px[n++] = focus_px + i * STEP_PX;
    return n;
}

static int make_plans(struct picture_behind *b, const struct sst_live *live, double cut_px)
{
    double plane_px[PICTURE_PLANES];
    const int n = choose_planes(plane_px, live, cut_px);
    int err = 0;

    for (int i = 0; i < b->planned; i++)
        sst_render_plan_fini(&b->plan[i]);
    for (int i = 0; i < b->cols * b->rows; i++)
        b->cell[i] = (struct picture_cell){ .stale = 1, .holes = b->cell[i].holes };
    for (b->planned = b->round = 0; b->planned < n && !err; b->planned += !err) {
        struct sst_render_config cfg;

        sst_render_config_defaults(&cfg);
        cfg.verify = SST_VERIFY_ON;
        cfg.focus_px = plane_px[b->planned];
        picture_resolve(&cfg, live);
        b->plane_px[b->planned] = cfg.focus_px;
        err = sst_render_plan_init(&b->plan[b->planned], live->renderer, &cfg);
        b->plan[b->planned].votes_only = true;
    }
    b->focus_px = live->focus.focus_px;
    b->cut_px = cut_px;
    b->counted = live->counted;
    b->present_serial = live->present_serial;
    b->disp_min_px = live->lf.disp_min_px;
    return b->planned ? 0 : err;
}

/* Cells on a plane must be rendered again: all, or the marked ones. */
static void make_stale(struct picture_behind *b, int plane, const uint8_t *marked)
{
    for (int i = 0; i < b->cols * b->rows; i++) {
        if (b->cell[i].plane == plane && (!marked || marked[i]) && !b->cell[i].stale)
            b->cell[i].stale = 1;
    }
}

static int update_plans(struct picture_behind *b, const struct sst_live *live, double cut_px)
{
    if (!is_current(b, live, live->focus.focus_px, cut_px))
        return make_plans(b, live, cut_px);
    for (int i = 0; i < b->planned && b->counted != live->counted; i++) {
        if (sst_render_plan_update(&b->plan[i], live->renderer, PICTURE_NOTICEABLE, PICTURE_NOTICEABLE_SHARE))
            make_stale(b, i, NULL);
    }
    b->counted = live->counted;
    return 0;
}

/* --- cells -------------------------------------------------------------------------------------------------------- */

/* Count the holes of all cells. @return any */
static bool count_holes(struct picture_behind *b, const struct sst_map_u8 *weight)
{
    bool any = false;

    for (int i = 0; i < b->cols * b->rows; i++)
        b->cell[i].holes = 0;
    for (int y = 0; y < weight->height; y++) {
        const uint8_t *row = sst_map_u8_row(weight, y);
        struct picture_cell *cell = b->cell + (size_t)(y / SST_RENDER_CELL_HEIGHT) * (size_t)b->cols;

        for (int x = 0; x < weight->width; x++) {
            if (row[x] < PICTURE_SEEN_WEIGHT) {
                cell[x / SST_RENDER_CELL_WIDTH].holes++;
                any = true;
            }
        }
    }
    return any;
}

/* View whose removed pixels are counted: the reference view, another one while its camera delivers nothing; or NULL. */
static const struct sst_view *front_view(const struct sst_live *live)
{
    const struct sst_lightfield *lf = &live->lf;
    const int views = lf->rows * lf->cols;

    for (int i = 0; i < views; i++) {
        const int k = (lf->ref_view + i) % views;

        if (live->present[k] && lf->views[k].disp.data)
            return &lf->views[k];
    }
    return NULL;
}

/* The agreement from which a colour is seen, by its share in the removed pixels of a view and in the seen pixels of the
 * picture: where all rays end in leaves, some of them agree. */
static void count_colours(struct picture_behind *b, const struct sst_live *live, const struct sst_image *image,
                          const struct sst_map_u8 *weight, double cut_px)
{
    const struct sst_view *v = front_view(live);
    const double cut_q6 = (cut_px - live->lf.disp_min_px) * SST_DISP_SCALE;
    uint32_t front[PICTURE_BEHIND_COLOURS] = { 0 }, behind[PICTURE_BEHIND_COLOURS] = { 0 }, fronts = 0, behinds = 0;

    memset(b->least, AGREED, sizeof(b->least));
    if (!v)
        return;
    for (int y = 0; y < image->height; y += COUNTED_STEP) {
        const uint16_t *disp = sst_map_u16_row(&v->disp, y);

        for (int x = 0; x < image->width; x += COUNTED_STEP) {
            if (disp[x] != SST_DISP_NONE && disp[x] > cut_q6) {
                front[picture_behind_colour(sst_image_row(&v->image, 0, y)[x], sst_image_row(&v->image, 1, y)[x],
                                            sst_image_row(&v->image, 2, y)[x])]++;
                fronts++;
            }
            if (sst_map_u8_row(weight, y)[x] >= PICTURE_SEEN_WEIGHT) {
                behind[picture_behind_colour(sst_image_row(image, 0, y)[x], sst_image_row(image, 1, y)[x],
                                             sst_image_row(image, 2, y)[x])]++;
                behinds++;
            }
        }
    }
    for (int i = 0; i < PICTURE_BEHIND_COLOURS; i++) {
        if ((uint64_t)front[i] * (behinds + 1) > (uint64_t)behind[i] * (fronts + 1))
            b->least[i] = AGREED_FRONT;
    }
}

/* Find cells with holes, in late sets by the last maps. @return any */
static bool find_holes(struct picture_behind *b, const struct sst_live *live, const struct sst_map_u8 *weight)
{
    bool any = false;

    b->late = live->late && b->planned;
    if (!b->late) {
        memcpy(b->seen.data, weight->data, weight->stride * (size_t)weight->height);
        return count_holes(b, weight);
    }
    for (int i = 0; i < b->cols * b->rows; i++)
        any |= b->cell[i].holes > 0;
    return any;
}

/* Mean agreement of a cell's pixels. */
static float score(const struct picture_behind *b, const struct sst_map_u8 *agreed, int at)
{
    const int x0 = at % b->cols * SST_RENDER_CELL_WIDTH, y0 = at / b->cols * SST_RENDER_CELL_HEIGHT;
    const int x1 = sst_min_int(x0 + SST_RENDER_CELL_WIDTH, agreed->width);
    const int y1 = sst_min_int(y0 + SST_RENDER_CELL_HEIGHT, agreed->height);
    int sum = 0;

    for (int y = y0; y < y1; y++) {
        for (int x = x0; x < x1; x++)
            sum += sst_map_u8_row(agreed, y)[x];
    }
    return (float)sum / (float)((x1 - x0) * (y1 - y0));
}

/* Render the wanted cells on one plane. */
static int render_cells(struct picture_behind *b, int plane, struct sst_image *image, struct sst_map_u8 *agreed)
{
    if (!memchr(b->wanted, 1, (size_t)b->cols * (size_t)b->rows))
        return 0;
    b->plan[plane].agreed = agreed;
    return sst_render_plan_render(&b->plan[plane], b->wanted, image, NULL);
}

/* Nothing is seen in a cell. */
static void hide_cell(struct picture_behind *b, int at)
{
    const int x0 = at % b->cols * SST_RENDER_CELL_WIDTH, y0 = at / b->cols * SST_RENDER_CELL_HEIGHT;
    const int x1 = sst_min_int(x0 + SST_RENDER_CELL_WIDTH, b->agreed.width);

    for (int y = y0; y < sst_min_int(y0 + SST_RENDER_CELL_HEIGHT, b->agreed.height); y++)
        memset(sst_map_u8_row(&b->agreed, y) + x0, 0, (size_t)(x1 - x0));
}

/* Sets in which all stale cells are rendered, by the time between sets. */
static int count_turns(struct picture_behind *b, int64_t t_ns)
{
    const int64_t since_ns = t_ns - b->t_ns, least_ns = TURN_NS / MOST_TURNS;
    const int64_t step_ns = since_ns < least_ns ? least_ns : since_ns < TURN_NS ? since_ns : TURN_NS;

    b->t_ns = t_ns;
    b->step_ns = b->step_ns ? (3 * b->step_ns + step_ns) / 4 : step_ns;
    return sst_clamp_int((int)((TURN_NS + b->step_ns / 2) / b->step_ns), TURNS, MOST_TURNS);
}

/* The run of cells that a cell belongs to. */
static int run_of(const struct picture_behind *b, int at)
{
    return at / b->cols * ((b->cols + RUN - 1) / RUN) + at % b->cols / RUN;
}

int picture_behind_slowness(const struct picture_behind *b, int at)
{
    return b->cell[at].calm < CALM || !b->swaying ? 1 : CALM_TIMES;
}

/* Sets within which a stale cell is rendered. */
static int turns_of(const struct picture_behind *b, int at)
{
    return b->turns * picture_behind_slowness(b, at);
}

static bool is_starting(const struct picture_behind *b)
{
    return b->round < START_ROUNDS;
}

/* Is a stale cell rendered in this round? All in the first one and in exact mode. */
static bool has_turn(const struct picture_behind *b, const struct sst_live *live, int at)
{
    const int turns = !b->round ? 1 : is_starting(b) ? START_TURNS : turns_of(b, at);

    return !live->cfg.skip_change || b->cell[at].stale >= turns || (run_of(b, at) + b->round) % turns == 0;
}

static void mark_stale(struct picture_behind *b, const struct sst_live *live)
{
    int holes = 0, stale = 0;

    for (int plane = 0; plane < b->planned && b->serial != live->serial; plane++) {
        memset(b->changed, 0, (size_t)b->cols * (size_t)b->rows);
        picture_mark_changes(b->changed, live, &b->plan[plane], b->serial);
        make_stale(b, plane, b->changed);
    }
    b->serial = live->serial;
    for (int i = 0; i < b->cols * b->rows; i++) {
        holes += b->cell[i].holes > 0;
        stale += b->cell[i].holes && b->cell[i].stale;
    }
    b->swaying = 2 * stale > holes;
}

bool picture_behind_render(struct picture_behind *b, const struct sst_live *live, const struct sst_image *image,
                           const struct sst_map_u8 *weight, double cut_px)
{
    int err = 0;

    if (!live->low_confidence || isnan(live->focus.focus_px) || reserve(b, &live->lf) || !find_holes(b, live, weight) ||
        update_plans(b, live, cut_px))
        return false;
    if (!b->late)
        count_colours(b, live, image, weight, cut_px);
    mark_stale(b, live);
    b->turns = count_turns(b, live->focus.t_ns);
    for (int plane = 0; plane < b->planned && !err; plane++) {
        for (int i = 0; i < b->cols * b->rows; i++)
            b->wanted[i] = b->cell[i].holes && b->cell[i].plane == plane && b->cell[i].stale && has_turn(b, live, i);
        err = render_cells(b, plane, &b->image, &b->agreed);
        for (int i = 0; i < b->cols * b->rows && !err; i++) {
            if (!b->wanted[i])
                continue;
            b->cell[i].stale = 0;
            b->cell[i].score = score(b, &b->agreed, i);
            b->cell[i].calm = (uint8_t)sst_min_int(b->cell[i].calm + 1, CALM);
        }
    }
    for (int i = 0; i < b->cols * b->rows; i++) {
        if (!b->cell[i].stale)
            continue;
        hide_cell(b, i);
        b->cell[i].stale = (uint8_t)sst_min_int(b->cell[i].stale + 1, CALM_TIMES * MOST_TURNS);
    }
    return !err;
}

/* What the picture shows in a cell: has it changed? */
static bool has_changed(const struct picture_behind *b, const struct picture_memory *m, int at)
{
    const int across = SST_RENDER_CELL_WIDTH / SST_RENDER_CELL_HEIGHT, x0 = at % b->cols * across;
    const int x1 = sst_min_int(x0 + across, m->cols[CELL_LEVEL]);
    const struct picture_votes *v = m->level[CELL_LEVEL] + (size_t)(at / b->cols) * (size_t)m->cols[CELL_LEVEL];
    int same = 0, changed = 0;

    for (int x = x0; x < x1; x++) {
        same += v[x].same;
        changed += v[x].changed;
    }
    return changed >= CHANGED_PX && changed > CHANGED * (same + changed);
}

/* Changes wake their cell and the cells around it. */
static void wake_changed(struct picture_behind *b, const struct picture_memory *m)
{
    b->moving = 0;
    for (int i = 0; i < b->cols * b->rows; i++) {
        const int col = i % b->cols, row = i / b->cols;

        if (!has_changed(b, m, i))
            continue;
        b->moving++;
        for (int y = sst_max_int(row - 1, 0); y <= sst_min_int(row + 1, b->rows - 1); y++) {
            for (int x = sst_max_int(col - 1, 0); x <= sst_min_int(col + 1, b->cols - 1); x++)
                b->cell[y * b->cols + x].calm = 0;
        }
    }
}

/* The plane that a cell is tried on in this round; -1: none. */
static int candidate(const struct picture_behind *b, int at)
{
    const int run = run_of(b, at), plane = b->cell[at].plane, turns = EXPLORE * turns_of(b, at);

    if (!b->cell[at].holes || b->cell[at].stale)
        return -1;
    if (is_starting(b))
        return (run + b->round) % START_TRIED ? -1 : (1 + b->round / START_TRIED) % b->planned;
    if ((run + b->round) % turns)
        return -1;
    return (plane + (b->round / turns % 2 ? 1 : b->planned - 1)) % b->planned;
}

void picture_behind_explore(struct picture_behind *b, const struct picture_memory *m)
{
    int err = 0;

    wake_changed(b, m);

    for (int plane = 0; plane < b->planned && !err; plane++) {
        for (int i = 0; i < b->cols * b->rows; i++)
            b->wanted[i] = b->cell[i].plane != plane && candidate(b, i) == plane;
        err = render_cells(b, plane, &b->trial, &b->trial_agreed);
        for (int i = 0; i < b->cols * b->rows && !err; i++) {
            const float found = b->wanted[i] ? score(b, &b->trial_agreed, i) : 0;

            if (found > (float)BETTER * b->cell[i].score)
                b->cell[i] = (struct picture_cell){
                    .holes = b->cell[i].holes, .plane = (uint8_t)plane, .stale = 1, .score = found
                };
        }
    }
    b->round++;
}

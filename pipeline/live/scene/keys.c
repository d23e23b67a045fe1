#include <math.h>

#include "pipeline/live/scene/scene_internal.h"

/* One key for this number of views along rows and along columns. */
#define KEY_SPACING 3
/* Steps of half a pixel at half size: see-through weights resolve far coarser differences only. */
#define DIVISOR 2
#define STEPS 32 /* of a whole register of costs */
#define Q6    64 /* stored disparities to a px */
/* Census between pixels in halves: as fine as the steps. */
#define PHASE_STEP 2
/* Penalties of the semi-global optimisation, equal to the preview preset's. */
#define PENALTY_1 14
#define PENALTY_2 90
#define EDGE_STEP 24
#define PATHS     4
/* The range of a rectangle's last map is searched, and this many steps more at either end (S3): 4 px. */
#define AROUND_STEPS 4

static bool present_at(const struct sst_lightfield *lf, int row, int col)
{
    return row >= 0 && col >= 0 && row < lf->rows && col < lf->cols && lf->views[row * lf->cols + col].present;
}

int scene_neighbours(const struct sst_lightfield *lf, int view, int out[SST_SCENE_NEIGHBOURS])
{
    static const int sides[][2] = {
        { 0, -1 }, { 0, 1 }, { -1, 0 }, { 1, 0 }, { -1, -1 }, { -1, 1 }, { 1, -1 }, { 1, 1 }
    };
    int count = 0;

    for (int i = 0; i < (int)ARRAY_LEN(sides) && count < SST_SCENE_NEIGHBOURS; i++) {
        const int row = view / lf->cols + sides[i][0], col = view % lf->cols + sides[i][1];

        if (present_at(lf, row, col))
            out[count++] = row * lf->cols + col;
    }
    return count;
}

/* The present view with a neighbour that is nearest to a position, within reach; -1: none. Ties: the lower index. */
static int nearest_view(const struct sst_lightfield *lf, int row, int col, int reach)
{
    int best = -1, least = 0;

    for (int r = row - reach; r <= row + reach; r++) {
        for (int c = col - reach; c <= col + reach; c++) {
            const int distance = (r - row) * (r - row) + (c - col) * (c - col);
            int unused[SST_SCENE_NEIGHBOURS];

            if (!present_at(lf, r, c) || (best >= 0 && distance >= least))
                continue;
            if (scene_neighbours(lf, r * lf->cols + c, unused)) {
                best = r * lf->cols + c;
                least = distance;
            }
        }
    }
    return best;
}

static int add_key(int *views, int count, int view)
{
    for (int i = 0; i < count; i++) {
        if (views[i] == view)
            return count;
    }
    if (view < 0 || count == SST_SCENE_KEYS)
        return count;
    views[count] = view;
    return count + 1;
}

int scene_choose_keys(const struct sst_lightfield *lf, int views[SST_SCENE_KEYS])
{
    const int down = (lf->rows + KEY_SPACING - 1) / KEY_SPACING, across = (lf->cols + KEY_SPACING - 1) / KEY_SPACING;
    const int ref = lf->ref_view;
    /* If the reference has no present neighbour, use the nearest view that has one. */
    int count = add_key(views, 0, nearest_view(lf, ref / lf->cols, ref % lf->cols, sst_max_int(lf->rows, lf->cols)));

    for (int i = 0; i < down; i++) {
        for (int j = 0; j < across; j++)
            count = add_key(views, count,
                            nearest_view(lf, (2 * i + 1) * lf->rows / (2 * down), (2 * j + 1) * lf->cols / (2 * across),
                                         KEY_SPACING / 2));
    }
    return count;
}

static bool overlap(const struct scene_rect *a, const struct scene_rect *b)
{
    return a->x0 < b->x1 && b->x0 < a->x1 && a->y0 < b->y1 && b->y0 < a->y1;
}

static void join(struct scene_rect *a, const struct scene_rect *b)
{
    a->x0 = sst_min_int(a->x0, b->x0);
    a->y0 = sst_min_int(a->y0, b->y0);
    a->x1 = sst_max_int(a->x1, b->x1);
    a->y1 = sst_max_int(a->y1, b->y1);
}

/* Add a rectangle: joined with the ones that it overlaps, and with the last one when the list is full. */
static int add_rect(struct scene_rect *rects, int count, struct scene_rect r)
{
    for (int i = 0; i < count;) {
        if (!overlap(&rects[i], &r) && count < SST_SCENE_RECTS) {
            i++;
            continue;
        }
        join(&r, &rects[i]);
        rects[i] = rects[--count];
        i = 0;
    }
    rects[count] = r;
    return count + 1;
}

int scene_gather(struct scene_rect rects[SST_SCENE_RECTS], const uint8_t *dirty, int cols, int rows, int width,
                 int height)
{
    int count = 0;

    for (int y = 0; y < rows; y++) {
        for (int x = 0, end; x < cols; x = end + 1) {
            for (end = x; end < cols && dirty[y * cols + end] == 1; end++)
                ;
            if (end > x)
                count = add_rect(rects, count, (struct scene_rect){ x - 1, y - 1, end + 1, y + 2 });
        }
    }
    for (int i = 0; i < count; i++) {
        rects[i].x0 = sst_max_int(rects[i].x0 * SST_SCENE_CELLS, 0);
        rects[i].y0 = sst_max_int(rects[i].y0 * SST_SCENE_CELLS, 0);
        rects[i].x1 = sst_min_int(rects[i].x1 * SST_SCENE_CELLS, width);
        rects[i].y1 = sst_min_int(rects[i].y1 * SST_SCENE_CELLS, height);
    }
    return count;
}

double scene_disp_min(double min_px)
{
    return 2 * floor(min_px / 2);
}

int scene_matcher_init(struct scene_matcher *m, double min_px, double max_px, int width, int height)
{
    struct scene_matcher made = { 0 };
    const int first = (int)floor(min_px / 2), last = (int)ceil(max_px / 2);
    int err = sst_volume_init(&made.volume, width, height, first, (last - first) * DIVISOR + 1);

    made.volume.divisor = DIVISOR;
    made.volume.phase_step = PHASE_STEP;
    err = err ? err : sst_map_u16_init(&made.disp, width, height);
    err = err ? err : sst_map_u8_init(&made.confidence, width, height);
    if (err)
        scene_matcher_fini(&made);
    else
        *m = made;
    return err;
}

void scene_matcher_fini(struct scene_matcher *m)
{
    sst_volume_fini(&m->volume);
    sst_map_u16_fini(&m->disp);
    sst_map_u8_fini(&m->confidence);
}

/* The part of a picture inside a rectangle; borrowed. */
static struct sst_image part_of(const struct sst_image *img, const struct scene_rect *r)
{
    struct sst_image part = { .width = r->x1 - r->x0, .height = r->y1 - r->y0, .stride = img->stride };

    for (int c = 0; c < 3; c++)
        part.plane[c] = sst_image_row(img, c, r->y0) + r->x0;
    return part;
}

/* Some of the steps of a volume. */
struct steps {
    int first, count;
    size_t padded;
};

/* The steps of a rectangle's last map and around; a stored disparity of a map counts 64 for a step. Whole registers, and
 * whole px of the volume. */
static struct steps last_steps(const struct scene_matcher *m, const struct scene_key *key, const struct scene_rect *r)
{
    const struct steps all = { 0, m->volume.steps, m->volume.steps_padded };
    int least = SST_DISP_NONE, most = 0, first, last;
    size_t padded;

    for (int y = r->y0; y < r->y1; y++) {
        const uint16_t *disp = sst_map_u16_row(&key->maps.disp, y);

        for (int x = r->x0; x < r->x1; x++) {
            least = sst_min_int(least, disp[x]);
            most = sst_max_int(most, disp[x]);
        }
    }
    if (most == SST_DISP_NONE)
        return all;
    first = sst_max_int(least / Q6 - AROUND_STEPS, 0) / DIVISOR * DIVISOR;
    last = sst_min_int(most / Q6 + 1 + AROUND_STEPS, all.count - 1);
    padded = ((size_t)(last - first + 1) + STEPS - 1) / STEPS * STEPS;
    if (first > last || padded >= all.padded)
        return all;
    first = sst_min_int(first, (all.count - (int)padded + DIVISOR - 1) / DIVISOR * DIVISOR);
    return (struct steps){ first, sst_min_int((int)padded, all.count - first), padded };
}

/* Count the disparities that a narrower search would have missed. */
static void compare(struct scene_matcher *m, const struct sst_map_u16 *disp, const struct steps *last)
{
    for (int y = 0; y < disp->height; y++) {
        const uint16_t *row = sst_map_u16_row(disp, y);

        for (int x = 0; x < disp->width; x++) {
            const int step = row[x] * DIVISOR / Q6;

            m->missed += row[x] != SST_DISP_NONE && (step < last->first || step >= last->first + last->count);
        }
    }
    m->compared += (int64_t)disp->width * disp->height;
}

/* Copy changed tiles to the key's map; half-size disparities, from step `first` on, become full-size ones. */
static void store(struct scene_key *key, const struct sst_map_u16 *disp, int first, const struct sst_descriptor *desc,
                  const struct scene_rect *r, const uint8_t *dirty, int tile_cols)
{
    const int add = Q6 * first / DIVISOR;

    for (int y = r->y0; y < r->y1; y++) {
        const uint16_t *from = sst_map_u16_row(disp, y - r->y0);
        const uint8_t *tiles = dirty + y / SST_SCENE_CELLS * tile_cols;
        const uint8_t *seen = desc->seen.data ? sst_map_u8_row(&desc->seen, y) : NULL;
        uint16_t *to = sst_map_u16_row(&key->maps.disp, y);

        for (int x = r->x0; x < r->x1; x++) {
            if (tiles[x / SST_SCENE_CELLS])
                to[x] = seen && !seen[x] ? (uint16_t)SST_DISP_NONE : (uint16_t)(2 * (from[x - r->x0] + add));
        }
    }
}

int scene_match(struct scene_matcher *m, const struct sst_lightfield *lf, const struct sst_descriptor *desc,
                struct scene_key *key, const struct scene_rect *rect, const uint8_t *dirty, int tile_cols)
{
    static const struct sst_disparity_config cfg = {
        .paths = PATHS, .p1 = PENALTY_1, .p2 = PENALTY_2, .edge_step = EDGE_STEP
    };
    const struct sst_view *v = &lf->views[key->view];
    const struct sst_image part = part_of(&desc[key->view].image, rect);
    const struct steps all = { 0, m->volume.steps, m->volume.steps_padded };
    const struct steps last = m->ranges == SCENE_RANGES_WHOLE ? all : last_steps(m, key, rect);
    const struct steps *at = m->ranges == SCENE_RANGES_LAST ? &last : &all;
    const int disp_min = m->volume.disp_min;
    const int64_t cells = (int64_t)part.width * part.height;
    struct sst_neighbour neighbours[SST_SCENE_NEIGHBOURS];
    struct sst_map_u16 disp = m->disp;
    struct sst_map_u8 confidence = m->confidence;
    int err;

    for (int i = 0; i < key->neighbours; i++) {
        const int n = key->neighbour[i];

        neighbours[i] = (struct sst_neighbour){ &desc[n], lf->views[n].bx - v->bx, lf->views[n].by - v->by };
    }
    disp.width = confidence.width = part.width;
    disp.height = confidence.height = part.height;
    m->searched += cells * at->count;
    m->left_out += cells * (all.count - at->count);
    m->volume.disp_min = disp_min + at->first / DIVISOR;
    m->volume.steps = at->count;
    m->volume.steps_padded = at->padded;
    sst_volume_window(&m->volume, rect->x0, rect->y0, part.width, part.height);
    sst_volume_fill(&m->volume, &desc[key->view], neighbours, key->neighbours);
    err = sst_disparity_sgm(&m->volume, &part, &cfg);
    err = err ? err : sst_volume_winner(&m->volume, false, &disp, &confidence);
    err = err ? err : sst_disparity_median5(&disp, &m->volume.lines);
    m->volume.disp_min = disp_min;
    m->volume.steps = all.count;
    m->volume.steps_padded = all.padded;
    if (!err && m->ranges == SCENE_RANGES_COMPARE)
        compare(m, &disp, &last);
    if (!err)
        store(key, &disp, at->first, &desc[key->view], rect, dirty, tile_cols);
    return err;
}

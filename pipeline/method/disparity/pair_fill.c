/* Before the holes of a pair's map are filled: surfaces too small to be believed are dropped, and the margin that the
 * other image does not show continues the plane beside it. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/mem.h"
#include "pipeline/method/disparity/stage.h"

#define JOINED_Q6 64 /* neighbours of one surface differ by a pixel at most */

/* Pixels that the plane of a margin is fitted to, beside the row's first confirmed one. */
#define PLANE_COLUMNS  48
#define PLANE_ROWS     8          /* to both sides */
#define PLANE_NEAR_Q6  (4 * 64)   /* others are not of that surface */
#define PLANE_LEAST    40         /* fewer carry no slope */
#define PLANE_ERROR_Q6 (0.3 * 64) /* RMS; more is no plane */
#define PLANE_SLOPE_Q6 (0.2 * 64) /* per column; steeper surfaces end before the margin does */

static uint32_t find_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i) {
        parent[i] = parent[parent[i]];
        i = parent[i];
    }
    return i;
}

static void join(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = find_root(parent, a);
    b = find_root(parent, b);
    if (a < b)
        parent[b] = a;
    else
        parent[a] = b;
}

static bool joined(int a, int b)
{
    return abs(a - b) <= JOINED_Q6;
}

/* Label row y: every pixel gets the surface of its left or upper neighbour, or a new one. @return surfaces so far */
static uint32_t label_row(uint32_t *label, uint32_t *parent, uint32_t count, const struct sst_map_u8 *status,
                          const struct sst_map_u16 *disp, int y)
{
    const int w = disp->width;
    const uint8_t *ok = sst_map_u8_row(status, y), *ok_above = sst_map_u8_row(status, sst_max_int(y - 1, 0));
    const uint16_t *d = sst_map_u16_row(disp, y), *above = sst_map_u16_row(disp, sst_max_int(y - 1, 0));
    uint32_t *own = label + (size_t)y * (size_t)w;

    for (int x = 0; x < w; x++) {
        bool upper;

        if (ok[x] != SST_DISPARITY_CORRECT)
            continue;
        upper = y > 0 && ok_above[x] == SST_DISPARITY_CORRECT && joined(d[x], above[x]);
        if (x > 0 && ok[x - 1] == SST_DISPARITY_CORRECT && joined(d[x], d[x - 1])) {
            own[x] = own[x - 1];
            if (upper && own[x] != own[x - w])
                join(parent, own[x], own[x - w]);
        } else if (upper) {
            own[x] = own[x - w];
        } else {
            parent[count] = count;
            own[x] = count++;
        }
    }
    return count;
}

int sst_disparity_drop_specks(struct sst_map_u8 *status, const struct sst_map_u16 *disp_q6, int least)
{
    const size_t w = (size_t)disp_q6->width, pixels = w * (size_t)disp_q6->height;
    uint32_t *label = sst_mem_alloc_raw(pixels, 3 * sizeof(*label)), *parent = label + pixels;
    uint32_t *size = parent + pixels, count = 0;

    if (!label)
        return -ENOMEM;
    for (int y = 0; y < disp_q6->height; y++)
        count = label_row(label, parent, count, status, disp_q6, y);
    for (uint32_t i = 0; i < count; i++)
        size[i] = 0;
    for (int y = 0; y < disp_q6->height; y++) {
        for (size_t x = 0; x < w; x++) {
            if (sst_map_u8_row(status, y)[x] == SST_DISPARITY_CORRECT)
                size[label[(size_t)y * w + x] = find_root(parent, label[(size_t)y * w + x])]++;
        }
    }
    for (int y = 0; y < disp_q6->height; y++) {
        uint8_t *s = sst_map_u8_row(status, y);

        for (size_t x = 0; x < w; x++) {
            if (s[x] == SST_DISPARITY_CORRECT && size[label[(size_t)y * w + x]] < (uint32_t)least)
                s[x] = SST_DISPARITY_OCCLUSION;
        }
    }
    sst_mem_free(label);
    return 0;
}

/* Sums over the points of a plane: across, down, and the disparity above the anchor's. */
struct sums {
    int64_t n, x, y, z, xx, xy, yy, xz, yz, zz;
};

/* Of row y's anchor at column x0 and the pixels beside it, in direction dir. */
static struct sums sum_points(const struct sst_map_u16 *disp, const struct sst_map_u8 *status, int x0, int y, int dir)
{
    const int anchor = sst_map_u16_row(disp, y)[x0], end = sst_min_int(y + PLANE_ROWS, disp->height - 1);
    const int columns = sst_min_int(PLANE_COLUMNS, dir > 0 ? disp->width - x0 : x0 + 1);
    struct sums s = { 0 };

    for (int j = sst_max_int(y - PLANE_ROWS, 0); j <= end; j++) {
        const uint16_t *d = sst_map_u16_row(disp, j) + x0;
        const uint8_t *ok = sst_map_u8_row(status, j) + x0;
        int n = 0, x = 0, z = 0, xx = 0, xz = 0, zz = 0; /* of the row: 48 points, |z| <= 256 */

        for (int i = 0; i < columns; i++) {
            const int at = d[i * dir] - anchor;

            if (ok[i * dir] != SST_DISPARITY_CORRECT || abs(at) > PLANE_NEAR_Q6)
                continue;
            n++;
            x += i;
            z += at;
            xx += i * i;
            xz += i * at;
            zz += at * at;
        }
        s.n += n;
        s.x += x;
        s.y += (j - y) * n;
        s.z += z;
        s.xx += xx;
        s.xy += (j - y) * x;
        s.yy += (j - y) * (j - y) * n;
        s.xz += xz;
        s.yz += (j - y) * z;
        s.zz += zz;
    }
    return s;
}

/* Slope of the plane along the row, 1/64 px per column away from the margin; 0 where the points are none. */
static double plane_slope(const struct sums *s)
{
    /* Moments about the mean, times n; whole numbers, so exact. */
    const int64_t xx = s->n * s->xx - s->x * s->x, xy = s->n * s->xy - s->x * s->y, yy = s->n * s->yy - s->y * s->y;
    const int64_t xz = s->n * s->xz - s->x * s->z, yz = s->n * s->yz - s->y * s->z, zz = s->n * s->zz - s->z * s->z;
    const double det = (double)xx * (double)yy - (double)xy * (double)xy, n = (double)s->n;
    double across, down, error;

    if (s->n < PLANE_LEAST || det <= 0)
        return 0;
    across = ((double)xz * (double)yy - (double)yz * (double)xy) / det;
    down = ((double)yz * (double)xx - (double)xz * (double)xy) / det;
    error = ((double)zz - across * (double)xz - down * (double)yz) / (n * n);
    return error <= PLANE_ERROR_Q6 * PLANE_ERROR_Q6 && fabs(across) <= PLANE_SLOPE_Q6 ? across : 0;
}

/* Columns x0 - dir, x0 - 2 dir ... to the border continue the plane beside x0, the first confirmed one. */
static void extend(struct sst_map_u16 *disp, const struct sst_map_u8 *status, int x0, int y, int dir, int range)
{
    const struct sums s = sum_points(disp, status, x0, y, dir);
    const double slope = plane_slope(&s);
    uint16_t *d = sst_map_u16_row(disp, y);

    for (int i = 1, x = x0 - dir; x >= 0 && x < disp->width; i++, x -= dir)
        d[x] = (uint16_t)sst_clamp_int(d[x0] - (int)lrint(slope * i), 0, 64 * range);
}

void sst_disparity_extend_margins(struct sst_map_u16 *disp_q6, struct sst_map_u8 *status, int disp_min, int range)
{
    const int w = disp_q6->width;
    const int left = sst_clamp_int(disp_min + range, 0, w - 1), right = sst_clamp_int(-disp_min, 0, w - 1);

    for (int y = 0; y < disp_q6->height; y++) {
        const uint8_t *ok = sst_map_u8_row(status, y);
        int first = 0, last = w - 1;

        while (first <= left && ok[first] != SST_DISPARITY_CORRECT)
            first++;
        while (last >= w - 1 - right && ok[last] != SST_DISPARITY_CORRECT)
            last--;
        if (first > 0 && first <= left)
            extend(disp_q6, status, first, y, 1, range);
        if (last < w - 1 && last >= w - 1 - right)
            extend(disp_q6, status, last, y, -1, range);
    }
    /* Only now: what was extended must not support the planes of other rows. */
    for (int y = 0; y < disp_q6->height; y++) {
        uint8_t *s = sst_map_u8_row(status, y);
        int first = 0, last = w - 1;

        while (first <= left && s[first] != SST_DISPARITY_CORRECT)
            first++;
        while (last >= w - 1 - right && s[last] != SST_DISPARITY_CORRECT)
            last--;
        for (int x = 0; first <= left && x < first; x++)
            s[x] = SST_DISPARITY_CORRECT;
        for (int x = w - 1; last >= w - 1 - right && x > last; x--)
            s[x] = SST_DISPARITY_CORRECT;
    }
}

/* Text that cameras draw into their frames, such as a clock. It changes in every set, is at the same position in all
 * views, and is no part of the scene: its tiles are decoded in one set out of BURNT_SETS and count as unchanged in the
 * others.
 *
 * A tile at the upper or lower edge is text if it has changed in many sets, each time in nearly all views: an object of
 * the scene is at another position in every view. A tile of text with a changed tile of the scene near it is decoded as
 * any other tile, since an object may be moving into it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/live/frames/frames_internal.h"

#define BURNT_SETS  4  /* text is read in one set of this number */
#define BURNT_ROWS  2  /* of tiles, along the upper and along the lower edge */
#define BURNT_KNOWN 10 /* a tile is text from this number of changes on, ... */
#define BURNT_MOST  20
#define BURNT_FADE  8     /* ... of which one is forgotten in this number of sets without a change; ... */
#define BURNT_VIEWS 4     /* ... each judged by at least this number of views, ... */
#define BURNT_ALIKE 0.875 /* ... of which this fraction changed, or else did not change: it is no text */

int frames_burnt_init(struct frames_burnt *b, int cols, int rows)
{
    *b = (struct frames_burnt){ .cols = cols, .rows = rows };
    b->often = sst_mem_alloc((size_t)cols, (size_t)rows);
    b->reached = sst_mem_alloc((size_t)cols, (size_t)rows);
    if (b->often && b->reached)
        return 0;
    frames_burnt_fini(b);
    return -ENOMEM;
}

void frames_burnt_fini(struct frames_burnt *b)
{
    sst_mem_free(b->often);
    sst_mem_free(b->reached);
    *b = (struct frames_burnt){ 0 };
}

static bool is_text(const struct frames_burnt *b, int tile)
{
    return b->often[tile] >= BURNT_KNOWN;
}

bool frames_burnt_read(struct frames_burnt *b)
{
    b->sets++;
    return b->sets - b->read >= BURNT_SETS;
}

void frames_burnt_accepted(struct frames_burnt *b)
{
    b->read = b->sets;
}

bool frames_burnt_alone(const struct frames_burnt *b, const uint8_t *changed)
{
    for (int t = 0; t < b->cols * b->rows; t++) {
        if (changed[t] && !is_text(b, t))
            return false;
    }
    return true;
}

void frames_burnt_learn(struct frames_burnt *b, const uint8_t *const *changed, int views)
{
    if (views < BURNT_VIEWS)
        return;
    for (int t = 0; t < b->cols * b->rows; t++) {
        const int row = t / b->cols;
        int n = 0;

        if (row >= BURNT_ROWS && row < b->rows - BURNT_ROWS)
            continue;
        for (int k = 0; k < views; k++)
            n += changed[k][t];
        if (n >= BURNT_ALIKE * views)
            b->often[t] = (uint8_t)sst_min_int(b->often[t] + 1, BURNT_MOST);
        else if (n > (1 - BURNT_ALIKE) * views) /* or text that was read near something else in some views */
            b->often[t] = is_text(b, t) ? (uint8_t)(b->often[t] - 1) : 0;
        else if (!n && b->often[t] && b->sets % BURNT_FADE == 0)
            b->often[t]--;
    }
}

/* Note near which tiles something else has changed. */
static void reach(struct frames_burnt *b, const uint8_t *changed)
{
    memset(b->reached, 0, (size_t)b->cols * (size_t)b->rows);
    for (int t = 0; t < b->cols * b->rows; t++) {
        const int x0 = sst_max_int(t % b->cols - 1, 0), x1 = sst_min_int(t % b->cols + 1, b->cols - 1);
        const int y0 = sst_max_int(t / b->cols - BURNT_ROWS, 0);
        const int y1 = sst_min_int(t / b->cols + BURNT_ROWS, b->rows - 1);

        for (int y = y0; y <= y1 && changed[t] && !is_text(b, t); y++)
            memset(b->reached + y * b->cols + x0, 1, (size_t)(x1 - x0 + 1));
    }
}

int frames_burnt_leave(struct frames_burnt *b, uint8_t *changed)
{
    int left = 0;

    reach(b, changed);
    for (int t = 0; t < b->cols * b->rows; t++) {
        if (!changed[t] || b->reached[t] || !is_text(b, t))
            continue;
        changed[t] = 0;
        left++;
    }
    return left;
}

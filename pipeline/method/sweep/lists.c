/* Planes that are computed of views in work, by rows and blocks: in the second round the planes that views claim around
 * there (design.md, 5.7). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/method/sweep/sweep_internal.h"

#define GROUPS ((SWEEP_TILE + SWEEP_LOOK) / SWEEP_GROUP + 2) /* with the rows above and below */
#define NEAR   1 /* listed planes are at most so far from a plane of the view's own map */
#define PARTS  (SST_CONSENSUS_BLOCK / SST_CONSENSUS_PART)

int sweep_lists_init(const struct sweep *s, struct sweep_lists *l)
{
    const size_t entries = (size_t)s->planes * (size_t)s->blocks;

    l->on = sst_mem_alloc(entries, GROUPS);
    l->plane = sst_mem_alloc(entries, GROUPS);
    l->count = sst_mem_alloc((size_t)s->blocks, GROUPS);
    l->own = sst_mem_alloc(entries, 1);
    return l->on && l->plane && l->count && l->own ? 0 : -ENOMEM;
}

void sweep_lists_fini(struct sweep_lists *l)
{
    sst_mem_free(l->on);
    sst_mem_free(l->plane);
    sst_mem_free(l->count);
    sst_mem_free(l->own);
}

static int group_of(const struct sweep_lists *l, int y)
{
    return y / SWEEP_GROUP - l->first;
}

const uint8_t *sweep_lists_on(const struct sweep *s, const struct sweep_lists *l, int y)
{
    return l->on + (size_t)group_of(l, y) * (size_t)s->planes * (size_t)s->blocks;
}

struct sst_consensus_listed sweep_lists_at(const struct sweep *s, const struct sweep_lists *l, int y)
{
    const size_t group = (size_t)group_of(l, y), blocks = (size_t)s->blocks;

    return (struct sst_consensus_listed){ l->plane + group * (size_t)s->planes * blocks, l->count + group * blocks };
}

/* Blocks of a view whose pixels, or pixels beside them, show claimed parts of the plane in rows[0] .. rows[1]. */
static void list_plane(uint8_t *on, const struct sweep *s, const struct sweep_plane *p, const int shift[2],
                       const int rows[2])
{
    const int left = shift[0] - p->x0 - 1;

    memset(on, 0, (size_t)s->blocks);
    for (int b = 0; b < s->blocks; b++) {
        const int from = sst_max_int(left + b * SST_CONSENSUS_BLOCK, 0) / SST_CONSENSUS_PART;
        const int to = (left + (b + 1) * SST_CONSENSUS_BLOCK + 1) / SST_CONSENSUS_PART;
        const unsigned wanted = (1U << (to - from + 1)) - 1;
        const int first = from / PARTS, count = sst_min_int(3, p->blocks - first);

        for (int y = rows[0]; y <= rows[1] && !on[b]; y++) {
            const uint8_t *claimed = p->claimed + (size_t)((y + shift[1] - p->y0) % p->rows) * (size_t)p->blocks;
            unsigned parts = 0;

            for (int i = 0; i < count; i++)
                parts |= (unsigned)claimed[first + i] << PARTS * i;
            on[b] = (parts >> from % PARTS & wanted) != 0;
        }
    }
}

/* Planes near the view's own map in blocks of rows[0] .. rows[1]. */
static void find_own(const struct sweep *s, const struct sweep_lists *l, int k, const int rows[2])
{
    for (int b = 0; b < s->blocks; b++) {
        const int left = b * SST_CONSENSUS_BLOCK, end = sst_min_int(left + SST_CONSENSUS_BLOCK, s->width);
        uint8_t near[256 + 2 * NEAR] = { 0 }, *own = near + NEAR;

        for (int y = rows[0]; y <= rows[1]; y++) {
            const uint8_t *plane = s->view[k].plane + (size_t)y * s->stride + SWEEP_PAD;

            for (int x = left; x < end; x++)
                own[plane[x]] = 1;
        }
        for (int i = 0; i < s->planes; i++) {
            uint8_t any = 0;

            for (int j = -NEAR; j <= NEAR; j++)
                any |= own[i + j];
            l->own[i * s->blocks + b] = any;
        }
    }
}

/* The lists of a group of rows. */
static void list_group(const struct sweep *s, const struct sweep_lists *l, int k, int top, int bottom)
{
    const int rows[2] = { sst_max_int(top, s->view[k].top) - (top > 0), sst_min_int(bottom, s->height - 1) };
    const size_t at = (size_t)group_of(l, top) * (size_t)s->planes * (size_t)s->blocks;
    uint8_t *on = l->on + at, *count = l->count + group_of(l, top) * s->blocks;

    memset(count, 0, (size_t)s->blocks);
    if (s->own)
        find_own(s, l, k, rows);
    for (int i = 0; i < s->planes; i++, on += s->blocks) {
        if (s->again)
            list_plane(on, s, &s->plane[i], s->plane[i].shift[k], rows);
        else
            memset(on, 1, (size_t)s->blocks);
        for (int b = 0; s->own && b < s->blocks; b++)
            on[b] &= l->own[i * s->blocks + b];
        for (int b = 0; b < s->blocks; b++) {
            if (i == s->planes - 1 && !count[b]) /* nothing is claimed: any plane */
                on[b] = 1;
            if (on[b])
                l->plane[at + (size_t)b * (size_t)s->planes + count[b]++] = (uint8_t)i;
        }
    }
}

void sweep_lists_make(const struct sweep *s, struct sweep_lists *l, int k, int bottom)
{
    int y = sst_max_int(s->view[k].top - 1, 0);

    l->first = y / SWEEP_GROUP;
    /* Rows of the consensus are there from the one above the tile to the one below it. */
    for (int end; y <= sst_min_int(bottom, s->height - 1); y = end) {
        end = (y / SWEEP_GROUP + 1) * SWEEP_GROUP;
        list_group(s, l, k, y, sst_min_int(end, bottom));
    }
}

void sweep_lists_clear(const struct sweep *s, const struct sweep_lists *l, uint8_t *layer, uint8_t value,
                       const int rows[2])
{
    const uint8_t *was = sweep_lists_on(s, l, rows[0]), *is = sweep_lists_on(s, l, rows[1]);

    for (int i = 0; was != is && i < s->planes; i++, was += s->blocks, is += s->blocks) {
        uint8_t *to = layer + (size_t)i * s->stride + SWEEP_PAD;
        const bool same = !memcmp(was, is, (size_t)s->blocks);

        for (int b = 0; !same && b < s->blocks; b++) {
            if (was[b] && !is[b])
                memset(to + (ptrdiff_t)b * SST_CONSENSUS_BLOCK, value, SST_CONSENSUS_BLOCK);
        }
    }
}

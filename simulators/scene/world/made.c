#include "simulators/scene/world/world_internal.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/mem.h"

struct item {
    struct sim_made_key key;
    struct sim_jpeg frame;
    uint64_t used;
};

struct shelf {
    struct item *items;
    int count, capacity;
};

struct sim_made {
    struct shelf *shelves; /* one per camera, which keeps lookups short */
    int cams;
    size_t bytes, budget;
    uint64_t clock;
};

int sim_made_create(struct sim_made **out, int cams, size_t budget_bytes)
{
    struct sim_made *m = calloc(1, sizeof(*m));

    if (!m)
        return -ENOMEM;
    *m = (struct sim_made){ calloc((size_t)cams, sizeof(*m->shelves)), cams, 0, budget_bytes, 0 };
    if (!m->shelves) {
        free(m);
        return -ENOMEM;
    }
    *out = m;
    return 0;
}

void sim_made_destroy(struct sim_made *m)
{
    if (!m)
        return;
    for (int c = 0; c < m->cams; c++) {
        for (int i = 0; i < m->shelves[c].count; i++)
            free(m->shelves[c].items[i].frame.data);
        free(m->shelves[c].items);
    }
    free(m->shelves);
    free(m);
}

static bool same(const struct sim_made_key *a, const struct sim_made_key *b)
{
    return a->frame == b->frame && a->fourcc == b->fourcc && a->width == b->width && a->height == b->height &&
           a->light == b->light && !memcmp(a->pose_um, b->pose_um, sizeof(a->pose_um));
}

const struct sim_jpeg *sim_made_find(struct sim_made *m, const struct sim_made_key *key)
{
    const struct shelf *s = &m->shelves[key->cam];

    for (int i = 0; i < s->count; i++) {
        if (same(&s->items[i].key, key)) {
            s->items[i].used = ++m->clock;
            return &s->items[i].frame;
        }
    }
    return NULL;
}

static void drop_oldest(struct sim_made *m)
{
    struct shelf *from = NULL;
    int oldest = 0;

    for (int c = 0; c < m->cams; c++) {
        for (int i = 0; i < m->shelves[c].count; i++) {
            if (!from || m->shelves[c].items[i].used < from->items[oldest].used) {
                from = &m->shelves[c];
                oldest = i;
            }
        }
    }
    m->bytes -= from->items[oldest].frame.bytes;
    free(from->items[oldest].frame.data);
    from->items[oldest] = from->items[--from->count];
}

int sim_made_keep(struct sim_made *m, const struct sim_made_key *key, const struct sim_jpeg *frame)
{
    struct shelf *s = &m->shelves[key->cam];

    while (m->bytes && m->bytes + frame->bytes > m->budget)
        drop_oldest(m);
    if (!sst_mem_grow(&s->items, s->count, &s->capacity, sizeof(*s->items))) {
        free(frame->data);
        return -ENOMEM;
    }
    s->items[s->count++] = (struct item){ *key, *frame, ++m->clock };
    m->bytes += frame->bytes;
    return 0;
}

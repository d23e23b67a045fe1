#include "pipeline/gpu/resident.h"

void sst_gpu_resident_claim(struct sst_gpu_residents *r, struct sst_gpu *g, const void *of)
{
    if (r->of != of) {
        r->turn++;
        sst_gpu_resident_drop_unused(r, g);
    }
    r->of = of;
}

struct sst_gpu_buffer *sst_gpu_resident_find(struct sst_gpu_residents *r, const void *of, enum sst_gpu_resident which,
                                             int view)
{
    struct sst_gpu_resident_plane *p = &r->plane[which][view];

    if (!of || of != r->of || !p->buffer)
        return NULL;
    p->used = r->turn;
    return p->buffer;
}

void sst_gpu_resident_put(struct sst_gpu_residents *r, struct sst_gpu *g, enum sst_gpu_resident which, int view,
                          struct sst_gpu_buffer *b)
{
    sst_gpu_resident_drop(r, g, which, view);
    r->plane[which][view] = (struct sst_gpu_resident_plane){ b, r->turn };
}

void sst_gpu_resident_drop(struct sst_gpu_residents *r, struct sst_gpu *g, enum sst_gpu_resident which, int view)
{
    struct sst_gpu_resident_plane *p = &r->plane[which][view];

    if (p->buffer)
        sst_gpu_buffer_destroy(g, p->buffer);
    p->buffer = NULL;
}

bool sst_gpu_resident_drop_unused(struct sst_gpu_residents *r, struct sst_gpu *g)
{
    bool any = false;

    for (int which = 0; which < SST_GPU_RESIDENTS; which++) {
        for (int view = 0; view < SST_GPU_RESIDENT_VIEWS; view++) {
            if (!r->plane[which][view].buffer || r->plane[which][view].used == r->turn)
                continue;
            sst_gpu_resident_drop(r, g, (enum sst_gpu_resident)which, view);
            any = true;
        }
    }
    return any;
}

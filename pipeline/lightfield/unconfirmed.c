#include "pipeline/lightfield/unconfirmed.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/thread.h"

struct count {
    int64_t pixels, unconfirmed;
};

struct job {
    struct sst_unconfirmed *u;
    const struct sst_lightfield *lf;
    struct count *count; /* [views] */
};

/* Count the valid pixels in columns from .. to-1 of row y, and those of unconfirmed disparity. */
static void count_run(struct count *c, const struct sst_view *v, int from, int to, int y)
{
    const uint8_t *confidence = sst_map_u8_row(&v->confidence, y);
    const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, y) : NULL;

    for (int x = from; x < to; x++) {
        const int seen = !valid || valid[x];

        c->pixels += seen;
        c->unconfirmed += seen && !confidence[x];
    }
}

static int count_view(void *arg, int view, int worker SST_UNUSED)
{
    const struct job *job = arg;
    const struct sst_view *v = &job->lf->views[view];
    struct sst_map_u8 *map = &job->u->view[view];
    const int width = v->confidence.width, height = v->confidence.height;
    int err;

    if (!v->confidence.data)
        return 0;
    err = sst_map_u8_init(map, (width + SST_UNCONFIRMED_BLOCK - 1) / SST_UNCONFIRMED_BLOCK,
                          (height + SST_UNCONFIRMED_BLOCK - 1) / SST_UNCONFIRMED_BLOCK);
    for (int i = 0; !err && i < map->width * map->height; i++) {
        const int x = i % map->width * SST_UNCONFIRMED_BLOCK, y = i / map->width * SST_UNCONFIRMED_BLOCK;
        struct count c = { 0, 0 };

        for (int row = y; row < sst_min_int(y + SST_UNCONFIRMED_BLOCK, height); row++)
            count_run(&c, v, x, sst_min_int(x + SST_UNCONFIRMED_BLOCK, width), row);
        if (c.pixels)
            sst_map_u8_row(map, y / SST_UNCONFIRMED_BLOCK)[x / SST_UNCONFIRMED_BLOCK] =
                (uint8_t)fmin(255 / SST_UNCONFIRMED_FULL * (double)c.unconfirmed / (double)c.pixels + 0.5, 255);
        job->count[view].pixels += c.pixels;
        job->count[view].unconfirmed += c.unconfirmed;
    }
    return err;
}

int sst_unconfirmed_init(struct sst_unconfirmed *u, const struct sst_lightfield *lf, int threads)
{
    struct job job = { .u = u, .lf = lf };
    struct count all = { 0, 0 };
    int err = -ENOMEM;

    u->views = lf->rows * lf->cols;
    u->view = calloc((size_t)u->views, sizeof(*u->view));
    job.count = calloc((size_t)u->views, sizeof(*job.count));
    if (u->view && job.count)
        err = sst_parallel_for(u->views, sst_thread_count(threads), count_view, &job);
    for (int k = 0; !err && k < u->views; k++) {
        all.pixels += job.count[k].pixels;
        all.unconfirmed += job.count[k].unconfirmed;
    }
    u->confirmed = all.pixels ? 1 - (double)all.unconfirmed / (double)all.pixels : NAN;
    free(job.count);
    return err;
}

void sst_unconfirmed_fini(struct sst_unconfirmed *u)
{
    for (int k = 0; u->view && k < u->views; k++)
        sst_map_u8_fini(&u->view[k]);
    free(u->view);
    *u = (struct sst_unconfirmed){ 0 };
}

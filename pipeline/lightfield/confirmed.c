#include <math.h>

#include "base/thread.h"
#include "pipeline/lightfield/lightfield.h"

struct job {
    const struct sst_lightfield *lf;
    struct sst_confirmed count[SST_MAX_VIEWS];
};

struct sst_confirmed sst_view_confirmed(const struct sst_view *v)
{
    struct sst_confirmed n = { 0, 0 };

    for (int y = 0; y < v->confidence.height; y++) {
        const uint8_t *confidence = sst_map_u8_row(&v->confidence, y);
        const uint8_t *valid = v->valid.data ? sst_map_u8_row(&v->valid, y) : NULL;

        for (int x = 0; x < v->confidence.width; x++) {
            const int seen = !valid || valid[x];

            n.pixels += seen;
            n.confirmed += seen && confidence[x];
        }
    }
    return n;
}

static int count_view(void *arg, int view, int worker SST_UNUSED)
{
    struct job *job = arg;

    job->count[view] = sst_view_confirmed(&job->lf->views[view]);
    return 0;
}

double sst_lightfield_confirmed(const struct sst_lightfield *lf, int threads)
{
    const int views = lf->rows * lf->cols;
    struct job job = { .lf = lf };
    struct sst_confirmed all = { 0, 0 };

    if (sst_parallel_for(views, sst_thread_count(threads), count_view, &job))
        return NAN;
    for (int k = 0; k < views; k++) {
        all.pixels += job.count[k].pixels;
        all.confirmed += job.count[k].confirmed;
    }
    return all.pixels ? (double)all.confirmed / (double)all.pixels : NAN;
}

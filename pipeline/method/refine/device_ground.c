/* Planes of grounds on a device: sums over pixels and medians of residuals are its; of the sums of each round the CPU
 * makes planes, a few operations a ground. */
#include <string.h>

#include "pipeline/gpu/refine.h"
#include "pipeline/method/refine/refine_internal.h"

_Static_assert(SST_GPU_REFINE_LABELS == SST_MAX_CLASSES, "a bit each");
_Static_assert(SST_IMAGE_MAX_SIDE <= 1 << 15, "sums of a group in 32 bits");

/* A view in work. */
struct fit {
    struct sst_refine_device *d;
    int view;
    struct sst_gpu_refine_fit push;
    struct refine_grounds *out;
    int64_t all[SST_GPU_REFINE_LABELS]; /* pixels that count */
};

static int upload_planes(const struct fit *f)
{
    struct sst_gpu_refine_ground ground[SST_GPU_REFINE_LABELS];

    for (int i = 0; i < SST_GPU_REFINE_LABELS; i++) {
        const struct sst_ground *g = &f->out->ground[i];

        sst_gpu_split(ground[i].a, (uint64_t)g->a_q24);
        sst_gpu_split(ground[i].b, (uint64_t)g->b_q24);
        sst_gpu_split(ground[i].d0, (uint64_t)g->d0_q24);
        sst_gpu_split(ground[i].limit, INT64_MAX);
    }
    return refine_device_upload(f->d, REFINE_KEPT_GROUNDS, ground, sizeof(ground));
}

static int sum_up(const struct fit *f, struct sst_gpu_refine_ground_sums *sums)
{
    struct sst_gpu_work work = { .shader = SST_GPU_REFINE_GROUND_SUMS, .push = &f->push };
    const size_t bytes = SST_GPU_REFINE_LABELS * sizeof(*sums);
    int err;

    memset(sums, 0, bytes);
    err = refine_device_upload(f->d, REFINE_KEPT_GROUND_SUMS, sums, bytes);
    work.buffer[SST_GPU_REFINE_GROUND_SUMS_VIEW] = f->d->view[f->view].buffer;
    work.buffer[SST_GPU_REFINE_GROUND_SUMS_GROUNDS] = f->d->kept[REFINE_KEPT_GROUNDS];
    work.buffer[SST_GPU_REFINE_GROUND_SUMS_OUT] = f->d->kept[REFINE_KEPT_GROUND_SUMS];
    err = err ? err : refine_device_dispatch(f->d, &work, f->push.width, f->push.height);
    return err ? err : refine_device_download(f->d, REFINE_KEPT_GROUND_SUMS, sums, bytes);
}

/* Limits by medians, and no residuals left. */
static int set_limits(const struct fit *f)
{
    const uint32_t grounds = (uint32_t)__builtin_popcountll(sst_gpu_whole(f->push.labels));
    struct sst_gpu_work work = { .shader = SST_GPU_REFINE_GROUND_LIMIT, .push = &f->push, .groups = { grounds, 1, 1 } };

    work.buffer[SST_GPU_REFINE_GROUND_LIMIT_MISSES] = f->d->kept[REFINE_KEPT_GROUND_MISSES];
    work.buffer[SST_GPU_REFINE_GROUND_LIMIT_GROUNDS] = f->d->kept[REFINE_KEPT_GROUNDS];
    f->d->report.dispatches++;
    return sst_gpu_dispatch(f->d->gpu, &work);
}

static int count_misses(const struct fit *f)
{
    struct sst_gpu_work work = { .shader = SST_GPU_REFINE_GROUND_MISSES, .push = &f->push };

    work.buffer[SST_GPU_REFINE_GROUND_MISSES_VIEW] = f->d->view[f->view].buffer;
    work.buffer[SST_GPU_REFINE_GROUND_MISSES_GROUNDS] = f->d->kept[REFINE_KEPT_GROUNDS];
    work.buffer[SST_GPU_REFINE_GROUND_MISSES_OUT] = f->d->kept[REFINE_KEPT_GROUND_MISSES];
    return refine_device_dispatch(f->d, &work, f->push.width, f->push.height);
}

static struct sst_ground_sums joined(const struct sst_gpu_refine_ground_sums *s)
{
    return (struct sst_ground_sums){ .n = (int64_t)sst_gpu_whole(s->n),
                                     .x = (int64_t)sst_gpu_whole(s->x),
                                     .y = (int64_t)sst_gpu_whole(s->y),
                                     .d = (int64_t)sst_gpu_whole(s->d),
                                     .xx = (int64_t)sst_gpu_whole(s->xx),
                                     .xy = (int64_t)sst_gpu_whole(s->xy),
                                     .yy = (int64_t)sst_gpu_whole(s->yy),
                                     .xd = (int64_t)sst_gpu_whole(s->xd),
                                     .yd = (int64_t)sst_gpu_whole(s->yd) };
}

/* Planes of the round from its sums, or after the last one whether they are any; labels without one are left out. */
static void solve(struct fit *f, int round, const struct sst_gpu_refine_ground_sums *sums, int min_pixels)
{
    uint64_t labels = sst_gpu_whole(f->push.labels);

    for (uint64_t left = labels; left; left &= left - 1) {
        const int i = __builtin_ctzll(left);
        const struct sst_ground_sums s = joined(&sums[i]);
        bool is_plane;

        f->all[i] = round ? f->all[i] : s.n;
        is_plane = round < SST_GROUND_ROUNDS ? sst_ground_solve(&f->out->ground[i], &s, min_pixels)
                                             : sst_ground_is_plane(s.n, f->all[i]);
        if (!is_plane)
            labels &= ~((uint64_t)1 << i);
    }
    sst_gpu_split(f->push.labels, labels);
}

int refine_device_grounds(struct sst_refine_device *d, const struct refine_job *job, int view,
                          struct refine_grounds *out)
{
    struct sst_gpu_refine_ground_sums sums[SST_GPU_REFINE_LABELS];
    struct fit f = { .d = d,
                     .view = view,
                     .push = { .width = job->lf->width,
                               .height = job->lf->height,
                               .spread = SST_GROUND_SPREAD_Q24,
                               .bins = SST_DISP_BINS },
                     .out = out };
    const uint64_t labels = job->cfg->ground_plane ? job->ground : 0;
    const size_t bytes = SST_DISP_BINS * sizeof(uint32_t);
    int err = refine_device_keep(d, REFINE_KEPT_GROUNDS, SST_GPU_REFINE_LABELS * sizeof(struct sst_gpu_refine_ground));

    *out = (struct refine_grounds){ 0 };
    sst_gpu_split(f.push.labels, labels);
    sst_gpu_split(f.push.least, (uint64_t)sst_ground_floor(job->cfg));
    if (err || !labels)
        return err;
    err = refine_device_keep(d, REFINE_KEPT_GROUND_MISSES, (size_t)__builtin_popcountll(labels) * bytes);
    err = err ? err : set_limits(&f); /* whatever there was, no residuals are left */
    err = err ? err : upload_planes(&f);
    for (int round = 0; round <= SST_GROUND_ROUNDS && sst_gpu_whole(f.push.labels) && !err; round++) {
        err = sum_up(&f, sums);
        if (err)
            break;
        solve(&f, round, sums, job->cfg->min_pixels);
        if (round == SST_GROUND_ROUNDS || !sst_gpu_whole(f.push.labels))
            break;
        err = upload_planes(&f);
        err = err ? err : count_misses(&f);
        err = err ? err : set_limits(&f);
    }
    out->planar = sst_gpu_whole(f.push.labels);
    return err;
}

/* Label refinement on a device: a view's pixels go there once, its labels come back. The CPU sees sums over grounds and
 * regions, from which it makes planes and mean normals, and the outermost pixels of regions in each row, for hulls.
 *
 * A device that fails is closed. The view in work and the next ones are then refined on the CPU, one more after each
 * failure, twice as many each time; then the device is opened again. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/mem.h"
#include "pipeline/gpu/refine.h"
#include "pipeline/method/refine/refine_internal.h"

/* A view in work. */
struct work {
    struct sst_refine_device *d;
    const struct refine_job *job;
    struct sst_view *view;
    struct refine_grounds grounds;
    uint32_t *extents; /* [classes][height] on the host, if labels compete */
    int width, height;
    size_t pixels;
    uint64_t seen, mixed; /* labels that compete; those of conflicts between objects and grounds */
    bool normals;
};

_Static_assert(SST_EXTENT_NONE == 0xFFFF, "as refine_extents leaves it");

#define THE_VIEW REFINE_KEPT /* among buffers of a dispatch: that in work */

void refine_device_drop(struct sst_refine_device *d, enum refine_kept which)
{
    sst_gpu_buffer_destroy(sst_gpu_shared_device(d->shared), d->kept[which]);
    d->kept[which] = NULL;
    d->bytes[which] = 0;
}

static void drop(void *arg)
{
    struct sst_refine_device *d = arg;

    for (int i = 0; i < REFINE_KEPT; i++)
        refine_device_drop(d, (enum refine_kept)i);
    d->has_table = false;
    refine_drop_views(d);
}

bool refine_device_drop_kept(struct sst_refine_device *d)
{
    bool any = false;

    for (int i = 0; i < REFINE_KEPT; i++) {
        if (i == REFINE_KEPT_OUT || i == REFINE_KEPT_COUNTS || !d->kept[i])
            continue;
        refine_device_drop(d, (enum refine_kept)i);
        any = true;
    }
    d->has_table = false;
    return any;
}

static void note_name(struct sst_refine_device *d)
{
    const struct sst_gpu_info *info = sst_gpu_shared_info(d->shared);

    snprintf(d->report.name, sizeof(d->report.name), "%s", info->name);
    snprintf(d->report.driver, sizeof(d->report.driver), "%s", info->driver);
}

int sst_refine_device_create(struct sst_refine_device **out, struct sst_gpu_shared *shared)
{
    static const enum sst_gpu_shader shaders[] = {
        SST_GPU_REFINE_MASK,        SST_GPU_REFINE_COLUMNS,       SST_GPU_REFINE_COMPETE,      SST_GPU_REFINE_SUMS,
        SST_GPU_REFINE_PLANES,      SST_GPU_REFINE_NORMALS,       SST_GPU_REFINE_ASSIGN,       SST_GPU_VOTE,
        SST_GPU_LABEL_CARRY,        SST_GPU_LABEL_FILL,           SST_GPU_LABEL_CELLS,         SST_GPU_REFINE_COUNT,
        SST_GPU_REFINE_GROUND_SUMS, SST_GPU_REFINE_GROUND_MISSES, SST_GPU_REFINE_GROUND_LIMIT, SST_GPU_REFINE_EXTENTS
    };
    struct sst_refine_device *d;
    int err;

    *out = NULL;
    if (!shared)
        return 0;
    d = calloc(1, sizeof(*d));
    if (!d) {
        sst_log_error("not enough memory for a device");
        return -ENOMEM;
    }
    d->shared = shared;
    d->stage = 1;
    d->user = (struct sst_gpu_user){
        .shaders = shaders, .count = ARRAY_LEN(shaders), .work = "refine labels", .drop = drop, .arg = d
    };
    err = sst_gpu_shared_join(shared, &d->user);
    if (err) {
        free(d);
        return err;
    }
    note_name(d);
    *out = d;
    return 0;
}

void sst_refine_device_destroy(struct sst_refine_device *d)
{
    if (!d)
        return;
    sst_gpu_shared_leave(d->shared, &d->user);
    sst_mem_kept_fini(&d->words);
    sst_mem_kept_fini(&d->corners);
    sst_mem_kept_fini(&d->extents);
    free(d);
}

const char *sst_refine_stage_name(enum sst_refine_stage stage)
{
    static const char *const names[SST_REFINE_STAGES] = { "entropy", "distributions", "carrying" };

    return names[stage];
}

void sst_refine_device_note_stage(struct sst_refine_device *d, enum sst_refine_stage stage)
{
    if (d)
        d->report.stages_on_cpu |= 1U << stage;
}

void sst_refine_device_report(struct sst_refine_device *d, struct sst_refine_device_report *out)
{
    *out = d->report;
    d->report = (struct sst_refine_device_report){ 0 };
    memcpy(d->report.name, out->name, sizeof(out->name));
    memcpy(d->report.driver, out->driver, sizeof(out->driver));
}

/* --- memory and dispatches ---------------------------------------------------------------------------------------- */

int refine_device_keep(struct sst_refine_device *d, enum refine_kept which, size_t bytes)
{
    int err;

    if (d->bytes[which] >= bytes)
        return 0;
    refine_device_drop(d, which);
    err = sst_gpu_buffer_create(d->gpu, &d->kept[which], bytes);
    if (err == -ENOMEM && sst_gpu_shared_make_room(d->shared, &d->user))
        err = sst_gpu_buffer_create(d->gpu, &d->kept[which], bytes);
    while (err == -ENOMEM && refine_drop_oldest(d))
        err = sst_gpu_buffer_create(d->gpu, &d->kept[which], bytes);
    if (!err)
        d->bytes[which] = bytes;
    return err;
}

int refine_device_upload(struct sst_refine_device *d, enum refine_kept which, const void *data, size_t bytes)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err = refine_device_keep(d, which, bytes);

    err = err ? err : sst_gpu_upload(d->gpu, d->kept[which], 0, data, bytes);
    d->report.upload_bytes += (int64_t)bytes;
    d->report.upload_ns += sst_clock_now_ns() - start_ns;
    return err;
}

int refine_device_download(struct sst_refine_device *d, enum refine_kept which, void *data, size_t bytes)
{
    const int64_t start_ns = sst_clock_now_ns();
    int err = sst_gpu_wait(d->gpu);
    const int64_t done_ns = sst_clock_now_ns();

    err = err ? err : sst_gpu_download(d->gpu, data, d->kept[which], 0, bytes);
    d->report.wait_ns += done_ns - start_ns;
    d->report.download_ns += sst_clock_now_ns() - done_ns;
    return err;
}

static int dispatch(struct sst_refine_device *d, enum sst_gpu_shader shader, const void *push, uint32_t x, uint32_t y,
                    const enum refine_kept *kept, size_t count)
{
    struct sst_gpu_work work = { .shader = shader, .push = push, .groups = { x, y, 1 } };

    for (size_t i = 0; i < count; i++)
        work.buffer[i] = kept[i] < REFINE_KEPT ? d->kept[kept[i]] : d->view[d->in_work].buffer;
    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

/* Over all pixels. */
static int dispatch_view(const struct work *w, enum sst_gpu_shader shader, const void *push,
                         const enum refine_kept *kept, size_t count)
{
    const uint32_t x = (uint32_t)(w->width + SST_GPU_REFINE_WIDTH - 1) / SST_GPU_REFINE_WIDTH;
    const uint32_t y = (uint32_t)(w->height + SST_GPU_REFINE_HEIGHT - 1) / SST_GPU_REFINE_HEIGHT;

    return dispatch(w->d, shader, push, x, y, kept, count);
}

/* --- steps -------------------------------------------------------------------------------------------------------- */

static int upload_table(const struct work *w)
{
    uint32_t(*table)[2];
    int err;

    if (w->d->has_table)
        return 0;
    table = sst_mem_keep(&w->d->words, SST_DISP_BINS, sizeof(*table));
    if (!table)
        return -ENOMEM;
    for (int q = 0; q < SST_DISP_BINS; q++)
        sst_gpu_split(table[q], w->job->candidates[q]);
    err = refine_device_upload(w->d, REFINE_KEPT_TABLE, table, SST_DISP_BINS * sizeof(*table));
    w->d->has_table = !err;
    return err;
}

static size_t extents_bytes(const struct work *w)
{
    return (size_t)w->job->lf->classes.count * (size_t)w->height * sizeof(*w->extents);
}

static int find_extents(const struct work *w)
{
    static const enum refine_kept kept[] = { THE_VIEW, REFINE_KEPT_EXTENTS };
    const struct sst_gpu_refine_extents push = { w->width, w->height, (uint32_t)w->job->lf->classes.count };
    const int err = refine_device_keep(w->d, REFINE_KEPT_EXTENTS, extents_bytes(w));

    return err ? err : dispatch(w->d, SST_GPU_REFINE_EXTENTS, &push, (uint32_t)w->height, 1, kept, ARRAY_LEN(kept));
}

/* Candidates of all pixels, and which labels compete. */
static int find_candidates(struct work *w)
{
    static const enum refine_kept kept[] = { THE_VIEW,         REFINE_KEPT_TABLE,  REFINE_KEPT_GROUNDS,
                                             REFINE_KEPT_SEEN, REFINE_KEPT_CHOICE, REFINE_KEPT_MASK };
    struct sst_gpu_refine_mask push = { .width = w->width, .height = w->height };
    uint32_t seen[4] = { 0 };
    int err;

    w->d->turn++;
    err = refine_device_view(w->d, w->job->lf, w->d->in_work, 1U << SST_GPU_PLANE_LABELS, NULL);
    err = err ? err : upload_table(w);
    err = err ? err : refine_device_grounds(w->d, w->job, w->d->in_work, &w->grounds);
    sst_gpu_split(push.planar, w->grounds.planar);
    sst_gpu_split(push.ground, w->job->ground);
    err = err ? err : refine_device_upload(w->d, REFINE_KEPT_SEEN, seen, sizeof(seen));
    err = err ? err : refine_device_keep(w->d, REFINE_KEPT_CHOICE, w->pixels * sizeof(struct sst_gpu_refine_choice));
    err = err ? err : refine_device_keep(w->d, REFINE_KEPT_MASK, w->pixels * 2 * sizeof(uint32_t));
    err = err ? err : dispatch_view(w, SST_GPU_REFINE_MASK, &push, kept, ARRAY_LEN(kept));
    err = err ? err : find_extents(w);
    err = err ? err : refine_device_download(w->d, REFINE_KEPT_SEEN, seen, sizeof(seen));
    w->seen = sst_gpu_whole(seen);
    w->mixed = sst_gpu_whole(seen + 2);
    w->normals = w->mixed && w->job->cfg->p_normal > 0;
    return err;
}

/* Normals where they count, with the sums of regions. */
static int find_normals(const struct work *w)
{
    static const enum refine_kept sums[] = { THE_VIEW, REFINE_KEPT_SUMS },
                                  planes[] = { REFINE_KEPT_SUMS, REFINE_KEPT_PLANES };
    static const enum refine_kept normals[] = { THE_VIEW, REFINE_KEPT_MASK, REFINE_KEPT_PLANES, REFINE_KEPT_REGIONS,
                                                REFINE_KEPT_SUMS };
    static const struct sst_gpu_refine_region none[SST_GPU_REFINE_LABELS];
    const struct sst_gpu_refine_window window = { w->width, w->height, w->job->cfg->normal_window / 2 };
    struct sst_gpu_refine_normals push = {
        .width = w->width, .height = w->height, .radius = window.radius, .frame = w->job->frame
    };
    int err = refine_device_keep(w->d, REFINE_KEPT_SUMS, w->pixels * sizeof(struct sst_gpu_refine_sums));

    sst_gpu_split(push.mixed, w->mixed);
    sst_gpu_split(push.ground, w->job->ground);
    err = err ? err : refine_device_keep(w->d, REFINE_KEPT_PLANES, w->pixels * sizeof(struct sst_surface_plane));
    err = err ? err : refine_device_upload(w->d, REFINE_KEPT_REGIONS, none, sizeof(none));
    err = err ? err : dispatch_view(w, SST_GPU_REFINE_SUMS, &window, sums, ARRAY_LEN(sums));
    err = err ? err : dispatch_view(w, SST_GPU_REFINE_PLANES, &window, planes, ARRAY_LEN(planes));
    return err ? err : dispatch_view(w, SST_GPU_REFINE_NORMALS, &push, normals, ARRAY_LEN(normals));
}

/* Outermost pixels of all labels in each row, for hulls. */
static int download_extents(struct work *w)
{
    const size_t bytes = extents_bytes(w);

    w->extents = sst_mem_keep(&w->d->extents, bytes, 1);
    return w->extents ? refine_device_download(w->d, REFINE_KEPT_EXTENTS, w->extents, bytes) : -ENOMEM;
}

/* @return corners of the hull of a label's region, uploaded; 0: it is absent; or an error */
static int upload_hull(const struct work *w, int label)
{
    const size_t most = 2 * (size_t)w->height + 2;
    int32_t *corners = sst_mem_keep(&w->d->corners, 4 * most, sizeof(*corners));
    struct sst_hull hull = { 0, corners, corners + most };
    int32_t *pairs = corners + 2 * most;
    int err;

    if (!corners)
        return -ENOMEM;
    sst_hull_build(&hull, w->extents + (size_t)(label - 1) * (size_t)w->height, w->height);
    for (int i = 0; i < hull.count; i++) {
        pairs[2 * i] = hull.x[i];
        pairs[2 * i + 1] = hull.y[i];
    }
    err = refine_device_keep(w->d, REFINE_KEPT_HULL, 2 * most * sizeof(*pairs));
    if (!err && hull.count)
        err = refine_device_upload(w->d, REFINE_KEPT_HULL, pairs, 2 * (size_t)hull.count * sizeof(*pairs));
    return err ? err : hull.count;
}

static int compete(const struct work *w, int label)
{
    static const enum refine_kept columns[] = { THE_VIEW, REFINE_KEPT_COLUMNS };
    static const enum refine_kept kept[] = { REFINE_KEPT_MASK, REFINE_KEPT_COLUMNS, REFINE_KEPT_HULL,
                                             REFINE_KEPT_CHOICE };
    const struct sst_gpu_refine_columns of = { w->width, w->height, (uint32_t)label };
    const int corners = upload_hull(w, label);
    const struct sst_gpu_refine_compete push = { w->width,          w->height,
                                                 (uint32_t)label,   (uint32_t)(w->job->ground >> (label - 1) & 1),
                                                 (uint32_t)corners, w->job->cfg->p_distance > 0 };
    const uint32_t groups = (uint32_t)(w->width + SST_GPU_REFINE_COLUMN_GROUP - 1) / SST_GPU_REFINE_COLUMN_GROUP;
    int err = corners < 0 ? corners : refine_device_keep(w->d, REFINE_KEPT_COLUMNS, w->pixels * sizeof(uint32_t));

    if (corners > 0)
        err = err ? err : dispatch(w->d, SST_GPU_REFINE_COLUMNS, &of, groups, 1, columns, ARRAY_LEN(columns));
    return err ? err : dispatch_view(w, SST_GPU_REFINE_COMPETE, &push, kept, ARRAY_LEN(kept));
}

/* Means of the regions' normals. */
static int exchange_regions(const struct work *w)
{
    struct sst_gpu_refine_region sums[SST_GPU_REFINE_LABELS];
    struct sst_gpu_refine_mean means[SST_GPU_REFINE_LABELS] = { { { 0 }, 0 } };
    int err = w->normals ? refine_device_download(w->d, REFINE_KEPT_REGIONS, sums, sizeof(sums)) : 0;

    for (int i = 0; i < SST_GPU_REFINE_LABELS && w->normals && !err; i++) {
        struct sst_region r = { .normals = (int64_t)sst_gpu_whole(sums[i].normals),
                                .pixels = (int64_t)sst_gpu_whole(sums[i].pixels) };

        for (int c = 0; c < 3; c++)
            r.sum_q20[c] = (int64_t)sst_gpu_whole(sums[i].sum_q20[c]);
        sst_region_finish(&r);
        memcpy(means[i].mean, r.mean, sizeof(r.mean));
        means[i].known = sst_region_has_normal(&r);
    }
    return err ? err : refine_device_upload(w->d, REFINE_KEPT_MEANS, means, sizeof(means));
}

static int assign(const struct work *w)
{
    const enum refine_kept kept[] = { THE_VIEW,           REFINE_KEPT_MASK,
                                      REFINE_KEPT_CHOICE, w->normals ? REFINE_KEPT_SUMS : THE_VIEW,
                                      REFINE_KEPT_MEANS,  REFINE_KEPT_OUT };
    const struct sst_refine_config *cfg = w->job->cfg;
    const struct sst_gpu_refine_assign push = {
        w->width, w->height, w->normals, (float)cfg->p_distance, (float)cfg->p_normal, (float)cfg->tau
    };
    const size_t pitch = ((size_t)w->width + 3) / 4 * 4, bytes = pitch * (size_t)w->height;
    const uint32_t x = (uint32_t)(pitch / 4 + SST_GPU_REFINE_WIDTH - 1) / SST_GPU_REFINE_WIDTH;
    const uint32_t y = (uint32_t)(w->height + SST_GPU_REFINE_HEIGHT - 1) / SST_GPU_REFINE_HEIGHT;
    uint8_t *labels = sst_mem_keep(&w->d->words, bytes, 1);
    int err = labels ? refine_device_keep(w->d, REFINE_KEPT_OUT, bytes) : -ENOMEM;

    err = err ? err : dispatch(w->d, SST_GPU_REFINE_ASSIGN, &push, x, y, kept, ARRAY_LEN(kept));
    err = err ? err : refine_device_download(w->d, REFINE_KEPT_OUT, labels, bytes);
    for (int row = 0; row < w->height && !err; row++)
        memcpy(sst_map_u8_row(&w->view->label, row), labels + (size_t)row * pitch, (size_t)w->width);
    return err;
}

/* --- views -------------------------------------------------------------------------------------------------------- */

/* The labels of a view change at the end, once all has worked. */
static int refine_view(struct sst_refine_device *d, const struct refine_job *job, int view)
{
    struct work w = { .d = d,
                      .job = job,
                      .view = &job->lf->views[view],
                      .width = job->lf->width,
                      .height = job->lf->height,
                      .pixels = (size_t)job->lf->width * (size_t)job->lf->height };
    int err;

    d->in_work = view;
    err = find_candidates(&w);
    if (w.normals)
        err = err ? err : find_normals(&w);
    if (w.seen)
        err = err ? err : download_extents(&w);
    for (int label = 1; label <= job->lf->classes.count && !err; label++) {
        if (w.seen >> (label - 1) & 1)
            err = compete(&w, label);
    }
    err = err ? err : exchange_regions(&w);
    return err ? err : assign(&w);
}

bool refine_device_begin(struct sst_refine_device *d, int *err)
{
    sst_gpu_shared_lock(d->shared);
    d->gpu = sst_gpu_shared_take(d->shared, &d->user, err);
    if (d->gpu)
        note_name(d);
    return d->gpu;
}

bool refine_device_end_locked(struct sst_refine_device *d, int err, const char *what)
{
    const bool done = d->gpu && !err;

    if (done)
        sst_gpu_shared_succeed(d->shared);
    if (err)
        snprintf(d->report.why, sizeof(d->report.why), "%s",
                 err == -EOVERFLOW ? "views are too far apart" : sst_gpu_error(err));
    if (err && ((err != -ENOMEM && err != -EOVERFLOW) || !d->gpu)) { /* else the device is not to blame */
        sst_log_warning("%s: %s; %s on the CPU, and the device is opened again after %d more", d->report.name,
                        sst_gpu_error(err), what, sst_gpu_shared_fail(d->shared));
        d->report.failures++;
    }
    d->gpu = NULL;
    return done;
}

bool refine_device_end(struct sst_refine_device *d, int err, const char *what)
{
    const bool done = refine_device_end_locked(d, err, what);

    sst_gpu_shared_unlock(d->shared);
    return done;
}

/* @return true: the view is done */
static bool try_view(struct sst_refine_device *d, const struct refine_job *job, int view)
{
    const int64_t start_ns = sst_clock_now_ns();
    bool done;
    int err;

    if (refine_device_begin(d, &err))
        err = refine_view(d, job, view);
    done = refine_device_end(d, err, "the view is refined");
    d->report.views += done;
    d->report.on_cpu += !done;
    d->report.total_ns += sst_clock_now_ns() - start_ns;
    return done;
}

void refine_device_start(struct sst_refine_device *d)
{
    sst_gpu_shared_lock(d->shared);
    d->has_table = false;
    d->stage++;
    sst_gpu_shared_unlock(d->shared);
}

int refine_on_device(struct sst_refine_device *d, struct refine_job *job, int count)
{
    for (int i = 0; i < count; i++) {
        if (job->cfg->cancel && *job->cfg->cancel)
            return -ECANCELED;
        job->done[refine_of_batch(job, i)] = try_view(d, job, refine_of_batch(job, i));
    }
    return 0;
}

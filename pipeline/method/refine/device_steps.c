/* Label refinement of a view on a device: its pixels go there once, its labels come back. The CPU sees sums over
 * grounds and regions, from which it makes planes and mean normals, and the outermost pixels of regions in each row,
 * for hulls.
 *
 * What is kept for each pixel on the way is much larger than the view, so that where it does not fit, that is done in
 * bands of rows: first to find which labels compete anywhere, then for the sums of regions' normals, last for labels.
 * What a band needs of the steps before is computed again. */
#include <errno.h>
#include <string.h>

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
    int top, rows;        /* band in work */
    int most;             /* rows of a band; the height: there is one band */
    uint64_t seen, mixed; /* labels that compete; those of conflicts between objects and grounds */
    bool normals;
};

_Static_assert(SST_EXTENT_NONE == 0xFFFF, "as refine_extents leaves it");

#define THE_VIEW REFINE_KEPT /* among buffers of a dispatch: that in work */

static int dispatch(struct sst_refine_device *d, enum sst_gpu_shader shader, const void *push, uint32_t x, uint32_t y,
                    const enum refine_kept *kept, size_t count)
{
    struct sst_gpu_work work = { .shader = shader, .push = push, .groups = { x, y, 1 } };

    for (size_t i = 0; i < count; i++)
        work.buffer[i] = kept[i] < REFINE_KEPT ? d->kept[kept[i]] : d->view[d->in_work].buffer;
    d->report.dispatches++;
    return sst_gpu_dispatch(d->gpu, &work);
}

/* Over the pixels of some rows. */
static int dispatch_rows(const struct work *w, enum sst_gpu_shader shader, const void *push, int rows,
                         const enum refine_kept *kept, size_t count)
{
    const uint32_t x = (uint32_t)(w->width + SST_GPU_REFINE_WIDTH - 1) / SST_GPU_REFINE_WIDTH;
    const uint32_t y = (uint32_t)(rows + SST_GPU_REFINE_HEIGHT - 1) / SST_GPU_REFINE_HEIGHT;

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

/* What bands are made from: the view, and the planes of its grounds. */
static int begin_view(struct work *w)
{
    static const uint32_t none[4];
    int err;

    w->d->turn++;
    err = refine_device_view(w->d, w->job->lf, w->d->in_work, 1U << SST_GPU_PLANE_LABELS, NULL);
    err = err ? err : upload_table(w);
    err = err ? err : refine_device_grounds(w->d, w->job, w->d->in_work, &w->grounds);
    return err ? err : refine_device_upload(w->d, REFINE_KEPT_SEEN, none, sizeof(none));
}

/* Candidates of the band's pixels. */
static int find_candidates(const struct work *w)
{
    static const enum refine_kept kept[] = { THE_VIEW,         REFINE_KEPT_TABLE,  REFINE_KEPT_GROUNDS,
                                             REFINE_KEPT_SEEN, REFINE_KEPT_CHOICE, REFINE_KEPT_MASK };
    const size_t pixels = (size_t)w->width * (size_t)w->most;
    struct sst_gpu_refine_mask push = { .width = w->width, .height = w->height, .top = w->top, .rows = w->rows };
    int err = refine_device_keep(w->d, REFINE_KEPT_CHOICE, pixels * sizeof(struct sst_gpu_refine_choice));

    sst_gpu_split(push.planar, w->grounds.planar);
    sst_gpu_split(push.ground, w->job->ground);
    err = err ? err : refine_device_keep(w->d, REFINE_KEPT_MASK, pixels * 2 * sizeof(uint32_t));
    return err ? err : dispatch_rows(w, SST_GPU_REFINE_MASK, &push, w->rows, kept, ARRAY_LEN(kept));
}

/* Rows that the windows of the band's pixels, or of those at their sides, have their middle in. @return the first one
 */
static int rows_around(const struct work *w, int *rows)
{
    const int radius = w->job->cfg->normal_window / 2, top = sst_max_int(w->top - radius, 0);

    *rows = sst_min_int(w->top + w->rows + radius, w->height) - top;
    return top;
}

/* Normals of the band where they count, which add to the sums of regions. */
static int find_normals(const struct work *w)
{
    static const enum refine_kept sums[] = { THE_VIEW, REFINE_KEPT_SUMS },
                                  planes[] = { REFINE_KEPT_SUMS, REFINE_KEPT_PLANES };
    static const enum refine_kept normals[] = { THE_VIEW, REFINE_KEPT_MASK, REFINE_KEPT_PLANES, REFINE_KEPT_REGIONS,
                                                REFINE_KEPT_SUMS };
    const int radius = w->job->cfg->normal_window / 2;
    const size_t pixels = (size_t)w->width * (size_t)sst_min_int(w->most + 2 * radius, w->height);
    struct sst_gpu_refine_window window = { .width = w->width, .height = w->height, .radius = radius };
    struct sst_gpu_refine_normals push = {
        .width = w->width, .height = w->height, .radius = radius, .frame = w->job->frame, .top = w->top, .rows = w->rows
    };
    int err = refine_device_keep(w->d, REFINE_KEPT_SUMS, pixels * sizeof(struct sst_gpu_refine_sums));

    window.top = push.first = rows_around(w, &window.rows);
    sst_gpu_split(push.mixed, w->mixed);
    sst_gpu_split(push.ground, w->job->ground);
    err = err ? err : refine_device_keep(w->d, REFINE_KEPT_PLANES, pixels * sizeof(struct sst_surface_plane));
    err = err ? err : dispatch_rows(w, SST_GPU_REFINE_SUMS, &window, window.rows, sums, ARRAY_LEN(sums));
    err = err ? err : dispatch_rows(w, SST_GPU_REFINE_PLANES, &window, window.rows, planes, ARRAY_LEN(planes));
    return err ? err : dispatch_rows(w, SST_GPU_REFINE_NORMALS, &push, w->rows, normals, ARRAY_LEN(normals));
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

static size_t columns_bytes(const struct work *w)
{
    return (size_t)w->width * (size_t)w->most * sizeof(uint32_t);
}

/* A label of the band's pixels. */
static int compete(const struct work *w, int label)
{
    static const enum refine_kept columns[] = { THE_VIEW, REFINE_KEPT_COLUMNS };
    static const enum refine_kept kept[] = { REFINE_KEPT_MASK, REFINE_KEPT_COLUMNS, REFINE_KEPT_HULL,
                                             REFINE_KEPT_CHOICE };
    const struct sst_gpu_refine_columns of = { w->width, w->height, (uint32_t)label, w->top, w->rows };
    const int corners = upload_hull(w, label);
    const struct sst_gpu_refine_compete push = { w->width,
                                                 w->height,
                                                 (uint32_t)label,
                                                 (uint32_t)(w->job->ground >> (label - 1) & 1),
                                                 (uint32_t)corners,
                                                 w->job->cfg->p_distance > 0,
                                                 w->top,
                                                 w->rows };
    const uint32_t groups = (uint32_t)(w->width + SST_GPU_REFINE_COLUMN_GROUP - 1) / SST_GPU_REFINE_COLUMN_GROUP;
    int err = corners < 0 ? corners : refine_device_keep(w->d, REFINE_KEPT_COLUMNS, columns_bytes(w));

    if (corners > 0)
        err = err ? err : dispatch(w->d, SST_GPU_REFINE_COLUMNS, &of, groups, 1, columns, ARRAY_LEN(columns));
    return err ? err : dispatch_rows(w, SST_GPU_REFINE_COMPETE, &push, w->rows, kept, ARRAY_LEN(kept));
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

/* Bytes of a row of labels. */
static size_t pitch_of(const struct work *w)
{
    return ((size_t)w->width + 3) / 4 * 4;
}

/* @param labels  out, of the view: those of the band */
static int assign(const struct work *w, uint8_t *labels)
{
    const enum refine_kept kept[] = { THE_VIEW,           REFINE_KEPT_MASK,
                                      REFINE_KEPT_CHOICE, w->normals ? REFINE_KEPT_SUMS : THE_VIEW,
                                      REFINE_KEPT_MEANS,  REFINE_KEPT_OUT };
    const struct sst_refine_config *cfg = w->job->cfg;
    const struct sst_gpu_refine_assign push = {
        w->width, w->height, w->normals, (float)cfg->p_distance, (float)cfg->p_normal, (float)cfg->tau, w->top, w->rows
    };
    const size_t pitch = pitch_of(w);
    const uint32_t x = (uint32_t)(pitch / 4 + SST_GPU_REFINE_WIDTH - 1) / SST_GPU_REFINE_WIDTH;
    const uint32_t y = (uint32_t)(w->rows + SST_GPU_REFINE_HEIGHT - 1) / SST_GPU_REFINE_HEIGHT;
    int err = refine_device_keep(w->d, REFINE_KEPT_OUT, pitch * (size_t)w->most);

    err = err ? err : dispatch(w->d, SST_GPU_REFINE_ASSIGN, &push, x, y, kept, ARRAY_LEN(kept));
    return err ? err
               : refine_device_download(w->d, REFINE_KEPT_OUT, labels + (size_t)w->top * pitch,
                                        (size_t)w->rows * pitch);
}

/* --- bands -------------------------------------------------------------------------------------------------------- */

static bool first_band(struct work *w)
{
    w->top = 0;
    w->rows = w->most;
    return true;
}

static bool next_band(struct work *w)
{
    w->top += w->most;
    w->rows = sst_min_int(w->most, w->height - w->top);
    return w->rows > 0;
}

/* Candidates of a band again, if others were found since. */
static int restore_candidates(const struct work *w)
{
    return w->most < w->height ? find_candidates(w) : 0;
}

/* Which labels compete in the view. */
static int find_competitors(struct work *w)
{
    uint32_t seen[4];
    int err = begin_view(w);

    for (bool more = first_band(w); more && !err; more = next_band(w))
        err = find_candidates(w);
    err = err ? err : find_extents(w);
    err = err ? err : refine_device_download(w->d, REFINE_KEPT_SEEN, seen, sizeof(seen));
    if (err)
        return err;
    w->seen = sst_gpu_whole(seen);
    w->mixed = sst_gpu_whole(seen + 2);
    w->normals = w->mixed && w->job->cfg->p_normal > 0;
    return 0;
}

/* Normals of the view, for the sums of regions; those of the only band stay. */
static int sum_normals(struct work *w)
{
    static const struct sst_gpu_refine_region none[SST_GPU_REFINE_LABELS];
    int err = refine_device_upload(w->d, REFINE_KEPT_REGIONS, none, sizeof(none));

    for (bool more = first_band(w); more && !err; more = next_band(w)) {
        err = restore_candidates(w);
        err = err ? err : find_normals(w);
    }
    return err;
}

static int refine_band(struct work *w, uint8_t *labels)
{
    int err = restore_candidates(w);

    if (w->normals && w->most < w->height)
        err = err ? err : find_normals(w); /* sums of regions are not read again */
    for (int label = 1; label <= w->job->lf->classes.count && !err; label++) {
        if (w->seen >> (label - 1) & 1)
            err = compete(w, label);
    }
    return err ? err : assign(w, labels);
}

/* The labels of a view change at the end, once all has worked. */
static int refine_view(struct work *w)
{
    const size_t pitch = pitch_of(w);
    const struct sst_gpu_label_keep bytes = { .way = SST_GPU_KEEP_BYTES, .pitch = (uint32_t)pitch };
    uint8_t *labels = NULL;
    int err = find_competitors(w);

    if (w->normals)
        err = err ? err : sum_normals(w);
    if (w->seen)
        err = err ? err : download_extents(w);
    err = err ? err : exchange_regions(w);
    if (!err) {
        labels = sst_mem_keep(&w->d->words, pitch * (size_t)w->height, 1);
        err = labels ? 0 : -ENOMEM;
    }
    for (bool more = first_band(w); more && !err; more = next_band(w))
        err = refine_band(w, labels);
    if (w->most < w->height)
        w->d->view[w->d->in_work].labels = false;
    else
        err =
            err ? err : refine_device_keep_labels(w->d, w->job->lf, w->d->in_work, bytes, w->d->kept[REFINE_KEPT_OUT]);
    for (int row = 0; row < w->height && !err; row++)
        memcpy(sst_map_u8_row(&w->view->label, row), labels + (size_t)row * pitch, (size_t)w->width);
    return err;
}

/* Bytes of a pixel in work; and of those around the band as well: where normals count. */
#define BAND_BYTES   (sizeof(struct sst_gpu_refine_choice) + 2 * sizeof(uint32_t) + sizeof(uint32_t) + 1)
#define WINDOW_BYTES (sizeof(struct sst_gpu_refine_sums) + sizeof(struct sst_surface_plane))
#define SLACK_BYTES  (1 << 14) /* of sums and means */

/* Rows of a band that fit into `bytes`. */
static int rows_that_fit(const struct work *w, uint64_t bytes)
{
    const uint64_t width = (uint64_t)w->width + 3, around = 2 * (uint64_t)(w->job->cfg->normal_window / 2);
    const uint64_t buffer = sst_gpu_get_info(w->d->gpu)->buffer_bytes / (width * sizeof(struct sst_gpu_refine_sums));
    const uint64_t grounds = w->job->cfg->ground_plane ? (uint64_t)__builtin_popcountll(w->job->ground) : 0;
    const uint64_t corners = 2 * ((uint64_t)w->height + 1) * 2 * sizeof(int32_t);
    const uint64_t fixed = (SST_DISP_BINS * (2 + grounds)) * sizeof(uint32_t) + extents_bytes(w) + corners +
                           around * width * WINDOW_BYTES + SLACK_BYTES;
    const uint64_t rows = bytes > fixed ? (bytes - fixed) / (width * (BAND_BYTES + WINDOW_BYTES)) : 0;
    const uint64_t limit = buffer > around ? buffer - around : 0;

    return (int)sst_clamp_double((double)(rows < limit ? rows : limit), 0, w->height);
}

/* After a view did not fit: bands of fewer rows, of about the same height, and room for another view beside them if it
 * is not dear. @return false: not even one fits */
static bool shrink(struct work *w)
{
    const uint64_t view = 2 * sizeof(uint32_t) * (uint64_t)w->width * (uint64_t)w->height;
    uint64_t bytes;
    int rows, bands;

    refine_device_drop_kept(w->d);
    refine_device_drop(w->d, REFINE_KEPT_OUT);
    bytes = sst_gpu_free_bytes(w->d->gpu);
    rows = rows_that_fit(w, bytes / 2 > view ? bytes - view : bytes);
    rows = sst_min_int(rows, w->most / 2);
    if (!rows)
        return false;
    bands = (w->height + rows - 1) / rows;
    w->d->rows = (w->height + bands - 1) / bands;
    return true;
}

int refine_device_steps(struct sst_refine_device *d, const struct refine_job *job, int view)
{
    const int height = job->lf->height;
    int err;

    d->in_work = view;
    for (;;) {
        struct work w = { .d = d,
                          .job = job,
                          .view = &job->lf->views[view],
                          .width = job->lf->width,
                          .height = height,
                          .most = d->rows ? sst_min_int(d->rows, height) : height };

        err = refine_view(&w);
        if (!err)
            d->report.in_parts += w.most < height;
        if (err != -ENOMEM || !d->view[view].buffer || !shrink(&w))
            return err;
    }
}

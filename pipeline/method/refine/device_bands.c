/* Votes, carried labels and labels from cells on a device that does not hold all views that take part: in bands of rows.
 * Of another view only those rows are uploaded that show what the band's pixels show, by the smallest and the largest
 * disparity of the band. */
#include <errno.h>
#include <string.h>

#include "base/mem.h"
#include "pipeline/gpu/refine.h"
#include "pipeline/method/labels/labels.h"
#include "pipeline/method/refine/refine_internal.h"

/** A band's result in d->words: a word a pixel, and a second plane of them if there are two. */
typedef int band_fn(struct sst_refine_device *d, void *arg, int top, int rows);

/* What a band's result is put together to. */
static void keep_band(const struct sst_refine_device *d, uint32_t *all, int width, int height, int top, int rows,
                      int planes)
{
    const size_t n = (size_t)width * (size_t)rows, view = (size_t)width * (size_t)height;
    const uint32_t *words = d->words.data;

    for (int i = 0; i < planes; i++)
        memcpy(all + (size_t)i * view + (size_t)top * (size_t)width, words + (size_t)i * n, n * sizeof(*words));
}

static void write_maps(struct sst_map_u8 *label, struct sst_map_f32 *entropy, const uint32_t *all)
{
    const size_t width = (size_t)label->width, n = width * (size_t)label->height;

    for (int y = 0; y < label->height; y++, all += width) {
        uint8_t *to = sst_map_u8_row(label, y);

        for (size_t x = 0; x < width; x++)
            to[x] = (uint8_t)all[x];
        if (entropy)
            memcpy(sst_map_f32_row(entropy, y), all + n, width * sizeof(*all));
    }
}

/* Bands of as many rows as fit; maps are written when all of them are done. */
static int in_bands(struct sst_refine_device *d, struct sst_map_u8 *label, struct sst_map_f32 *entropy, band_fn *band,
                    void *arg)
{
    const int height = label->height, planes = entropy ? 2 : 1;
    uint32_t *all = sst_mem_keep(&d->result, (size_t)planes * (size_t)label->width * (size_t)height, sizeof(*all));
    int rows = d->band_rows ? sst_min_int(d->band_rows, height) : (height + 1) / 2, err = -ENOMEM;

    d->turn++;
    while (all && rows && err == -ENOMEM) {
        err = 0;
        d->band_rows = rows;
        for (int top = 0; top < height && !err; top += rows) {
            const int n = sst_min_int(rows, height - top);

            err = band(d, arg, top, n);
            if (!err)
                keep_band(d, all, label->width, height, top, n, planes);
        }
        if (err != -ENOMEM)
            continue;
        refine_device_drop_kept(d);
        refine_device_drop(d, REFINE_KEPT_OUT);
        rows /= 2;
    }
    if (!err)
        write_maps(label, entropy, all);
    return err;
}

/* @param planes  of the result */
static int download(struct sst_refine_device *d, enum refine_kept which, int width, int rows, int planes)
{
    const size_t bytes = (size_t)planes * (size_t)width * (size_t)rows * sizeof(uint32_t);
    void *words = sst_mem_keep(&d->words, bytes, 1);

    return words ? refine_device_download(d, which, words, bytes) : -ENOMEM;
}

/* --- votes and carried labels ------------------------------------------------------------------------------------- */

#define PLANES (1U << SST_GPU_PLANE_LABELS | 1U << SST_GPU_PLANE_COLOURS)

struct exchange {
    const struct sst_refine_carry *c;
    bool vote;
    int planes;
    struct sst_gpu_shift shift[SST_REFINE_SOURCES];
};

struct rows {
    int top, end;
};

/* Smallest and largest disparity of some rows. @return false: there is none */
static bool find_span(const struct sst_map_u16 *disp, int top, int rows, int32_t span[2])
{
    span[0] = SST_DISP_NONE;
    span[1] = -1;
    for (int y = top; y < top + rows; y++) {
        const uint16_t *q = sst_map_u16_row(disp, y);

        for (int x = 0; x < disp->width; x++) {
            if (q[x] == SST_DISP_NONE)
                continue;
            span[0] = sst_min_int(span[0], q[x]);
            span[1] = sst_max_int(span[1], q[x]);
        }
    }
    return span[1] >= 0;
}

/* Rows of a source in which the band's surfaces may be. */
static struct rows rows_of(const struct exchange *x, int i, const int32_t span[2], int top, int rows)
{
    const struct sst_gpu_shift *s = &x->shift[i];
    const int height = x->c->lf->height;
    const int at[2] = { s->down + ((s->down_part + span[0] * s->down_step) >> 16),
                        s->down + ((s->down_part + span[1] * s->down_step) >> 16) };
    const int first = sst_clamp_int(top + sst_min_int(at[0], at[1]), 0, height);

    return (struct rows){ first, sst_clamp_int(top + rows + sst_max_int(at[0], at[1]), first, height) };
}

/* Upload the rows of sources `first` and up to SST_GPU_VOTERS - 1 more. @param rows  out: of each source */
static int upload_sources(struct sst_refine_device *d, const struct exchange *x, int first, struct sst_gpu_work *work,
                          struct sst_gpu_shift *shift, int32_t *rows, int top, int n)
{
    const struct sst_refine_carry *c = x->c;
    int32_t span[2];
    const bool any = find_span(&c->lf->views[c->view].disp, top, n, span);
    int err = 0;

    for (int i = 0; i < SST_GPU_VOTERS && !err; i++) {
        const enum refine_kept which = (enum refine_kept)(REFINE_KEPT_BAND + 1 + i);
        const bool is_one = first + i < c->count;
        const struct rows r = any && is_one ? rows_of(x, first + i, span, top, n) : (struct rows){ 0, 0 };

        shift[i] = is_one ? x->shift[first + i] : (struct sst_gpu_shift){ 0 };
        shift[i].down += top - r.top;
        rows[i] = r.end - r.top;
        if (rows[i]) {
            const int from = c->sources[first + i].view;

            err = refine_device_rows(d, which, c->lf, from, PLANES, c->entropies ? &c->entropies[from] : NULL, r.top,
                                     r.end);
        }
        work->buffer[SST_GPU_VOTE_VOTERS + i] = d->kept[rows[i] ? which : REFINE_KEPT_BAND];
    }
    work->buffer[SST_GPU_VOTE_OWN] = d->kept[REFINE_KEPT_BAND];
    return err;
}

static int fill_band(struct sst_refine_device *d, int width, int rows)
{
    const struct sst_gpu_label_fill push = { width, rows };
    struct sst_gpu_work work = { .shader = SST_GPU_LABEL_FILL, .push = &push };
    int err = refine_device_keep(d, REFINE_KEPT_FILLED, (size_t)width * (size_t)rows * sizeof(uint32_t));

    work.buffer[SST_GPU_LABEL_FILL_OWN] = d->kept[REFINE_KEPT_BAND];
    work.buffer[SST_GPU_LABEL_FILL_FROM] = d->kept[REFINE_KEPT_OUT];
    work.buffer[SST_GPU_LABEL_FILL_OUT] = d->kept[REFINE_KEPT_FILLED];
    return err ? err : refine_device_dispatch(d, &work, width, rows);
}

/* Votes, or labels of up to SST_GPU_VOTERS sources at once: later ones give labels to pixels that have none yet. */
static int gather_band(struct sst_refine_device *d, const struct exchange *x, int top, int rows)
{
    const int width = x->c->lf->width;
    int err = 0;

    for (int first = 0; !err && (first < x->c->count || first == 0); first += SST_GPU_VOTERS) {
        const int count = sst_min_int(x->c->count - first, SST_GPU_VOTERS);
        struct sst_gpu_vote vote = { .width = width, .height = rows, .count = count };
        struct sst_gpu_label_carry carry = { .width = width,
                                             .height = rows,
                                             .count = count,
                                             .flags = (x->planes > 1 ? SST_GPU_CARRY_ENTROPIES : 0U) |
                                                      (first ? SST_GPU_CARRY_MORE : 0U) };
        struct sst_gpu_work work = { .shader = x->vote ? SST_GPU_VOTE : SST_GPU_LABEL_CARRY };

        err = upload_sources(d, x, first, &work, vote.shift, vote.rows, top, rows);
        memcpy(carry.shift, vote.shift, sizeof(carry.shift));
        memcpy(carry.rows, vote.rows, sizeof(carry.rows));
        work.push = x->vote ? (const void *)&vote : &carry;
        work.buffer[SST_GPU_VOTE_OUT] = d->kept[REFINE_KEPT_OUT];
        err = err ? err : refine_device_dispatch(d, &work, width, rows);
    }
    return err;
}

/* Gaps are filled from rows beyond the band, which are carried as well. */
static int exchange_band(struct sst_refine_device *d, void *arg, int top, int rows)
{
    const struct exchange *x = arg;
    const int width = x->c->lf->width, reach = x->c->fill ? SST_GPU_FILL_REACH : 0;
    const int from = sst_max_int(top - reach, 0), n = sst_min_int(top + rows + reach, x->c->lf->height) - from;
    int err = refine_device_rows(d, REFINE_KEPT_BAND, x->c->lf, x->c->view, PLANES, NULL, from, from + n);

    err = err ? err
              : refine_device_keep(d, REFINE_KEPT_OUT,
                                   (size_t)x->planes * (size_t)width * (size_t)n * sizeof(uint32_t));
    err = err ? err : gather_band(d, x, from, n);
    if (x->c->fill)
        err = err ? err : fill_band(d, width, n);
    err = err ? err : download(d, x->c->fill ? REFINE_KEPT_FILLED : REFINE_KEPT_OUT, width, n, x->planes);
    if (!err && reach) {
        uint32_t *words = d->words.data;

        memmove(words, words + (size_t)(top - from) * (size_t)width, (size_t)rows * (size_t)width * sizeof(*words));
    }
    return err;
}

int refine_device_exchange(struct sst_refine_device *d, struct sst_map_u8 *label, struct sst_map_f32 *entropy,
                           const struct sst_refine_carry *c, bool vote)
{
    struct exchange x = { .c = c, .vote = vote, .planes = entropy ? 2 : 1 };
    int err = 0;

    for (int i = 0; i < c->count && !err; i++)
        err = refine_set_shift(&x.shift[i], &c->sources[i]);
    return err ? err : in_bands(d, label, entropy, exchange_band, &x);
}

/* --- labels from cells -------------------------------------------------------------------------------------------- */

struct enlarging {
    const struct sst_refine_enlarge *e;
    const struct sst_label_cells *cells;
    struct sst_gpu_label_cells push;
};

/* Places of all columns, and of the band's rows. */
static int upload_places(struct sst_refine_device *d, const struct enlarging *e, int top, int rows)
{
    const struct sst_gpu_label_place *from = (const struct sst_gpu_label_place *)e->cells->places;
    const size_t columns = (size_t)e->push.width;
    struct sst_gpu_label_place *places = sst_mem_keep(&d->words, columns + (size_t)rows, sizeof(*places));

    if (!places)
        return -ENOMEM;
    memcpy(places, from, columns * sizeof(*places));
    memcpy(places + columns, from + columns + top, (size_t)rows * sizeof(*places));
    return refine_device_upload(d, REFINE_KEPT_PLACES, places, (columns + (size_t)rows) * sizeof(*places));
}

static int enlarge_band(struct sst_refine_device *d, void *arg, int top, int rows)
{
    const struct enlarging *e = arg;
    const int planes = e->push.entropies ? 2 : 1;
    const size_t bytes = (size_t)planes * (size_t)e->push.width * (size_t)rows * sizeof(uint32_t);
    struct sst_gpu_label_cells push = e->push;
    struct sst_gpu_work work = { .shader = SST_GPU_LABEL_CELLS, .push = &push };
    int err = refine_device_rows(d, REFINE_KEPT_BAND, e->e->lf, e->e->view, 1U << SST_GPU_PLANE_COLOURS, NULL, top,
                                 top + rows);

    push.height = rows;
    err = err ? err : refine_device_upload(d, REFINE_KEPT_CELLS, e->cells->cells, e->cells->cells_bytes);
    err = err ? err : upload_places(d, e, top, rows);
    err = err ? err : refine_device_keep(d, REFINE_KEPT_OUT, bytes);
    work.buffer[SST_GPU_LABEL_CELLS_VIEW] = d->kept[REFINE_KEPT_BAND];
    work.buffer[SST_GPU_LABEL_CELLS_CELLS] = d->kept[REFINE_KEPT_CELLS];
    work.buffer[SST_GPU_LABEL_CELLS_PLACES] = d->kept[REFINE_KEPT_PLACES];
    work.buffer[SST_GPU_LABEL_CELLS_OUT] = d->kept[REFINE_KEPT_OUT];
    err = err ? err : refine_device_dispatch(d, &work, push.width, rows);
    return err ? err : download(d, REFINE_KEPT_OUT, push.width, rows, planes);
}

int refine_device_enlarge(struct sst_refine_device *d, struct sst_map_u8 *label, struct sst_map_f32 *entropy,
                          const struct sst_refine_enlarge *e, const struct sst_label_cells *cells,
                          const struct sst_gpu_label_cells *push)
{
    struct enlarging all = { e, cells, *push };

    return in_bands(d, label, entropy, enlarge_band, &all);
}

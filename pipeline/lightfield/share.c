/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/lightfield/share.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/claim.h"
#include "base/clock.h"
#include "base/file.h"
#include "base/mem.h"

#define POLL_LEAST_NS INT64_C(1000000) /* until others are looked for again: a part of the time waited so far, ... */
#define POLL_MOST_NS  INT64_C(100000000)
#define POLL_PART     8
#define BLOCK_PIXELS  ((size_t)600000)
#define BLOCKS_LEAST  12 /* so that several workers have some each */

static const char magic[8] = "sstmaps2";

struct sst_share {
    char dir[SST_PATH_MAX], job[SST_CLAIM_JOB];
    int index, count, lease_ms;
    int step;       /* that were shared so far */
    int64_t cpu_ns; /* of this process when the last one ended */
};

int sst_share_open(struct sst_share **out, const struct sst_share_config *cfg)
{
    struct sst_share *s = calloc(1, sizeof(*s));
    int err = s ? sst_path_make_dir(cfg->dir) : -ENOMEM;

    if (err) {
        free(s);
        return err;
    }
    snprintf(s->dir, sizeof(s->dir), "%s", cfg->dir);
    snprintf(s->job, sizeof(s->job), "%s", cfg->job);
    s->index = cfg->index;
    s->count = cfg->count;
    s->lease_ms = cfg->lease_ms;
    s->cpu_ns = sst_clock_cpu_ns();
    *out = s;
    return 0;
}

void sst_share_close(struct sst_share *s)
{
    free(s);
}

/* --- results in files --------------------------------------------------------------------------------------------- */

/* Maps and images begin alike: sizes, stride, and the pointer to their memory. */
#define ALIKE(type, member)                                                                                            \
    _Static_assert(offsetof(struct type, stride) == offsetof(struct sst_map_u8, stride) &&                             \
                       offsetof(struct type, member) == offsetof(struct sst_map_u8, data),                             \
                   "one layout")
ALIKE(sst_map_u16, data);
ALIKE(sst_map_f32, data);
ALIKE(sst_image, plane);

struct sst_share_map {
    void *map;     /* of a list: where the pointer to it is */
    int planes;    /* one below the other; 0: no map or image, but values or a list */
    size_t *count; /* of a list, else NULL */
    size_t bytes;  /* of a pixel in a plane, of all values, of an element of a list */
};

static void add(struct sst_share_maps *maps, struct sst_share_map map)
{
    maps->failed = maps->failed || !sst_mem_grow(&maps->map, maps->count, &maps->capacity, sizeof(*maps->map));
    if (!maps->failed)
        maps->map[maps->count++] = map;
}

void sst_share_add_u8(struct sst_share_maps *maps, struct sst_map_u8 *map)
{
    add(maps, (struct sst_share_map){ map, 1, NULL, sizeof(*map->data) });
}

void sst_share_add_u16(struct sst_share_maps *maps, struct sst_map_u16 *map)
{
    add(maps, (struct sst_share_map){ map, 1, NULL, sizeof(*map->data) });
}

void sst_share_add_f32(struct sst_share_maps *maps, struct sst_map_f32 *map)
{
    add(maps, (struct sst_share_map){ map, 1, NULL, sizeof(*map->data) });
}

void sst_share_add_image(struct sst_share_maps *maps, struct sst_image *image)
{
    add(maps, (struct sst_share_map){ image, 3, NULL, 1 });
}

void sst_share_add_values(struct sst_share_maps *maps, void *values, size_t bytes)
{
    add(maps, (struct sst_share_map){ values, 0, NULL, bytes });
}

void sst_share_add_list(struct sst_share_maps *maps, void *list, size_t *count, size_t each)
{
    add(maps, (struct sst_share_map){ list, 0, count, each });
}

/* Head of a file before the bytes of a result. Rows are stored with their padding, so that a map is one piece. */
struct shape {
    int32_t width, height; /* 0: empty */
    uint64_t bytes;
};

/* @param data  out: the bytes */
static struct shape shape_of(const struct sst_share_map *m, void **data)
{
    struct sst_map_u8 map;

    if (m->count) {
        memcpy(data, m->map, sizeof(*data));
        return (struct shape){ *data != NULL, 1, *data ? *m->count * m->bytes : 0 };
    }
    *data = m->map;
    if (!m->planes)
        return (struct shape){ 1, 1, m->bytes };
    memcpy(&map, m->map, sizeof(map));
    *data = map.data;
    return map.data ? (struct shape){ map.width, map.height, (size_t)m->planes * map.stride * (size_t)map.height }
                    : (struct shape){ 0, 0, 0 };
}

#define RARE 16 /* values for each one that may differ by levels; a wrong computation changes more */

/* Bytes that differ; `bytes` + 1: one by more than `levels`. */
static size_t count_differing(const uint8_t *a, const uint8_t *b, size_t bytes, int levels)
{
    size_t n = 0;

    if (!memcmp(a, b, bytes))
        return 0;
    for (size_t i = 0; i < bytes; i++) {
        if (abs(a[i] - b[i]) > levels)
            return bytes + 1;
        n += a[i] != b[i];
    }
    return n;
}

static bool maps_equal(const struct sst_share_map *a, const struct sst_share_map *b, int levels)
{
    void *data[2];
    const struct shape shape = shape_of(a, &data[0]), other = shape_of(b, &data[1]);
    const size_t rows = (size_t)shape.height * (size_t)sst_max_int(a->planes, 1);
    /* Padding of rows is not part of the result. */
    const size_t bytes = a->planes ? (size_t)shape.width * a->bytes : shape.bytes;
    size_t differ = 0;

    levels = a->planes && a->bytes == 1 ? levels : 0;
    if (a->planes != b->planes || a->bytes != b->bytes || !a->count != !b->count || shape.width != other.width ||
        shape.height != other.height || shape.bytes != other.bytes)
        return false;
    for (size_t y = 0; shape.width && y < rows; y++) {
        const size_t at = y * (shape.bytes / rows);
        const size_t n = count_differing((const uint8_t *)data[0] + at, (const uint8_t *)data[1] + at, bytes, levels);

        if (n > bytes)
            return false;
        differ += n;
    }
    return RARE * differ <= (size_t)shape.width * rows;
}

bool sst_share_maps_equal(const struct sst_share_maps *a, const struct sst_share_maps *b, int levels)
{
    bool equal = a->count == b->count && !a->failed && !b->failed;

    for (int i = 0; equal && i < a->count; i++)
        equal = maps_equal(&a->map[i], &b->map[i], levels);
    return equal;
}

void sst_share_maps_fini(struct sst_share_maps *maps)
{
    free(maps->map);
    *maps = (struct sst_share_maps){ 0 };
}

/* Free a list, and make room for as many bytes. */
static int renew_list(const struct sst_share_map *m, struct shape to)
{
    void *list;

    if (to.bytes % m->bytes || to.bytes > SST_IMAGE_MAX_PIXELS * m->bytes)
        return -EINVAL;
    memcpy(&list, m->map, sizeof(list));
    sst_mem_free(list);
    *m->count = to.bytes / m->bytes;
    list = to.width ? sst_mem_alloc_raw(*m->count, m->bytes) : NULL;
    memcpy(m->map, &list, sizeof(list));
    return to.width && !list ? -ENOMEM : 0;
}

/* Free a result, and make room for one of a shape. @return 0, -ENOMEM, -EINVAL: it cannot have that */
static int renew(const struct sst_share_map *m, struct shape to)
{
    struct sst_map_u8 map;

    if (m->count)
        return renew_list(m, to);
    if (!m->planes)
        return 0;
    memcpy(&map, m->map, sizeof(map));
    sst_mem_free(map.data);
    memset(m->map, 0, m->planes == 3 ? sizeof(struct sst_image) : sizeof(map));
    if (!to.width)
        return 0;
    return m->planes == 3                ? sst_image_init(m->map, to.width, to.height)
           : m->bytes == sizeof(float)   ? sst_map_f32_init(m->map, to.width, to.height)
           : m->bytes == sizeof(int16_t) ? sst_map_u16_init(m->map, to.width, to.height)
                                         : sst_map_u8_init(m->map, to.width, to.height);
}

/* Results lost with the machine are computed again, so nothing is synced. */
static int write_maps(const char *path, const struct sst_share_maps *maps)
{
    struct sst_outfile out;
    int err = sst_outfile_open(&out, path);

    if (err)
        return err;
    out.unsynced = true;
    fwrite(magic, sizeof(magic), 1, out.stream);
    for (int i = 0; i < maps->count; i++) {
        void *data;
        const struct shape shape = shape_of(&maps->map[i], &data);

        fwrite(&shape, sizeof(shape), 1, out.stream);
        if (shape.bytes)
            fwrite(data, shape.bytes, 1, out.stream);
    }
    return sst_outfile_commit(&out);
}

static int read_map(FILE *f, const struct sst_share_map *m)
{
    struct shape shape, made;
    void *data;
    int err;

    if (fread(&shape, sizeof(shape), 1, f) != 1)
        return -EBADMSG;
    err = renew(m, shape);
    if (err)
        return err == -EINVAL ? -EBADMSG : err;
    made = shape_of(m, &data);
    if (made.bytes != shape.bytes || made.width != shape.width || (shape.bytes && fread(data, shape.bytes, 1, f) != 1))
        return -EBADMSG;
    return 0;
}

static int read_maps(const char *path, const struct sst_share_maps *maps)
{
    FILE *f = fopen(path, "rbe");
    char begin[sizeof(magic)] = "";
    int err = f ? 0 : -errno;

    if (!err && (fread(begin, sizeof(begin), 1, f) != 1 || memcmp(begin, magic, sizeof(magic)) != 0))
        err = -EBADMSG;
    for (int i = 0; !err && i < maps->count; i++)
        err = read_map(f, &maps->map[i]);
    if (!err && fgetc(f) != EOF)
        err = -EBADMSG;
    if (f)
        fclose(f);
    if (err == -ENOMEM)
        sst_log_error("not enough memory for the maps in %s", path);
    else if (err)
        sst_log_error("%s, maps from another worker: %s; remove the folder and process again", path,
                      err == -EBADMSG ? "damaged" : strerror(-err));
    return err && err != -ENOMEM ? -EIO : err;
}

/* --- steps -------------------------------------------------------------------------------------------------------- */

enum item_state {
    ITEM_OPEN = 0,
    ITEM_HERE = 1,  /* computed by this process */
    ITEM_THERE = 2, /* by another one: to be read */
};

struct item {
    struct sst_claim_watch watch;
    enum item_state state;
};

struct step {
    struct sst_share *s;
    char dir[SST_PATH_MAX];
    sst_work_fn *fn; /* or: */
    sst_share_batch_fn *batch;
    void *arg;
    sst_share_maps_fn *maps;
    int *index;                        /* shared ones, block by block, then from `shared` on the others */
    int shared, indices, block, count; /* block: indices of an item; count: items */
    int64_t start_ns, start_cpu_ns;
    /* under lock */
    pthread_mutex_t lock;
    struct item *item;
    int next; /* place in this process's order from which threads look for work */
    bool done_some, held;
};

static int item_path(const struct step *t, int i, const char *suffix, char out[SST_PATH_MAX])
{
    char name[32];

    snprintf(name, sizeof(name), "%03d%s", i, suffix);
    return sst_path_join(out, t->dir, name);
}

static int end_of(const struct step *t, int i)
{
    return sst_min_int((i + 1) * t->block, t->shared);
}

/* Of all indices of an item. */
static int list_maps(const struct step *t, int i, struct sst_share_maps *out)
{
    for (int k = i * t->block; k < end_of(t, i); k++)
        t->maps(t->arg, t->index[k], out);
    return out->failed ? -ENOMEM : 0;
}

/* Leave the results of an item for the others, and end the claim. @param err  of its work; then `error` says why */
static int finish_item(const struct step *t, int i, struct sst_claim *claim, int err, const char *error)
{
    struct sst_share_maps maps = { 0 };
    char path[SST_PATH_MAX];
    int end;

    err = err ? err : list_maps(t, i, &maps);
    err = err ? err : item_path(t, i, ".maps", path);
    err = err ? err : write_maps(path, &maps);
    free(maps.map);
    end = sst_claim_end(claim, !err ? NULL : error[0] ? error : strerror(-err));
    return err ? err : end == -ESTALE ? 0 : end;
}

static int compute_item(const struct step *t, int i, int worker, struct sst_claim *claim)
{
    char error[SST_LOG_MAX] = "";
    int err = 0;

    sst_log_copy_errors(error, sizeof(error));
    for (int k = i * t->block; !err && k < end_of(t, i); k++)
        err = t->fn(t->arg, t->index[k], worker);
    err = finish_item(t, i, claim, err, error);
    sst_log_copy_errors(NULL, 0);
    return err;
}

static void note(struct step *t, bool *what)
{
    pthread_mutex_lock(&t->lock);
    *what = true;
    pthread_mutex_unlock(&t->lock);
}

/* Claim an item unless another process does it or has. @param claim  out, NULL: it is not this process's */
static int claim_item(struct step *t, int i, struct sst_claim **claim)
{
    struct item *item = &t->item[i];
    struct sst_claim_info info;
    char dir[SST_PATH_MAX];
    int err = item_path(t, i, "", dir);

    *claim = NULL;
    err = err ? err : sst_claim_look(&info, dir);
    if (err)
        return err;
    if (info.state == SST_CLAIM_DONE && !strcmp(info.job, t->s->job)) {
        item->state = ITEM_THERE;
        return 0;
    }
    err = -EBUSY;
    if (info.state != SST_CLAIM_HELD || sst_claim_expired(&item->watch, &info, t->s->lease_ms))
        err = sst_claim_take(claim, dir, &info, t->s->job, t->s->lease_ms);
    if (err == -EBUSY) {
        note(t, &t->held);
        return 0;
    }
    if (err)
        return err;
    item->state = ITEM_HERE;
    note(t, &t->done_some);
    return 0;
}

/* The next item that is open: the process's own part first, which are neighbours, then the rest. @return -1: none */
static int next_item(struct step *t)
{
    int at = -1;

    pthread_mutex_lock(&t->lock);
    while (at < 0 && t->next < t->count) {
        at = (int)((t->next++ + (int64_t)t->s->index * t->count / t->s->count) % t->count);
        at = t->item[at].state == ITEM_OPEN ? at : -1;
    }
    pthread_mutex_unlock(&t->lock);
    return at;
}

/* A thread. */
static int work(void *arg, int index SST_UNUSED, int worker)
{
    struct step *t = arg;
    int err = 0;

    for (int i; !err && (i = next_item(t)) >= 0;) {
        struct sst_claim *claim;

        err = claim_item(t, i, &claim);
        if (!err && claim)
            err = compute_item(t, i, worker, claim);
    }
    return err;
}

/* Batches of up to `most` items, one after the other. */
static int work_in_batches(struct step *t, int most, int *index, struct sst_claim **claim)
{
    char error[SST_LOG_MAX] = "";
    int err = 0, n;

    sst_log_copy_errors(error, sizeof(error));
    do {
        int failed;

        n = 0;
        for (int i; !err && n < most && (i = next_item(t)) >= 0;) {
            err = claim_item(t, i, &claim[n]);
            index[n] = i;
            n += !err && claim[n];
        }
        failed = err || !n ? err : t->batch(t->arg, index, n);
        for (int k = 0; k < n; k++) {
            err = finish_item(t, index[k], claim[k], failed, error);
            failed = failed ? failed : err;
        }
        err = failed;
    } while (!err && n);
    sst_log_copy_errors(NULL, 0);
    return err;
}

static int read_item(void *arg, int i, int worker SST_UNUSED)
{
    const struct step *t = arg;
    struct sst_share_maps maps = { 0 };
    char path[SST_PATH_MAX];
    int err = 0;

    if (t->item[i].state != ITEM_THERE)
        return 0;
    err = list_maps(t, i, &maps);
    err = err ? err : item_path(t, i, ".maps", path);
    err = err ? err : read_maps(path, &maps);
    free(maps.map);
    return err;
}

static void wait_for_others(int64_t since_ns)
{
    const int64_t waited_ns = sst_clock_now_ns() - since_ns;
    const int64_t part_ns = waited_ns / POLL_PART > POLL_LEAST_NS ? waited_ns / POLL_PART : POLL_LEAST_NS;

    nanosleep(&(struct timespec){ .tv_nsec = part_ns < POLL_MOST_NS ? part_ns : POLL_MOST_NS }, NULL);
}

/* Work that writes nothing for others is done by every process. */
static int work_alone(void *arg, int i, int worker)
{
    const struct step *t = arg;

    return t->fn(t->arg, t->index[t->shared + i], worker);
}

/* @param index, claim  scratch of batches [threads], or NULL */
static int run_step(struct step *t, int threads, int *index, struct sst_claim **claim)
{
    int64_t since_ns = sst_clock_now_ns();
    int err = sst_parallel_for(t->indices - t->shared, threads, work_alone, t);

    if (err)
        return err;
    do {
        t->next = 0;
        t->held = t->done_some = false;
        err = t->fn ? sst_parallel_for(sst_min_int(threads, t->count), threads, work, t)
                    : work_in_batches(t, threads, index, claim);
        if (t->done_some)
            since_ns = sst_clock_now_ns();
        else if (!err && t->held)
            wait_for_others(since_ns);
    } while (!err && t->held);
    return err ? err : sst_parallel_for(t->count, threads, read_item, t);
}

/* Divide the indices into ones that write something and the rest. */
static int list_indices(struct step *t)
{
    int last = t->indices;

    t->index = calloc((size_t)t->indices + 1, sizeof(*t->index));
    if (!t->index)
        return -ENOMEM;
    for (int k = 0; k < t->indices; k++) {
        struct sst_share_maps maps = { 0 };

        t->maps(t->arg, k, &maps);
        if (maps.count || maps.failed || t->batch)
            t->index[t->shared++] = k;
        else
            t->index[--last] = k;
        free(maps.map);
    }
    return 0;
}

static int open_step(struct step *t, struct sst_share *s)
{
    char name[16];
    int err = list_indices(t);

    if (err)
        return err;
    t->s = s;
    t->start_ns = sst_clock_now_ns();
    t->start_cpu_ns = sst_clock_cpu_ns();
    t->block = sst_clamp_int(t->block, 1, sst_max_int(t->shared / BLOCKS_LEAST, 1));
    t->count = (t->shared + t->block - 1) / t->block;
    snprintf(name, sizeof(name), "step-%02d", s->step++);
    err = sst_path_join(t->dir, s->dir, name);
    err = err ? err : sst_path_make_dir(t->dir);
    t->item = err ? NULL : calloc((size_t)t->count + 1, sizeof(*t->item));
    if (!t->item) {
        free(t->index);
        return err ? err : -ENOMEM;
    }
    pthread_mutex_init(&t->lock, NULL);
    return 0;
}

static void close_step(struct step *t)
{
    const int64_t cpu_ns = sst_clock_cpu_ns();
    int here = 0;

    for (int i = 0; i < t->count; i++)
        here += t->item[i].state == ITEM_HERE;
    sst_log_info("step %d: %d of %d items here, %.1f ms, processor %.1f ms; before it %.1f ms", t->s->step - 1, here,
                 t->count, (double)(sst_clock_now_ns() - t->start_ns) * 1e-6, (double)(cpu_ns - t->start_cpu_ns) * 1e-6,
                 (double)(t->start_cpu_ns - t->s->cpu_ns) * 1e-6);
    t->s->cpu_ns = cpu_ns;
    pthread_mutex_destroy(&t->lock);
    free(t->item);
    free(t->index);
}

int sst_share_blocks(struct sst_share *s, int count, int block, int threads, sst_work_fn *fn, void *arg,
                     sst_share_maps_fn *maps)
{
    struct step t = { .fn = fn, .arg = arg, .maps = maps, .indices = count, .block = block };
    int err;

    if (!s)
        return sst_parallel_for(count, threads, fn, arg);
    err = open_step(&t, s);
    if (err)
        return err;
    err = run_step(&t, threads, NULL, NULL);
    close_step(&t);
    return err;
}

int sst_share_for(struct sst_share *s, int count, int threads, sst_work_fn *fn, void *arg, sst_share_maps_fn *maps)
{
    return sst_share_blocks(s, count, 1, threads, fn, arg, maps);
}

int sst_share_block(size_t pixels)
{
    return (int)(BLOCK_PIXELS / (pixels + 1)) + 1;
}

/* All items by this process alone. */
static int do_batches(int count, int most, sst_share_batch_fn *fn, void *arg, int *index)
{
    int err = 0;

    for (int i = 0, n; !err && i < count; i += n) {
        n = sst_min_int(most, count - i);
        for (int k = 0; k < n; k++)
            index[k] = i + k;
        err = fn(arg, index, n);
    }
    return err;
}

int sst_share_batches(struct sst_share *s, int count, int most, sst_share_batch_fn *fn, void *arg,
                      sst_share_maps_fn *maps)
{
    const int at_once = sst_max_int(most, 1);
    struct step t = { .batch = fn, .arg = arg, .maps = maps, .indices = count, .block = 1 };
    struct sst_claim **claim = calloc((size_t)at_once, sizeof(struct sst_claim *));
    int *index = calloc((size_t)at_once, sizeof(*index));
    int err = claim && index ? 0 : -ENOMEM;

    if (!err && !s) {
        err = do_batches(count, at_once, fn, arg, index);
    } else if (!err) {
        err = open_step(&t, s);
        if (!err) {
            err = run_step(&t, at_once, index, claim);
            close_step(&t);
        }
    }
    free(index);
    free(claim);
    return err;
}

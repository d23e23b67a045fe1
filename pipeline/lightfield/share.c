#include "pipeline/lightfield/share.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/claim.h"
#include "base/file.h"
#include "base/mem.h"

#define POLL_NS      INT64_C(10000000) /* until others are looked for again; doubled with each look, */
#define POLL_MOST_NS INT64_C(100000000)

static const char magic[8] = "sstmaps1";

struct sst_share {
    char dir[SST_PATH_MAX], job[SST_CLAIM_JOB];
    int index, count, lease_ms;
    int step; /* that were shared so far */
};

int sst_share_open(struct sst_share **out, const char *dir, const char *job, int index, int count, int lease_ms)
{
    struct sst_share *s = calloc(1, sizeof(*s));
    int err = s ? sst_path_make_dir(dir) : -ENOMEM;

    if (err) {
        free(s);
        return err;
    }
    snprintf(s->dir, sizeof(s->dir), "%s", dir);
    snprintf(s->job, sizeof(s->job), "%s", job);
    s->index = index;
    s->count = count;
    s->lease_ms = lease_ms;
    *out = s;
    return 0;
}

void sst_share_close(struct sst_share *s)
{
    free(s);
}

/* --- maps in files ------------------------------------------------------------------------------------------------ */

static void add(struct sst_share_maps *maps, void *map, size_t pixel_bytes)
{
    maps->failed = maps->failed || !sst_mem_grow(&maps->map, maps->count, &maps->capacity, sizeof(*maps->map));
    if (!maps->failed)
        maps->map[maps->count++] = (struct sst_share_map){ map, pixel_bytes };
}

void sst_share_add_u8(struct sst_share_maps *maps, struct sst_map_u8 *map)
{
    add(maps, map, sizeof(uint8_t));
}

void sst_share_add_u16(struct sst_share_maps *maps, struct sst_map_u16 *map)
{
    add(maps, map, sizeof(uint16_t));
}

void sst_share_add_f32(struct sst_share_maps *maps, struct sst_map_f32 *map)
{
    add(maps, map, sizeof(float));
}

struct shape {
    int32_t width, height; /* 0: empty */
};

/* A map's rows, whatever its pixels are. */
static struct shape shape_of(const struct sst_share_map *m, uint8_t **data, size_t *stride)
{
    if (m->pixel_bytes == sizeof(uint8_t)) {
        const struct sst_map_u8 *map = m->map;

        *data = map->data;
        *stride = map->stride;
        return map->data ? (struct shape){ map->width, map->height } : (struct shape){ 0, 0 };
    }
    if (m->pixel_bytes == sizeof(uint16_t)) {
        const struct sst_map_u16 *map = m->map;

        *data = (uint8_t *)map->data;
        *stride = map->stride;
        return map->data ? (struct shape){ map->width, map->height } : (struct shape){ 0, 0 };
    } else {
        const struct sst_map_f32 *map = m->map;

        *data = (uint8_t *)map->data;
        *stride = map->stride;
        return map->data ? (struct shape){ map->width, map->height } : (struct shape){ 0, 0 };
    }
}

/* Free a map, and initialise it to a shape. */
static int reshape(const struct sst_share_map *m, struct shape to)
{
    if (m->pixel_bytes == sizeof(uint8_t)) {
        sst_map_u8_fini(m->map);
        return to.width ? sst_map_u8_init(m->map, to.width, to.height) : 0;
    }
    if (m->pixel_bytes == sizeof(uint16_t)) {
        sst_map_u16_fini(m->map);
        return to.width ? sst_map_u16_init(m->map, to.width, to.height) : 0;
    }
    sst_map_f32_fini(m->map);
    return to.width ? sst_map_f32_init(m->map, to.width, to.height) : 0;
}

static int write_maps(const char *path, const struct sst_share_maps *maps)
{
    struct sst_outfile out;
    int err = sst_outfile_open(&out, path);

    if (err)
        return err;
    fwrite(magic, sizeof(magic), 1, out.stream);
    for (int i = 0; i < maps->count; i++) {
        const struct sst_share_map *m = &maps->map[i];
        uint8_t *data;
        size_t stride;
        const struct shape shape = shape_of(m, &data, &stride);

        fwrite(&shape, sizeof(shape), 1, out.stream);
        for (int y = 0; y < shape.height; y++)
            fwrite(data + (size_t)y * stride, m->pixel_bytes, (size_t)shape.width, out.stream);
    }
    return sst_outfile_commit(&out);
}

static int read_map(FILE *f, const struct sst_share_map *m)
{
    struct shape shape;
    uint8_t *data;
    size_t stride;
    int err;

    if (fread(&shape, sizeof(shape), 1, f) != 1)
        return -EBADMSG;
    err = reshape(m, shape);
    if (err)
        return err == -EINVAL ? -EBADMSG : err;
    shape = shape_of(m, &data, &stride);
    for (int y = 0; y < shape.height; y++) {
        if (fread(data + (size_t)y * stride, m->pixel_bytes, (size_t)shape.width, f) != (size_t)shape.width)
            return -EBADMSG;
    }
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
    sst_work_fn *fn;
    void *arg;
    sst_share_maps_fn *maps;
    int count;
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

static int compute(struct step *t, int i, int worker, struct sst_claim *claim)
{
    struct sst_share_maps maps = { 0 };
    char path[SST_PATH_MAX], error[SST_LOG_MAX] = "";
    int err, end;

    sst_log_copy_errors(error, sizeof(error));
    err = t->fn(t->arg, i, worker);
    if (!err)
        t->maps(t->arg, i, &maps);
    err = err ? err : maps.failed ? -ENOMEM : item_path(t, i, ".maps", path);
    err = err ? err : write_maps(path, &maps);
    sst_log_copy_errors(NULL, 0);
    free(maps.map);
    if (err && !error[0])
        snprintf(error, sizeof(error), "%s", strerror(-err));
    end = sst_claim_end(claim, err ? error : NULL);
    return err ? err : end == -ESTALE ? 0 : end;
}

/* Compute an item unless another process does or has. */
static int try_item(struct step *t, int i, int worker)
{
    struct item *item = &t->item[i];
    struct sst_claim_info info;
    struct sst_claim *claim;
    char dir[SST_PATH_MAX];
    int err = item_path(t, i, "", dir);

    err = err ? err : sst_claim_look(&info, dir);
    if (err)
        return err;
    if (!strcmp(info.job, t->s->job) && info.state >= SST_CLAIM_DONE) {
        item->state = ITEM_THERE;
        if (info.state == SST_CLAIM_DONE)
            return 0;
        sst_log_error("worker %s: %s", info.worker, info.error);
        return -EIO;
    }
    err = -EBUSY;
    if (info.state != SST_CLAIM_HELD || sst_claim_expired(&item->watch, &info, t->s->lease_ms))
        err = sst_claim_take(&claim, dir, &info, t->s->job, t->s->lease_ms);
    if (err == -EBUSY) {
        pthread_mutex_lock(&t->lock);
        t->held = true;
        pthread_mutex_unlock(&t->lock);
        return 0;
    }
    if (err)
        return err;
    item->state = ITEM_HERE;
    pthread_mutex_lock(&t->lock);
    t->done_some = true;
    pthread_mutex_unlock(&t->lock);
    return compute(t, i, worker, claim);
}

/* A thread: the process's own part of the items first, which are neighbours, then the rest. */
static int work(void *arg, int index SST_UNUSED, int worker)
{
    struct step *t = arg;
    int err = 0;

    for (;;) {
        int at;

        pthread_mutex_lock(&t->lock);
        at = t->next++;
        pthread_mutex_unlock(&t->lock);
        if (err || at >= t->count)
            return err;
        at = (int)((at + (int64_t)t->s->index * t->count / t->s->count) % t->count);
        if (t->item[at].state == ITEM_OPEN)
            err = try_item(t, at, worker);
    }
}

static int read_item(void *arg, int i, int worker SST_UNUSED)
{
    struct step *t = arg;
    struct sst_share_maps maps = { 0 };
    char path[SST_PATH_MAX];
    int err = 0;

    if (t->item[i].state != ITEM_THERE)
        return 0;
    t->maps(t->arg, i, &maps);
    err = maps.failed ? -ENOMEM : item_path(t, i, ".maps", path);
    err = err ? err : read_maps(path, &maps);
    free(maps.map);
    return err;
}

int sst_share_for(struct sst_share *s, int count, int threads, sst_work_fn *fn, void *arg, sst_share_maps_fn *maps)
{
    struct step t = { .s = s, .fn = fn, .arg = arg, .maps = maps, .count = count };
    int64_t pause_ns = POLL_NS;
    char name[16];
    int err;

    if (!s)
        return sst_parallel_for(count, threads, fn, arg);
    snprintf(name, sizeof(name), "step-%02d", s->step++);
    err = sst_path_join(t.dir, s->dir, name);
    err = err ? err : sst_path_make_dir(t.dir);
    if (err)
        return err;
    t.item = calloc((size_t)count, sizeof(*t.item));
    if (!t.item)
        return -ENOMEM;
    pthread_mutex_init(&t.lock, NULL);
    do {
        t.next = 0;
        t.held = t.done_some = false;
        err = sst_parallel_for(sst_min_int(threads, count), threads, work, &t);
        if (!err && t.held && !t.done_some) {
            nanosleep(&(struct timespec){ .tv_nsec = pause_ns }, NULL);
            pause_ns = pause_ns < POLL_MOST_NS / 2 ? 2 * pause_ns : POLL_MOST_NS;
        }
    } while (!err && t.held);
    err = err ? err : sst_parallel_for(count, threads, read_item, &t);
    pthread_mutex_destroy(&t.lock);
    free(t.item);
    return err;
}

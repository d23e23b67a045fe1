/*
 * The file: struct head, struct entry [cams][frames], then the frames' bytes in the order in which cameras were
 * finished. It is written and read on the same machine: numbers are in native byte order.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/scene/world/world_internal.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "base/thread.h"

#define CACHE_KEPT        16   /* loops */
#define CACHE_LOOKED_AT   256  /* loops */
#define CACHE_LEFT_OVER_S 3600 /* a temporary file this old is abandoned */

static const char magic[8] = "SSTLOOP1";

struct head {
    char magic[8];
    uint8_t key[SST_SIM_KEY_BYTES];
    uint64_t bytes; /* of the whole file */
    uint32_t cams, frames;
};

struct entry {
    uint64_t offset;
    uint32_t bytes, scan, rest, dc_step; /* as in struct sim_jpeg */
};

struct sim_loop {
    const uint8_t *map;
    size_t bytes;
    const struct entry *entries;
    uint32_t cams, frames;
    struct early *early;             /* until all frames are there; NULL: they were */
    _Atomic(struct sim_loop *) whole; /* prepared in the background; NULL: not yet */
};

/* --- reading ------------------------------------------------------------------------------------------------------ */

/* A truncated or modified file must not cause reads outside it. */
static bool is_whole(const struct sim_loop *l, const uint8_t key[SST_SIM_KEY_BYTES])
{
    const struct head *h = (const struct head *)(const void *)l->map;
    const size_t count = (size_t)l->cams * l->frames, first = sizeof(*h) + count * sizeof(struct entry);

    if (l->bytes < first || memcmp(h->magic, magic, sizeof(magic)) || memcmp(h->key, key, SST_SIM_KEY_BYTES) ||
        h->bytes != l->bytes || h->cams != l->cams || h->frames != l->frames)
        return false;
    for (size_t i = 0; i < count; i++) {
        const struct entry *e = &l->entries[i];

        if (e->offset < first || e->offset > l->bytes || e->bytes > l->bytes - e->offset || e->scan > e->rest ||
            e->rest > e->bytes || !e->dc_step)
            return false;
    }
    return true;
}

/* @return 0, -ENOENT (no usable loop), -ENOMEM */
static int map_file(struct sim_loop **out, const char *path, const uint8_t key[SST_SIM_KEY_BYTES], int cams, int frames)
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    struct sim_loop *l = NULL;
    struct stat st;
    int err = -ENOENT;
    void *map;

    if (fd < 0)
        return err;
    if (fstat(fd, &st) || st.st_size < (off_t)sizeof(struct head)) {
        sst_log_warning("the prepared world %s is damaged; rendering it again", path);
        goto done;
    }
    l = calloc(1, sizeof(*l));
    map = l ? mmap(NULL, (size_t)st.st_size, PROT_READ, MAP_SHARED, fd, 0) : MAP_FAILED;
    if (map == MAP_FAILED) {
        err = -ENOMEM;
        goto done;
    }
    *l = (struct sim_loop){
        .map = map,
        .bytes = (size_t)st.st_size,
        .entries = (const struct entry *)(const void *)((const uint8_t *)map + sizeof(struct head)),
        .cams = (uint32_t)cams,
        .frames = (uint32_t)frames,
    };
    if (!is_whole(l, key)) {
        sst_log_warning("the prepared world %s is damaged; rendering it again", path);
        goto done;
    }
    *out = l;
    l = NULL;
    err = 0;

done:
    close(fd);
    sim_loop_close(l);
    return err;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

struct job {
    bool background;
    FILE *file;
    const char *name;
    int cams, frames;
    sim_render_fn *render;
    void *arg;
    pthread_mutex_t lock;
    struct entry *entries; /* under lock, as all below */
    uint64_t end;
    int done;
};

static int store_locked(struct job *j, int cam, const struct sim_jpeg *frames)
{
    for (int i = 0; i < j->frames; i++) {
        const struct sim_jpeg *f = &frames[i];

        if (fwrite(f->data, f->bytes, 1, j->file) != 1) {
            const int err = errno ? -errno : -EIO;

            sst_log_error("cannot write a frame of the simulated world: %s; check the disk of the cache",
                          strerror(-err));
            return err;
        }
        j->entries[(size_t)cam * (size_t)j->frames + (size_t)i] =
            (struct entry){ j->end, f->bytes, f->scan, f->rest, f->dc_step };
        j->end += f->bytes;
    }
    j->done++;
    if (j->background)
        fprintf(stderr, SIM_LOOP_PROGRESS "\n", j->name, j->done, j->cams);
    else if (isatty(STDERR_FILENO))
        fprintf(stderr, "\rpreparing the world %s: %d of %d cameras%s", j->name, j->done, j->cams,
                j->done == j->cams ? "\n" : "");
    return 0;
}

static int prepare_camera(void *arg, int cam, int worker SST_UNUSED)
{
    struct job *j = arg;
    struct sim_jpeg *frames = calloc((size_t)j->frames, sizeof(*frames));
    int err;

    if (j->background)
        sst_thread_nice(19);
    err = frames ? j->render(j->arg, cam, frames) : -ENOMEM;

    if (!err) {
        pthread_mutex_lock(&j->lock);
        err = store_locked(j, cam, frames);
        pthread_mutex_unlock(&j->lock);
    }
    for (int i = 0; frames && i < j->frames; i++)
        free(frames[i].data);
    free(frames);
    return err;
}

/* The index is at the start of the file and is known last. */
static int write_index(const struct job *j, const uint8_t key[SST_SIM_KEY_BYTES])
{
    struct head h = { .bytes = j->end, .cams = (uint32_t)j->cams, .frames = (uint32_t)j->frames };

    memcpy(h.magic, magic, sizeof(magic));
    memcpy(h.key, key, SST_SIM_KEY_BYTES);
    if (fseeko(j->file, 0, SEEK_SET) || fwrite(&h, sizeof(h), 1, j->file) != 1 ||
        fwrite(j->entries, sizeof(*j->entries), (size_t)j->cams * (size_t)j->frames, j->file) !=
            (size_t)j->cams * (size_t)j->frames) {
        const int err = errno ? -errno : -EIO;

        sst_log_error("cannot write the index of the simulated world: %s; check the disk of the cache", strerror(-err));
        return err;
    }
    return 0;
}

static int prepare(const char *path, const uint8_t key[SST_SIM_KEY_BYTES], struct job *j)
{
    const size_t count = (size_t)j->cams * (size_t)j->frames;
    struct sst_outfile file;
    int err = sst_outfile_open(&file, path);

    if (err)
        return err;
    j->file = file.stream;
    j->end = sizeof(struct head) + count * sizeof(struct entry);
    j->entries = calloc(count, sizeof(*j->entries));
    err = !j->entries ? -ENOMEM : fseeko(j->file, (off_t)j->end, SEEK_SET) ? -EIO : 0;
    err = err ? err : sst_parallel_for(j->cams, sst_thread_count(0), prepare_camera, j);
    err = err ? err : write_index(j, key);
    free(j->entries);
    if (!err)
        return sst_outfile_commit(&file);
    sst_outfile_abort(&file);
    return err;
}

/* --- the cache ---------------------------------------------------------------------------------------------------- */

struct cached {
    char name[SST_SIM_KEY_BYTES + 8];
    int64_t used_s;
};

static int newest_first(const void *a, const void *b)
{
    const int64_t x = ((const struct cached *)a)->used_s, y = ((const struct cached *)b)->used_s;

    return x > y ? -1 : x < y;
}

/** Clean the cache before another loop is written: remove leftovers of killed programs and all but the most recently
 *  used loops. Mapped files stay valid; files that cannot be removed are kept. */
static void tidy(const char *folder)
{
    struct cached all[CACHE_LOOKED_AT];
    const time_t now = time(NULL);
    DIR *dir = opendir(folder);
    const struct dirent *e;
    int n = 0;

    while (dir && n < CACHE_LOOKED_AT && (e = readdir(dir))) {
        const char *end = strstr(e->d_name, ".loop");
        struct stat st;

        if (!end || fstatat(dirfd(dir), e->d_name, &st, AT_SYMLINK_NOFOLLOW) || !S_ISREG(st.st_mode))
            continue;
        if (!strncmp(end, ".loop.tmp-", 10) && now - st.st_mtime > CACHE_LEFT_OVER_S)
            (void)unlinkat(dirfd(dir), e->d_name, 0);
        if (!end[5] && end - e->d_name == SST_SIM_KEY_BYTES) {
            memcpy(all[n].name, e->d_name, sizeof(".loop") + SST_SIM_KEY_BYTES);
            all[n++].used_s = st.st_mtime;
        }
    }
    qsort(all, (size_t)n, sizeof(all[0]), newest_first);
    for (int i = CACHE_KEPT - 1; i < n; i++)
        (void)unlinkat(dirfd(dir), all[i].name, 0);
    if (dir)
        closedir(dir);
}

static int render_all(const char *path, const uint8_t key[SST_SIM_KEY_BYTES], struct job *j, struct sim_loop **out)
{
    int err;

    pthread_mutex_init(&j->lock, NULL);
    err = prepare(path, key, j);
    pthread_mutex_destroy(&j->lock);
    if (!err && (err = map_file(out, path, key, j->cams, j->frames)) == -ENOENT) {
        sst_log_error("the prepared world %s vanished; choose another folder for the cache", path);
        err = -EIO;
    }
    return err;
}

/* --- at once ------------------------------------------------------------------------------------------------------ */

struct early {
    struct job job;
    uint8_t key[SST_SIM_KEY_BYTES];
    char path[SST_PATH_MAX];
    sim_render_fn *render;
    struct sim_jpeg *first; /* [cams] */
    pthread_t thread;
    bool runs;
};

static int render_first(void *arg, int cam, int worker SST_UNUSED)
{
    struct early *e = arg;

    return e->render(e->job.arg, cam, &e->first[cam]);
}

static void *render_rest(void *arg)
{
    struct sim_loop *l = arg, *whole = NULL;

    sst_thread_name("sst-prepare");
    if (!render_all(l->early->path, l->early->key, &l->early->job, &whole)) /* logged, or ended */
        atomic_store(&l->whole, whole);
    return NULL;
}

/* Signals are the caller's: its event loop has to get them. */
static int start_rest(struct sim_loop *l)
{
    sigset_t all, before;
    int err;

    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    err = -pthread_create(&l->early->thread, NULL, render_rest, l);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return err;
}

static int open_at_once(struct sim_loop **out, const char *path, const struct sim_loop_config *cfg, const struct job *j)
{
    struct sim_loop *l = calloc(1, sizeof(*l));
    struct early *e = l ? calloc(1, sizeof(*e)) : NULL;
    int err;

    if (!e) {
        free(l);
        return -ENOMEM;
    }
    l->early = e;
    l->cams = (uint32_t)cfg->cams;
    l->frames = (uint32_t)cfg->frames;
    e->job = *j;
    e->job.background = true;
    e->render = cfg->render_first;
    memcpy(e->key, cfg->key, sizeof(e->key));
    snprintf(e->path, sizeof(e->path), "%s", path);
    e->first = calloc((size_t)cfg->cams, sizeof(*e->first));
    err = e->first ? sst_parallel_for(cfg->cams, sst_thread_count(0), render_first, e) : -ENOMEM;
    err = err ? err : start_rest(l);
    e->runs = !err;
    if (err)
        sim_loop_close(l);
    else
        *out = l;
    return err;
}

int sim_loop_open(struct sim_loop **out, const struct sim_loop_config *cfg)
{
    struct job j = {
        .name = cfg->name, .cams = cfg->cams, .frames = cfg->frames, .render = cfg->render, .arg = cfg->arg
    };
    const char *folder = cfg->folder;
    const uint8_t *key = cfg->key;
    char file[SST_SIM_KEY_BYTES + 8], path[SST_PATH_MAX];
    int err;

    for (int i = 0; i < SST_SIM_KEY_BYTES / 2; i++)
        snprintf(file + 2 * i, 3, "%02x", key[i]);
    snprintf(file + SST_SIM_KEY_BYTES, 8, ".loop");
    err = sst_path_join(path, folder, file);
    err = err ? err : sst_path_make_dir(folder);
    if (err)
        return err;
    err = map_file(out, path, key, cfg->cams, cfg->frames);
    if (!err)
        (void)utimensat(AT_FDCWD, path, NULL, 0); /* mark as used */
    if (err != -ENOENT)
        return err;
    tidy(folder);
    return cfg->render_first && cfg->frames > 1 ? open_at_once(out, path, cfg, &j) : render_all(path, key, &j, out);
}

static void close_early(struct early *e, uint32_t cams)
{
    if (!e)
        return;
    if (e->runs)
        pthread_join(e->thread, NULL);
    for (uint32_t i = 0; e->first && i < cams; i++)
        free(e->first[i].data);
    free(e->first);
    free(e);
}

void sim_loop_close(struct sim_loop *l)
{
    if (!l)
        return;
    close_early(l->early, l->cams);
    sim_loop_close(atomic_load(&l->whole));
    if (l->map)
        munmap((void *)(uintptr_t)l->map, l->bytes);
    free(l);
}

bool sim_loop_whole(const struct sim_loop *l)
{
    return !l->early || atomic_load(&l->whole);
}

struct sim_jpeg sim_loop_frame(const struct sim_loop *l, int cam, int frame)
{
    const struct entry *e;

    if (l->early && !atomic_load(&l->whole))
        return l->early->first[cam];
    if (l->early)
        l = atomic_load(&l->whole);
    e = &l->entries[(size_t)cam * l->frames + (size_t)frame];
    return (struct sim_jpeg){
        .data = (uint8_t *)(uintptr_t)(l->map + e->offset),
        .bytes = e->bytes,
        .scan = e->scan,
        .rest = e->rest,
        .dc_step = e->dc_step,
    };
}

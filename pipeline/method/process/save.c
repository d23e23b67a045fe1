/* The folder of a processed light field: its maps and what explains them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>

#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/folder.h"
#include "pipeline/method/process/process.h"

static const char *const extra_names[SST_EXTRAS] = { "labels_initial", "labels_hcsm", "entropy" };

struct job {
    const struct sst_lightfield *lf;
    const struct sst_process_extras *extras;
    struct sst_outdir out[SST_EXTRAS];
};

/* Map `index % views` of extra `index / views`. */
static int write_extra(void *arg, int index, int worker SST_UNUSED)
{
    const struct job *job = arg;
    const int views = job->lf->rows * job->lf->cols, extra = index / views, view = index % views;
    const struct sst_map_u8 *map = &job->extras->map[extra][view];
    char name[16], file[32], path[SST_PATH_MAX];
    int err;

    if (!map->data)
        return 0;
    sst_view_name(job->lf, view, name);
    snprintf(file, sizeof(file), "%s.png", name);
    err = sst_path_join(path, job->out[extra].temporary, file);
    return err ? err : sst_map_u8_write_png(map, path, extra == SST_EXTRA_ENTROPY ? NULL : sst_classes_palette());
}

static void remove_folder(const char *dir, const char *name)
{
    char path[SST_PATH_MAX];

    if (!sst_path_join(path, dir, name))
        sst_path_remove_tree(path);
}

static void remove_stale(const struct sst_lightfield *lf, const char *dir)
{
    for (int i = 0; lf->files->external_labels && i < SST_EXTRAS; i++)
        remove_folder(dir, extra_names[i]);
    if (lf->files->external_disparity && !sst_lightfield_has(lf, SST_LOAD_CONFIDENCE))
        remove_folder(dir, "confidence");
}

/* Everything is written before anything is replaced. */
int sst_process_save(const struct sst_lightfield *lf, const struct sst_process_extras *extras, const char *dir,
                     int threads)
{
    struct job job = { .lf = lf, .extras = extras };
    char path[SST_PATH_MAX];
    int err = 0, opened = 0;

    for (; !err && extras->map[0] && opened < SST_EXTRAS; opened++) {
        err = sst_path_join(path, dir, extra_names[opened]);
        err = err ? err : sst_outdir_open(&job.out[opened], path, true);
        if (err)
            break;
        job.out[opened].synced = true;
    }
    err = err ? err : sst_parallel_for(opened * lf->rows * lf->cols, SST_WRITE_THREADS, write_extra, &job);
    err = err ? err : sst_lightfield_save_maps(lf, dir, threads);
    for (int i = 0; i < opened; i++) {
        err = err ? err : sst_outdir_commit(&job.out[i]);
        sst_outdir_abort(&job.out[i]);
    }
    if (!err)
        remove_stale(lf, dir);
    return err;
}

/* Files of the views: the samples that all of 16 bits are scaled from, the qualities of JPEG. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/deep.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define HEADER 25 /* bytes of a PNG up to its bit depth */

/* Whether it can have 16 bits: of a TIFF, the whole file says it. */
static bool may_be_deep(const char *path)
{
    uint8_t head[HEADER] = { 0 };
    FILE *f = fopen(path, "rb");
    const bool read = f && fread(head, 1, HEADER, f) == HEADER;

    if (f)
        fclose(f);
    return read && !sst_image_is_jpeg(head, HEADER) && (memcmp(head, "\x89PNG", 4) != 0 || head[HEADER - 1] == 16);
}

/* Add a view's samples. @return 1; 0: it has 8 bits */
static int count_view(struct sst_sample_counts *counts, const struct sst_lightfield *lf, int k, const char *dir)
{
    char path[SST_PATH_MAX];
    uint8_t *data;
    size_t size;
    int err = view_path(path, lf, k, dir);

    if (err || !may_be_deep(path))
        return err;
    err = sst_file_read(path, SST_VIEW_FILE_MAX, &data, &size);
    if (err)
        return err;
    err = sst_image_count_samples(counts, data, size, path);
    free(data);
    return err;
}

int sst_lightfield_choose_samples(struct sst_lightfield *lf, const char *dir, const char *name)
{
    struct sst_sample_counts *counts = calloc(1, sizeof(*counts));
    int deep = 0, present = 0, r = counts ? 0 : -ENOMEM;

    lf->samples = (struct sst_samples){ 0, 0 };
    for (int k = 0; r >= 0 && k < lf->rows * lf->cols; k++) {
        if (!lf->views[k].present)
            continue;
        present++;
        r = count_view(counts, lf, k, dir);
        deep += r > 0;
    }
    if (r >= 0 && deep && deep < present)
        sst_log_warning("%s: %d of %d views have 16 bits, the others 8: their samples mean different light; make all "
                        "of one kind",
                        name, deep, present);
    else if (r >= 0 && deep)
        lf->samples = sst_samples_choose(counts);
    if (r >= 0 && deep)
        sst_samples_report(counts, lf->samples, name);
    if (r == -ENOMEM)
        sst_log_error("no memory to count the samples of %s", name);
    free(counts);
    return r < 0 ? r : 0;
}

int sst_lightfield_levels(const struct sst_lightfield *lf, const char *dir, bool report, int *before, int *after)
{
    struct sst_sample_counts *counts = lf->files->without_folder ? NULL : calloc(1, sizeof(*counts));
    int r = lf->files->without_folder ? 0 : counts ? count_view(counts, lf, lf->ref_view, dir) : -ENOMEM;

    *before = lf->files->levels[0];
    *after = lf->files->levels[1];
    if (r > 0) {
        sst_samples_levels(before, after, counts, lf->samples);
        if (report)
            sst_samples_report(counts, lf->samples, lf->files->view[lf->ref_view].name);
    }
    free(counts);
    return r < 0 ? r : 0;
}

int sst_lightfield_jpeg_quality(double *quality, const struct sst_lightfield *lf, const char *dir)
{
    for (int k = 0; k < lf->rows * lf->cols; k++) {
        const char *name = lf->files->view[k].name;
        const size_t n = strlen(name);
        struct view_file file;
        int err;

        quality[k] = lf->files->without_folder ? lf->files->view[k].quality : NAN;
        if (lf->files->without_folder)
            continue;
        if (!lf->views[k].present || (n > 4 && !strcasecmp(name + n - 4, ".png")))
            continue;
        err = view_file_read(&file, lf, k, dir);
        if (err)
            return err;
        if (file.size > 2 && file.data[0] == 0xFF && file.data[1] == 0xD8)
            quality[k] = sst_jpeg_quality(file.data, file.size, file.path);
        free(file.data);
    }
    return 0;
}

int sst_lightfield_read_file(struct sst_deep *out, const struct sst_lightfield *lf, const char *dir, int view)
{
    struct view_file file;
    struct sst_deep made;
    int err = read_view(&file, lf, view, dir);

    if (err)
        return err;
    err = sst_deep_decode(&made, file.data, file.size, file.path);
    free(file.data);
    if (err)
        return err;
    err = view_check_size(lf, file.path, made.width, made.height);
    if (err)
        sst_deep_fini(&made);
    else
        *out = made;
    return err;
}

struct deep_job {
    struct sst_map_u16 (*plane)[3];
    const struct sst_lightfield *lf;
    const char *dir;
};

static int read_deep(void *arg, int k, int worker SST_UNUSED)
{
    const struct deep_job *job = arg;
    const struct sst_map_u16 *green = &job->plane[k][1];
    struct view_file file;
    int err;

    if (!job->lf->views[k].present)
        return 0;
    err = view_file_read(&file, job->lf, k, job->dir);
    if (err)
        return err;
    err = sst_image_decode_deep(job->plane[k], file.data, file.size, file.path);
    free(file.data);
    return err ? err : view_check_size(job->lf, file.path, green->width, green->height);
}

int sst_lightfield_read_deep(struct sst_map_u16 (*plane)[3], const struct sst_lightfield *lf, const char *dir, int threads)
{
    struct deep_job job = { plane, lf, dir };

    return sst_parallel_for(lf->rows * lf->cols, sst_thread_count(threads), read_deep, &job);
}

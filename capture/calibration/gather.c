/* Corners and samples of light from all pictures of a source. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/mem.h"
#include "base/thread.h"
#include "capture/calibration/calibration_internal.h"
#include "pipeline/calibration/board/coverage.h"
#include "pipeline/image/codec.h"

#define GUESSES 3 /* pictures without the board that are searched for other boards */

void sst_gathered_fini(struct sst_gathered *g)
{
    sst_detections_fini(&g->all);
    sst_photometric_samples_fini(&g->light);
}

void gather_result_fini(struct gather_result *result)
{
    sst_detection_fini(&result->detection);
    sst_photometric_samples_fini(&result->light);
    *result = (struct gather_result){ 0 };
}

int gather_detect(struct gather_result *out, const struct sst_gather_config *cfg, struct sst_image *image, int view,
                  int frame)
{
    int err = sst_board_detect(&cfg->board, image, &cfg->detect, &out->detection, &out->outcome);

    out->present = true;
    out->detection.view = view;
    out->detection.frame = frame;
    if (!err && out->outcome == SST_DETECT_FOUND && cfg->light)
        err = sst_photometric_collect(&out->light, &cfg->board, image, &out->detection);
    sst_image_fini(image);
    return err;
}

int gather_add(struct sst_gathered *to, struct gather_result *result)
{
    struct sst_photometric_samples *light = &to->light;
    int err = 0;

    if (result->present)
        to->all.outcome[result->outcome]++;
    if (result->present && result->outcome == SST_DETECT_FOUND)
        err = sst_detections_add(&to->all, &result->detection);
    for (int i = 0; !err && i < result->light.count; i++) {
        if (sst_mem_grow(&light->sample, light->count, &light->capacity, sizeof(*light->sample)))
            light->sample[light->count++] = result->light.sample[i];
        else
            err = -ENOMEM;
    }
    gather_result_fini(result);
    return err;
}

int sst_gather_write_coverage(const struct sst_detections *all, const char *path)
{
    struct sst_coverage *coverage = calloc((size_t)(all->rows * all->cols), sizeof(*coverage));
    struct sst_image picture = { 0 };
    int err = coverage ? 0 : -ENOMEM;

    if (!err) {
        sst_coverage_count(coverage, all);
        err = sst_coverage_picture(&picture, all, coverage);
    }
    err = err ? err : sst_image_write_png(&picture, path);
    sst_image_fini(&picture);
    free(coverage);
    return err;
}

/* --- all pictures of a source ------------------------------------------------------------------------------------- */

struct work {
    const struct sst_gather_source *source;
    const struct sst_gather_config *cfg;
    int views, width, height;
    struct gather_result *result; /* [frames * views] */
    SST_ATOMIC(int) done;
};

static int detect_one(void *arg, int index, int worker)
{
    struct work *w = arg;
    const int view = index % w->views, frame = index / w->views;
    struct sst_image image = { 0 };
    int err = sst_gather_source_read(w->source, view, frame, &image), done;

    if (err == -EILSEQ) /* a damaged frame counts as one that the camera missed */
        w->result[index].damaged = true;
    if (err)
        return err == -ENODATA || err == -EILSEQ ? 0 : err;
    if (image.width != w->width || image.height != w->height) {
        sst_log_error("%s, camera %s, %s: the picture has %dx%d pixels, others have %dx%d; all must be of one size",
                      w->source->path, w->source->camera_name[view], w->source->frame_name[frame], image.width,
                      image.height, w->width, w->height);
        sst_image_fini(&image);
        return -EBADMSG;
    }
    err = gather_detect(&w->result[index], w->cfg, &image, view, frame);
    done = ++w->done;
    if (!worker && w->cfg->progress)
        w->cfg->progress(w->cfg->arg, (double)done / (w->source->frames * w->views));
    return err;
}

static int find_size(struct work *w)
{
    for (int i = 0; i < w->source->frames * w->views; i++) {
        struct sst_image image;
        const int err = sst_gather_source_read(w->source, i % w->views, i / w->views, &image);

        if (err == -ENODATA || err == -EILSEQ)
            continue;
        if (!err) {
            w->width = image.width;
            w->height = image.height;
            sst_image_fini(&image);
        }
        return err;
    }
    sst_log_error("%s holds no picture that can be read", w->source->path);
    return -EBADMSG;
}

/* Guess of the other board in pictures without the wanted one. */
static void log_other_board(const struct work *w, int found)
{
    char text[128], shows[160];
    int tried = 0;

    sst_board_format(&w->cfg->board, text);
    for (int i = 0; i < w->source->frames * w->views && tried < GUESSES; i++) {
        struct sst_image image;
        bool guessed;

        if (!w->result[i].present ||
            (w->result[i].outcome != SST_DETECT_NONE && w->result[i].outcome != SST_DETECT_OTHER_BOARD) ||
            sst_gather_source_read(w->source, i % w->views, i / w->views, &image))
            continue;
        tried++;
        guessed = sst_board_guess(&w->cfg->board, &image, shows);
        sst_image_fini(&image);
        if (guessed) {
            sst_log_error("%s: the board %s is in %d of %d pictures; camera %s, %s: %s; correct --board",
                          w->source->path, text, found, w->done, w->source->camera_name[i % w->views],
                          w->source->frame_name[i / w->views], shows);
            return;
        }
    }
    sst_log_error(
        "%s: the board %s is in %d of %d pictures; are its kind and its numbers of squares right (--board), is it "
        "sharp, lit, not mirrored and large enough in the picture?",
        w->source->path, text, found, w->done);
}

static void log_left_out(const struct work *w)
{
    static const struct {
        enum sst_detect_outcome outcome;
        const char *what;
    } kinds[] = { { SST_DETECT_BLURRED, "blurred" },
                  { SST_DETECT_MOVING, "blurred by motion" },
                  { SST_DETECT_OTHER_BOARD, "of another board" } };

    for (size_t k = 0; k < ARRAY_LEN(kinds); k++) {
        int n = 0, worst = -1;
        char edges[64] = "";

        for (int i = 0; i < w->source->frames * w->views; i++) {
            const struct gather_result *s = &w->result[i];

            if (!s->present || s->outcome != kinds[k].outcome)
                continue;
            n++;
            if (worst < 0 || s->detection.blur_px > w->result[worst].detection.blur_px)
                worst = i;
        }
        if (n && w->result[worst].detection.blur_px > 0)
            snprintf(edges, sizeof(edges), ", edges %.1f px wide", w->result[worst].detection.blur_px);
        if (n)
            sst_log_warning("%d of %d pictures are left out because they are %s%s camera %s, %s%s", n, w->done,
                            kinds[k].what, edges[0] ? "; worst:" : ", the first of",
                            w->source->camera_name[worst % w->views], w->source->frame_name[worst / w->views], edges);
    }
}

static void log_damaged(const struct work *w)
{
    int n = 0, first = -1;

    for (int i = 0; i < w->source->frames * w->views; i++) {
        if (!w->result[i].damaged)
            continue;
        first = n++ ? first : i;
    }
    if (n)
        sst_log_warning("%s: %d frame%s damaged and left out, the first of camera %s, %s", w->source->path, n,
                        n == 1 ? " is" : "s are", w->source->camera_name[first % w->views],
                        w->source->frame_name[first / w->views]);
}

static int add_all(struct sst_gathered *out, struct work *w)
{
    const struct sst_gather_source *s = w->source;
    int err = sst_detections_init(
        &out->all,
        &(struct sst_detections){
            .board = w->cfg->board, .rows = s->rows, .cols = s->cols, .width = w->width, .height = w->height });

    if (err)
        return err;
    out->all.rig = s->rig;
    memcpy(out->all.camera_name, s->camera_name, (size_t)w->views * sizeof(*s->camera_name));
    if (s->drive_mm) {
        out->all.drive_mm = malloc((size_t)w->views * sizeof(*s->drive_mm));
        if (!out->all.drive_mm)
            return -ENOMEM;
        memcpy(out->all.drive_mm, s->drive_mm, (size_t)w->views * sizeof(*s->drive_mm));
    }
    for (int f = 0; f < s->frames && !err; f++) {
        const int frame = sst_detections_frame(&out->all, s->frame_name[f]);

        err = frame < 0 ? frame : 0;
        for (int view = 0; view < w->views && !err; view++)
            err = gather_add(out, &w->result[f * w->views + view]);
    }
    return err;
}

int sst_gather(struct sst_gathered *out, const struct sst_gather_source *source, const struct sst_gather_config *cfg)
{
    struct work w = { .source = source, .cfg = cfg, .views = source->rows * source->cols };
    const int n = source->frames * w.views;
    struct sst_gathered g = { 0 };
    int found = 0, err;

    w.result = calloc((size_t)n, sizeof(*w.result));
    err = w.result ? find_size(&w) : -ENOMEM;
    err = err ? err : sst_parallel_for(n, cfg->threads, detect_one, &w);
    if (!err) {
        log_damaged(&w);
        log_left_out(&w);
        for (int i = 0; i < n; i++)
            found += w.result[i].present && w.result[i].outcome == SST_DETECT_FOUND;
        if (found * 10 < w.done) { /* in hardly any: most likely another board */
            log_other_board(&w, found);
            err = -EBADMSG;
        }
    }
    err = err ? err : add_all(&g, &w);
    for (int i = 0; w.result && i < n; i++)
        gather_result_fini(&w.result[i]);
    free(w.result);
    if (err)
        sst_gathered_fini(&g);
    else
        *out = g;
    return err;
}

/* Pictures of a recording's framesets. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/log.h"
#include "capture/calibration/calibration_internal.h"
#include "capture/recording/recording.h"
#include "pipeline/image/raw.h"

int gather_recorded_open(struct sst_gather_source *out, const struct sst_gather_selection *selection)
{
    const struct sst_recording_info *info;
    int sets, err = sst_recording_open(&out->recording, out->path);

    if (err)
        return err;
    info = sst_recording_info(out->recording);
    sets = sst_recording_sets(out->recording);
    out->rows = info->rows;
    out->cols = info->cols;
    if (selection->grid[0] && (selection->grid[0] != out->rows || selection->grid[1] != out->cols)) {
        sst_log_error("%s is of %dx%d cameras, not %dx%d; leave out --grid", out->path, out->rows, out->cols,
                      selection->grid[0], selection->grid[1]);
        return -EBADMSG;
    }
    out->spacing_mm = info->spacing_mm;
    out->frames = gather_selection_count(selection, sets);
    if (!out->frames) {
        sst_log_error("%s holds no set; record some first", out->path);
        return -EBADMSG;
    }
    out->camera_name = calloc((size_t)(out->rows * out->cols), sizeof(*out->camera_name));
    out->frame_name = calloc((size_t)out->frames, sizeof(*out->frame_name));
    out->frameset = calloc((size_t)out->frames, sizeof(*out->frameset));
    if (!out->camera_name || !out->frame_name || !out->frameset)
        return -ENOMEM;
    for (int i = 0; i < info->cameras; i++) {
        const struct sst_recorder_track *t = &info->track[i];

        snprintf(out->camera_name[t->row * out->cols + t->col], sizeof(*out->camera_name), "%s",
                 t->serial[0] ? t->serial
                 : t->port[0] ? t->port
                              : t->name);
        if (!out->camera_name[t->row * out->cols + t->col][0])
            snprintf(out->camera_name[t->row * out->cols + t->col], sizeof(*out->camera_name), "%02d_%02d", t->row,
                     t->col);
    }
    for (int i = 0; i < out->frames; i++) {
        out->frameset[i] = gather_selection_at(selection, sets, i);
        snprintf(out->frame_name[i], sizeof(*out->frame_name), "set %d", out->frameset[i]);
    }
    return 0;
}

int gather_recorded_read(const struct sst_gather_source *source, int view, int frame, struct sst_image *out)
{
    const struct sst_recording_info *info = sst_recording_info(source->recording);
    struct sst_recording_set *set = malloc(sizeof(*set));
    uint8_t *data = NULL;
    size_t bytes = 0;
    int cam = 0, err = set ? 0 : -ENOMEM;

    while (cam < info->cameras && info->track[cam].row * source->cols + info->track[cam].col != view)
        cam++;
    if (!err && cam == info->cameras)
        err = -ENODATA;
    if (!err)
        err = sst_recording_set(source->recording, source->frameset[frame], set);
    if (!err && set->frame[cam].faults & SST_RECORDING_BAD_PICTURE)
        err = -ENODATA;
    if (!err)
        err = sst_recording_picture(source->recording, set, cam, &data, &bytes);
    if (!err)
        err = sst_raw_decode(out, &(struct sst_raw){ info->fourcc, info->width, info->height, set->frame[cam].stride,
                                                     data, bytes });
    free(data);
    free(set);
    return err == -EBADMSG ? -EILSEQ : err;
}

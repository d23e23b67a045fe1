/* cli/calibrate_source.h - pictures of a board wherever they are: folders, recordings, light fields, a rig's captures.
 */
#ifndef SST_CLI_CALIBRATE_SOURCE_H
#define SST_CLI_CALIBRATE_SOURCE_H

#include <stdbool.h>

#include "capture/recording/recording.h"
#include "pipeline/image/image.h"

/** Pictures by view and frame; a frame is a moment (or, on a rig, a placement of the board). */
struct calibrate_source {
    const char *path;
    int rows, cols, frames;
    char (*camera_name)[64];         /* [rows * cols]; "" where there is no camera */
    char (*frame_name)[64];          /* [frames] */
    double spacing_mm;               /* of the array, as the recording says; 0: unknown */
    bool rig;                        /* the views are poses of one camera ... */
    double (*drive_mm)[3];           /* ... at these positions, by its drives; NULL: unknown */
    char **file;                     /* [frames][rows * cols] paths; NULL: no picture */
    struct sst_recording *recording; /* or the pictures are in its sets: */
    int *set;                        /* [frames] */
};

/** Which pictures to take. */
struct calibrate_pick {
    int grid[2];    /* 0: from names */
    bool rig;       /* take views as poses of one camera even where nothing says so */
    int every, max; /* of a recording's sets each n-th, and at most so many; 0: all */
};

/** How many of `all` frames are taken. */
static inline int calibrate_pick_count(const struct calibrate_pick *pick, int all)
{
    const int some = pick->every > 1 ? (all + pick->every - 1) / pick->every : all;

    return pick->max && some > pick->max ? pick->max : some;
}

/** Which of `all` frames is taken as the i-th: spread evenly. */
static inline int calibrate_pick_at(const struct calibrate_pick *pick, int all, int i)
{
    const int every = pick->every > 1 ? pick->every : 1, some = (all + every - 1) / every;

    return (int)((long long)i * some / calibrate_pick_count(pick, all)) * every;
}

/**
 * Look what is there:
 *   a recording; a light field, or a folder of them (a frame each); a folder with one folder of pictures per camera,
 *   files of the same name being one moment; a folder of pictures named CAMERA + number (left01.jpg, right01.jpg).
 * Cameras named rr_cc have that place in the grid; others fill it in the order of their names.
 *
 * @return 0, -ENOENT, -EBADMSG (no pictures, names that do not fit the grid), -ENOMEM ...; logged.
 */
SST_MUST_CHECK int calibrate_source_open(struct calibrate_source *out, const char *path,
                                         const struct calibrate_pick *pick);
void calibrate_source_close(struct calibrate_source *source);

/** The recording part of it (calibrate_recording.c). */
SST_MUST_CHECK int calibrate_recording_open(struct calibrate_source *out, const struct calibrate_pick *pick);
SST_MUST_CHECK int calibrate_recording_read(const struct calibrate_source *source, int view, int frame,
                                            struct sst_image *out);

/** @return 0, -ENODATA (there is none; not logged), -EILSEQ (a recording's frame is damaged; not logged), or a reader's
 *  error; logged. Thread: any. */
SST_MUST_CHECK int calibrate_source_read(const struct calibrate_source *source, int view, int frame,
                                         struct sst_image *out);

/** A frame's bytes as a picture. @return 0, -EBADMSG, -EINVAL, -ENOMEM; not logged. */
SST_MUST_CHECK int calibrate_decode(struct sst_image *out, uint32_t fourcc, int width, int height, size_t stride,
                                    const uint8_t *data, size_t bytes);

#endif

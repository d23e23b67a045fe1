/* cli/calibrate_gather.h - from pictures to corners and samples of light, in folders or as they come. */
#ifndef SST_CLI_CALIBRATE_GATHER_H
#define SST_CLI_CALIBRATE_GATHER_H

#include "cli/calibrate_source.h"
#include "config/array.h"
#include "pipeline/calibration/photometric/light.h"

struct calibrate_gathered {
    struct sst_detections all;
    struct sst_light_samples light;
};

struct calibrate_gather_config {
    struct sst_board board;
    struct sst_detect_config detect;
    bool light; /* also collect samples of light */
    int threads;
    const char *coverage; /* picture to keep up to date, or NULL */
};

void calibrate_gathered_fini(struct calibrate_gathered *gathered);

/**
 * Find the board in every picture of a source and tell what was left out and why.
 * @return 0, -EBADMSG (no board anywhere, pictures of different sizes), -ENOTSUP, -ENOMEM, a reader's error; logged.
 */
SST_MUST_CHECK int calibrate_gather(struct calibrate_gathered *out, const struct calibrate_source *source,
                                    const struct calibrate_gather_config *cfg);

struct calibrate_live_config {
    struct sst_array_config *array;
    const char *keep; /* record the sets here too; NULL: no */
    int sets;         /* end after so many with a board; 0: when nothing is missing, or at Ctrl-C */
    double seconds;   /* 0: no limit */
    int *set;         /* out: number of each frame's set in the recording; to free */
};

/**
 * Take sets of the live array until its coverage is complete, and say all the time what is still missing. A set in
 * which the board stands where it stood in the last one is passed over.
 * @return as above, and what capture returns
 */
SST_MUST_CHECK int calibrate_live(struct calibrate_gathered *out, const struct calibrate_gather_config *cfg,
                                  struct calibrate_live_config *live);

/** Write the coverage picture. @return 0 or what outputs return; logged */
SST_MUST_CHECK int calibrate_write_coverage(const struct sst_detections *all, const char *path);

/* --- one moment --------------------------------------------------------------------------------------------------- */

/** What one picture gave; zeroed before use. */
struct calibrate_shot {
    enum sst_detect_outcome outcome;
    bool there;   /* a picture was there */
    bool damaged; /* a frame was there that is no picture */
    struct sst_detection detection;
    struct sst_light_samples light;
};

/** Find the board in one picture, which is given back. */
SST_MUST_CHECK int calibrate_shoot(struct calibrate_shot *shot, const struct calibrate_gather_config *cfg,
                                   struct sst_image *image, int view, int frame);
/** Take a shot over into what was gathered; frees it. */
SST_MUST_CHECK int calibrate_take(struct calibrate_gathered *to, struct calibrate_shot *shot);
void calibrate_shot_fini(struct calibrate_shot *shot);

#endif

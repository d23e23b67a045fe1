/* pipeline/lightfield/export_parts.h - what the exports share. Inside pipeline/lightfield only. */
#ifndef SST_PIPELINE_LIGHTFIELD_EXPORT_PARTS_H
#define SST_PIPELINE_LIGHTFIELD_EXPORT_PARTS_H

#include "pipeline/camera/calib.h"
#include "pipeline/lightfield/import.h"

/** An export at work. */
struct sst_export_job {
    struct sst_lightfield lf;
    const struct sst_export_config *cfg;
    const char *out; /* temporary folder */
};

/** Bytes of a view's file, whose hash is checked; data to free with free(). path is out, for messages. */
SST_MUST_CHECK int sst_export_read_view(const struct sst_export_job *job, int view, char path[SST_PATH_MAX],
                                        uint8_t **data, size_t *size);

/**
 * The cameras that made the views' files: the light field's calibration, or one pinhole in the rectified views' plane,
 * its principal point in the middle of the picture.
 * @return 0, -EBADMSG (focal length or spacing is unknown, or a view's camera), -ENOMEM; logged
 */
SST_MUST_CHECK int sst_export_cameras(struct sst_calib *out, const struct sst_lightfield *lf,
                                      const struct sst_export_config *cfg);

/** "images/rr_cc.png" (or .jpg) of a view. */
void sst_export_image_name(const struct sst_export_job *job, int view, char out[64]);

/**
 * A COLMAP model as text in dir/sparse/0: cameras, images, points3D (empty), rigs and frames. COLMAP's convention:
 * the upper left pixel's centre is (0.5, 0.5); poses take points (metres) from the reference camera's axes into a
 * camera.
 * @param name  of view k's file below images/
 */
SST_MUST_CHECK int sst_colmap_write(const struct sst_calib *calib, const char (*name)[64], const char *dir);

/**
 * nerfstudio's transforms.json in dir. Its convention: the upper left pixel's centre is (0.5, 0.5); matrices take
 * points (metres) from the camera (x right, y up, z back) into a world with z up, y forward (applied_transform says
 * so).
 */
SST_MUST_CHECK int sst_nerfstudio_write(const struct sst_calib *calib, const char (*name)[64], const char *dir);

#endif

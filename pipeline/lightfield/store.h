/* pipeline/lightfield/store.h - lightfield.json to and from memory, and hashes. Inside pipeline/lightfield only. */
#ifndef SST_PIPELINE_LIGHTFIELD_STORE_H
#define SST_PIPELINE_LIGHTFIELD_STORE_H

#include "pipeline/lightfield/folder.h"

#define SST_LIGHTFIELD_VERSION 2 /* the newest; a light field without a calibration is written as 1 */
#define SST_DISP_ABS_MAX_PX 32768.0 /* no disparity is larger than an image */
#define SST_RANGE_MAX_PX 1023.0     /* what 16 bits of 1/64 px hold, less the mark for unknown */
#define SST_VIEW_FILE_MAX ((size_t)1 << 30) /* bytes of one view's file */

/** SHA-256 of a buffer as lower-case hex. */
void sst_sha256_hex(char out[65], const uint8_t *data, size_t size);

/** May this be the name of a view's file? No slash, no dot in front, printable, 1 to 255 bytes. */
bool sst_view_file_name_ok(const char *name);

/** Check that the numbers of a light field make sense, for reading and before writing. @return NULL or what is wrong
 *  (storage of the thread). */
const char *sst_lightfield_fault(const struct sst_lightfield *lf);

/** lightfield.json of a light field. Of a calibration it holds how it is used, and the hash of its file.
 *  @param hashes  [views][65], for views whose own is empty @return NULL: no memory. Free with free(). */
char *sst_lightfield_to_json(const struct sst_lightfield *lf, char (*hashes)[65], const char *calibration_sha256);

/** Read lightfield.json strictly: every field present, of its type and in its range, none unknown. Of a calibrated one
 *  `rectified` is there but for its views, calibration is not.
 *  @return 0, -ENOENT, -EBADMSG, -ENOMEM, -EIO; logged with file and field. */
SST_MUST_CHECK int sst_lightfield_read_json(struct sst_lightfield *lf, const char *path);

/** Read the calibration of a light field that has been read by sst_lightfield_read_json() and has one.
 *  @return 0, -ENOENT, -EBADMSG (not the one it was made with), -ENOMEM, -EIO; logged. */
SST_MUST_CHECK int sst_calibration_load(struct sst_lightfield *lf, const char *dir);

/** Undo sst_lightfield_calibrate(), but for the offsets: width and height are those of the raw frames again. */
void sst_calibration_drop(struct sst_lightfield *lf);

/** Turn view's raw image into the rectified one, and make valid. @return 0, -EINVAL, -ENOMEM; logged. */
SST_MUST_CHECK int sst_calibration_rectify_view(struct sst_lightfield *lf, int view);

#endif

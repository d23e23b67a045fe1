/* Frames recorded in parts, joined with the whole frame that they belong to. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>

#include "capture/recording/recording.h"
#include "pipeline/image/jpeg_parts.h"

#define SAME_NS 1000 /* between the time in parts and the set's time in the manifest */

/* The whole frame of a camera at a moment. */
static int read_base(const struct sst_recording *r, int64_t wall_ns, int cam, uint8_t **data, size_t *bytes)
{
    struct sst_recording_set *set = malloc(sizeof(*set));
    int i = 0, err = set ? sst_recording_near(r, wall_ns, SAME_NS, &i) : -ENOMEM;

    err = err ? err : sst_recording_set(r, i, set);
    if (!err && set->frame[cam].faults & SST_FRAME_PARTS)
        err = -EBADMSG;
    err = err ? err : sst_recording_frame(r, set, cam, data);
    if (!err)
        *bytes = set->frame[cam].bytes;
    free(set);
    return err == -ENOENT ? -ENODATA : err; /* it was trimmed */
}

int sst_recording_picture(const struct sst_recording *r, const struct sst_recording_set *set, int cam, uint8_t **data,
                          size_t *bytes)
{
    struct sst_jpeg_bytes parts, base = { 0 };
    uint8_t *read = NULL, *whole = NULL;
    const struct sst_recording_info *info = sst_recording_info(r);
    int64_t base_ns = 0;
    int err = sst_recording_frame(r, set, cam, &read);

    if (err)
        return err;
    *bytes = set->frame[cam].bytes;
    if (!(set->frame[cam].faults & SST_FRAME_PARTS)) {
        *data = read;
        return 0;
    }
    parts = (struct sst_jpeg_bytes){ read, *bytes };
    err = sst_jpeg_parts_base(parts, &base_ns) ? read_base(r, base_ns, cam, &whole, &base.bytes) : -EBADMSG;
    if (!err) {
        base.data = whole;
        err = sst_jpeg_parts_join(&(struct sst_jpeg_pair){ base, parts, info->width, info->height }, data, bytes);
        err = err == -EINVAL ? -EBADMSG : err;
    }
    free(read);
    free(whole);
    return err;
}

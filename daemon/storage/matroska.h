/* daemon/storage/matroska.h - the plan of a Matroska file with one track, of frames that lie in other files. */
#ifndef SST_DAEMON_STORAGE_MATROSKA_H
#define SST_DAEMON_STORAGE_MATROSKA_H

#include "daemon/storage/spans.h"

#define SST_MATROSKA_TRACK_MAX 4096 /* bytes of a track's description */

struct sst_matroska_frame {
    int64_t t_ns;   /* any clock; not before the frame's before it */
    int64_t offset; /* first byte in its file */
    uint32_t bytes;
    int file; /* of the plan */
};

struct sst_matroska_track {
    int number;                            /* 1 .. 16382 */
    uint8_t entry[SST_MATROSKA_TRACK_MAX]; /* the element TrackEntry, whole, of this number */
    size_t bytes;
};

/** Describe a track of JPEG pictures. @param name  for people */
void sst_matroska_jpeg_track(struct sst_matroska_track *out, int width, int height, const char *name);

/**
 * Copy the description of a track out of the first bytes of a Matroska file.
 * @return 0, -ENOENT (no such track), -EBADMSG (no Matroska, torn, or a description that is too long); not logged
 */
SST_MUST_CHECK int sst_matroska_find_track(const uint8_t *data, size_t n, int number, struct sst_matroska_track *out);

/**
 * Plan the file: head with duration and an index to seek by, then the frames, a cluster a second. The same arguments
 * give the same bytes.
 *
 * @param to       their files were added before
 * @param wall_ns  of the first frame
 * @return 0, -ENODATA (count is 0), -ENOMEM
 */
SST_MUST_CHECK int sst_matroska_plan(struct sst_spans *to, const struct sst_matroska_track *track, const char *title,
                                     int64_t wall_ns, const struct sst_matroska_frame *frame, size_t count);

#endif

/* daemon/storage/video.h - a recording as a file that plays: one camera, or the see-through view. */
#ifndef SST_DAEMON_STORAGE_VIDEO_H
#define SST_DAEMON_STORAGE_VIDEO_H

#include "daemon/storage/spans.h"

/* The see-through view of a recording: pictures one after the other, and a line of JSON for each. */
#define SST_VIDEO_PICTURES "view.mjpeg"
#define SST_VIDEO_INDEX    "view.jsonl"
#define SST_VIDEO_LINE_MAX 256

/** A picture of the view, as its line says. */
struct sst_video_line {
    int64_t t_ns, wall_ns; /* of its set */
    uint64_t set;          /* index of the trigger */
    int64_t offset;        /* in SST_VIDEO_PICTURES */
    int64_t bytes;
};

/** Write a line with its end. @return its bytes */
size_t sst_video_write_line(char out[SST_VIDEO_LINE_MAX], const struct sst_video_line *line);
/** @return false: it is none, or torn */
bool sst_video_read_line(const char *text, struct sst_video_line *line);

/**
 * Plan the video of a camera: every frame that its recording holds of it, bytes untouched. A recording that is being
 * written gives what it holds by now.
 *
 * @param to   zeroed by the caller; its paths are below dir
 * @param dir  of the recording
 * @return 0, -ENOENT (no such camera, or no recording), -ENODATA (no frame of it), -EBADMSG, -EIO, -ENOMEM; logged by
 *         what reads recordings. Waits for the disk.
 */
SST_MUST_CHECK int sst_video_plan_camera(struct sst_spans *to, const char *dir, int row, int col);

/** Likewise the see-through view. @return as above; -ENOENT: none was recorded */
SST_MUST_CHECK int sst_video_plan_view(struct sst_spans *to, const char *dir);

#endif

/* capture/recording/setlist.h - recording.json and the lines of sets.jsonl. Inside capture/recording only.
 *
 * A line is one JSON object; its last member is the CRC-32 of all bytes of the line before that member. Two kinds:
 *   {"segment":N,"session":S,"start_ns":T,"wall_ns":W,"crc":"xxxxxxxx"}   the sets below are in segments/N.mkv
 *   {"set":index,"t_ns":...,"frames":[[cam,...],...],"missing":[...],"crc":"xxxxxxxx"} */
#ifndef SST_CAPTURE_RECORDING_SETLIST_H
#define SST_CAPTURE_RECORDING_SETLIST_H

#include "base/file.h"
#include "capture/recording/recording.h"

#define SST_RECORDING_VERSION 1
#define SST_SETLIST_COLUMNS 10
#define SST_SETLIST_LINE_MAX (1024 + SST_CAMERAS_MAX * 192) /* bytes of a line with its end */

/** segments/NNNNNN.mkv in dir; number 0..999999. */
SST_MUST_CHECK int sst_segment_path(char out[SST_PATH_MAX], const char *dir, int number);

/** The columns of a line's frames, in their order. */
extern const char *const sst_setlist_columns[SST_SETLIST_COLUMNS];

/** Write recording.json, whole or not at all. @return 0 or an error of the output; logged. */
SST_MUST_CHECK int sst_setlist_write_info(const char *path, const struct sst_recorder_config *cfg);

/** Read it strictly. @return 0, -ENOENT, -EBADMSG, -EIO, -ENOMEM; logged. */
SST_MUST_CHECK int sst_setlist_read_info(const char *path, struct sst_recording_info *info);

/** Write a line with its '\n' into out [SST_SETLIST_LINE_MAX]. @return its bytes. */
size_t sst_setlist_segment_line(char *out, int segment, int session, int64_t start_ns, int64_t wall_ns);
size_t sst_setlist_set_line(char *out, const struct sst_set *set, const int64_t *offset, const uint32_t *crc32);

/** Does the line (without '\n') end in its own checksum? */
bool sst_setlist_line_whole(const char *line, size_t n);

struct sst_setlist_segment {
    int segment, session;
    int64_t start_ns, wall_ns; /* of its beginning */
};

/**
 * Read a line that is whole.
 * @param segment  out, of a segment's line
 * @param set      out, of a set's line, its segment and session excepted; NULL: only the kind is asked for
 * @return 0: it is a segment's line, 1: a set's; -EBADMSG, -ENOMEM. Not logged.
 */
SST_MUST_CHECK int sst_setlist_parse(const char *line, size_t n, int cameras, struct sst_setlist_segment *segment,
                                      struct sst_recording_set *set);

/**
 * Read one camera's frame from a set's line that is whole and was written here, without reading all others.
 * @param wall_ns  out, of the set; frame: out, arrival_ns 0; not present: the set has none of the camera
 * @return 0, -EBADMSG: of another form, perhaps sst_setlist_parse() reads it
 */
SST_MUST_CHECK int sst_setlist_parse_frame(const char *line, int cam, int64_t *wall_ns,
                                           struct sst_recording_frame *frame);

#endif

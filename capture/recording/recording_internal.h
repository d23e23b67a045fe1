/* capture/recording/recording_internal.h - private declarations of this folder; code outside of it includes the
 * public headers. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_RECORDING_RECORDING_INTERNAL_H
#define SST_CAPTURE_RECORDING_RECORDING_INTERNAL_H

#include <jansson.h>

#include "base/file.h"
#include "capture/recording/recorder.h"
#include "capture/recording/recording.h"

/* --- resume: prepare a recording for further sets. --- */

struct resume_point {
    int64_t manifest_bytes; /* where the next line goes */
    int segment, session;   /* the next ones */
};

/**
 * Remove half-written output of a killed recorder or a power cut: sets at the end with incomplete bytes, torn lines,
 * segments that no line names. Earlier sets stay as they are.
 *
 * @param manifest_fd  of sets.jsonl, writable; the recording is locked
 * @return 0, -EEXIST (made with another array, format or size), -EBADMSG, -EIO, -ENOSPC (no number left), -ENOMEM.
 *         Logged.
 */
SST_MUST_CHECK int resume_prepare(struct resume_point *out, const struct sst_recorder_config *cfg, int manifest_fd);

/* --- manifest ---
 * recording.json and the lines of sets.jsonl.
 *
 * A line is one JSON object; its last member is the CRC-32 of all bytes of the line before that member. Two kinds:
 *   {"segment":N,"session":S,"start_ns":T,"wall_ns":W,"crc":"xxxxxxxx"}   the sets below are in segments/N.mkv
 *   {"set":index,"t_ns":...,"frames":[[cam,...],...],"missing":[...],"crc":"xxxxxxxx"} */

#define SST_RECORDING_VERSION 1
#define MANIFEST_COLUMNS      10
#define MANIFEST_LINE_MAX     (1024 + SST_CAMERAS_MAX * 192) /* bytes of a line with its end */

#define SEGMENT_NUMBER_MAX 999999 /* six digits */

/** segments/NNNNNN.mkv in dir; number 0..SEGMENT_NUMBER_MAX. */
SST_MUST_CHECK int segment_path(char out[SST_PATH_MAX], const char *dir, int number);

/** The columns of a line's frames, in their order. */
extern const char *const manifest_columns[MANIFEST_COLUMNS];

/** Write an object as a file, whole or not at all. @return 0, -ENOMEM, or an error of the output; logged. */
SST_MUST_CHECK int manifest_write_json(const char *path, const json_t *root);

/** Write recording.json, whole or not at all. @return 0 or an error of the output; logged. */
SST_MUST_CHECK int manifest_write_info(const char *path, const struct sst_recorder_config *cfg);

/** Read it strictly. @return 0, -ENOENT, -EBADMSG, -EIO, -ENOMEM; logged. */
SST_MUST_CHECK int manifest_read_info(const char *path, struct sst_recording_info *info);

/** Write a line with its '\n' into out [MANIFEST_LINE_MAX]. @return its bytes. */
size_t manifest_segment_line(char *out, int segment, int session, int64_t start_ns, int64_t wall_ns);
size_t manifest_set_line(char *out, const struct sst_frameset *set, const int64_t *offset, const uint32_t *crc32);

/** Does the line (without '\n') end in its own checksum? */
bool manifest_line_whole(const char *line, size_t n);

struct manifest_segment {
    int segment, session;
    int64_t start_ns, wall_ns; /* of its beginning */
};

/**
 * Read a line that is whole.
 * @param segment  out, of a segment's line
 * @param set      out, of a set's line, its segment and session excepted; NULL: only determine the kind
 * @return 0: it is a segment's line, 1: a set's; -EBADMSG, -ENOMEM. Not logged.
 */
SST_MUST_CHECK int manifest_parse(const char *line, size_t n, int cameras, struct manifest_segment *segment,
                                  struct sst_recording_set *set);

/**
 * Read one camera's frame from a set's line that is whole and was written here, without reading all others.
 * @param wall_ns  out, of the set; frame: out, arrival_ns 0; not present: the set has none of the camera
 * @return 0, -EBADMSG: of another form; manifest_parse() may read it
 */
SST_MUST_CHECK int manifest_parse_frame(const char *line, int cam, int64_t *wall_ns, struct sst_recording_frame *frame);

/* --- index: offsets of the lines of a recording. --- */

struct index_line {
    int64_t at;     /* first byte in sets.jsonl */
    uint32_t bytes; /* without the line's end */
    int segment, session;
    bool damaged; /* its checksum is wrong: nothing is known of the set */
};

/* Fixed after open. */
struct recording_join; /* private to join.c */

struct sst_recording {
    struct recording_join *join; /* of several recordings, and no file of its own; else NULL */
    char *dir;
    int fd; /* of sets.jsonl */
    struct sst_recording_info info;
    struct sst_recording_removed removed;
    struct index_line *line; /* [count], one a set */
    int count, capacity;
    int segment, session; /* of the last segment's line; -1 and 0: none */
    int64_t good_bytes;   /* behind the last line that is whole */
    int64_t size;         /* read so far */
};

/* --- join --- */

#define RECORDING_PARTS_MAX 16

void join_close(struct recording_join *join);
SST_MUST_CHECK int join_set(const struct sst_recording *r, int i, struct sst_recording_set *set);
SST_MUST_CHECK int join_frame(const struct sst_recording *r, const struct sst_recording_set *set, int cam, uint8_t **data);
SST_MUST_CHECK int join_line(const struct sst_recording *r, int i, char **text);

/* --- ebml: heads of Matroska elements, as far as finding frames and ends of files needs them. --- */

#define SST_EBML_HEAD         0x1A45DFA3u
#define SST_EBML_SEGMENT      0x18538067u
#define SST_EBML_CLUSTER      0x1F43B675u
#define SST_EBML_BLOCK_GROUP  0xA0u
#define SST_EBML_BLOCK        0xA1u
#define SST_EBML_SIMPLE_BLOCK 0xA3u

#define SST_EBML_UNKNOWN  UINT64_MAX /* size of an element that was not finished */
#define SST_EBML_HEAD_MAX 12         /* bytes of an id and a size at most */

struct ebml {
    uint32_t id;
    uint64_t size; /* of the data behind the head, or SST_EBML_UNKNOWN */
    size_t head;   /* bytes */
};

/** Read a number of 1 to 8 bytes. @param value  without the length's marker. All ones is a value here: libavformat
 * writes track 127 so. @return its bytes, 0 when data ends before it or it is none. */
size_t ebml_number(const uint8_t *data, size_t n, uint64_t *value);

/** Read an element's head. @return 0 or -EBADMSG (not logged). */
SST_MUST_CHECK int ebml_head(const uint8_t *data, size_t n, struct ebml *out);

/* --- segment: writes one Matroska file of a recording. --- */

struct segment_file { /* one thread at a time */
    char *path;
    int fd, cameras;
    int64_t start_ns;
    int64_t pos, end; /* of the next write; end of the added data */
    int64_t kept;     /* end of the data that stays, also if the segment is abandoned: set by the caller */
    int64_t last_ms[SST_CAMERAS_MAX];
    int error; /* of the first failed write, negative; nothing is written after it */
    struct AVFormatContext *format;
    struct AVPacket *packet;
};

#define STAMP_SLACK_NS 1000000000 /* a stamp farther from its set's is wrong and must not move others */

/** Largest frame, bytes: fits one block. */
#define SST_SEGMENT_FRAME_MAX ((size_t)1 << 30)

/** @return 0, or -ENOTSUP, logged: FFmpeg's libraries are missing, here or in the build */
SST_MUST_CHECK int segment_possible(void);

/**
 * Create the file and write its head.
 *
 * @param path      must not exist
 * @param start_ns  time stamp 0 of the file
 * @return 0, -errno of the system, -ENOTSUP (built without libavformat), -EINVAL (libavformat refuses the tracks;
 *         logged). Other errors are not logged; nothing is left of the file.
 */
SST_MUST_CHECK int segment_open(struct segment_file **out, const char *path, const struct sst_recorder_config *cfg,
                                int64_t start_ns);

/**
 * Append the set's frames; all bytes are with the kernel afterwards. Empty frames are left out.
 *
 * Time stamps in the file are whole milliseconds, never backwards, at most 1 s from the set's.
 * @param offset  out, of each present frame's first byte in the file; -1 of others
 * @return 0 or -errno (not logged); after an error only segment_abandon() may follow.
 */
SST_MUST_CHECK int segment_add(struct segment_file *segment, const struct sst_frameset *set,
                               int64_t offset[SST_CAMERAS_MAX]);

/** Write cues, duration and size, and free. @param sync  make it durable as well
 *  @return 0 or -errno (not logged): the file is then truncated after the last set and readable. */
SST_MUST_CHECK int segment_finish(struct segment_file *segment, bool sync);

/** Truncate the file after the last set that was kept (remove it if there is none), and free. NULL is fine. */
void segment_abandon(struct segment_file *segment);

/* Shared with mkv.c; types of libavformat. */
struct AVCodecParameters;
struct AVFormatContext;
struct AVDictionary;

/** Describe frames of a V4L2 format as libavcodec does. */
void segment_set_codec(struct AVCodecParameters *par, uint32_t fourcc, int width, int height);
/** Write the head of a file, with bytes that depend on its frames alone. @param options  of the muxer, added to
 *  @return 0 or more, or an AVERROR */
SST_MUST_CHECK int segment_write_head(struct AVFormatContext *format, struct AVDictionary **options);

/* --- sync: a thread that makes files durable at intervals. --- */

/** Make the names in a folder durable. @return 0 or -errno, not logged. */
SST_MUST_CHECK int sync_folder(const char *folder);

struct sync; /* opaque */

/** Start the thread. @param folder  of the segments: synced when a new one is watched. @return 0, -ENOMEM, -errno. */
SST_MUST_CHECK int sync_start(struct sync **out, const char *folder, double every_s);

/**
 * Set the two files that are written from now on: the segment is synced first, then the manifest. The previous pair is
 * synced once more. The descriptors stay the caller's (they are duplicated).
 * @return 0, -errno, -EAGAIN (the disk is so far behind that no more pairs can wait)
 */
SST_MUST_CHECK int sync_watch(struct sync *sync, int segment_fd, int manifest_fd);

/** Is there room for another pair? */
bool sync_has_room(struct sync *sync);

/** The error of a sync since the last call, 0: none. Logged by the thread, once per change of state. */
int sync_fetch_error(struct sync *sync);

/** Sync once more, end the thread, free. @return 0 or that sync's error. NULL is fine. */
int sync_stop(struct sync *sync);

#endif

/* capture/recording/recording.h - reader of a recording: its sets, its frames' bytes, and their damage. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_RECORDING_RECORDING_H
#define SST_CAPTURE_RECORDING_RECORDING_H

#include "capture/recording/recorder.h"
#include "capture/recording/trim.h"

struct sst_recording; /* opaque; after open any number of threads may read */

/** recording.json: properties of all sets. */
struct sst_recording_info {
    int rows, cols, cameras;
    uint32_t fourcc;
    int width, height;
    double rate_hz, spacing_mm; /* 0 unknown */
    struct sst_recorder_track track[SST_CAMERAS_MAX];
};

struct sst_recording_frame {
    bool present;
    uint32_t sequence, lost_before;
    int64_t t_ns, arrival_ns; /* CLOCK_MONOTONIC of the recording machine */
    int64_t offset;           /* first byte in the segment's file; -1: empty frame */
    size_t bytes, stride;     /* stride 0: compressed */
    unsigned faults;          /* sst_frame_fault */
    uint32_t crc32;
};

/** Faults that concern a frame's bytes; a stamp that went backwards does not. */
#define SST_RECORDING_BAD_PICTURE (SST_FRAME_BAD & ~(unsigned)SST_FRAME_BACKWARDS)

struct sst_recording_set {
    uint64_t index; /* of the trigger; restarts with each run of the recorder */
    int64_t t_ns, wall_ns;
    bool edge;
    int segment, session; /* session: number of the run of the recorder */
    int present;
    struct sst_skew skew;
    int joined; /* number in a joined recording */
    struct sst_recording_frame frame[SST_CAMERAS_MAX];
};

/**
 * Read recording.json and index sets.jsonl; the lines of sets are read again on access. Skips a torn end (a recorder
 * was killed, or is writing) and sets that were trimmed (trim.h); if removed.json is damaged, all sets of segments
 * before the first present one count as trimmed.
 *
 * @return 0, -ENOENT (no recording), -EBADMSG, -EIO, -EACCES, -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_recording_open(struct sst_recording **out, const char *dir);

/**
 * Open recordings that several hosts made of one array as one recording: a set has the frames of all hosts that have
 * its trigger. Its index is the trigger's, its times are the first such host's. Only info, sets, set, line and frame
 * (below) apply to it.
 * @param dirs  [count], of equal grid, size, format and rate, without common cameras @return also -EINVAL (count)
 */
SST_MUST_CHECK int sst_recording_open_joined(struct sst_recording **out, const char *const *dirs, int count);

void sst_recording_close(struct sst_recording *recording); /* NULL is fine */

const struct sst_recording_info *sst_recording_info(const struct sst_recording *recording);
const char *sst_recording_dir(const struct sst_recording *recording);

/** Number of sets, in the order of recording: 0 .. n-1. */
int sst_recording_sets(const struct sst_recording *recording);

/** Part trimmed from its beginning. */
const struct sst_recording_removed *sst_recording_removed(const struct sst_recording *recording);

/** Bytes after the last whole line of the manifest. */
int64_t sst_recording_torn_bytes(const struct sst_recording *recording);

/** Segments that sets.jsonl does not name: one that was being written, or more where lines are lost.
 *  @param bytes  out, their sum */
int sst_recording_unlisted(const struct sst_recording *recording, int64_t *bytes);

/** Bytes of a segment; -1: it is missing, or lines were added to sets.jsonl since it was opened. */
int64_t sst_recording_segment_size(const struct sst_recording *recording, int segment);

/** Read set i from the manifest. @return 0, -EBADMSG (its line is damaged), -EIO, -ENOMEM. Not logged. */
SST_MUST_CHECK int sst_recording_set(const struct sst_recording *recording, int i, struct sst_recording_set *set);

/** One camera's frame of a set. */
struct sst_recording_one {
    int segment;                      /* of the set */
    int64_t wall_ns;                  /* of the set */
    struct sst_recording_frame frame; /* without its arrival_ns */
};

/**
 * Read one camera's frame of set i from the manifest; faster than sst_recording_set() for one camera in many sets.
 * @return 0, -EBADMSG (its line is damaged), -EIO, -ENOMEM. Not logged.
 */
SST_MUST_CHECK int sst_recording_frame_of(const struct sst_recording *recording, int i, int cam,
                                          struct sst_recording_one *out);

/** The set nearest to a moment, by the wall clock, which may have been stepped. @param within_ns  farther ones do not
 * count
 *  @param i  out @return 0, -ENOENT, -ENOMEM. Not logged. */
SST_MUST_CHECK int sst_recording_near(const struct sst_recording *recording, int64_t wall_ns, int64_t within_ns,
                                      int *i);

/** The line of set i, unchanged, without its newline. *text to free with free(). @return as
 *  sst_recording_near() */
SST_MUST_CHECK int sst_recording_line(const struct sst_recording *recording, int i, char **text);

/**
 * The bytes of camera cam's frame in a set, as they were recorded, checked against their checksum.
 *
 * @param data  out, to free with free(); frame[cam].bytes bytes
 * @return 0, -ENODATA (the frame is missing or empty), -EBADMSG (damaged: the bytes differ or are not there), -EIO,
 *         -ENOMEM. Not logged.
 */
SST_MUST_CHECK int sst_recording_frame(const struct sst_recording *recording, const struct sst_recording_set *set,
                                       int cam, uint8_t **data);

/**
 * The same as a whole picture: of a frame of which only parts were recorded (SST_FRAME_PARTS), joined with the frame
 * that they belong to.
 *
 * @param bytes  out, of it
 * @return as sst_recording_frame(), -ENODATA also if that frame is not there any more. Not logged.
 */
SST_MUST_CHECK int sst_recording_picture(const struct sst_recording *recording, const struct sst_recording_set *set,
                                         int cam, uint8_t **data, size_t *bytes);

/** Whether the segment is long enough for all frames of a set; reads none. @param cam  out, first camera with a
 *  missing frame; -1: none @return 0, -EBADMSG, -EIO. Not logged. */
SST_MUST_CHECK int sst_recording_check_size(const struct sst_recording *recording, const struct sst_recording_set *set,
                                            int *cam);

/** Read and verify all of set i. @param cam  out, first camera with a damaged frame; -1: the line is damaged.
 *  @return 0 or the error. */
SST_MUST_CHECK int sst_recording_check(const struct sst_recording *recording, int i, int *cam);

#endif

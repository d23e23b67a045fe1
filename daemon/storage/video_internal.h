/* daemon/storage/video_internal.h - downloads: a folder as a tar archive, a camera or the view of a recording as a video. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_STORAGE_VIDEO_INTERNAL_H
#define SST_DAEMON_STORAGE_VIDEO_INTERNAL_H

#include <sys/types.h>

#include "base/base.h"
#include "base/file.h"
#include "capture/recording/mkv.h"

/* --- tar ---
 * a folder as a virtual tar archive: headers in memory, contents read from the files themselves, so that it needs no
 * disk space and is ready at once. */

#define TAR_BLOCK 512

struct tar_entry {
    uint8_t header[TAR_BLOCK];
    int64_t at;   /* of the header in the archive */
    int64_t size; /* of the file; 0: a folder */
    char *path;   /* below the folder */
};

/** One thread at a time. */
struct tar {
    struct tar_entry *entry;
    int count, capacity;
    int64_t bytes;        /* of the archive */
    uint64_t tag;         /* differs for other content */
    int folder, file, fd; /* fd: of entry `file`; -1: none is open */
};

/**
 * List the archive (POSIX ustar) of a folder's regular files and folders as they are now, sorted by name; links and
 * devices are left out.
 *
 * @param dir  its last part is the archive's name of the folder; NAME/views/00_00.jpg of all files must fit 100 bytes
 * @return 0, -ENAMETOOLONG, -ENOMEM or -errno of reading; not logged. tar_close() follows in any case.
 */
SST_MUST_CHECK int tar_open(struct tar *out, const char *dir);

/** Read from any position before the end. @return bytes, at least one, or -errno; -EBADMSG: a file is shorter now */
SST_MUST_CHECK ssize_t tar_read(struct tar *t, int64_t at, void *out, size_t n);

void tar_close(struct tar *t);

/** Open a file below a folder for reading, without following links or waiting for an entry that is no file.
 *  @return descriptor or -errno */
SST_MUST_CHECK int open_below(int folder, const char *path);

/** FNV-1a over some more bytes; *tag begins at 0. */
void add_to_tag(uint64_t *tag, const void *data, size_t n);

/* --- video: exports one camera of a recording, or the see-through view, as a playable file. --- */

/* The see-through view of a recording: pictures one after the other, and a line of JSON for each. */
#define SST_VIDEO_PICTURES "view.mjpeg"
#define SST_VIDEO_INDEX    "view.jsonl"
#define SST_VIDEO_LINE_MAX 256

/** A line of the index: a picture of the view. */
struct video_line {
    int64_t t_ns, wall_ns; /* of its set */
    uint64_t set;          /* index of the trigger */
    int64_t offset;        /* in SST_VIDEO_PICTURES */
    int64_t bytes;
};

/** Write a line with its end. @return its bytes */
size_t video_write_line(char out[SST_VIDEO_LINE_MAX], const struct video_line *line);
/** @return false: not such a line, or torn */
bool video_read_line(const char *text, struct video_line *line);

/** Frames of a video, and their description. Zeroed: none. */
struct video {
    char dir[SST_PATH_MAX], title[128], track[96];
    struct sst_mkv_config format;
    struct sst_mkv_frame *frame;
    size_t count, capacity;
    int64_t bytes; /* of all frames */
};

/**
 * List the frames that a recording has of a camera; one that is being written gives its frames by now.
 *
 * @param dir  of the recording
 * @return 0, -ENOENT (no such camera, or no recording), -ENODATA (no frame of it), -EBADMSG, -EIO, -ENOMEM; the reader of
 *         recordings logs. video_fini() follows in any case. Waits for the disk.
 */
SST_MUST_CHECK int video_of_camera(struct video *v, const char *dir, int row, int col);

/** Wall time of the view's first picture; 0: it cannot be read. */
int64_t video_view_from(const char *dir);
/** List the frames of the see-through view. @return as of video_of_camera(); -ENOENT: none was recorded */
SST_MUST_CHECK int video_of_view(struct video *v, const char *dir);

/** @return true: the file is no longer wanted */
typedef bool video_ended_fn(void *arg);

/** Write the file, bytes of frames untouched. @param fd  as of sst_mkv_write() @return as sst_mkv_write(), -ECANCELED,
 *  -EAGAIN (something of it was removed meanwhile) or -errno of reading; not logged */
SST_MUST_CHECK int video_write(struct video *v, int fd, video_ended_fn *ended, void *arg);

void video_fini(struct video *v);

#endif

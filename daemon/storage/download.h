/* daemon/storage/download.h - a recording, snapshot or export opened for download, read by position. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_STORAGE_DOWNLOAD_H
#define SST_DAEMON_STORAGE_DOWNLOAD_H

#include <sys/types.h>

#include "base/base.h"

#define SST_DOWNLOADS_MAX 16 /* at a time; a page of thumbnails needs six */

/** One thread at a time. */
struct sst_download {
    int64_t bytes;    /* total size */
    char tag[24];     /* [0-9a-f], differs for other content; "": still growing, ranges must not be combined */
    const char *type; /* MIME type, static */
    /** Read up to n bytes from any position before the end; waits for the disk. @return bytes, at least one, or -errno:
     *  the rest was removed or cannot be read */
    ssize_t (*read)(struct sst_download *d, int64_t at, void *out, size_t n);
    void (*close)(struct sst_download *d); /* and free */
};

#endif

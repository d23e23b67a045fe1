/* daemon/slot/download.h - how something that is kept reaches who downloads it: over a pair of sockets, so that who
 * waits for the disk and who waits for the network hold up nobody but each other.
 *
 * Storage first gives a struct sst_download_info, when it knows it; without an error it is then told one
 * struct sst_download_part, and gives exactly those bytes. An end before that: the rest cannot be read. Closing the
 * socket at any time ends the download. */
#ifndef SST_DAEMON_SLOT_DOWNLOAD_H
#define SST_DAEMON_SLOT_DOWNLOAD_H

#include "base/base.h"

#define SST_DOWNLOADS_MAX 16 /* at a time; a page of thumbnails takes six */

struct sst_download_info {
    int err;       /* 0, -ENOENT (gone), -ENODATA (nothing of it was recorded), or what reading it met */
    int64_t bytes; /* of the whole */
    char tag[24];  /* [0-9a-f]: other content has another one; "": it still grows, parts of it do not fit together */
};

struct sst_download_part {
    int64_t first, bytes; /* first + bytes is at most info.bytes */
};

#endif

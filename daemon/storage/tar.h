/* daemon/storage/tar.h - a folder as a tar archive. */
#ifndef SST_DAEMON_STORAGE_TAR_H
#define SST_DAEMON_STORAGE_TAR_H

#include "daemon/storage/spans.h"

/**
 * Plan the archive (POSIX ustar) of a folder's regular files and folders as they are now, in the order of their names;
 * links and devices are left out.
 *
 * @param to    zeroed by the caller; its paths are below the folder
 * @param fd    of the folder, stays the caller's
 * @param name  that it has in the archive, without '/'; NAME/views/00_00.jpg of all files must fit 100 bytes
 * @return 0, -ENAMETOOLONG, -ENOMEM or -errno of reading; not logged.
 */
SST_MUST_CHECK int sst_tar_plan(struct sst_spans *to, int fd, const char *name);

#endif

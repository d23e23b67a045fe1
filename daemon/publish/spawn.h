/* daemon/publish/spawn.h - programs that the service starts. */
#ifndef SST_DAEMON_PUBLISH_SPAWN_H
#define SST_DAEMON_PUBLISH_SPAWN_H

#include <sys/types.h>

#include "base/base.h"

/**
 * Start a program as a process group of its own, so that Ctrl-C on a terminal is for the service alone, with signals as
 * usual.
 *
 * @param fd   [fds]; what becomes descriptor 0, 1 ...: one that is not below its place, or 2, standard error; -1:
 *             /dev/null to read. All others are closed
 * @param env  environ, or another one
 * @return 0, or a negative errno, also of what keeps the program itself from being run. Thread: any
 */
SST_MUST_CHECK int sst_spawn(pid_t *pid, const char *program, char *const argv[], char *const env[], const int *fd,
                             int fds);

#endif

/* daemon/publish/rtsp_parts.h - parts of the RTSP server on the service's side: its settings, its socket, its process.
 */
#ifndef SST_DAEMON_PUBLISH_RTSP_PARTS_H
#define SST_DAEMON_PUBLISH_RTSP_PARTS_H

#include <sys/types.h>

#include "daemon/publish/rtsp.h"
#include "daemon/publish/rtsp_link.h"

/** Check the settings and read the password. @return 0, -EINVAL, -ENOENT, -EACCES, -EBADMSG; logged */
SST_MUST_CHECK int rtsp_check(struct rtsp_login *out, const struct sst_rtsp_config *cfg);

/** A socket that listens where the settings, checked, say. @param port  out @return descriptor, or -errno; logged */
SST_MUST_CHECK int rtsp_listen(const char *address, int port, bool quiet, int *bound);

/** Start the process. @param link  out, the service's end @return 0, -errno */
SST_MUST_CHECK int rtsp_spawn(pid_t *pid, int *link, int listener);

/** Kill the process, wait for it, and say how it ended, as the end of a sentence. Takes about half a second at most.
 *  @return false: it has not ended yet, and is to be reaped */
SST_MUST_CHECK bool rtsp_kill(pid_t pid, char *how, size_t room);
/** Clear away a process that was killed. @return false: it has still not ended */
SST_MUST_CHECK bool rtsp_reap(pid_t pid);

#endif

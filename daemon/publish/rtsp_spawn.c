#define _GNU_SOURCE /* environ */

/* The process that serves clients: begun, and ended. */
#include "daemon/publish/rtsp_parts.h"

#if WITH_RTSP

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "daemon/publish/spawn.h"

#define KILL_NS 500000000LL /* the disk may hold a process that dumps core */

int sst_rtsp_spawn(pid_t *pid, int *link, int listener)
{
    static char word[] = SST_RTSP_PROCESS, name[] = "sstd";
    char *const argv[] = { name, word, NULL };
    int pair[2], err;

    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair))
        return -errno;
    err = sst_rtsp_link_init(pair[0]);
    if (!err)
        err = sst_spawn(pid, "/proc/self/exe", argv, environ,
                        (const int[]){ [SST_RTSP_LINK_FD] = pair[1], 2, 2, [SST_RTSP_LISTEN_FD] = listener },
                        SST_RTSP_LISTEN_FD + 1);
    close(pair[1]);
    if (err)
        close(pair[0]);
    else
        *link = pair[0];
    return err;
}

void sst_rtsp_kill(pid_t pid, char *how, size_t room)
{
    const struct timespec moment = { .tv_nsec = 2000000 };
    const int64_t start_ns = sst_clock_now_ns();
    int status = 0;
    pid_t got;

    kill(pid, SIGKILL); /* ended already: this does nothing */
    while (((got = waitpid(pid, &status, WNOHANG)) == 0 || (got < 0 && errno == EINTR)) &&
           sst_clock_now_ns() - start_ns < KILL_NS)
        nanosleep(&moment, NULL);
    if (got != pid)
        snprintf(how, room, "does not end");
    else if (WIFSIGNALED(status))
        snprintf(how, room, "ended by signal %d (%s)", WTERMSIG(status), strsignal(WTERMSIG(status)));
    else
        snprintf(how, room, "ended with status %d", WEXITSTATUS(status));
}

#endif

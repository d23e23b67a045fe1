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

#include "daemon/publish/publish_internal.h"

/* Two milliseconds apart: the disk may hold a process that dumps core. Counted: a machine that stood still ends no
 * wait. */
#define KILL_LOOKS 250

int rtsp_spawn(pid_t *pid, int *link, int listener)
{
    static char word[] = SST_RTSP_PROCESS, name[] = "sstd";
    char *const argv[] = { name, word, NULL };
    int pair[2], err;

    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair))
        return -errno;
    err = rtsp_link_init(pair[0]);
    if (!err)
        err = spawn_program(pid, "/proc/self/exe", argv, environ,
                            (const int[]){ [SST_RTSP_LINK_FD] = pair[1], 2, 2, [SST_RTSP_LISTEN_FD] = listener },
                            SST_RTSP_LISTEN_FD + 1);
    close(pair[1]);
    if (err)
        close(pair[0]);
    else
        *link = pair[0];
    return err;
}

bool rtsp_kill(pid_t pid, char *how, size_t room)
{
    const struct timespec moment = { .tv_nsec = 2000000 };
    int status = 0, looks = 0;
    pid_t got;

    kill(pid, SIGKILL); /* ended already: this does nothing */
    while (((got = waitpid(pid, &status, WNOHANG)) == 0 || (got < 0 && errno == EINTR)) && looks++ < KILL_LOOKS)
        nanosleep(&moment, NULL);
    if (got != pid)
        snprintf(how, room, "does not end");
    else if (WIFSIGNALED(status))
        snprintf(how, room, "ended by signal %d (%s)", WTERMSIG(status), strsignal(WTERMSIG(status)));
    else
        snprintf(how, room, "ended with status %d", WEXITSTATUS(status));
    return got != 0;
}

bool rtsp_reap(pid_t pid)
{
    return waitpid(pid, NULL, WNOHANG) != 0;
}

#endif

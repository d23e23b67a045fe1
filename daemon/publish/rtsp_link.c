#include "daemon/publish/rtsp_link.h"

#include <errno.h>
#include <poll.h>
#include <stdbool.h>
#include <sys/socket.h>
#include <sys/time.h>

#if WITH_RTSP

#define SLICE_US 100000
#define HUNG     30 /* slices in a row in which nothing moved; counted: a machine that stood still hangs nobody */

int rtsp_link_init(int fd)
{
    const struct timeval slice = { .tv_usec = SLICE_US };

    return setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &slice, sizeof(slice)) ||
                   setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &slice, sizeof(slice))
               ? -errno
               : 0;
}

/* @return bytes moved, 0: none in this slice of time, -errno */
static ssize_t move(int fd, void *data, size_t bytes, bool out)
{
    const ssize_t n = out ? send(fd, data, bytes, MSG_NOSIGNAL) : recv(fd, data, bytes, 0);

    if (n < 0)
        return errno == EINTR || errno == EAGAIN ? 0 : -errno;
    return n ? n : -EPIPE;
}

static int move_all(int fd, void *data, size_t bytes, bool out, int stop)
{
    struct pollfd wish = { .fd = stop, .events = POLLIN };
    int idle = 0;

    for (size_t done = 0; done < bytes;) {
        const ssize_t n = move(fd, (uint8_t *)data + done, bytes - done, out);

        if (n < 0)
            return (int)n;
        if (n > 0)
            idle = 0;
        else if (stop >= 0 && poll(&wish, 1, 0) > 0)
            return -ECANCELED;
        else if (++idle > HUNG)
            return -ETIMEDOUT;
        done += (size_t)n;
    }
    return 0;
}

int rtsp_link_send(int fd, const struct rtsp_message *message, const void *data, int stop)
{
    const int err = move_all(fd, (void *)(uintptr_t)message, sizeof(*message), true, stop);

    return err || !message->bytes ? err : move_all(fd, (void *)(uintptr_t)data, message->bytes, true, stop);
}

int rtsp_link_read(int fd, void *out, size_t bytes, int stop)
{
    return move_all(fd, out, bytes, false, stop);
}

#endif

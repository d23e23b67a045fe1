/* The listening socket, and the password file. */
#include "publishers/rtsp/rtsp_internal.h"

#include <errno.h>

#include "base/file.h"
#include "base/log.h"

#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#define BACKLOG           32
#define PASSWORD_FILE_MAX 4096

static int resolve(struct addrinfo **out, const char *address, int port)
{
    const struct addrinfo hints = { .ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE,
                                    .ai_socktype = SOCK_STREAM };
    char service[16];

    snprintf(service, sizeof(service), "%d", port);
    return port < 0 || port > 65535 || getaddrinfo(address, service, &hints, out) ? -EINVAL : 0;
}

static int read_password(const char *path, char out[RTSP_PASSWORD])
{
    struct stat st;
    uint8_t *data;
    size_t size, n;
    int err = sst_file_read_text(path, PASSWORD_FILE_MAX, &data, &size);

    if (err == -EACCES)
        sst_log_error("rtsp.password_file %s cannot be read by this user; chgrp sst-rtsp %s && chmod 640 %s", path,
                      path, path);
    if (err)
        return err;
    n = strcspn((const char *)data, "\r\n");
    if (n >= RTSP_PASSWORD_LEAST && n < RTSP_PASSWORD) {
        memcpy(out, data, n);
        out[n] = 0;
    } else {
        sst_log_error(
            "rtsp.password_file %s: its first line is the password, %d to %d characters, not %zu; shorter ones "
            "are soon guessed",
            path, RTSP_PASSWORD_LEAST, RTSP_PASSWORD - 1, n);
        err = -EBADMSG;
    }
    free(data);
    if (!err && !stat(path, &st) && (st.st_mode & S_IROTH))
        sst_log_warning("rtsp.password_file %s can be read by everybody; chmod o= %s", path, path);
    return err;
}

int rtsp_read_login(struct rtsp_login *out, const struct sst_config *config)
{
    struct rtsp_login login = { .user = "" };
    int err = 0;

    if (config->rtsp.user[0]) {
        snprintf(login.user, sizeof(login.user), "%s", config->rtsp.user);
        err = read_password(config->rtsp.password_file, login.password);
    }
    if (!err)
        *out = login;
    return err;
}

int rtsp_listen(const struct sst_config *config)
{
    const char *address = config->rtsp.address;
    const int one = 1, port = config->rtsp.port;
    struct addrinfo *at;
    int fd, err = resolve(&at, address, port);

    if (err)
        return err;
    fd = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one)) ||
        bind(fd, at->ai_addr, at->ai_addrlen) || listen(fd, BACKLOG)) {
        err = -errno;
        sst_log_error("rtsp.address %s, port %d: %s; %s", address, port,
                      err == -EADDRINUSE ? "another program listens there" : strerror(-err),
                      err == -EADDRINUSE ? "`ss -ltnp` names it; stop it or set rtsp.port"
                                         : "set rtsp.address and rtsp.port");
        if (fd >= 0)
            close(fd);
    }
    freeaddrinfo(at);
    return err ? err : fd;
}

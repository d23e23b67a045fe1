/* Where clients connect to, and who may. */
#include "daemon/publish/rtsp_parts.h"

#include <errno.h>

#include "base/file.h"
#include "base/log.h"

#if WITH_RTSP

#include <arpa/inet.h>
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

static bool is_loopback(const struct sockaddr *at)
{
    const struct in6_addr *v6 = &((const struct sockaddr_in6 *)(const void *)at)->sin6_addr;

    if (at->sa_family == AF_INET)
        return ntohl(((const struct sockaddr_in *)(const void *)at)->sin_addr.s_addr) >> 24 == 127;
    return IN6_IS_ADDR_LOOPBACK(v6);
}

static int read_password(const char *path, char out[SST_RTSP_PASSWORD])
{
    struct stat st;
    uint8_t *data;
    size_t size, n;
    int err = sst_file_read(path, PASSWORD_FILE_MAX, &data, &size);

    if (err)
        return err;
    n = strcspn((const char *)data, "\r\n");
    if (n && n < SST_RTSP_PASSWORD) {
        memcpy(out, data, n);
        out[n] = 0;
    } else {
        sst_log_error("rtsp.password_file %s: its first line is the password, 1 to %d characters", path,
                      SST_RTSP_PASSWORD - 1);
        err = -EBADMSG;
    }
    free(data);
    if (!err && !stat(path, &st) && (st.st_mode & S_IROTH))
        sst_log_warning("rtsp.password_file %s can be read by everybody; chmod o= %s", path, path);
    return err;
}

int rtsp_check(struct rtsp_login *out, const struct sst_rtsp_config *cfg)
{
    const bool user = cfg->user && cfg->user[0], file = cfg->password_file && cfg->password_file[0];
    struct rtsp_login login = { .user = "" };
    struct addrinfo *at = NULL;
    int err = resolve(&at, cfg->address, cfg->port);

    if (err) {
        sst_log_error("rtsp.address %s, rtsp.port %d: not a numeric address, like 127.0.0.1, and a port up to 65535",
                      cfg->address, cfg->port);
        return err;
    }
    if (user != file) {
        sst_log_error("rtsp: a password needs both rtsp.user and rtsp.password_file");
        err = -EINVAL;
    } else if (user && (strchr(cfg->user, ':') || strlen(cfg->user) >= sizeof(login.user))) {
        sst_log_error("rtsp.user %.64s: a user's name has no colon and at most %zu characters", cfg->user,
                      sizeof(login.user) - 1);
        err = -EINVAL;
    } else if (!user && !cfg->insecure && !is_loopback(at->ai_addr)) {
        sst_log_error("rtsp.address %s can be reached from other machines: set rtsp.user and rtsp.password_file, or "
                      "rtsp.insecure: true to show everybody the pictures",
                      cfg->address);
        err = -EINVAL;
    }
    freeaddrinfo(at);
    if (!err && user) {
        strcpy(login.user, cfg->user);
        err = read_password(cfg->password_file, login.password);
    }
    if (!err)
        *out = login;
    return err;
}

static int bound_port(int fd)
{
    struct sockaddr_in6 at;
    socklen_t size = sizeof(at);

    return getsockname(fd, (struct sockaddr *)&at, &size) ? 0 : ntohs(at.sin6_port); /* that of IPv4 has its place */
}

int rtsp_listen(const char *address, int port, bool quiet, int *bound)
{
    const int one = 1;
    struct addrinfo *at;
    int fd, err = resolve(&at, address, port);

    if (err)
        return err;
    fd = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof(one)) ||
        bind(fd, at->ai_addr, at->ai_addrlen) || listen(fd, BACKLOG)) {
        err = -errno;
        if (!quiet)
            sst_log_error("rtsp.address %s, port %d: %s; %s", address, port,
                          err == -EADDRINUSE ? "another program listens there" : strerror(-err),
                          err == -EADDRINUSE ? "`ss -ltnp` names it; stop it or set rtsp.port"
                                             : "set rtsp.address and rtsp.port");
        if (fd >= 0)
            close(fd);
    } else {
        *bound = bound_port(fd);
    }
    freeaddrinfo(at);
    return err ? err : fd;
}

#endif

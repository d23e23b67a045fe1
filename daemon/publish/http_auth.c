/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE /* struct ucred */
/* Authorization: tokens, peers of the UNIX socket, and delays after wrong tokens. */
#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.h"
#include "base/log.h"
#include "daemon/publish/publish_internal.h"

#define TOKEN_BYTES 32
#define TOKEN_LEAST 32 /* characters of one that was chosen by hand */
#define GROUPS_MAX  1024

static int make_token(const char *path)
{
    char text[2 * TOKEN_BYTES + 2];

    if (!http_random_text(text, TOKEN_BYTES))
        return -EIO;
    strcat(text, "\n");
    return http_write_private(path, text);
}

static int read_token(const char *path, char *out)
{
    char text[HTTP_TOKEN_MAX + 2] = "";
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    struct stat st = { 0 };
    ssize_t n = -1;
    int err = 0;

    if (fd < 0)
        return -errno;
    if (fstat(fd, &st) || (S_ISREG(st.st_mode) && (n = read(fd, text, sizeof(text) - 1)) < 0))
        err = -EIO;
    else if (!S_ISREG(st.st_mode))
        err = S_ISDIR(st.st_mode) ? -EISDIR : -EBADMSG;
    close(fd);
    if (err)
        return err;
    text[strcspn(text, " \t\r\n")] = 0;
    if (strlen(text) < TOKEN_LEAST || strlen(text) > HTTP_TOKEN_MAX ||
        text[strspn(text, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.")])
        return -EBADMSG;
    if (st.st_mode & 077)
        sst_log_warning("token %s can be read by others; chmod 600 %s, and remove it to have a new one made", path,
                        path);
    strcpy(out, text);
    return 0;
}

static int load_token(const char *path, char *out)
{
    int err = read_token(path, out);

    if (err == -ENOENT) {
        err = make_token(path);
        err = err ? err : read_token(path, out);
    }
    if (err == -EBADMSG)
        sst_log_error("token %s is not %d to %d letters, digits, - _ .; remove it to have a new one made", path,
                      TOKEN_LEAST, HTTP_TOKEN_MAX);
    else if (err)
        sst_log_error("token %s: %s; web.token_file must be in a folder that the service can write", path,
                      strerror(-err));
    return err;
}

/* @param usual  may be missing without a word: it is made with the programs that are its members */
static gid_t group_id(const char *name, const char *key, const char *usual)
{
    char text[16384];
    struct group group, *found = NULL;

    if (!name || !name[0])
        return (gid_t)-1;
    if (getgrnam_r(name, &group, text, sizeof(text), &found) || !found) {
        if (strcmp(name, usual) != 0)
            sst_log_warning("%s: there is no group %s; make it by `groupadd %s`", key, name, name);
        return (gid_t)-1;
    }
    return found->gr_gid;
}

int http_auth_init(struct http_auth *a, const struct sst_http_config *cfg)
{
    char view[SST_PATH_MAX];
    int err = 0;

    memset(a, 0, sizeof(*a));
    a->group = group_id(cfg->group, "control.group", "");
    a->view_group = group_id(cfg->view_group, "control.view_group", "sst-view");
    snprintf(a->group_name, sizeof(a->group_name), "%s", cfg->group ? cfg->group : "");
    if (cfg->address) {
        if (!cfg->token_file || !cfg->token_file[0]) {
            sst_log_error("web.token_file: name a file for the token of TCP clients, or set web.enabled: false");
            return -EINVAL;
        }
        if (snprintf(view, sizeof(view), "%s.view", cfg->token_file) >= (int)sizeof(view))
            return -ENAMETOOLONG;
        err = load_token(cfg->token_file, a->control);
        err = err ? err : load_token(view, a->view);
    }
    sst_brake_init(&a->brake);
    http_tokens_init(&a->tokens, cfg->token_file && cfg->token_file[0] ? cfg->token_file : NULL);
    http_sessions_init(&a->sessions, cfg->address ? cfg->token_file : NULL, a->control, a->view);
    a->sessions.tokens = &a->tokens;
    return err;
}

void http_auth_fini(struct http_auth *a)
{
    sst_brake_fini(&a->brake);
    http_sessions_fini(&a->sessions);
    http_tokens_fini(&a->tokens);
    memset(a->control, 0, sizeof(a->control));
    memset(a->view, 0, sizeof(a->view));
}

/* In constant time: neither the length nor the place of a difference shows. */
static bool same_token(const char *secret, const char *given)
{
    const size_t n = strlen(given);
    volatile unsigned difference = !secret[0];

    for (size_t i = 0; i <= HTTP_TOKEN_MAX; i++)
        difference |= (unsigned)(secret[i] ^ (i < n ? given[i] : 0));
    return !difference && n <= HTTP_TOKEN_MAX;
}

bool http_auth_token(struct http_auth *a, const char *token, struct http_grant *out)
{
    const bool control = same_token(a->control, token), view = same_token(a->view, token);

    *out = (struct http_grant){ 0 };
    if (!control && !view)
        return strlen(token) <= HTTP_TOKEN_MAX && http_tokens_find(&a->tokens, token, out);
    out->role = control ? SST_ROLE_CONTROL : SST_ROLE_VIEW;
    out->rights = control ? SST_RIGHTS_ALL : SST_RIGHTS_READ;
    strcpy(out->user, control ? "control" : "view");
    return true;
}

/* Is the peer in a group, by its own group or one of the others that it had when it connected? */
static bool peer_in_group(int fd, gid_t own, gid_t wanted)
{
    gid_t groups[GROUPS_MAX];
    socklen_t size = sizeof(groups);

    if (wanted == (gid_t)-1)
        return false;
    if (own == wanted)
        return true;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups, &size))
        return false;
    for (size_t i = 0; i < size / sizeof(groups[0]); i++) {
        if (groups[i] == wanted)
            return true;
    }
    return false;
}

enum sst_role http_auth_peer(const struct http_auth *a, int fd, char *who)
{
    struct ucred peer;
    socklen_t size = sizeof(peer);

    snprintf(who, 96, "unknown");
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) || size != sizeof(peer))
        return SST_ROLE_ANYONE;
    snprintf(who, 96, "uid %u, process %d", (unsigned)peer.uid, (int)peer.pid);
    if (peer.uid == 0 || peer.uid == geteuid() || peer_in_group(fd, peer.gid, a->group))
        return SST_ROLE_CONTROL;
    return peer_in_group(fd, peer.gid, a->view_group) ? SST_ROLE_VIEW : SST_ROLE_ANYONE;
}

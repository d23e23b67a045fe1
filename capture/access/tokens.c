/* File of named tokens: JSON, which only the service and root can read. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/file.h"
#include "base/text.h"
#include "capture/access/access_internal.h"
#include "pipeline/kernels/sha256.h"

#define FILE_BYTES 65536
#define LETTERS    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_."

static const char *const words[] = { "view", "snapshot", "recordings", "control" };

/* --- rights ------------------------------------------------------------------------------------------------------- */

unsigned sst_access_right(const char *word, size_t n)
{
    for (size_t i = 0; i < ARRAY_LEN(words); i++)
        if (strlen(words[i]) == n && !memcmp(words[i], word, n))
            return i == 3 ? SST_RIGHTS_ALL : 1u << i;
    return 0;
}

unsigned sst_access_rights(const char *text)
{
    unsigned rights = 0;

    for (const char *at = text;; at++) {
        const size_t n = strcspn(at, ",");
        const unsigned one = sst_access_right(at, n);

        if (!one)
            return 0;
        rights |= one;
        at += n;
        if (!*at)
            return rights;
    }
}

const char *sst_access_rights_text(unsigned rights, char out[SST_ACCESS_TEXT])
{
    out[0] = 0;
    for (size_t i = 0; i < ARRAY_LEN(words); i++)
        if (rights & 1u << i)
            sst_text_add(out, SST_ACCESS_TEXT, "%s%s", out[0] ? "," : "", words[i]);
    return out;
}

json_t *sst_access_rights_json(unsigned rights)
{
    json_t *list = json_array();

    for (size_t i = 0; i < ARRAY_LEN(words); i++)
        if (rights & 1u << i)
            json_array_append_new(list, json_string(words[i]));
    return list;
}

void sst_access_hash(char out[65], const char *secret)
{
    sst_sha256_hex(out, secret, strlen(secret));
}

/* --- reading ------------------------------------------------------------------------------------------------------ */

static bool is_name(const char *name)
{
    const size_t n = strlen(name);

    return n > 0 && n <= SST_ACCESS_NAME && strspn(name, LETTERS) == n && strcmp(name, "view") != 0 &&
           strcmp(name, "control") != 0;
}

static int read_one(struct sst_access_token *out, const json_t *o)
{
    const char *name, *hash, *word;
    json_int_t created, expires;
    const json_t *rights, *one;
    size_t i;

    if (json_unpack((json_t *)(uintptr_t)o, "{s:s, s:s, s:o, s:I, s:I}", "name", &name, "sha256", &hash, "rights", &rights,
                    "created_s", &created, "expires_s", &expires) ||
        !is_name(name) || strlen(hash) != 64 || strspn(hash, "0123456789abcdef") != 64 || created < 0 || expires < 0)
        return -EBADMSG;
    *out = (struct sst_access_token){ .created_s = created, .expires_s = expires };
    strcpy(out->name, name);
    strcpy(out->sha256, hash);
    json_array_foreach(rights, i, one)
    {
        word = json_string_value(one);
        out->rights |= word ? sst_access_right(word, strlen(word)) : 0;
    }
    return out->rights ? 0 : -EBADMSG;
}

static int parse(struct sst_access_list *out, const char *text, size_t bytes)
{
    json_t *root = json_loadb(text, bytes, 0, NULL);
    const json_t *list = json_object_get(root, "tokens"), *one;
    int err = json_is_array(list) && json_array_size(list) <= SST_ACCESS_TOKENS ? 0 : -EBADMSG;
    size_t i;

    json_array_foreach(err ? NULL : list, i, one)
    {
        err = err ? err : read_one(&out->token[i], one);
    }
    if (!err)
        out->tokens = (int)json_array_size(list);
    json_decref(root);
    return err;
}

/* One that others can write lets them in; one that another user owns, too. */
static int check_owner(const struct stat *st, const char *path, char error[256])
{
    if (!S_ISREG(st->st_mode)) {
        snprintf(error, 256, "%.160s is not a file", path);
        return -EBADMSG;
    }
    if (st->st_mode & 077) {
        snprintf(error, 256, "%.140s can be read or written by others, so that no token in it is accepted; chmod 600",
                 path);
        return -EPERM;
    }
    if (geteuid() && st->st_uid != geteuid() && st->st_uid) {
        snprintf(error, 256, "%.140s belongs to another user, so that no token in it is accepted; chown it", path);
        return -EPERM;
    }
    return 0;
}

int sst_access_read(struct sst_access_list *out, const char *path, char error[256])
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW);
    char text[FILE_BYTES];
    struct stat st;
    ssize_t n;
    int err;

    memset(out, 0, sizeof(*out));
    if (fd < 0 && errno == ENOENT)
        return 0;
    if (fd < 0 || fstat(fd, &st)) {
        err = -errno;
        snprintf(error, 256, "%.160s: %s", path, strerror(-err));
        if (fd >= 0)
            close(fd);
        return err;
    }
    err = check_owner(&st, path, error);
    n = err ? 0 : read(fd, text, sizeof(text));
    if (!err && (n < 0 || n == (ssize_t)sizeof(text) || parse(out, text, (size_t)n))) {
        err = -EBADMSG;
        snprintf(error, 256, "%.160s is not a list of tokens; remove it to begin a new one", path);
    }
    if (err)
        memset(out, 0, sizeof(*out));
    close(fd);
    return err;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

void access_folder(const char *path, char out[SST_PATH_MAX])
{
    const char *slash = strrchr(path, '/');

    snprintf(out, SST_PATH_MAX, "%.*s", slash == path ? 1 : slash ? (int)(slash - path) : 1, slash ? path : ".");
}

/* Root writes for the service: its file must stay the service's. */
int access_give(int fd, const char *path)
{
    char folder[SST_PATH_MAX];
    struct stat st;

    access_folder(path, folder);
    if (geteuid() || (stat(path, &st) && stat(folder, &st)))
        return 0;
    return fchown(fd, st.st_uid, st.st_gid) ? -errno : 0;
}

static char *text_of(const struct sst_access_list *list)
{
    json_t *all = json_array(), *root;
    char *text;

    for (int i = 0; i < list->tokens; i++) {
        const struct sst_access_token *t = &list->token[i];

        json_array_append_new(all, json_pack("{s:s, s:s, s:o, s:I, s:I}", "name", t->name, "sha256", t->sha256, "rights",
                                             sst_access_rights_json(t->rights), "created_s", (json_int_t)t->created_s,
                                             "expires_s", (json_int_t)t->expires_s));
    }
    root = json_pack("{s:s, s:i, s:o}", "format", "sst-tokens", "version", 1, "tokens", all);
    text = json_dumps(root, JSON_INDENT(1));
    json_decref(root);
    return text;
}

static int write_list(const struct sst_access_list *list, const char *path)
{
    char fresh[SST_PATH_MAX + 8], *text = text_of(list);
    const size_t n = text ? strlen(text) : 0;
    int fd, err = 0;

    if (!text)
        return -ENOMEM;
    snprintf(fresh, sizeof(fresh), "%s.new", path);
    (void)unlink(fresh);
    fd = open(fresh, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    err = fd < 0 ? -errno : access_give(fd, path);
    errno = 0;
    if (!err && (write(fd, text, n) != (ssize_t)n || fsync(fd)))
        err = errno ? -errno : -EIO;
    if (fd >= 0)
        close(fd);
    if (!err && rename(fresh, path))
        err = -errno;
    if (err)
        (void)unlink(fresh);
    free(text);
    return err;
}

/* The folder's lock: a file of its own would be root's or the service's. @return descriptor to close, or -errno */
static int lock_folder(const char *path)
{
    char folder[SST_PATH_MAX];
    int fd;

    access_folder(path, folder);
    fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0)
        return -errno;
    if (flock(fd, LOCK_EX)) {
        const int err = -errno;

        close(fd);
        return err;
    }
    return fd;
}

static int find(const struct sst_access_list *list, const char *name)
{
    for (int i = 0; i < list->tokens; i++)
        if (!strcmp(list->token[i].name, name))
            return i;
    return -1;
}

static int insert(struct sst_access_list *list, const struct sst_access_token *token, char *secret, char error[256])
{
    const int64_t now_s = sst_clock_wall_ns() / 1000000000;
    struct sst_access_token *t = &list->token[list->tokens];
    uint8_t random[32];

    if (find(list, token->name) >= 0) {
        snprintf(error, 256, "there is a token %s already; revoke it first, or choose another name", token->name);
        return -EEXIST;
    }
    if (list->tokens == SST_ACCESS_TOKENS) {
        snprintf(error, 256, "there are %d tokens, and no more are possible; revoke some", SST_ACCESS_TOKENS);
        return -ENOSPC;
    }
    if (getentropy(random, sizeof(random))) {
        snprintf(error, 256, "this machine has no random numbers");
        return -EIO;
    }
    for (size_t i = 0; i < sizeof(random); i++)
        snprintf(secret + 2 * i, 3, "%02x", random[i]);
    *t = *token;
    t->created_s = now_s;
    sst_access_hash(t->sha256, secret);
    list->tokens++;
    return 0;
}

static int check_new(const struct sst_access_token *token, char error[256])
{
    if (!is_name(token->name))
        snprintf(error, 256,
                 "a name has 1 to %d letters, digits, - _ ., and is neither `view` nor `control`, which the tokens of "
                 "web.token_file have",
                 SST_ACCESS_NAME);
    else if (!token->rights || token->rights & ~(unsigned)SST_RIGHTS_ALL)
        snprintf(error, 256, "rights are one or more of view, snapshot, recordings, control");
    else if (token->expires_s && token->expires_s <= sst_clock_wall_ns() / 1000000000)
        snprintf(error, 256, "a token must expire later than now");
    else
        return 0;
    return -EINVAL;
}

/* Under the folder's lock: read, change, write. @param token  to add, or NULL: `name` is revoked */
static int change(const char *path, const struct sst_access_token *token, const char *name, char *secret,
                  char error[256])
{
    struct sst_access_list list;
    const int lock = lock_folder(path);
    int err = lock < 0 ? lock : 0, i;

    error[0] = 0;
    err = err ? err : sst_access_read(&list, path, error);
    if (!err && token) {
        err = insert(&list, token, secret, error);
    } else if (!err) {
        i = find(&list, name);
        if (i < 0) {
            snprintf(error, 256, "there is no token %.32s", name);
            err = -ENOENT;
        } else {
            memmove(&list.token[i], &list.token[i + 1], (size_t)(--list.tokens - i) * sizeof(list.token[0]));
        }
    }
    err = err ? err : write_list(&list, path);
    if (err && !error[0])
        snprintf(error, 256, "%.160s cannot be written: %s", path, strerror(-err));
    if (lock >= 0)
        close(lock);
    return err;
}

int sst_access_add(const char *path, const struct sst_access_token *token, char *secret, char error[256])
{
    const int err = check_new(token, error);

    return err ? err : change(path, token, NULL, secret, error);
}

int sst_access_revoke(const char *path, const char *name, char error[256])
{
    return change(path, NULL, name, NULL, error);
}

json_t *sst_access_json(const struct sst_access_list *list, int64_t now_s)
{
    json_t *all = json_array();

    for (int i = 0; i < list->tokens; i++) {
        const struct sst_access_token *t = &list->token[i];
        char created[SST_CLOCK_TEXT], expires[SST_CLOCK_TEXT];

        sst_clock_text(created, t->created_s * 1000000000);
        sst_clock_text(expires, t->expires_s * 1000000000);
        json_array_append_new(all, json_pack("{s:s, s:o, s:s, s:s?, s:b}", "name", t->name, "rights",
                                             sst_access_rights_json(t->rights), "created", created, "expires",
                                             t->expires_s ? expires : NULL, "expired",
                                             t->expires_s && t->expires_s <= now_s));
    }
    return all;
}

/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "client/client.h"

#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/types.h>

#include "base/clock.h"
#include "base/curl.h"
#include "base/file.h"
#include "base/log.h"

#if WITH_CURL
#include <sys/un.h>
#endif

#define CONNECT_S       5
#define STATUS_S        5          /* without a byte: the status is at hand */
#define ANSWER_S        15         /* without a byte of another answer */
#define MAKE_S          600        /* without a byte of a video, which is made before its first one */
#define SILENCE_S       60         /* without a byte of an endless stream: the service sends signs of life more often */
#define ANSWER_BYTES    (16 << 20) /* of an answer that is kept in memory, or of a line */
#define TOKEN_BYTES     4096
#define PART_HEAD_BYTES 4096 /* of a part of a stream */
#define TAR_END_BYTES   1024 /* zeros that end an archive; a chunked transfer has no length */

struct sst_client {
#if WITH_CURL
    const struct sst_curl *lib; /* NULL: not loaded */
    CURL *curl;
    struct curl_slist *get_headers, *post_headers;
#endif
    char place[512];  /* for messages: socket path or URL */
    const char *token_file; /* NULL: none */
    const char *base; /* of URLs */
    /* of the running transfer */
    char *text; /* the answer, or the beginning of a line or part; ends in NUL */
    size_t length, room;
    FILE *file;       /* destination instead of `text`, or NULL */
    bool made;        /* the answer has to be made first */
    size_t zeros;     /* zero bytes that it ends with */
    const char *type; /* Content-Type of the answer, or NULL; until the next transfer */
    sst_client_line_fn *line;
    sst_client_picture_fn *picture;
    void *arg;                    /* of both */
    int err;                      /* why receiving ended */
    int64_t heard_ns, silence_ns; /* of the last byte; how long none may come */
    sst_client_continue_fn *go_on;
    void *go_on_arg;
};

#if WITH_CURL
/* --- receiving ---------------------------------------------------------------------------------------------------- */

static int append(struct sst_client *c, const char *data, size_t bytes)
{
    if (bytes > ANSWER_BYTES - c->length) {
        sst_log_error("the service at %s answers with more than %d MiB", c->place, ANSWER_BYTES >> 20);
        return -EPROTO;
    }
    if (c->length + bytes + 1 > c->room) {
        const size_t room = 2 * (c->length + bytes + 1);
        char *text = realloc(c->text, room);

        if (!text) {
            sst_log_error("no memory for an answer of the service");
            return -ENOMEM;
        }
        c->text = text;
        c->room = room;
    }
    memcpy(c->text + c->length, data, bytes);
    c->length += bytes;
    c->text[c->length] = 0;
    return 0;
}

static void consume(struct sst_client *c, size_t bytes)
{
    c->length -= bytes;
    memmove(c->text, c->text + bytes, c->length + 1);
}

/* Pass on the complete lines; the rest moves to the front. */
static int pass_lines(struct sst_client *c)
{
    char *line = c->text, *end;
    int err = 0;

    while (!err && (end = memchr(line, '\n', (size_t)(c->text + c->length - line)))) {
        *end = 0;
        if (*line)
            err = c->line(c->arg, line);
        line = end + 1;
    }
    consume(c, (size_t)(line - c->text));
    return err;
}

/* Value of a header of a part, "Name: value"; NULL: not there. */
static const char *part_header(const char *head, const char *name)
{
    const size_t n = strlen(name);

    for (const char *line = head; line; line = strstr(line, "\r\n"), line += line ? 2 : 0)
        if (!strncasecmp(line, name, n) && line[n] == ':')
            return line + n + 1;
    return NULL;
}

/* The first part of the received bytes. @return bytes up to its end; 0: not complete yet; -EPROTO */
static ssize_t parse_part(struct sst_client *c, struct sst_client_picture *out)
{
    char *end = c->length ? strstr(c->text, "\r\n\r\n") : NULL;
    const char *length, *time, *set;
    unsigned long long seconds = 0, micro = 0;
    size_t head;

    if (!end)
        return c->length > PART_HEAD_BYTES ? -EPROTO : 0;
    *end = 0;
    length = part_header(c->text, "Content-Length");
    time = part_header(c->text, "X-Timestamp");
    set = part_header(c->text, "X-Sst-Set");
    out->bytes = length ? strtoul(length, NULL, 10) : 0;
    out->set = set ? strtoull(set, NULL, 10) : 0;
    if (time && sscanf(time, "%llu.%6llu", &seconds, &micro) == 2)
        out->wall_ns = (int64_t)(seconds * 1000000000 + micro * 1000);
    *end = '\r';
    head = (size_t)(end + 4 - c->text);
    if (!out->bytes || out->bytes > ANSWER_BYTES - head)
        return -EPROTO;
    out->data = (const uint8_t *)c->text + head;
    return c->length < head + out->bytes ? 0 : (ssize_t)(head + out->bytes);
}

/* Pass on the complete parts of a multipart stream; the rest moves to the front. */
static int pass_parts(struct sst_client *c)
{
    struct sst_client_picture picture = { 0 };
    ssize_t used;
    int err = 0;

    while (!err && (used = parse_part(c, &picture)) != 0) {
        if (used < 0) {
            sst_log_error("%s does not answer as sstd does: its stream has no pictures", c->place);
            return -EPROTO;
        }
        err = c->picture(c->arg, &picture);
        consume(c, (size_t)used);
        picture = (struct sst_client_picture){ 0 };
    }
    return err;
}

static void count_zeros(struct sst_client *c, const char *data, size_t bytes)
{
    size_t n = 0;

    while (n < bytes && !data[bytes - 1 - n])
        n++;
    c->zeros = n == bytes ? c->zeros + n : n;
}

static size_t receive(char *data, size_t one, size_t bytes, void *arg)
{
    struct sst_client *c = arg;
    long code = 0;

    (void)one; /* always 1 */
    c->heard_ns = sst_clock_now_ns();
    (void)c->lib->curl_easy_getinfo(c->curl, CURLINFO_RESPONSE_CODE, &code);
    if (code / 100 == 2 && c->file) {
        if (fwrite(data, 1, bytes, c->file) != bytes)
            c->err = errno ? -errno : -EIO;
        count_zeros(c, data, bytes);
    } else {
        c->err = append(c, data, bytes);
        if (!c->err && code / 100 == 2 && c->line)
            c->err = pass_lines(c);
        else if (!c->err && code / 100 == 2 && c->picture)
            c->err = pass_parts(c);
    }
    return c->err ? 0 : bytes;
}

static int progress(void *arg, curl_off_t total, curl_off_t now, curl_off_t up_total, curl_off_t up_now)
{
    struct sst_client *c = arg;

    (void)total, (void)now, (void)up_total, (void)up_now;
    if (c->go_on && !c->err && !c->go_on(c->go_on_arg))
        c->err = -ECANCELED;
    if (!c->err && sst_clock_now_ns() - c->heard_ns > c->silence_ns)
        c->err = -ETIMEDOUT;
    return c->err != 0;
}

/* --- errors ------------------------------------------------------------------------------------------------------- */

static int transfer_error(struct sst_client *c, CURLcode code, const char *said)
{
    long os = 0;

    (void)c->lib->curl_easy_getinfo(c->curl, CURLINFO_OS_ERRNO, &os);
    switch (code) {
    case CURLE_COULDNT_CONNECT:
        if (os == EACCES || os == EPERM) {
            sst_log_error("no right to use %s: join its group (`adduser %s sst`, then log in again), or use sudo",
                          c->place, getenv("USER") ? getenv("USER") : "USER");
            return -EACCES;
        }
        /* fall through */
    case CURLE_COULDNT_RESOLVE_HOST:
        sst_log_error("no service runs at %s: see `systemctl status sstd`; --socket or --url name another", c->place);
        return -ENOPKG;
    case CURLE_OPERATION_TIMEDOUT:
        sst_log_error("the service at %s does not answer: see `systemctl status sstd` and `journalctl -u sstd`",
                      c->place);
        return -ETIMEDOUT;
    case CURLE_SSL_CONNECT_ERROR:
        sst_log_error("the service at %s cannot be asked by TLS: %s; without web.tls_certificate it is http://",
                      c->place, *said ? said : c->lib->curl_easy_strerror(code));
        return -ENOPKG;
    case CURLE_OUT_OF_MEMORY:
        sst_log_error("no memory to ask the service");
        return -ENOMEM;
    default:
        sst_log_error("the service at %s cannot be asked: %s", c->place, *said ? said : c->lib->curl_easy_strerror(code));
        return code == CURLE_PEER_FAILED_VERIFICATION ? -EACCES : -EPROTO;
    }
}

static int refusal(struct sst_client *c, long code)
{
    static const struct {
        long code;
        int err;
    } known[] = {
        { 400, EBADMSG }, { 401, EACCES },  { 403, EACCES },  { 404, ENOENT }, { 409, EBUSY },
        { 429, EBUSY },   { 501, ENOTSUP }, { 503, ENODATA }, { 507, ENOSPC },
    };
    json_t *body = c->length ? json_loadb(c->text, c->length, 0, NULL) : NULL;
    const char *error = json_string_value(json_object_get(body, "error"));
    char sentence[600];
    int err = EPROTO;

    for (size_t i = 0; i < ARRAY_LEN(known); i++)
        err = known[i].code == code ? known[i].err : err;
    snprintf(sentence, sizeof(sentence), "%s", error ? error : "");
    for (char *t = sentence; *t; t++) /* no answer drives the terminal */
        *t = (unsigned char)*t < ' ' || *t == 127 ? '?' : *t;
    if (code == 401 && c->token_file)
        sst_log_error("the service at %s does not accept the token in %s: it was revoked, has expired or is another service's; "
                      "`sst token list` on that machine shows those that count",
                      c->place, c->token_file);
    else if (code == 401)
        sst_log_error("the service at %s requires a token: --token-file FILE names a file that holds it, a copy of its "
                      "web.token_file",
                      c->place);
    else if (*sentence)
        sst_log_error("%s", sentence);
    else
        sst_log_error("the service at %s refuses with HTTP status %ld and no reason", c->place, code);
    json_decref(body);
    return -err;
}

static int silence_s(const struct sst_client *c, const char *path, bool endless)
{
    if (c->made)
        return MAKE_S;
    if (endless)
        return SILENCE_S;
    return !strcmp(path, "/api/v1/status") ? STATUS_S : ANSWER_S;
}

/* One request; received bytes go to file, line, picture or text. */
static int transfer(struct sst_client *c, const char *path, const char *post, bool endless)
{
    char url[1024], said[CURL_ERROR_SIZE] = "";
    CURLcode code;
    long status = 0;

    if (snprintf(url, sizeof(url), "%s%s", c->base, path) >= (int)sizeof(url)) {
        sst_log_error("the address %.40s... is too long", c->base);
        return -ENAMETOOLONG;
    }
    c->err = 0;
    c->length = 0;
    c->heard_ns = sst_clock_now_ns();
    c->silence_ns = silence_s(c, path, endless) * INT64_C(1000000000);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_URL, url);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_ERRORBUFFER, said);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_HTTPGET, 1L);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_HTTPHEADER, post ? c->post_headers : c->get_headers);
    if (post) {
        (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_POST, 1L);
        (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_POSTFIELDSIZE, (long)strlen(post));
        (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_POSTFIELDS, post);
    }
    code = c->lib->curl_easy_perform(c->curl);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_ERRORBUFFER, NULL);
    (void)c->lib->curl_easy_getinfo(c->curl, CURLINFO_RESPONSE_CODE, &status);
    (void)c->lib->curl_easy_getinfo(c->curl, CURLINFO_CONTENT_TYPE, &c->type);
    if (c->err == -ETIMEDOUT)
        return transfer_error(c, CURLE_OPERATION_TIMEDOUT, said);
    if (c->err)
        return c->err;
    if (code != CURLE_OK)
        return transfer_error(c, code, said);
    return status / 100 == 2 ? 0 : refusal(c, status);
}

/* --- opening ------------------------------------------------------------------------------------------------------ */

static bool add_header(const struct sst_client *c, struct curl_slist **list, const char *header)
{
    struct curl_slist *longer = c->lib->curl_slist_append(*list, header);

    if (longer)
        *list = longer;
    return longer;
}

static int add_token(struct sst_client *c, const char *file)
{
    char header[TOKEN_BYTES + 32];
    uint8_t *token;
    size_t size;
    int err = sst_file_read_text(file, TOKEN_BYTES, &token, &size);

    if (err)
        return err;
    while (size && (token[size - 1] == '\n' || token[size - 1] == '\r' || token[size - 1] == ' '))
        size--;
    for (size_t i = 0; i < size; i++)
        err = token[i] <= ' ' || token[i] > '~' ? -EBADMSG : err;
    if (err || !size)
        sst_log_error("%s: a token is one line of letters and digits", file);
    snprintf(header, sizeof(header), "Authorization: Bearer %.*s", (int)size, (const char *)token);
    free(token);
    if (err || !size)
        return -EBADMSG;
    return add_header(c, &c->get_headers, header) && add_header(c, &c->post_headers, header) ? 0 : -ENOMEM;
}

/* Where the token passes nothing but this machine. */
static bool is_private(const char *url)
{
    const char *host = url + 7 + (url[7] == '[');
    const size_t n = strcspn(host, url[7] == '[' ? "]" : ":/");
    struct in_addr v4;
    char name[64];

    if (!strncmp(url, "https://", 8))
        return true;
    if (n >= sizeof(name) || memchr(host, '@', strcspn(host, "/")))
        return false;
    snprintf(name, sizeof(name), "%.*s", (int)n, host);
    return !strcasecmp(name, "localhost") || !strcmp(name, "::1") ||
           (!strncmp(name, "127.", 4) && inet_pton(AF_INET, name, &v4) == 1);
}

static int set_place(struct sst_client *c, const struct sst_client_service *where)
{
    const char *path = where->socket ? where->socket : getenv("SST_SOCKET");

    path = path && *path ? path : SST_CLIENT_SOCKET;
    snprintf(c->place, sizeof(c->place), "%s", where->url ? where->url : path);
    if (where->url) {
        if (strncmp(where->url, "http://", 7) && strncmp(where->url, "https://", 8)) {
            sst_log_error("--url %s: an address begins with http:// or https://", where->url);
            return -EINVAL;
        }
        /* Paths begin with a slash. */
        if (c->place[strlen(c->place) - 1] == '/')
            c->place[strlen(c->place) - 1] = 0;
        c->base = c->place;
        if (where->token_file && !is_private(where->url))
            sst_log_warning("--url %s: the token goes to another machine unencrypted; use https://, or `ssh -L`",
                            where->url);
        c->token_file = where->token_file;
        return c->token_file ? add_token(c, c->token_file) : 0;
    }
    if (strlen(path) >= sizeof(((struct sockaddr_un *)NULL)->sun_path)) {
        sst_log_error("%s: the path of a socket has at most %zu characters", path,
                      sizeof(((struct sockaddr_un *)NULL)->sun_path) - 1);
        return -EINVAL;
    }
    c->base = "http://localhost";
    return c->lib->curl_easy_setopt(c->curl, CURLOPT_UNIX_SOCKET_PATH, c->place) ? -ENOMEM : 0;
}

int sst_client_open(struct sst_client **out, const struct sst_client_service *where)
{
    struct sst_client *c = calloc(1, sizeof(*c));
    char why[256];
    int err = -ENOMEM;

    if (!c)
        goto fail;
    c->lib = sst_curl_load(why);
    if (!c->lib) {
        sst_log_error("%s", why);
        err = -ENOTSUP;
        goto fail;
    }
    c->curl = c->lib->curl_easy_init();
    if (!c->curl)
        goto fail;
    if (!add_header(c, &c->get_headers, "Accept: application/json, application/x-ndjson, */*;q=0.1") ||
        !add_header(c, &c->post_headers, "Content-Type: application/json") || !add_header(c, &c->post_headers, "Expect:"))
        goto fail;
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_WRITEFUNCTION, receive);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_WRITEDATA, c);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_XFERINFOFUNCTION, progress);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_XFERINFODATA, c);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_NOSIGNAL, 1L);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_PROTOCOLS_STR, "http,https");
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_PROXY, ""); /* no proxy of the environment */
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_CONNECTTIMEOUT, (long)CONNECT_S);
    (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_NOPROGRESS, 0L);
    if (where->ca)
        (void)c->lib->curl_easy_setopt(c->curl, CURLOPT_CAINFO, where->ca);
    err = set_place(c, where);
    if (err)
        goto fail;
    *out = c;
    return 0;

fail:
    if (err == -ENOMEM)
        sst_log_error("no memory to ask the service");
    sst_client_close(c);
    return err;
}

void sst_client_close(struct sst_client *c)
{
    if (!c)
        return;
    if (c->lib) {
        c->lib->curl_easy_cleanup(c->curl);
        c->lib->curl_slist_free_all(c->get_headers);
        c->lib->curl_slist_free_all(c->post_headers);
    }
    free(c->text);
    free(c);
}

#else

int sst_client_open(struct sst_client **out SST_UNUSED, const struct sst_client_service *where SST_UNUSED)
{
    sst_log_error("this build cannot ask the service: it was made without libcurl");
    return -ENOTSUP;
}

void sst_client_close(struct sst_client *c SST_UNUSED)
{
}

/* Never called: without open there is no client. */
static int transfer(struct sst_client *c SST_UNUSED, const char *path SST_UNUSED, const char *post SST_UNUSED,
                    bool endless SST_UNUSED)
{
    return -ENOTSUP;
}

#endif

/* --- requests ----------------------------------------------------------------------------------------------------- */

int sst_client_json(struct sst_client *c, const char *path, const json_t *post, json_t **out)
{
    char *body = post ? json_dumps(post, JSON_COMPACT) : NULL;
    json_t *answer;
    int err;

    if (post && !body) {
        sst_log_error("no memory to ask the service");
        return -ENOMEM;
    }
    err = transfer(c, path, body, false);
    free(body);
    if (err)
        return err;
    answer = c->length ? json_loadb(c->text, c->length, JSON_REJECT_DUPLICATES, NULL) : NULL;
    if (!answer) {
        sst_log_error("%s does not answer as sstd does: %s is not JSON", c->place, path);
        return -EPROTO;
    }
    *out = answer;
    return 0;
}

int sst_client_save(struct sst_client *c, const char *path, const char *type, const char *file)
{
    struct sst_outfile out;
    int err = sst_outfile_open(&out, file);

    if (err)
        return err;
    c->file = out.stream;
    c->made = !strcmp(type, "video/x-matroska");
    c->zeros = 0;
    err = transfer(c, path, NULL, false);
    c->made = false;
    c->file = NULL;
    if (c->err)
        sst_log_error("%s: %s: free space, or name another file", file, strerror(-c->err));
    if (!err && (!c->type || strncmp(c->type, type, strlen(type)) != 0)) {
        sst_log_error("%s does not answer as sstd does: %s is not %s", c->place, path, type);
        err = -EPROTO;
    } else if (!err && !strcmp(type, "application/x-tar") && c->zeros < TAR_END_BYTES) {
        sst_log_error("the service at %s ended while it sent %s: see `journalctl -u sstd`", c->place, path);
        err = -EPROTO;
    }
    if (!err)
        return sst_outfile_commit(&out);
    sst_outfile_abort(&out);
    return err;
}

int sst_client_bytes(struct sst_client *c, const char *path, uint8_t **data, size_t *bytes)
{
    const int err = transfer(c, path, NULL, false);

    if (err)
        return err;
    if (!c->length) {
        sst_log_error("%s does not answer as sstd does: %s is empty", c->place, path);
        return -EPROTO;
    }
    *data = (uint8_t *)c->text;
    *bytes = c->length;
    c->text = NULL;
    c->room = c->length = 0;
    return 0;
}

int sst_client_stream(struct sst_client *c, const char *path, sst_client_picture_fn *fn, void *arg)
{
    int err;

    c->picture = fn;
    c->arg = arg;
    err = transfer(c, path, NULL, true);
    c->picture = NULL;
    return err;
}

void sst_client_set_continue(struct sst_client *c, sst_client_continue_fn *fn, void *arg)
{
    c->go_on = fn;
    c->go_on_arg = arg;
}

int sst_client_lines(struct sst_client *c, const char *path, bool endless, sst_client_line_fn *fn, void *arg)
{
    int err;

    c->line = fn;
    c->arg = arg;
    err = transfer(c, path, NULL, endless);
    c->line = NULL;
    if (!err && c->length) /* a last line without an end */
        err = fn(arg, c->text);
    return err;
}

int sst_client_ask(const struct sst_client_service *where, const char *path, const json_t *post, json_t **out)
{
    struct sst_client *client;
    int err = sst_client_open(&client, where);

    if (err)
        return err;
    err = sst_client_json(client, path, post, out);
    sst_client_close(client);
    return err;
}

/* Requests to push services, by libcurl, which is loaded when the first message is sent. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/publish/push_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#if WITH_PUSH

#include "base/curl.h"

#define CONNECT_S 10
#define TOTAL_S   20

/* A message on its way. */
struct transfer {
    const struct push_message *m;
    bool refused; /* an address of a private network */
    size_t left;  /* bytes of the answer that may follow */
};

/* The name may have changed its address since the endpoint was checked: each address counts. */
static curl_socket_t open_socket(void *arg, curlsocktype purpose, struct curl_sockaddr *to)
{
    struct transfer *t = arg;

    if (purpose != CURLSOCKTYPE_IPCXN)
        return CURL_SOCKET_BAD;
    if (!t->m->settings->private_hosts && push_is_private(&to->addr)) {
        t->refused = true;
        return CURL_SOCKET_BAD;
    }
    return socket(to->family, to->socktype | SOCK_CLOEXEC, to->protocol);
}

static size_t discard(char *data SST_UNUSED, size_t size, size_t count, void *arg)
{
    struct transfer *t = arg;

    if (size * count > t->left)
        return 0;
    t->left -= size * count;
    return size * count;
}

static int go_on(void *arg, curl_off_t a SST_UNUSED, curl_off_t b SST_UNUSED, curl_off_t c SST_UNUSED,
                 curl_off_t d SST_UNUSED)
{
    const struct transfer *t = arg;

    return !t->m->go_on(t->m->arg);
}

static struct curl_slist *headers_of(const struct sst_curl *lib, const struct push_message *m)
{
    static const char *const fixed[] = { "Content-Type: application/octet-stream", "Content-Encoding: aes128gcm",
                                         "Urgency: high", "Expect:" };
    char ttl[32], *line = malloc(strlen(m->authorization) + 32);
    struct curl_slist *list = NULL, *more;
    bool whole = line != NULL;

    snprintf(ttl, sizeof(ttl), "TTL: %d", m->ttl_s);
    if (line)
        sprintf(line, "Authorization: %s", m->authorization);
    for (size_t i = 0; whole && i < ARRAY_LEN(fixed) + 2; i++) {
        more = lib->curl_slist_append(list, i < ARRAY_LEN(fixed) ? fixed[i] : i == ARRAY_LEN(fixed) ? ttl : line);
        whole = more != NULL;
        list = more ? more : list;
    }
    free(line);
    if (!whole) {
        lib->curl_slist_free_all(list);
        list = NULL;
    }
    return list;
}

static void set_options(const struct sst_curl *lib, CURL *curl, struct transfer *t, struct curl_slist *headers)
{
    const struct push_message *m = t->m;

    lib->curl_easy_setopt(curl, CURLOPT_URL, m->endpoint);
    lib->curl_easy_setopt(curl, CURLOPT_PROTOCOLS_STR, "https"); /* redirects are not followed */
    lib->curl_easy_setopt(curl, CURLOPT_PROXY, "");
    lib->curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
    lib->curl_easy_setopt(curl, CURLOPT_CONNECTTIMEOUT, (long)CONNECT_S);
    lib->curl_easy_setopt(curl, CURLOPT_TIMEOUT, (long)TOTAL_S);
    lib->curl_easy_setopt(curl, CURLOPT_HTTPHEADER, headers);
    lib->curl_easy_setopt(curl, CURLOPT_POST, 1L);
    lib->curl_easy_setopt(curl, CURLOPT_POSTFIELDS, m->body);
    lib->curl_easy_setopt(curl, CURLOPT_POSTFIELDSIZE, (long)m->bytes);
    lib->curl_easy_setopt(curl, CURLOPT_OPENSOCKETFUNCTION, open_socket);
    lib->curl_easy_setopt(curl, CURLOPT_OPENSOCKETDATA, t);
    lib->curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, discard);
    lib->curl_easy_setopt(curl, CURLOPT_WRITEDATA, t);
    lib->curl_easy_setopt(curl, CURLOPT_XFERINFOFUNCTION, go_on);
    lib->curl_easy_setopt(curl, CURLOPT_XFERINFODATA, t);
    lib->curl_easy_setopt(curl, CURLOPT_NOPROGRESS, 0L);
    if (m->settings->ca_file[0])
        lib->curl_easy_setopt(curl, CURLOPT_CAINFO, m->settings->ca_file);
}

int push_send(const struct push_message *m, int *retry_s, char why[160])
{
    const struct sst_curl *lib;
    struct curl_slist *headers;
    char failure[256];
    curl_off_t wait_s = 0;
    struct transfer t = { .m = m, .left = 1 << 16 };
    long status = 0;
    CURLcode code;
    CURL *curl;

    lib = sst_curl_load(failure);
    if (!lib) {
        snprintf(why, 160, "%.159s", failure);
        return -ENOTSUP;
    }
    curl = lib->curl_easy_init();
    headers = curl ? headers_of(lib, m) : NULL;
    if (!headers) {
        snprintf(why, 160, "out of memory");
        if (curl)
            lib->curl_easy_cleanup(curl);
        return -ENOMEM;
    }
    set_options(lib, curl, &t, headers);
    code = lib->curl_easy_perform(curl);
    if (code == CURLE_OK) {
        lib->curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, &status);
        lib->curl_easy_getinfo(curl, CURLINFO_RETRY_AFTER, &wait_s);
    } else {
        snprintf(why, 160, "%s", t.refused ? "its address is of a private network: push: private_hosts allows that"
                                           : lib->curl_easy_strerror(code));
    }
    *retry_s = wait_s > 0 && wait_s < 1000000 ? (int)wait_s : 0;
    lib->curl_slist_free_all(headers);
    lib->curl_easy_cleanup(curl);
    return code == CURLE_OK                      ? (int)status
           : code == CURLE_ABORTED_BY_CALLBACK ? -ECANCELED
           : t.refused                         ? -EACCES
                                               : -EIO;
}

#else

int push_send(const struct push_message *m SST_UNUSED, int *retry_s SST_UNUSED, char why[160])
{
    snprintf(why, 160, "built without libcurl, GnuTLS or Nettle");
    return -ENOTSUP;
}

#endif

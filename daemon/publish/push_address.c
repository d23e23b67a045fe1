/* Addresses of push services: https, known hosts, no private networks (server-side request forgery). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>

#include "daemon/publish/publish_internal.h"
#include "daemon/publish/push_internal.h"

/* Push services of Chrome, Edge and Opera, Firefox, Safari, Edge on Windows. */
static const char *const known[] = { "fcm.googleapis.com", "push.services.mozilla.com", "push.apple.com",
                                     "notify.windows.com" };

/* It, or a name below it. */
static bool is_below(const char *host, const char *domain)
{
    const size_t n = strlen(host), m = strlen(domain);

    return m && n >= m && !strcmp(host + n - m, domain) && (n == m || host[n - m - 1] == '.');
}

static bool is_allowed(const struct sst_push_settings *s, const char *host)
{
    bool allowed = false;

    for (int i = 0; i < s->hosts; i++)
        allowed |= is_below(host, s->host[i]);
    for (size_t i = 0; !s->hosts && i < ARRAY_LEN(known); i++)
        allowed |= is_below(host, known[i]);
    return allowed;
}

int push_check_endpoint(const struct sst_push_settings *s, const char *endpoint, char origin[300], char error[512])
{
    static const char scheme[] = "https://";
    const size_t n = strlen(endpoint), head = sizeof(scheme) - 1;
    char authority[256], host[256];
    size_t length;
    int port;

    if (n >= PUSH_ENDPOINT || strncmp(endpoint, scheme, head) != 0)
        return sst_api_refuse(error, -EINVAL, "endpoint must be an address with https of %d characters at most",
                              PUSH_ENDPOINT - 1);
    for (size_t i = 0; i < n; i++)
        if (endpoint[i] <= ' ' || endpoint[i] > '~' || strchr("\"\\<>^`{|}", endpoint[i]))
            return sst_api_refuse(error, -EINVAL, "endpoint has a character that no address has");
    length = strcspn(endpoint + head, "/?#");
    snprintf(authority, sizeof(authority), "%.*s", (int)(length < 255 ? length : 255), endpoint + head);
    if (length > 255 || !length || strchr(authority, '@') || !http_host_split(authority, host, &port))
        return sst_api_refuse(error, -EINVAL, "endpoint has no host, or a user");
    if (!is_allowed(s, host))
        return sst_api_refuse(error, -EINVAL,
                              "%.128s is no push service that this service knows; list it in push: hosts to allow it", host);
    snprintf(origin, 300, "%s%s", scheme, authority);
    return 0;
}

static bool is_private_v4(uint32_t a)
{
    static const struct {
        uint32_t net;
        int bits;
    } nets[] = {
        { 0x00000000, 8 },  { 0x0a000000, 8 },  { 0x64400000, 10 }, { 0x7f000000, 8 },  { 0xa9fe0000, 16 },
        { 0xac100000, 12 }, { 0xc0000000, 24 }, { 0xc0000200, 24 }, { 0xc0586300, 24 }, { 0xc0a80000, 16 },
        { 0xc6120000, 15 }, { 0xc6336400, 24 }, { 0xcb007100, 24 }, { 0xe0000000, 4 },  { 0xf0000000, 4 },
    };
    bool found = false;

    for (size_t i = 0; i < ARRAY_LEN(nets); i++)
        found |= (a ^ nets[i].net) >> (32 - nets[i].bits) == 0;
    return found;
}

static uint32_t word(const uint8_t *p)
{
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

bool push_is_private(const struct sockaddr *address)
{
    const struct sockaddr_in *v4 = (const struct sockaddr_in *)address;
    const struct sockaddr_in6 *v6 = (const struct sockaddr_in6 *)address;
    const uint8_t *b = v6->sin6_addr.s6_addr;

    if (address->sa_family == AF_INET)
        return is_private_v4(ntohl(v4->sin_addr.s_addr));
    if (address->sa_family != AF_INET6)
        return true;
    if (IN6_IS_ADDR_V4MAPPED(&v6->sin6_addr) || (word(b) == 0x0064ff9b && !word(b + 4) && !word(b + 8))) /* NAT64 */
        return is_private_v4(word(b + 12));
    return (b[0] & 0xe0) != 0x20 ||                        /* not global unicast */
           (word(b) >> 9 == 0x20010000 >> 9) ||            /* 2001::/23 */
           word(b) == 0x20010db8 || word(b) >> 16 == 0x2002; /* documentation, 6to4 */
}

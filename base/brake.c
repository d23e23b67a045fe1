/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/brake.h"

#include <netinet/in.h>
#include <string.h>

#define MINUTE_NS INT64_C(60000000000)

void sst_brake_init(struct sst_brake *b)
{
    memset(b, 0, sizeof(*b));
    pthread_mutex_init(&b->lock, NULL);
}

void sst_brake_fini(struct sst_brake *b)
{
    pthread_mutex_destroy(&b->lock);
}

void sst_brake_network(const struct sockaddr *address, uint8_t out[16])
{
    memset(out, 0, 16);
    if (address->sa_family == AF_INET) {
        out[10] = out[11] = 0xff;
        memcpy(out + 12, &((const struct sockaddr_in *)address)->sin_addr, 4);
    } else if (address->sa_family == AF_INET6) {
        const uint8_t *v6 = ((const struct sockaddr_in6 *)address)->sin6_addr.s6_addr;
        const bool mapped = IN6_IS_ADDR_V4MAPPED(&((const struct sockaddr_in6 *)address)->sin6_addr);

        memcpy(out, v6, mapped ? 16 : 8); /* one client has a whole /64 */
    }
}

static struct sst_brake_address *find_locked(struct sst_brake *b, const uint8_t network[16])
{
    for (int i = 0; i < SST_BRAKE_ADDRESSES; i++)
        if (b->address[i].since_ns && !memcmp(b->address[i].address, network, 16))
            return &b->address[i];
    return NULL;
}

static struct sst_brake_address *add_locked(struct sst_brake *b, const uint8_t network[16])
{
    struct sst_brake_address *w = &b->address[0];

    for (int i = 1; i < SST_BRAKE_ADDRESSES; i++)
        if (b->address[i].since_ns < w->since_ns)
            w = &b->address[i];
    memset(w, 0, sizeof(*w));
    memcpy(w->address, network, 16);
    return w;
}

static int seconds(int64_t left_ns)
{
    return left_ns > 0 ? (int)((left_ns + 999999999) / 1000000000) : 0;
}

int sst_brake_wrong(struct sst_brake *b, const uint8_t who[16], int64_t now_ns, bool *first)
{
    struct sst_brake_address *w;
    int64_t left_ns;

    *first = false;
    pthread_mutex_lock(&b->lock);
    w = find_locked(b, who);
    if (!w)
        w = add_locked(b, who);
    if (now_ns >= w->until_ns) {
        if (!w->since_ns || now_ns - w->since_ns > MINUTE_NS) {
            if (now_ns - w->until_ns > 15 * MINUTE_NS)
                w->times = 0;
            w->since_ns = now_ns;
            w->count = 0;
        }
        if (++w->count > SST_BRAKE_WRONG) {
            w->until_ns = now_ns + (MINUTE_NS << sst_min_int(w->times, 4)); /* 1, 2, 4, 8, 16 minutes */
            w->times++;
            w->since_ns = w->until_ns;
            w->count = 0;
            *first = true;
        }
    }
    left_ns = w->until_ns - now_ns;
    pthread_mutex_unlock(&b->lock);
    return seconds(left_ns);
}

int64_t sst_brake_turn(struct sst_brake *b, const uint8_t who[16], int64_t now_ns)
{
    const int64_t turn_ns = SST_BRAKE_TURN_S * INT64_C(1000000000);
    struct sst_brake_address *w;
    int64_t wait_ns = 0;

    pthread_mutex_lock(&b->lock);
    w = find_locked(b, who);
    if (w && now_ns < w->until_ns) {
        wait_ns = w->turn_ns > now_ns ? w->turn_ns - now_ns : 0;
        if (wait_ns > turn_ns)
            wait_ns = -1;
        else
            w->turn_ns = now_ns + wait_ns + turn_ns;
    }
    pthread_mutex_unlock(&b->lock);
    return wait_ns;
}

/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/log_limit.h"

#include <stdio.h>
#include <string.h>

#include "base/brake.h"
#include "base/log.h"

#define MINUTE_NS INT64_C(60000000000)

void sst_log_limit_work(struct sst_log_limit *l, int64_t now_ns)
{
    for (int i = 0; i <= SST_LOG_LIMIT_ADDRESSES; i++) {
        struct sst_log_limit_address *a = &l->address[i];

        if (!a->since_ns || now_ns - a->since_ns < MINUTE_NS)
            continue;
        if (a->held)
            sst_log_warning("%s: %u more of %s within a minute", l->what, a->held,
                            i < SST_LOG_LIMIT_ADDRESSES ? a->text : "other addresses");
        a->since_ns = a->held ? now_ns : 0;
        a->held = 0;
    }
}

bool sst_log_limit_due(struct sst_log_limit *l, const struct sockaddr *from, const char *text, int64_t now_ns)
{
    struct sst_log_limit_address *to = NULL;
    uint8_t network[16];

    sst_brake_network(from, network);
    sst_log_limit_work(l, now_ns);
    for (int i = SST_LOG_LIMIT_ADDRESSES; i >= 0; i--) {
        struct sst_log_limit_address *a = &l->address[i];
        const bool others = i == SST_LOG_LIMIT_ADDRESSES;

        if (!others && a->since_ns && !memcmp(a->network, network, sizeof(network))) {
            to = a;
            break;
        }
        if (others || !a->since_ns)
            to = a;
    }
    if (to->since_ns) {
        to->held++;
        return false;
    }
    to->since_ns = now_ns;
    memcpy(to->network, network, sizeof(network));
    snprintf(to->text, sizeof(to->text), "%s", text);
    return true;
}

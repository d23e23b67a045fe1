/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "daemon/counters/counters.h"

#include <stdio.h>
#include <string.h>

#include "base/clock.h"

#define HOLDS_NS INT64_C(30000000000)

void sst_counters_init(struct sst_counters *c)
{
    memset(c, 0, sizeof(*c));
    pthread_mutex_init(&c->lock, NULL);
}

void sst_counters_fini(struct sst_counters *c)
{
    pthread_mutex_destroy(&c->lock);
}

void sst_counters_set_problem(struct sst_counters *c, enum sst_counters_publisher publisher, const char *problem)
{
    pthread_mutex_lock(&c->lock);
    snprintf(c->publisher[publisher].problem, SST_COUNTERS_PROBLEM, "%s", problem);
    pthread_mutex_unlock(&c->lock);
}

void sst_counters_set_encoder(struct sst_counters *c, const char *name)
{
    pthread_mutex_lock(&c->lock);
    snprintf(c->encoder, sizeof(c->encoder), "%s", name);
    pthread_mutex_unlock(&c->lock);
}

void sst_counters_encoder(struct sst_counters *c, char out[16])
{
    pthread_mutex_lock(&c->lock);
    memcpy(out, c->encoder, sizeof(c->encoder));
    pthread_mutex_unlock(&c->lock);
}

void sst_counters_report(struct sst_counters *c, enum sst_counters_publisher publisher, int pid, int clients,
                         const char *problem)
{
    pthread_mutex_lock(&c->lock);
    c->publisher[publisher].restarts += c->publisher[publisher].pid && c->publisher[publisher].pid != pid;
    c->publisher[publisher].pid = pid;
    c->publisher[publisher].clients = clients;
    c->publisher[publisher].until_ns = sst_clock_now_ns() + HOLDS_NS;
    snprintf(c->publisher[publisher].problem, SST_COUNTERS_PROBLEM, "%s", problem);
    pthread_mutex_unlock(&c->lock);
}

static bool holds_locked(const struct sst_counters *c, int publisher)
{
    const int64_t until_ns = c->publisher[publisher].until_ns;

    return !until_ns || sst_clock_now_ns() < until_ns;
}

int sst_counters_clients(struct sst_counters *c, enum sst_counters_publisher publisher, unsigned *restarts)
{
    int clients;

    pthread_mutex_lock(&c->lock);
    clients = holds_locked(c, publisher) ? c->publisher[publisher].clients : 0;
    *restarts = c->publisher[publisher].restarts;
    pthread_mutex_unlock(&c->lock);
    return clients;
}

bool sst_counters_problem(struct sst_counters *c, char out[SST_COUNTERS_PROBLEM])
{
    bool any = false;

    pthread_mutex_lock(&c->lock);
    for (int i = 0; i < SST_COUNTERS_PUBLISHERS && !any; i++) {
        any = c->publisher[i].problem[0] && holds_locked(c, i);
        if (any)
            memcpy(out, c->publisher[i].problem, SST_COUNTERS_PROBLEM);
    }
    pthread_mutex_unlock(&c->lock);
    return any;
}

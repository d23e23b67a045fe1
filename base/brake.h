/* base/brake.h - pauses after wrong passwords, by address: ten in a minute block it for a minute, then for longer. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_BRAKE_H
#define SST_BASE_BRAKE_H

#include <pthread.h>
#include <stdbool.h>
#include <sys/socket.h>

#include "base/base.h"

#define SST_BRAKE_WRONG     10 /* within a minute */
#define SST_BRAKE_TURN_S    4  /* between attempts of a client that is blocked; connections wait 5 s at least */
#define SST_BRAKE_ADDRESSES 64 /* remembered; the one that was quiet for longest makes room */

struct sst_brake {
    pthread_mutex_t lock;
    /* under lock */
    struct sst_brake_address {
        uint8_t address[16]; /* IPv4 mapped; of IPv6 the network */
        int64_t since_ns;    /* of the minute counted; 0: free */
        int64_t until_ns;    /* blocked until then */
        int64_t turn_ns;     /* of the next attempt while it is blocked */
        int count, times;
    } address[SST_BRAKE_ADDRESSES];
};

void sst_brake_init(struct sst_brake *b);
void sst_brake_fini(struct sst_brake *b);

/** The address that identifies a client: IPv4 as a mapped address; of IPv6 the network. */
void sst_brake_network(const struct sockaddr *address, uint8_t out[16]);

/** Count a wrong password. @param who  the address, or another identification of a client
 *  @param first  out: true if this one starts a block @return seconds left of a block, 0: none */
int sst_brake_wrong(struct sst_brake *b, const uint8_t who[16], int64_t now_ns, bool *first);

/** Reserve the turn of an attempt: at once, or, of a client that is blocked, one each SST_BRAKE_TURN_S, and one more
 * may wait for its own. @return ns to wait; -1: others wait already */
int64_t sst_brake_turn(struct sst_brake *b, const uint8_t who[16], int64_t now_ns);

#endif

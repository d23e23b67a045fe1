/* daemon/publish/push.h - notifications of visits to browsers without an open page: Web Push (RFC 8030) with VAPID (RFC 8292). */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_PUBLISH_PUSH_H
#define SST_DAEMON_PUBLISH_PUSH_H

#include <jansson.h>

#include "config/sstd.h"
#include "daemon/events/events.h"

#define SST_PUSH_MAX 64 /* subscriptions */

struct sst_push; /* opaque; any thread, but open and close */

struct sst_push_config {
    struct sst_events *events; /* must outlive the object */
    const char *beside;        /* path of a file; in its folder are push-key.pem and push.json, the service's alone */
    const struct sst_push_settings *settings; /* copied, as site and page */
    const char *site;
    const char *page; /* address of links, without a slash at its end; "": that by which the browser subscribed */
};

/** Read the subscriptions and start the thread that sends. @return 0, -ENOMEM, -EAGAIN, -ENOSPC (too many watchers) */
SST_MUST_CHECK int sst_push_open(struct sst_push **out, const struct sst_push_config *cfg);
void sst_push_configure(struct sst_push *p, const struct sst_push_settings *settings, const char *site);

/** State of notifications for a page that subscribes: {supported, reason, key, subscriptions, cool_down_s, sent, failed}. The key is made by the first
 *  call. NULL: no memory */
json_t *sst_push_state(struct sst_push *p);

/**
 * Subscribe {endpoint, p256dh, auth, labels, zones, cool_down_s}, again with another filter; or, with the endpoint of a
 * subscription, {endpoint, delete: true} or {endpoint, test: true}.
 *
 * @param request  its members are known ones @return 0, or with a sentence: -EINVAL, -ENOENT, -EOVERFLOW (there are
 * SST_PUSH_MAX), -ENOTSUP, -EIO (they cannot be stored)
 */
SST_MUST_CHECK int sst_push_change(struct sst_push *p, const json_t *request, char error[512]);

/** Start to shut down; sst_push_close() waits for the end: a transfer at work ends within a second. NULL is fine. */
void sst_push_stop(struct sst_push *p);
void sst_push_close(struct sst_push *p);

#endif

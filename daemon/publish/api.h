/* daemon/publish/api.h - the interface of the service that the HTTP server calls: one function per request. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_DAEMON_PUBLISH_API_H
#define SST_DAEMON_PUBLISH_API_H

#include <jansson.h>

#include "base/jpeg_slot.h"
#include "daemon/events/events.h"
#include "daemon/storage/download.h"
#include "daemon/visits/visits.h"

/** Answer to a request: on success an object (never NULL), else an error in one sentence. */
struct sst_api_answer {
    json_t *body;    /* on success; owned by the receiver */
    char error[512]; /* on failure: fault, place, remedy */
};

/** Pictures by name. */
enum sst_api_picture {
    SST_PICTURE_VIEW = 0,      /* rendered; name: id of a view, "main" always exists */
    SST_PICTURE_CAMERA = 1,    /* untouched JPEG of a camera (other formats: encoded); name: "rRcC" */
    SST_PICTURE_LABELS = 2,    /* of the reference view, coloured */
    SST_PICTURE_DISPARITY = 3, /* of the reference view, coloured */
};

/**
 * The service. Every call, on any thread, returns within a second, even while the service is busy. It returns 0 or
 * -EINVAL (value; 400), -ENOENT (404), -EBUSY, -EAGAIN (409), -ENOSPC, -EROFS, -EIO (507, 500), -EOVERFLOW (too many
 * views; 429), -ENODATA (nothing captured yet; 503), -ENOTSUP (501), -ENOMEM. The service validates request
 * objects; an unknown member is refused and named.
 */
struct sst_api {
    void *arg;
    void *live; /* first argument of the verbs with the parameter `live` */
    int (*status)(void *arg, struct sst_api_answer *out);
    int (*cameras)(void *arg, struct sst_api_answer *out);
    int (*labels)(void *live, struct sst_api_answer *out); /* classes, colours, labels in view */
    int (*tracks)(void *live, struct sst_api_answer *out); /* moving objects */
    int (*visits)(void *arg, const struct sst_visits_query *query, struct sst_api_answer *out);
    int (*visit_days)(void *arg, const struct sst_visits_query *query, int offset_min, struct sst_api_answer *out);
    /** {"keep": true} or false, {"reviewed": true} or false, or {"delete": true}. @param visit  NULL: names of the
     * member `visits` @param user  of the request */
    int (*visit_change)(void *arg, const char *visit, const char *user, const json_t *request,
                        struct sst_api_answer *out);
    /** @param data  out, JPEG to free with free() */
    int (*visit_picture)(void *arg, const char *visit, enum sst_visit_picture kind, uint8_t **data, size_t *size);
    int (*metrics)(void *arg, char **text); /* Prometheus; to free with free() */
    int (*views)(void *live, struct sst_api_answer *out);
    /** @param client  owner of the view, so that no client changes others' views or has all; "": one that controls,
     *  which may. The other verbs with `client` follow it */
    int (*view_create)(void *live, const char *client, const json_t *settings, struct sst_api_answer *out);
    /** -EPERM: it is another client's */
    int (*view_change)(void *live, const char *client, const char *id, const json_t *settings,
                       struct sst_api_answer *out);
    int (*pick)(void *live, const char *id, double x, double y, struct sst_api_answer *out); /* px of the picture */
    /** Remove the thing at {x, y} of the reference view from a view's clear picture, or bring it back. */
    int (*view_remove)(void *live, const char *client, const char *id, const json_t *request,
                       struct sst_api_answer *out);
    int (*reload)(void *arg, bool dry_run, struct sst_api_answer *out);
    int (*zones)(void *arg, struct sst_api_answer *out);
    int (*masks)(void *arg, struct sst_api_answer *out);
    /** Other zones as a whole; the configuration file of the page is written and applied, or nothing happens. */
    int (*zones_change)(void *arg, const json_t *request, struct sst_api_answer *out);
    int (*record)(void *arg, const json_t *request, struct sst_api_answer *out);
    int (*snapshot)(void *arg, const json_t *request, struct sst_api_answer *out);
    int (*recordings)(void *arg, struct sst_api_answer *out);
    int (*export_)(void *arg, const json_t *request, struct sst_api_answer *out);
    int (*delete_)(void *arg, const json_t *request, struct sst_api_answer *out);
    /** Videos for others, made one after the other. */
    int (*cases)(void *arg, struct sst_api_answer *out);
    int (*case_create)(void *arg, const json_t *request, struct sst_api_answer *out);
    /** {"delete": true}: also ends one that is being made. */
    int (*case_change)(void *arg, const char *name, const json_t *request, struct sst_api_answer *out);
    int (*signing_key)(void *arg, char **pem); /* public key of their manifests; to free with free() */
    /** Notifications of browsers: what a page needs to subscribe; a subscription. */
    int (*push)(void *arg, struct sst_api_answer *out);
    int (*push_change)(void *arg, const json_t *request, struct sst_api_answer *out);
    /** A report of sst-rtsp or sst-onvif. */
    int (*publisher)(void *arg, const json_t *request, struct sst_api_answer *out);
    int (*calibration_check)(void *live, struct sst_api_answer *out);
    /** Get a reference to the JPEG slot of a picture stream. @return 0, -ENOENT, -EOVERFLOW, -ENODATA */
    int (*slot)(void *live, enum sst_api_picture kind, const char *name, struct sst_slot **out);
    /** Open a recording, snapshot or export for download, by its name with an extension (.tar, .mkv ...).
     *  @param out  owned by the caller @return 0, -EINPROGRESS (being made: call again), -ENOENT, -ENODATA (nothing
     * of it was recorded), -EBUSY (it is being written), -EMFILE (too many), -ENOSPC */
    int (*download)(void *arg, const char *name, struct sst_download **out);
    /* A recording that is played, for all viewers. Its pictures come from the verbs with the parameter `live`. */
    void *replayed; /* first argument of the verbs below */
    int (*replay)(void *replayed, struct sst_api_answer *out);
    int (*replay_change)(void *replayed, const json_t *request, struct sst_api_answer *out);
    /** The argument `live`, valid until the release. @return NULL: nothing is played; no release then */
    void *(*replay_take)(void *replayed);
    void (*replay_release)(void *replayed);
    struct sst_events *events;
};

/** Check that a request is an object with members of `known` only (ends in NULL); an error suggests the nearest name.
 *  A missing request counts as an empty one. @return 0, -EINVAL (`error` is one sentence) */
SST_MUST_CHECK int sst_api_members(const json_t *request, const char *const *known, char error[512]);

/** Check one name. @param kind  "member" @return as above */
SST_MUST_CHECK int sst_api_known(const char *kind, const char *name, const char *const *known, char error[512]);

/** Write the sentence of an error. @return err */
int sst_api_refuse(char error[512], int err, const char *fmt, ...) SST_PRINTF(3, 4);

/** A JSON number; null for NaN and infinities, which JSON lacks. @return NULL: no memory */
json_t *sst_api_real(double v);

#endif

/* daemon/publish/api.h - the verbs of the service that HTTP serves. */
#ifndef SST_DAEMON_PUBLISH_API_H
#define SST_DAEMON_PUBLISH_API_H

#include <jansson.h>

#include "base/jpeg_slot.h"
#include "daemon/events/events.h"
#include "daemon/storage/download.h"

/** Answer to a request: an object that is the caller's (never NULL at 0), or an error with one sentence. */
struct sst_api_answer {
    json_t *body;    /* of success; owned by the receiver */
    char error[512]; /* of failure: what, where, remedy */
};

/** Pictures by name. */
enum sst_api_picture {
    SST_PICTURE_VIEW = 0,      /* rendered, name: a view's id, "main" always exists */
    SST_PICTURE_CAMERA = 1,    /* untouched JPEG of a camera (other formats: encoded), name: "rRcC" */
    SST_PICTURE_LABELS = 2,    /* of the reference view, coloured */
    SST_PICTURE_DISPARITY = 3, /* likewise */
};

/**
 * The service. Every call returns within a second whatever else the service does, on any thread, and returns 0 or
 * -EINVAL (a value; 400), -ENOENT (404), -EBUSY, -EAGAIN (409), -ENOSPC, -EROFS, -EIO (507, 500), -EOVERFLOW (too many
 * views; 429), -ENODATA (nothing captured yet; 503), -ENOTSUP (501), -ENOMEM. Objects that come from outside are
 * checked by the service: unknown members are refused by name.
 */
struct sst_api {
    void *arg;
    void *live; /* first argument of the verbs whose parameter is `live` */
    int (*status)(void *arg, struct sst_api_answer *out);
    int (*cameras)(void *arg, struct sst_api_answer *out);
    int (*labels)(void *live, struct sst_api_answer *out); /* classes, colours, what is present */
    int (*metrics)(void *arg, char **text);                /* Prometheus; to free with free() */
    int (*views)(void *live, struct sst_api_answer *out);
    int (*view_create)(void *live, const json_t *settings, struct sst_api_answer *out);
    int (*view_change)(void *live, const char *id, const json_t *settings, struct sst_api_answer *out);
    int (*pick)(void *live, const char *id, double x, double y, struct sst_api_answer *out); /* px of the picture */
    int (*reload)(void *arg, bool dry_run, struct sst_api_answer *out);
    int (*record)(void *arg, const json_t *request, struct sst_api_answer *out);
    int (*snapshot)(void *arg, const json_t *request, struct sst_api_answer *out);
    int (*recordings)(void *arg, struct sst_api_answer *out);
    int (*export_)(void *arg, const json_t *request, struct sst_api_answer *out);
    int (*delete_)(void *arg, const json_t *request, struct sst_api_answer *out);
    /** A report of sst-rtsp or sst-mqtt. */
    int (*publisher)(void *arg, const json_t *request, struct sst_api_answer *out);
    int (*calibration_check)(void *live, struct sst_api_answer *out);
    /** A moving picture; a reference to its outlet. @return 0, -ENOENT, -EOVERFLOW, -ENODATA */
    int (*outlet)(void *live, enum sst_api_picture kind, const char *name, struct sst_slot **out);
    /** Open something in storage, by its name and what of it (.tar, .mkv ...).
     *  @param out  the caller's @return 0, -EINPROGRESS (it is being made: call again), -ENOENT, -ENODATA (nothing of
     * it was recorded), -EBUSY (it is being written), -EMFILE (too many), -ENOSPC */
    int (*download)(void *arg, const char *name, struct sst_download **out);
    struct sst_events *events;
};

/** Refuse what is no object, and members that are none of `known` (ends in NULL), with the one that may be meant. A
 *  missing request is an empty one. @return 0, -EINVAL (`error` is one sentence) */
SST_MUST_CHECK int sst_api_members(const json_t *request, const char *const *known, char error[512]);

/** Write the sentence of an error. @return err */
int sst_api_refuse(char error[512], int err, const char *fmt, ...) SST_PRINTF(3, 4);

/** A number, or null for what is none, or infinite: JSON has neither. NULL: no memory */
json_t *sst_api_real(double v);

#endif

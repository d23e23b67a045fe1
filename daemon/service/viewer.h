/* daemon/service/viewer.h - the live picture: newest sets of the ring go through the pipeline, viewers' pictures come
 * out. */
#ifndef SST_DAEMON_SERVICE_VIEWER_H
#define SST_DAEMON_SERVICE_VIEWER_H

#include "daemon/publish/api.h"
#include "daemon/service/array.h"
#include "daemon/service/window.h"
#include "daemon/storage/storage.h"
#include "pipeline/live/live.h"

struct sst_viewer; /* opaque; any thread, but open and close */

/** From the trigger to the picture: waiting in the ring, the stages of sst_live_update(), and what follows. */
enum sst_viewer_stage {
    SST_VIEWER_WAIT = 0,                     /* from the trigger until the set is taken up */
    SST_VIEWER_LIVE = 1,                     /* SST_LIVE_STAGES of them */
    SST_VIEWER_RENDER = 1 + SST_LIVE_STAGES, /* of all pictures wanted */
    SST_VIEWER_ENCODE = 2 + SST_LIVE_STAGES,
    SST_VIEWER_STAGES = 3 + SST_LIVE_STAGES,
};

/** "wait", "change" ... */
const char *sst_viewer_stage_name(enum sst_viewer_stage stage);

struct sst_viewer_state {
    bool enabled, ready;          /* ready: see-through pictures can be made */
    char reason[512];             /* why not */
    double rate_hz;               /* sets per second, over the last ten */
    uint64_t sets, dropped, idle; /* taken in; passed over for newer ones; taken in without any change */
    uint64_t pictures;            /* encoded */
    double changed_percent;       /* tiles, over the last ten seconds */
    double cpu_percent;           /* of one core, likewise, without rendering */
    struct sst_window latency_ms, stage_ms[SST_VIEWER_STAGES]; /* of sets that changed something */
    uint64_t tiles, tiles_changed, decodes, decodes_skipped, label_runs, label_runs_skipped;
    double error_change, error_labels;           /* last sampled; NaN */
    int width, height, views, present;           /* of the light field */
    double range_min_px, range_max_px, focus_px; /* NaN: not known */
    double focal_px, spacing_mm;                 /* 0: not known */
    int64_t beat_ns;                             /* when the thread was last seen alive */
    char check[512];                             /* last verdict on the calibration */
};

struct sst_viewer_config {
    const struct sst_config *config; /* copied */
    struct sst_ring *ring;           /* these stay */
    struct sst_array *array;
    struct sst_storage *storage;
    struct sst_events *events;
};

/** Start the threads. @return 0, -ENOMEM, -EAGAIN */
SST_MUST_CHECK int sst_viewer_open(struct sst_viewer **out, const struct sst_viewer_config *cfg);

/** Other settings. @param anew  the pipeline starts anew */
void sst_viewer_configure(struct sst_viewer *v, const struct sst_config *config, bool anew);

void sst_viewer_state(struct sst_viewer *v, struct sst_viewer_state *out);

/* Verbs of struct sst_api, by the same names; `viewer` is a struct sst_viewer. */
int sst_viewer_labels(void *viewer, struct sst_api_answer *out);
int sst_viewer_views(void *viewer, struct sst_api_answer *out);
int sst_viewer_view_create(void *viewer, const json_t *settings, struct sst_api_answer *out);
int sst_viewer_view_change(void *viewer, const char *id, const json_t *settings, struct sst_api_answer *out);
int sst_viewer_pick(void *viewer, const char *id, double x, double y, struct sst_api_answer *out);
int sst_viewer_calibration_check(void *viewer, struct sst_api_answer *out);
int sst_viewer_outlet(void *viewer, enum sst_api_picture kind, const char *name, struct sst_outlet **out);

/** Ask the threads to end, their work to return early and viewers to leave. */
void sst_viewer_stop(struct sst_viewer *v);
/** @return false: something in it hangs */
SST_MUST_CHECK bool sst_viewer_join(struct sst_viewer *v, int64_t until_ns);
/** After a join. NULL is fine. */
void sst_viewer_close(struct sst_viewer *v);

#endif

/* daemon/service/service_parts.h - the state behind sst_service, shared by its files. Only for them. */
#ifndef SST_DAEMON_SERVICE_SERVICE_PARTS_H
#define SST_DAEMON_SERVICE_SERVICE_PARTS_H

#include <pthread.h>

#include "daemon/counters/counters.h"
#include "daemon/publish/hooks.h"
#include "daemon/publish/http.h"
#include "daemon/service/service.h"
#include "daemon/service/viewer.h"

struct sst_service {
    /* fixed after open */
    char path[SST_PATH_MAX]; /* of the configuration; "": the default */
    int64_t start_ns;
    struct sst_api api;
    struct sst_events *events;
    struct sst_ring *ring;
    struct sst_storage *storage;
    struct sst_array *array;
    struct sst_viewer *viewer;
    struct sst_http *http; /* set under lock: its clients send requests before it is open */
    struct sst_hooks *hooks;
    struct sst_counters counters;
    /* main thread */
    unsigned generation;    /* of the layout that storage knows */
    int64_t wall_offset_ns; /* wall less monotonic */
    int64_t cpu_ns, cpu_at_ns;
    struct sst_array_state array_now; /* as looked at last: too large for a stack */
    struct sst_viewer_state viewer_now;
    pthread_mutex_t reload; /* held while the configuration is read again and applied, by whoever asked for it */
    pthread_mutex_t parts;  /* held while they are told a configuration */
    bool open;              /* under parts: all of them are there */
    /* under lock */
    pthread_mutex_t lock;
    struct sst_config config;
    enum sst_service_phase phase;
    char reason[512];
    double cpu_percent; /* of the process, over the last seconds */
    int64_t refused_ns; /* when a wrong password was last reported */
};

/* api.c */
void sst_service_api(struct sst_service *s);

/* status.c */
int sst_service_status(void *arg, struct sst_api_answer *out);
int sst_service_cameras(void *arg, struct sst_api_answer *out);

/** The certificate of HTTPS. @param days  out, left of it; negative: it has ended
 *  @return its end, seconds since 1970; 0: there is none */
int64_t sst_service_certificate(const struct sst_service *s, double *days);

/* metrics.c */
int sst_service_metrics(void *arg, char **text);

/* reload.c */
int sst_service_apply(void *arg, bool dry_run, struct sst_api_answer *out);

/** Resident memory and open descriptors of this process. */
void sst_service_process(uint64_t *rss_bytes, int *descriptors);

/** Storage is told where the see-through view comes from, once there is one. */
void sst_service_record_view(struct sst_service *s);

#endif

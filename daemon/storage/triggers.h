/* daemon/storage/triggers.h - when something is seen for long enough to be told and recorded. No input or output. */
#ifndef SST_DAEMON_STORAGE_TRIGGERS_H
#define SST_DAEMON_STORAGE_TRIGGERS_H

#include "config/sstd.h"

/* Something is seen when its share is reached, and still seen down to half of that. What is seen begins when that was
 * so for begin_s, and ends when it was not for end_s, in two sets at least; sets that say otherwise meanwhile take as
 * much time off again, and one odd set never changes anything. */
#define SST_WATCH_BEGIN_S 0.3
#define SST_WATCH_END_S   1.0
#define SST_WATCH_KEEPS   0.5
#define SST_WATCH_SHARE   0.02 /* of zones that no trigger names */
/* Changes that come again and again are told as one: each that begins within the first of these after the last one was
 * told to have ended doubles how long nothing must be seen for that, up to the second. Labels are told each time. */
#define SST_WATCH_AGAIN_NS 10000000000
#define SST_WATCH_HOLD_NS  60000000000
#define SST_WATCHES_MAX    (SST_TRIGGERS_MAX + SST_ZONES_MAX)

/** Something looked for: a change or a label, in a zone or in the whole picture. */
struct sst_watch {
    char zone[32], label[64]; /* "": the whole picture; any change */
    int trigger;              /* of the configuration: recording follows it; -1: it is only told */
    int index;                /* of the zone in what was seen; -1: the whole picture */
    double share;
    double begin_s, end_s; /* above 0; else those above */
    /* what is seen: recordings follow it */
    bool active;
    int sets;          /* in a row that speak for the other state, but for odd ones */
    int64_t t_ns;      /* set.t_ns of the last set */
    int64_t since_ns;  /* of the first set for the other state */
    int64_t weight_ns; /* time that speaks for it */
    int64_t begin_ns;  /* first set of the active state */
    int64_t last_ns;   /* last set that reached what keeps it */
    /* what is told of it */
    bool told;
    int64_t told_ns; /* begin_ns when it was told to have begun; when to have ended */
    int64_t hold_ns; /* nothing is seen for so long before it is told to have ended */
    int times;       /* it became active since it was told to have begun */
    bool was_active; /* at the last look */
    double peak;     /* largest share since then */
};

struct sst_watches {
    int count;
    struct sst_watch watch[SST_WATCHES_MAX];
};

/** The configuration's triggers, and changes in every zone that none of them names. Nothing is active. */
void sst_watches_init(struct sst_watches *w, const struct sst_config *config);

/** A value in a set; NaN counts as 0. @return true: active changed */
bool sst_watch_update(struct sst_watch *w, double value, int64_t t_ns);

/** After an update: is it to be told to have begun or ended (w->told)?  @return true: that changed */
bool sst_watch_tell(struct sst_watch *w, double value, int64_t t_ns);

/** How something stands goes on under other settings. */
void sst_watch_go_on(struct sst_watch *w, const struct sst_watch *before);

#endif

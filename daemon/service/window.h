/* daemon/service/window.h - the last values of something that is measured again and again, and their percentiles. */
#ifndef SST_DAEMON_SERVICE_WINDOW_H
#define SST_DAEMON_SERVICE_WINDOW_H

#include "base/base.h"

#define SST_WINDOW 512

/** Zeroed: empty. The caller locks. */
struct sst_window {
    uint64_t count; /* ever */
    double sum;     /* of all ever */
    float value[SST_WINDOW];
};

void sst_window_add(struct sst_window *w, double value);
/** Of the last SST_WINDOW values; 0 of an empty one. @param q  0..1, 1: the largest */
double sst_window_quantile(const struct sst_window *w, double q);

#endif

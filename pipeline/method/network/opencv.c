/* opencv_net.cc is in a part of its own, libsst-opencv.so. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "base/plugin.h"
#include "pipeline/method/network/opencv_net.h"

int cv_net_open(struct cv_net **out, const uint8_t *data, size_t size, char why[256])
{
#define LOAD(function) sst_plugin_symbol("opencv", function, why)
    SST_PLUGIN_CALL(LOAD, cv_net_open, out, data, size, why);
}

void cv_net_close(struct cv_net *net)
{
    char why[256];
    void (*loaded)(struct cv_net *) = NULL;

    if (net)
        *(void **)&loaded = sst_plugin_symbol("opencv", "cv_net_close", why);
    if (loaded)
        loaded(net);
}

int cv_net_run(struct cv_net *net, const struct cv_net_input *in, const float **result, int shape[3], char why[256])
{
    SST_PLUGIN_CALL(LOAD, cv_net_run, net, in, result, shape, why);
}

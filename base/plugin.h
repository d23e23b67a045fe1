/* base/plugin.h - loads parts of the program on first use: libsst-NAME.so beside the program, or in SST_PLUGINDIR
 * (lib/sst) beside its folder. They depend on libraries that load slowly and that most runs do not need. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_PLUGIN_H
#define SST_BASE_PLUGIN_H

#include "base/base.h"

/** Address of a function of a part; loads the part. @param why  out, cause of a failure. @return NULL: failed.
 *  Thread: any */
void *sst_plugin_symbol(const char *name, const char *symbol, char why[256]);

/** Body of a wrapper: calls the function of the same name in a part; -ENOTSUP if load(its name) returns NULL. */
#define SST_PLUGIN_CALL(load, function, ...)                                                                           \
    __typeof__(&(function)) loaded;                                                                                    \
                                                                                                                       \
    *(void **)&loaded = load(#function);                                                                               \
    return loaded ? loaded(__VA_ARGS__) : -ENOTSUP

#endif

/* base/plugin.h - parts of the program that are loaded when they are first used: libsst-NAME.so beside the program, or
 * in lib/ beside its folder. They bring libraries that take long to load and that most runs never need. */
#ifndef SST_BASE_PLUGIN_H
#define SST_BASE_PLUGIN_H

#include "base/base.h"

/** Function of a part; loads it. @param why  why not, in a few words. @return NULL: cannot be loaded. Thread: any */
void *sst_plugin_symbol(const char *name, const char *symbol, char why[256]);

/** Body of a function that is in a part: its result there, -ENOTSUP if load(its name) returns NULL. */
#define SST_PLUGIN_CALL(load, function, ...)                                                                           \
    __typeof__(&(function)) loaded;                                                                                    \
                                                                                                                       \
    *(void **)&loaded = load(#function);                                                                               \
    return loaded ? loaded(__VA_ARGS__) : -ENOTSUP

#endif

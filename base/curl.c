/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "base/curl.h"

#if WITH_CURL

#include <dlfcn.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>

static struct sst_curl lib; /* fixed after open_library() */
static char failure[256];   /* "": loaded */

static void open_library(void)
{
    void *library = dlopen(SST_CURL_LIBRARY, RTLD_NOW | RTLD_LOCAL);
    bool whole = true;

    if (!library) {
        snprintf(failure, sizeof(failure), "cannot load " SST_CURL_LIBRARY ": %.120s; install the package that has it", dlerror());
        return;
    }
#define X(name)                                                                                                        \
    *(void **)&lib.name = dlsym(library, #name);                                                                       \
    whole = whole && lib.name;
    SST_CURL_FUNCTIONS(X)
#undef X
    if (!whole)
        snprintf(failure, sizeof(failure), SST_CURL_LIBRARY " is of another version: functions are missing");
    else if (lib.curl_global_init(CURL_GLOBAL_DEFAULT))
        snprintf(failure, sizeof(failure), SST_CURL_LIBRARY " cannot be initialized");
}

const struct sst_curl *sst_curl_load(char why[256])
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;

    pthread_once(&once, open_library);
    if (failure[0])
        snprintf(why, sizeof(failure), "%s", failure);
    return failure[0] ? NULL : &lib;
}

#endif

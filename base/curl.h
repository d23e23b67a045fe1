/* base/curl.h - libcurl, loaded when it is first used: with the libraries that it needs it would take a third of every start of
 * sst. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_CURL_H
#define SST_BASE_CURL_H

#include "base/base.h"

#if WITH_CURL

#include <curl/curl.h>

#undef curl_easy_setopt
#undef curl_easy_getinfo

#define SST_CURL_FUNCTIONS(X)                                                                                          \
    X(curl_global_init)                                                                                                \
    X(curl_easy_init)                                                                                                  \
    X(curl_easy_setopt)                                                                                                \
    X(curl_easy_perform)                                                                                               \
    X(curl_easy_getinfo)                                                                                               \
    X(curl_easy_strerror)                                                                                              \
    X(curl_easy_cleanup)                                                                                               \
    X(curl_slist_append)                                                                                               \
    X(curl_slist_free_all)

/** Functions of the library, by their names. */
struct sst_curl {
#define X(name) __typeof__(&(name)) name;
    SST_CURL_FUNCTIONS(X)
#undef X
};

/** The library, initialized. @param why  out, a sentence; with NULL alone @return NULL: it is not there, or of another version.
 *  Thread: any */
const struct sst_curl *sst_curl_load(char why[256]);

#endif

#endif

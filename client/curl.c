/* The functions of libcurl that client.c calls. They load it when first called: with the libraries that it needs, it
 * would take a third of every start of sst. */
#include <curl/curl.h>
#include <dlfcn.h>
#include <pthread.h>
#include <stdarg.h>

#include "base/log.h"

#undef curl_easy_setopt
#undef curl_easy_getinfo

#define FUNCTIONS(X)                                                                                                   \
    X(curl_global_init)                                                                                                \
    X(curl_easy_init)                                                                                                  \
    X(curl_easy_setopt)                                                                                                \
    X(curl_easy_perform)                                                                                               \
    X(curl_easy_getinfo)                                                                                               \
    X(curl_easy_strerror)                                                                                              \
    X(curl_easy_cleanup)                                                                                               \
    X(curl_slist_append)                                                                                               \
    X(curl_slist_free_all)

static struct {
#define X(name) __typeof__(&(name)) name;
    FUNCTIONS(X)
#undef X
} curl; /* fixed after load() */
static bool loaded;
static pthread_once_t once = PTHREAD_ONCE_INIT;

static void load(void)
{
    void *library = dlopen(SST_CURL_LIBRARY, RTLD_NOW | RTLD_LOCAL);

    if (!library) {
        sst_log_error("cannot load %s: %s; install the package that has it", SST_CURL_LIBRARY, dlerror());
        return;
    }
    loaded = true;
#define X(name)                                                                                                        \
    *(void **)&curl.name = dlsym(library, #name);                                                                      \
    loaded = loaded && curl.name;
    FUNCTIONS(X)
#undef X
    if (!loaded)
        sst_log_error("%s is of another version: functions are missing", SST_CURL_LIBRARY);
}

/* Called first; where it fails, client.c calls none of the others. */
CURLcode curl_global_init(long flags)
{
    pthread_once(&once, load);
    return loaded ? curl.curl_global_init(flags) : CURLE_FAILED_INIT;
}

CURL *curl_easy_init(void)
{
    return curl.curl_easy_init();
}

/* The one argument is a long, a curl_off_t or a pointer: one register on the 64-bit systems that sst runs on. */
CURLcode curl_easy_setopt(CURL *handle, CURLoption option, ...)
{
    void *value;
    va_list args;

    va_start(args, option);
    value = va_arg(args, void *);
    va_end(args);
    return curl.curl_easy_setopt(handle, option, value);
}

CURLcode curl_easy_getinfo(CURL *handle, CURLINFO info, ...)
{
    void *value;
    va_list args;

    va_start(args, info);
    value = va_arg(args, void *);
    va_end(args);
    return curl.curl_easy_getinfo(handle, info, value);
}

CURLcode curl_easy_perform(CURL *handle)
{
    return curl.curl_easy_perform(handle);
}

const char *curl_easy_strerror(CURLcode code)
{
    return curl.curl_easy_strerror(code);
}

void curl_easy_cleanup(CURL *handle)
{
    if (loaded)
        curl.curl_easy_cleanup(handle);
}

struct curl_slist *curl_slist_append(struct curl_slist *list, const char *text)
{
    return curl.curl_slist_append(list, text);
}

void curl_slist_free_all(struct curl_slist *list)
{
    if (loaded)
        curl.curl_slist_free_all(list);
}

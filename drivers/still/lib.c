/* Loader of lib_gphoto.c, the part libsst-gphoto.so: libgphoto2 would make every start of sst 5 ms longer. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>

#include "base/plugin.h"
#include "drivers/still/still_internal.h"

static char why[256]; /* why the part cannot be loaded; written at the first call, which opens a camera */

static void *load(const char *function)
{
    return sst_plugin_symbol("gphoto", function, why);
}

/* Define a function that calls the one of its name in the part. */
#define LOADED(function, parameters, arguments)                                                                        \
    int function parameters                                                                                            \
    {                                                                                                                  \
        __typeof__(&(function)) loaded;                                                                                \
                                                                                                                       \
        *(void **)&loaded = load(#function);                                                                           \
        return loaded ? loaded arguments : -ENOPKG;                                                                    \
    }

LOADED(still_lib_open, (struct still_lib * *out, int bus, int address, int response_ms),
       (out, bus, address, response_ms))
LOADED(still_lib_read, (struct still_lib * lib, const char *name, struct still_setting *out), (lib, name, out))
LOADED(still_lib_write, (struct still_lib * lib, const char *name, const char *value), (lib, name, value))
LOADED(still_lib_storage, (struct still_lib * lib, struct sst_still_state *state), (lib, state))
LOADED(still_lib_release, (struct still_lib * lib), (lib))
LOADED(still_lib_event, (struct still_lib * lib, int timeout_ms, struct still_path *path), (lib, timeout_ms, path))
LOADED(still_lib_list, (struct still_lib * lib, struct still_path **list, int *count), (lib, list, count))
LOADED(still_lib_size, (struct still_lib * lib, const struct still_path *path, size_t *bytes), (lib, path, bytes))
LOADED(still_lib_download, (struct still_lib * lib, const struct still_path *path, uint8_t **data, size_t *bytes),
       (lib, path, data, bytes))
LOADED(still_lib_delete, (struct still_lib * lib, const struct still_path *path), (lib, path))

void still_lib_close(struct still_lib *lib)
{
    __typeof__(&still_lib_close) loaded = NULL;

    if (lib)
        *(void **)&loaded = load("still_lib_close");
    if (loaded)
        loaded(lib);
}

const char *still_lib_said(const struct still_lib *lib)
{
    __typeof__(&still_lib_said) loaded = NULL;

    if (lib)
        *(void **)&loaded = load("still_lib_said");
    return loaded ? loaded(lib) : why;
}

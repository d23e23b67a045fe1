/* Loader of lib_gphoto.c, the part libsst-gphoto.so: libgphoto2 would make every start of sst 5 ms longer. */
#include <errno.h>
#include <string.h>

#include "base/plugin.h"
#include "drivers/still/still_internal.h"

static char why[256]; /* why the part cannot be loaded; written at the first call, which opens a camera */

static void *load(const char *function)
{
    return sst_plugin_symbol("gphoto", function, why);
}

#define CALL(function, ...)                                                                                            \
    __typeof__(&(function)) loaded;                                                                                    \
                                                                                                                       \
    *(void **)&loaded = load(#function);                                                                               \
    return loaded ? loaded(__VA_ARGS__) : -ENOPKG

int still_lib_open(struct still_lib **out, int bus, int address, int response_ms)
{
    CALL(still_lib_open, out, bus, address, response_ms);
}

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

int still_lib_read(struct still_lib *lib, const char *name, struct still_setting *out)
{
    CALL(still_lib_read, lib, name, out);
}

int still_lib_write(struct still_lib *lib, const char *name, const char *value)
{
    CALL(still_lib_write, lib, name, value);
}

int still_lib_storage(struct still_lib *lib, struct sst_still_state *state)
{
    CALL(still_lib_storage, lib, state);
}

int still_lib_release(struct still_lib *lib)
{
    CALL(still_lib_release, lib);
}

int still_lib_event(struct still_lib *lib, int timeout_ms, struct still_path *path)
{
    CALL(still_lib_event, lib, timeout_ms, path);
}

int still_lib_list(struct still_lib *lib, struct still_path **list, int *count)
{
    CALL(still_lib_list, lib, list, count);
}

int still_lib_size(struct still_lib *lib, const struct still_path *path, size_t *bytes)
{
    CALL(still_lib_size, lib, path, bytes);
}

int still_lib_download(struct still_lib *lib, const struct still_path *path, uint8_t **data, size_t *bytes)
{
    CALL(still_lib_download, lib, path, data, bytes);
}

int still_lib_delete(struct still_lib *lib, const struct still_path *path)
{
    CALL(still_lib_delete, lib, path);
}

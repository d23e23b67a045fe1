/* Built without libgphoto2: cameras are listed, but not opened. */
#include "drivers/still/still_internal.h"

#if !WITH_GPHOTO2
#include <errno.h>

int still_lib_open(struct still_lib **out SST_UNUSED, int bus SST_UNUSED, int address SST_UNUSED,
                   int response_ms SST_UNUSED)
{
    return -ENOPKG;
}

void still_lib_close(struct still_lib *lib SST_UNUSED)
{
}

const char *still_lib_said(const struct still_lib *lib SST_UNUSED)
{
    return "";
}

int still_lib_read(struct still_lib *lib SST_UNUSED, const char *name SST_UNUSED, struct still_setting *out SST_UNUSED)
{
    return -ENOPKG;
}

int still_lib_write(struct still_lib *lib SST_UNUSED, const char *name SST_UNUSED, const char *value SST_UNUSED)
{
    return -ENOPKG;
}

int still_lib_storage(struct still_lib *lib SST_UNUSED, struct sst_still_state *state SST_UNUSED)
{
    return -ENOPKG;
}

int still_lib_release(struct still_lib *lib SST_UNUSED)
{
    return -ENOPKG;
}

int still_lib_event(struct still_lib *lib SST_UNUSED, int timeout_ms SST_UNUSED, struct still_path *path SST_UNUSED)
{
    return -ENOPKG;
}

int still_lib_size(struct still_lib *lib SST_UNUSED, const struct still_path *path SST_UNUSED, size_t *bytes SST_UNUSED)
{
    return -ENOPKG;
}

int still_lib_download(struct still_lib *lib SST_UNUSED, const struct still_path *path SST_UNUSED,
                       uint8_t **data SST_UNUSED, size_t *bytes SST_UNUSED)
{
    return -ENOPKG;
}

int still_lib_delete(struct still_lib *lib SST_UNUSED, const struct still_path *path SST_UNUSED)
{
    return -ENOPKG;
}
#endif

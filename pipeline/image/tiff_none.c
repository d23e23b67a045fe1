/* TIFF files of builds without libtiff. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "base/log.h"
#include "pipeline/image/image_internal.h"

static int refuse(const char *name)
{
    sst_log_error("%s: this build has no TIFF; install libtiff-dev and build again, or convert it to PNG", name);
    return -EBADMSG;
}

int tiff_decode(struct sst_deep *out SST_UNUSED, const uint8_t *data SST_UNUSED, size_t size SST_UNUSED,
                const char *name)
{
    return refuse(name);
}

int tiff_size(struct sst_deep_size *out SST_UNUSED, const uint8_t *data SST_UNUSED, size_t size SST_UNUSED,
              const char *name)
{
    return refuse(name);
}

int tiff_decode_grid(struct sst_map_f32 *grid SST_UNUSED, struct tiff_geo *geo SST_UNUSED,
                     const uint8_t *data SST_UNUSED, size_t size SST_UNUSED, const char *name)
{
    return refuse(name);
}

int tiff_write(const struct sst_deep *deep SST_UNUSED, const char *path)
{
    return refuse(path);
}

/* Checks of a downloaded file. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>

#include <turbojpeg.h>

#include "drivers/still/still.h"

/* Decoded to an eighth of its size: all coded data are read, and little is computed. */
#define SCALE      8
#define MAX_PIXELS ((size_t)1 << 28)

static int decode(tjhandle tj, const uint8_t *data, size_t bytes, int width, int height)
{
    const int w = (width + SCALE - 1) / SCALE, h = (height + SCALE - 1) / SCALE;
    uint8_t *luma = malloc((size_t)w * (size_t)h);
    int err = -ENOMEM;

    if (luma)
        err = tjDecompress2(tj, data, bytes, luma, w, w, h, TJPF_GRAY, TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS)
                  ? -EBADMSG
                  : 0;
    free(luma);
    return err;
}

int sst_still_check_jpeg(const uint8_t *data, size_t bytes, int *width, int *height)
{
    tjhandle tj;
    int w, h, subsampling, colours, err = -EBADMSG;

    if (bytes < 4 || data[0] != 0xff || data[1] != 0xd8)
        return -EBADMSG;
    tj = tjInitDecompress();
    if (!tj)
        return -ENOMEM;
    if (!tjDecompressHeader3(tj, data, bytes, &w, &h, &subsampling, &colours) && w > 0 && h > 0 &&
        (size_t)w * (size_t)h <= MAX_PIXELS)
        err = decode(tj, data, bytes, w, h);
    tjDestroy(tj);
    if (err)
        return err;
    *width = w;
    *height = h;
    return 0;
}

/* Cutter of split JPEGs for the cameras of this host. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "base/text.h"
#include "capture/array/array_internal.h"
#include "pipeline/image/jpeg_split.h"

static int create(void **state)
{
    struct sst_jpeg_split *split = NULL;
    const int err = sst_jpeg_split_create(&split);

    *state = split;
    return err;
}

static void destroy(void *state)
{
    sst_jpeg_split_destroy(state);
}

static int read_whole(void *state, const struct sst_grab_whole *whole, char *why, size_t size)
{
    const struct sst_jpeg_grid grid = { whole->split.rows, whole->split.cols, whole->width, whole->height };

    return sst_jpeg_split_read(state, (struct sst_jpeg_bytes){ whole->data, whole->bytes }, &grid, why, size);
}

static int cut(void *state, int part, struct sst_grab_piece *out, char *why, size_t size)
{
    struct sst_jpeg_bytes piece;
    const int err = sst_jpeg_split_cut(state, part, &piece);

    if (err == -ENOTSUP) {
        *why = 0;
        sst_text_add(why, size,
                     "its JPEGs have Huffman codes of their own, which cannot be cut into cameras; set cameras: format "
                     "to another one");
        return -EINVAL;
    }
    if (!err)
        *out = (struct sst_grab_piece){ piece.data, piece.bytes };
    return err;
}

const struct sst_grab_cutter array_jpeg_cutter = { create, destroy, read_whole, cut };

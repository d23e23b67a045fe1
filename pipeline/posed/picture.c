/* Pictures of a posed light field, read by its hashes. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/posed/picture.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/log.h"
#include "pipeline/kernels/sha256.h"
#include "pipeline/posed/posed_internal.h"

#define KEEP_PART 4 /* of the memory: one such part is kept at most */

static int check(const struct sst_posed *posed, const struct sst_deep *deep, const char *path)
{
    const int bits = deep->white > 255 ? 16 : 8;

    if (deep->width == posed->width && deep->height == posed->height && deep->channels == posed->channels &&
        bits == posed->bits)
        return 0;
    sst_log_error("%s has %dx%d pixels of %d x %d bits, its light field %dx%d of %d x %d; import the pictures again",
                  path, deep->width, deep->height, deep->channels, bits, posed->width, posed->height, posed->channels,
                  posed->bits);
    return -EBADMSG;
}

static int copy(struct sst_deep *out, const struct sst_deep *in)
{
    const int err = sst_deep_init(out, in->width, in->height, in->channels, in->white);

    for (int c = 0; c < in->channels && !err; c++)
        memcpy(out->plane[c].data, in->plane[c].data, in->plane[c].stride * (size_t)in->height);
    if (err)
        sst_log_error("no memory for a picture of %d x %d", in->width, in->height);
    return err;
}

int sst_posed_picture(struct sst_deep *out, const struct sst_posed *posed, const char *dir, int view)
{
    const struct sst_posed_view *v = &posed->view[view];
    char path[SST_PATH_MAX], hash[65];
    struct sst_deep made;
    uint8_t *data;
    size_t size;
    int err;

    if (posed->picture)
        return copy(out, &posed->picture[view]);
    if (posed->kept && posed->kept[view].width)
        return copy(out, &posed->kept[view]);
    err = posed_read_view(path, &data, &size, v, dir);
    if (err)
        return err;
    /* A file that cannot be decoded is reported as such, not as one that has changed. */
    err = sst_deep_decode(&made, data, size, path);
    sst_sha256_hex(hash, data, size);
    free(data);
    if (err)
        return err;
    err = check(posed, &made, path);
    if (!err && v->sha256[0] && strcmp(hash, v->sha256)) {
        sst_log_error("%s has changed since it was stored (its SHA-256 differs); import the pictures again", path);
        err = -EBADMSG;
    }
    if (err)
        sst_deep_fini(&made);
    else
        *out = made;
    return err;
}

/* Bytes of memory: the machine's, or fewer that the process is limited to. */
static double memory_bytes(void)
{
    const double all = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    struct rlimit limit;

    return !getrlimit(RLIMIT_AS, &limit) && limit.rlim_cur != RLIM_INFINITY ? fmin(all, (double)limit.rlim_cur) : all;
}

void sst_posed_keep(struct sst_posed *posed, double most)
{
    const double bytes = 2.0 * sst_posed_placed(posed) * posed->width * posed->height * posed->channels;

    if (!posed->picture && !posed->kept && bytes <= most && bytes <= memory_bytes() / KEEP_PART)
        posed->kept = calloc((size_t)posed->count, sizeof(*posed->kept));
}

int sst_posed_borrow(const struct sst_deep **out, struct sst_deep *own, const struct sst_posed *posed, const char *dir,
                     int view)
{
    struct sst_deep *to = posed->kept ? &posed->kept[view] : own;
    const bool there = posed->picture || (posed->kept && to->width);
    const int err = there ? 0 : sst_posed_picture(to, posed, dir, view);

    if (!err)
        *out = posed->picture ? &posed->picture[view] : to;
    return err;
}

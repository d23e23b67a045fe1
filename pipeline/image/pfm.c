/* PFM: "Pf", width height, scale (its sign is the byte order: negative is little-endian), rows from the bottom up. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/image/codec.h"
#include "pipeline/image/codec_formats.h"

struct header {
    long width, height;
    bool little_endian;
    const uint8_t *pixels;
};

static int malformed(const char *path, const char *what)
{
    sst_log_error("%s is not a one-channel PFM file: %s", path, what);
    return -EBADMSG;
}

/* The file is NUL-terminated in memory, so number parsing stops at its end. */
static int read_header(struct header *h, const uint8_t *data, size_t size, const char *path)
{
    const char *p = (const char *)data + 2;
    char *end;
    double scale;

    if (size < 2 || memcmp(data, "Pf", 2))
        return malformed(path,
                         size >= 2 && !memcmp(data, "PF", 2) ? "it has three channels" : "it does not begin with Pf");
    errno = 0;
    h->width = strtol(p, &end, 10);
    if (end == p || !isspace((unsigned char)*p))
        return malformed(path, "the width is missing");
    p = end;
    h->height = strtol(p, &end, 10);
    if (end == p || !isspace((unsigned char)*p))
        return malformed(path, "the height is missing");
    p = end;
    scale = strtod(p, &end);
    if (end == p || !isspace((unsigned char)*p) || !isfinite(scale) || scale == 0)
        return malformed(path, "the scale is missing or 0");
    if (end[0] == '\r' && end[1] == '\n')
        end++;
    if (!isspace((unsigned char)*end))
        return malformed(path, "the header does not end in a line break");
    h->pixels = (const uint8_t *)end + 1;
    h->little_endian = scale < 0;
    return 0;
}

static float load_float(const uint8_t *p, bool little_endian)
{
    uint32_t bits = 0;
    float v;

    for (int i = 0; i < 4; i++)
        bits |= (uint32_t)p[i] << 8 * (little_endian ? i : 3 - i);
    memcpy(&v, &bits, sizeof(v));
    return v;
}

static int read_rows(struct sst_map_f32 *map, const struct header *h, const char *path)
{
    for (int y = 0; y < map->height; y++) {
        const uint8_t *in = h->pixels + (size_t)(map->height - 1 - y) * (size_t)map->width * 4;
        float *out = sst_map_f32_row(map, y);

        for (int x = 0; x < map->width; x++) {
            out[x] = load_float(in + (size_t)x * 4, h->little_endian);
            if (isnan(out[x])) {
                sst_log_error("%s has a NaN at column %d, row %d; mark unknown values as inf", path, x, y);
                return -EBADMSG;
            }
        }
    }
    return 0;
}

int sst_map_f32_read_pfm(struct sst_map_f32 *map, const char *path)
{
    struct sst_map_f32 made = { 0 };
    struct header h;
    uint8_t *data;
    size_t size, have, want;
    int err = sst_file_read(path, SST_IMAGE_MAX_BYTES, &data, &size);

    if (err)
        return err;
    err = read_header(&h, data, size, path);
    if (err)
        goto out;
    if (h.width < 1 || h.height < 1 || h.width > SST_IMAGE_MAX_SIDE || h.height > SST_IMAGE_MAX_SIDE ||
        (size_t)h.width * (size_t)h.height > SST_IMAGE_MAX_PIXELS) {
        err = sst_image_size_error(-EINVAL, path, h.width, h.height);
        goto out;
    }
    have = size - (size_t)(h.pixels - data);
    want = (size_t)h.width * (size_t)h.height * 4;
    if (have != want) {
        sst_log_error("%s is %s: %ldx%ld pixels take %zu bytes and %zu are there; write it again", path,
                      have < want ? "truncated" : "too long", h.width, h.height, want, have);
        err = -EBADMSG;
        goto out;
    }
    err = sst_map_f32_init(&made, (int)h.width, (int)h.height);
    if (err) {
        err = sst_image_size_error(err, path, h.width, h.height);
        goto out;
    }
    err = read_rows(&made, &h, path);
    if (!err) {
        *map = made;
        made = (struct sst_map_f32){ 0 };
    }

out:
    sst_map_f32_fini(&made);
    free(data);
    return err;
}

int sst_map_f32_write_pfm(const struct sst_map_f32 *map, const char *path)
{
    const size_t row_bytes = (size_t)map->width * 4, size = row_bytes * (size_t)map->height;
    char *data = malloc(size + 64);
    int n, err;

    if (!data)
        return sst_image_size_error(-ENOMEM, path, map->width, map->height);
    n = snprintf(data, 64, "Pf\n%d %d\n%s\n", map->width, map->height,
                 __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? "-1.0" : "1.0");
    for (int y = 0; y < map->height; y++)
        memcpy(data + n + (size_t)(map->height - 1 - y) * row_bytes, sst_map_f32_row(map, y), row_bytes);
    err = sst_file_write(path, data, (size_t)n + size);
    free(data);
    return err;
}

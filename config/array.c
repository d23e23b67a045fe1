/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "config/array.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "config/config_internal.h"

const char *const sst_format_names[SST_FORMATS] = { "MJPEG", "YUYV",  "GREY",  "Y16",  "BGGR8",
                                                     "GBRG8", "GRBG8", "RGGB8", "RGB24" };
static const char format_codes[SST_FORMATS][5] = { "MJPG", "YUYV", "GREY", "Y16 ", "BA81", "GBRG", "GRBG", "RGGB", "RGB3" };

static uint32_t fourcc_of(const char code[5])
{
    return (uint32_t)code[0] | (uint32_t)code[1] << 8 | (uint32_t)code[2] << 16 | (uint32_t)code[3] << 24;
}

uint32_t sst_array_format(const char *name)
{
    for (size_t i = 0; i < ARRAY_LEN(sst_format_names); i++)
        if (!strcasecmp(name, sst_format_names[i]) || !strncmp(name, format_codes[i], 4))
            return fourcc_of(format_codes[i]);
    return strcasecmp(name, "JPEG") ? 0 : fourcc_of(format_codes[0]); /* drivers name it either way */
}

const char *sst_array_format_name(uint32_t fourcc)
{
    for (size_t i = 0; i < ARRAY_LEN(sst_format_names); i++)
        if (fourcc_of(format_codes[i]) == fourcc)
            return sst_format_names[i];
    return NULL;
}

int sst_array_count(const struct sst_array_config *cfg, enum sst_config_kind kind)
{
    int n = 0;

    for (int i = 0; i < cfg->bound; i++)
        n += cfg->camera[i].kind == kind;
    return n;
}

bool sst_array_triggered(const struct sst_array_config *cfg)
{
    if (cfg->role == SST_CONFIG_HEAD || cfg->source == SST_CONFIG_GPIO || cfg->source == SST_CONFIG_EXTERNAL)
        return true;
    return cfg->source == SST_CONFIG_SOFTWARE && cfg->bound && !sst_array_count(cfg, SST_CONFIG_V4L2) &&
           (cfg->genicam.trigger == SST_CONFIG_COMMAND || cfg->genicam.trigger == SST_CONFIG_ACTION);
}

bool sst_array_same_masks(const struct sst_array_config *a, const struct sst_array_config *b)
{
    bool same = a->masks == b->masks && !strcmp(a->mask_calibration, b->mask_calibration) &&
                a->mask_stamp == b->mask_stamp;

    for (int i = 0; same && i < a->masks; i++) {
        const struct sst_config_mask *m = &a->mask[i], *n = &b->mask[i];

        same = m->row == n->row && m->col == n->col && m->x0 == n->x0 && m->y0 == n->y0 && m->x1 == n->x1 &&
               m->y1 == n->y1 && m->near_px == n->near_px && m->far_px == n->far_px && !strcmp(m->points, n->points);
    }
    return same;
}

void sst_array_config_defaults(struct sst_array_config *cfg)
{
    int count;
    const struct sst_key *keys = sst_schema(&count);

    _Static_assert(offsetof(struct sst_config, array) == 0, "the array's keys lie in an array alone, too");
    memset(cfg, 0, sizeof(*cfg));
    for (int i = 0; i < count; i++)
        if (sst_key_of_array(&keys[i]))
            sst_key_set_default(&keys[i], cfg);
}

int sst_array_config_read(struct sst_array_config *cfg, const char *path)
{
    struct sst_config *all = calloc(1, sizeof(*all));
    int err;

    if (!all)
        return -ENOMEM;
    sst_array_config_defaults(&all->array);
    err = config_load(all, path, true);
    if (!err)
        *cfg = all->array;
    free(all);
    return err;
}

/* --- split pictures ----------------------------------------------------------------------------------------------- */

bool config_split(const char *text, int cells[2])
{
    if (strlen(text) != 3 || text[0] < '1' || text[0] > '8' || text[1] != 'x' || text[2] < '1' || text[2] > '8')
        return false;
    cells[0] = text[0] - '0';
    cells[1] = text[2] - '0';
    return cells[0] * cells[1] <= SST_CONFIG_PARTS_MAX;
}

int sst_array_split(const struct sst_array_config *cfg, int split[2])
{
    if (!config_split(cfg->split, split))
        split[0] = split[1] = 1;
    return split[0] * split[1];
}

void sst_array_place(const struct sst_array_config *cfg, int n, int *row, int *col)
{
    int split[2];
    const int parts = sst_array_split(cfg, split);
    const bool blocks = parts > 1 && cfg->rows % split[0] == 0 && cfg->cols % split[1] == 0;
    const int across = blocks ? cfg->cols / split[1] : cfg->cols, device = n / parts, part = n % parts;

    *row = blocks ? device / across * split[0] + part / split[1] : n / across;
    *col = blocks ? device % across * split[1] + part % split[1] : n % across;
}

bool sst_array_split_fault(const struct sst_array_config *cfg, char *why, size_t size)
{
    const char *format = sst_array_format_name(cfg->fourcc);
    int split[2], step[2] = { 1, 1 };
    const int parts = sst_array_split(cfg, split);

    if (parts == 1 || !format)
        return false;
    if (!strcmp(format, "MJPEG"))
        step[0] = step[1] = 8;
    else if (strcmp(format, "GREY") != 0 && strcmp(format, "Y16") != 0)
        step[0] = 2; /* of YUYV two pixels share their colour, of Bayer patterns four */
    if (strlen(format) == 5 && format[4] == '8')
        step[1] = 2;
    if (split[1] * cfg->width > SST_CONFIG_SIDE_MAX || split[0] * cfg->height > SST_CONFIG_SIDE_MAX) {
        snprintf(why, size,
                 "makes pictures of %dx%d from cameras of %dx%d, larger than the limit of %d; lower it, or width and "
                 "height, which are those of one camera",
                 split[1] * cfg->width, split[0] * cfg->height, cfg->width, cfg->height, SST_CONFIG_SIDE_MAX);
        return true;
    }
    if ((split[1] == 1 || cfg->width % step[0] == 0) && (split[0] == 1 || cfg->height % step[1] == 0))
        return false;
    snprintf(why, size,
             "cuts %s pictures into cameras of %dx%d, whose edges lie within a group of pixels; set width to a multiple "
             "of %d and height of %d, or another format",
             format, cfg->width, cfg->height, step[0], step[1]);
    return true;
}

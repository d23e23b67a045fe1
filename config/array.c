#include "config/array.h"

#include <errno.h>
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

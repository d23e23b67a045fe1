/* config/config_internal.h - parsing of configuration files, and checks between values. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CONFIG_CONFIG_INTERNAL_H
#define SST_CONFIG_CONFIG_INTERNAL_H

#include "base/yaml.h"
#include "config/schema.h"

#define SST_CONFIG_PATH      "/etc/sst/sstd.yaml"
#define SST_CONFIG_FILES_MAX 64 /* of conf.d */

/** Where the value of a key was read, for messages about contradictions. */
struct config_place {
    struct sst_yaml *doc;
    struct sst_yaml_node *node; /* NULL: in no file */
};

struct config_load {
    struct sst_config *cfg;
    bool array_only;                             /* keys of the service are known but not read */
    const char *zones;                           /* text in place of web.zones_file; NULL: read that */
    struct config_place at[SST_CONFIG_KEYS_MAX]; /* by the index of sst_schema(); in the last file with the key */
};

/** Read the keys of the array, or all keys, over cfg; for sst_config_read() and sst_array_config_read(). */
SST_MUST_CHECK int config_load(struct sst_config *cfg, const char *path, bool array_only);

/** Parse the values of one document, noting faults of single values. @param zones_only  other keys are unknown */
void config_parse(struct config_load *load, struct sst_yaml *doc, bool zones_only);

/** Parse "x,y x,y x,y". @param x, y  out, [SST_ZONE_POINTS] @return number of points, 2: a line; 0: no line, no polygon */
int config_points(const char *text, double *x, double *y);

/** Parse "2x2", rows and columns of cameras in a picture. @return false: it is none */
bool config_split(const char *text, int cells[2]);

/** Resolve names that refer to other keys, and note contradictions between values. */
void config_check_array(struct config_load *load);
void config_check_service(struct config_load *load);

/** Log warnings about unusual values. */
void config_warn(const struct config_load *load);

#endif

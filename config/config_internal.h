/* config/config_internal.h - inside config/: files become values, and values are checked against one another. */
#ifndef SST_CONFIG_CONFIG_INTERNAL_H
#define SST_CONFIG_CONFIG_INTERNAL_H

#include "base/yaml.h"
#include "config/schema.h"

#define SST_CONFIG_PATH      "/etc/sst/sstd.yaml"
#define SST_CONFIG_FILES_MAX 64 /* of conf.d */
#define SST_CONFIG_KEYS_MAX  128

/** Where a key's value was read, to say so when it does not fit another's. */
struct config_place {
    struct sst_yaml *doc;
    struct sst_yaml_node *node; /* NULL: in no file */
};

struct config_load {
    struct sst_config *cfg;
    bool array_only;                             /* the service's keys are known, and not read */
    struct config_place at[SST_CONFIG_KEYS_MAX]; /* by the index of sst_schema(); of the last file that has it */
};

/** Read the array's keys, or all, over cfg; sst_config_read() and sst_array_config_read(). */
SST_MUST_CHECK int config_load(struct sst_config *cfg, const char *path, bool array_only);

/** Take the values of one document, noting the faults of each alone. */
void config_parse(struct config_load *load, struct sst_yaml *doc);

/** Find what is named by other keys, and note what does not fit together. */
void config_check_array(struct config_load *load);
void config_check_service(struct config_load *load);

/** What is odd and may be meant: logged as warnings. */
void config_warn(const struct config_load *load);

#endif

/* cli/model_facts.h - what `sst models` finds out about one network. */
#ifndef SST_CLI_MODEL_FACTS_H
#define SST_CLI_MODEL_FACTS_H

#include <stdbool.h>

#include "base/base.h"

struct json_t;
struct sst_manifest_entry;

/**
 * One line of the list: file, folder, kind, bytes, precision, status (ok, hash mismatch, missing, unreadable), reason,
 * figures. Nothing is logged: a fault is the reason.
 *
 * @param entry  of the folder's manifest, or NULL
 * @return an object, to release with json_decref(); NULL without memory
 */
struct json_t *cli_model_facts(const char *path, const struct sst_manifest_entry *entry);

/** Print all about one network. @return 0, or what opening it returned; logged. */
SST_MUST_CHECK int cli_model_inspect(const char *path, bool json);

/** Print an object, which is released; NULL is -ENOMEM. */
SST_MUST_CHECK int cli_model_print(struct json_t *object);

#endif

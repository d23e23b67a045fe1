/* pipeline/method/network/manifest.h - manifest.json of a folder of networks: kind, hash and figures of each. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_MANIFEST_H
#define SST_PIPELINE_METHOD_NETWORK_MANIFEST_H

#include <stdbool.h>

#include "base/base.h"

#define SST_MANIFEST_NAME       "manifest.json"
#define SST_MANIFEST_MAX_MODELS 256

struct json_t;

/** One network; strings and numbers are owned by the manifest. */
struct sst_manifest_entry {
    const char *file;   /* plain name */
    const char *kind;   /* "labels" or "matching" */
    const char *sha256; /* lower-case hex */
    const char *licence, *training_data, *description;
    int64_t bytes;
    const struct json_t *figures; /* object of numbers */
};

struct sst_manifest {
    struct json_t *root;
    int n;
    struct sst_manifest_entry *entries;
};

/**
 * Read a manifest (docs/integrate/formats.md); every entry is complete and checked.
 *
 * @param name  of the file, for messages
 * @return 0, -ENOENT (a JSON object of another format; not logged), -EBADMSG, -ENOMEM; logged. Free with fini.
 */
SST_MUST_CHECK int sst_manifest_parse(struct sst_manifest *out, const char *text, size_t size, const char *name);

/** Load the manifest of a folder. @return 0, -ENOENT (none of our format; not logged), else as above; logged. */
SST_MUST_CHECK int sst_manifest_load(struct sst_manifest *out, const char *folder);
void sst_manifest_fini(struct sst_manifest *manifest);

/** Entry of a file name, or NULL. */
const struct sst_manifest_entry *sst_manifest_find(const struct sst_manifest *manifest, const char *file);

/** True if the file's bytes match the entry. */
bool sst_manifest_matches(const struct sst_manifest_entry *entry, const uint8_t *data, size_t size);

/**
 * Reject a network that differs from its entry in the manifest beside it. Folders without a manifest and unlisted files
 * are accepted.
 *
 * @return 0, -EBADMSG (another file than listed, or a broken manifest), -ENOMEM; logged.
 */
SST_MUST_CHECK int sst_manifest_check(const char *path, const uint8_t *data, size_t size);

#endif

/* pipeline/method/network/model_path.h - search path of networks that are named without a folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_MODEL_PATH_H
#define SST_PIPELINE_METHOD_NETWORK_MODEL_PATH_H

#include "base/file.h"

#define SST_MODEL_FOLDERS 4

/** The search folders, in order. */
struct sst_model_folders {
    int n;
    char path[SST_MODEL_FOLDERS][SST_PATH_MAX];
};

/**
 * The existing ones of: $SST_MODELS, ../models beside the program's folder (a build tree), ../share/sst/models
 * beside it (an installation), the configured data folder. None occurs twice.
 */
void sst_model_folders(struct sst_model_folders *out);

/**
 * Find a network by its file name: the first match in those folders.
 *
 * @return 0, -ENOPKG (in none of them; sst_model_path() logs it), -ENAMETOOLONG (logged)
 */
SST_MUST_CHECK int sst_model_find(char out[SST_PATH_MAX], const char *name);
SST_MUST_CHECK int sst_model_path(char out[SST_PATH_MAX], const char *name);

/**
 * Resolve a user's argument: the path of an existing .onnx file, else the name of an installed network, with or without
 * .onnx, else a path, which is checked on opening.
 *
 * @return 0, -ENOPKG (a name without dot or slash that is not installed), -ENAMETOOLONG; logged
 */
SST_MUST_CHECK int sst_model_resolve(char out[SST_PATH_MAX], const char *text);

#endif

/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/model_path.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"

static void add_folder(struct sst_model_folders *f, const char *folder)
{
    char *real =
        folder && *folder && strlen(folder) < SST_PATH_MAX && sst_path_is_dir(folder) ? realpath(folder, NULL) : NULL;
    bool known = !real || strlen(real) >= SST_PATH_MAX;

    for (int i = 0; !known && i < f->n; i++)
        known = !strcmp(f->path[i], real);
    if (!known)
        strcpy(f->path[f->n++], real);
    free(real);
}

void sst_model_folders(struct sst_model_folders *out)
{
    char path[SST_PATH_MAX];

    out->n = 0;
    add_folder(out, getenv("SST_MODELS"));
    if (!sst_path_beside_program(path, "../models"))
        add_folder(out, path);
    if (!sst_path_beside_program(path, "../share/sst/models"))
        add_folder(out, path);
    add_folder(out, SST_DATADIR "/models");
}

int sst_model_find(char out[SST_PATH_MAX], const char *name)
{
    struct sst_model_folders folders;
    char path[SST_PATH_MAX];

    sst_model_folders(&folders);
    for (int i = 0; i < folders.n; i++) {
        const int err = sst_path_join(path, folders.path[i], name);

        if (err)
            return err;
        if (sst_path_exists(path)) {
            strcpy(out, path);
            return 0;
        }
    }
    return -ENOPKG;
}

int sst_model_path(char out[SST_PATH_MAX], const char *name)
{
    const int err = sst_model_find(out, name);

    if (err == -ENOPKG)
        sst_log_error("model %s is neither in $SST_MODELS, nor in ../models or ../share/sst/models beside the program, "
                      "nor in " SST_DATADIR "/models; install the models or set SST_MODELS to their folder",
                      name);
    return err;
}

int sst_model_resolve(char out[SST_PATH_MAX], const char *text)
{
    const bool onnx = sst_text_ends(text, ".onnx");
    char name[256];
    int err = -ENOPKG;

    if (!strchr(text, '/') && *text && strlen(text) < sizeof(name) - 5 && !(onnx && sst_path_exists(text))) {
        snprintf(name, sizeof(name), "%s%s", text, onnx ? "" : ".onnx");
        err = sst_model_find(out, name);
        if (err == -ENOPKG && !strchr(text, '.') && !sst_path_exists(text)) {
            sst_log_error("unknown network `%s`; `sst models` lists the installed ones", text);
            return err;
        }
    }
    return err == -ENOPKG ? sst_path_join(out, text, NULL) : err;
}

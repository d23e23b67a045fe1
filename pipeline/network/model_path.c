#include "pipeline/network/model_path.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"

/* The folder `below` beside the program's own folder, or "". */
static void beside_program(char out[SST_PATH_MAX], const char *below)
{
    char exe[SST_PATH_MAX];
    const ssize_t n = readlink("/proc/self/exe", exe, sizeof(exe) - 1);
    char *slash;

    out[0] = 0;
    if (n <= 0)
        return;
    exe[n] = 0;
    slash = strrchr(exe, '/');
    if (!slash)
        return;
    *slash = 0;
    if (sst_path_join(out, exe, below))
        out[0] = 0;
}

int sst_model_find(char out[SST_PATH_MAX], const char *name)
{
    char built[SST_PATH_MAX], installed[SST_PATH_MAX], path[SST_PATH_MAX];
    const char *folders[] = { getenv("SST_MODELS"), built, installed, SST_DATADIR "/models" };

    beside_program(built, "../models");
    beside_program(installed, "../share/sst/models");
    for (size_t i = 0; i < ARRAY_LEN(folders); i++) {
        int err;

        if (!folders[i] || !*folders[i])
            continue;
        err = sst_path_join(path, folders[i], name);
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
        sst_log_error("model %s is neither in $SST_MODELS, nor in ../models or ../share/sst/models beside the program, nor in "
                      SST_DATADIR "/models; install the models or set SST_MODELS to their folder", name);
    return err;
}

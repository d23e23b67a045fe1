#include "pipeline/network/model_path.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/log.h"

/* ../models seen from the folder of the running program; empty where that cannot be told. */
static void beside_program(char out[SST_PATH_MAX])
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
    if (sst_path_join(out, exe, "../models"))
        out[0] = 0;
}

int sst_model_path(char out[SST_PATH_MAX], const char *name)
{
    char built[SST_PATH_MAX], path[SST_PATH_MAX];
    const char *folders[] = { getenv("SST_MODELS"), built, SST_DATADIR "/models" };

    beside_program(built);
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
    sst_log_error("model %s is neither in $SST_MODELS nor in %s nor in " SST_DATADIR "/models; install the models or set"
                  " SST_MODELS to their folder", name, *built ? built : "../models");
    return -ENOPKG;
}

#include "cli/cli_internal.h"

#include <errno.h>
#include <string.h>

#include "base/log.h"

int cli_precision(enum sst_precision *out, const char *name)
{
    if (!name)
        return 0;
    if (strcmp(name, "f32") && strcmp(name, "int8")) {
        sst_log_error("unknown precision `%s`; use f32 or int8", name);
        return -EINVAL;
    }
    *out = strcmp(name, "f32") ? SST_PRECISION_INT8 : SST_PRECISION_F32;
    return 0;
}

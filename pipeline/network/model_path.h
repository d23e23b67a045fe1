/* pipeline/network/model_path.h - where the networks lie that ship with the program. */
#ifndef SST_PIPELINE_NETWORK_MODEL_PATH_H
#define SST_PIPELINE_NETWORK_MODEL_PATH_H

#include "base/file.h"

SST_EXTERN_C_BEGIN

/**
 * Find a network by its file name, first match of: $SST_MODELS, ../models beside the program's folder (a build tree),
 * ../share/sst/models beside it (an installation), the folder that the build was configured for.
 *
 * @return 0, -ENOPKG (in none of them; sst_model_path() logs it), -ENAMETOOLONG (logged)
 */
SST_MUST_CHECK int sst_model_find(char out[SST_PATH_MAX], const char *name);
SST_MUST_CHECK int sst_model_path(char out[SST_PATH_MAX], const char *name);

SST_EXTERN_C_END

#endif

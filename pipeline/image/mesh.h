/* pipeline/image/mesh.h - meshes of a terrain as OBJ files. */
#ifndef SST_PIPELINE_IMAGE_MESH_H
#define SST_PIPELINE_IMAGE_MESH_H

#include "pipeline/image/heights.h"

/** Grid of a mesh's heights, in its own unit. @param text  ends with a NUL @param name  only used in messages
 *  @return as sst_heights_read() */
SST_MUST_CHECK int mesh_to_heights(struct sst_heights *out, const char *text, const char *name);

#endif

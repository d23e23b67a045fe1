/* Light of the shader `rectify`. */
#include "pipeline/gpu/rectify.h"

#include "pipeline/kernels/light_code.h"

void sst_gpu_rectify_light(float *out)
{
    for (int i = 0; i <= SST_LIGHT_WHITE; i++)
        sst_light_parts((float)i * (1.0f / (1 << SST_LIGHT_SHIFT)), &out[i], &out[SST_LIGHT_WHITE + 1 + i]);
}

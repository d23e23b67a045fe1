/* pipeline/kernels/templates.h - every kernel template, compiled by each level's .c with KERNEL(name) set. */
#include "pipeline/kernels/blend_finish_tmpl.h"
#include "pipeline/kernels/blend_tmpl.h"

void KERNEL(sst_kernels_fill)(struct sst_kernels *k);

void KERNEL(sst_kernels_fill)(struct sst_kernels *k)
{
#define X(name) k->name = KERNEL(name);
    SST_KERNEL_LIST(X)
#undef X
}

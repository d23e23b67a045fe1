/* The shader of products of matrices: what a shape is compiled for, and the types that glslang cannot write. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/gpu/gpu_internal.h"
#include "pipeline/gpu/net.h"

#include <errno.h>

#define HEADER      5          /* words before the first instruction */
#define MAGIC       0x07230203 /* the first of them */
#define SLAB_BYTES  64         /* of a pixel that are multiplied between two barriers */
#define GROUP_LIMIT 1024       /* invocations: sums of weights pass through that many words of shared memory */

/* Instructions of SPIR-V, and a decoration. */
enum { OP_TYPE_INT = 21, OP_SPEC_CONSTANT = 50, OP_DECORATE = 71, OP_TYPE_MATRIX = 4456, SPEC_ID = 1 };

/* 0: the shader cannot use the shape. Two matrices divide the pixels of a group and four its channels, the depth a slab
 * of 64 bytes into parts of 16, and the invocations are a multiple of the channels. */
uint32_t gpu_matrix_invocations(const struct sst_gpu_matrix *m)
{
    const uint32_t rows = SST_GPU_NET_MATRIX / 2, columns = SST_GPU_NET_MATRIX_OUT / 4;
    uint32_t lanes;

    if (!m->rows || !m->columns || !m->depth || rows % m->rows || columns % m->columns || SLAB_BYTES % m->depth ||
        m->depth % 16 || m->columns % 4)
        return 0;
    lanes = rows / m->rows * (columns / m->columns) * m->group;
    return lanes % SST_GPU_NET_MATRIX_OUT || lanes > GROUP_LIMIT ? 0 : lanes;
}

void gpu_matrix_stage_init(struct gpu_matrix_stage *s, VkPipelineShaderStageCreateInfo *info,
                           const struct sst_gpu_matrix *m)
{
    const uint32_t value[GPU_MATRIX_CONSTANTS] = { gpu_matrix_invocations(m), m->rows, m->columns, m->depth };

    for (uint32_t i = 0; i < GPU_MATRIX_CONSTANTS; i++) {
        s->value[i] = value[i];
        s->entry[i] = (VkSpecializationMapEntry){ i, i * (uint32_t)sizeof(*value), sizeof(*value) };
    }
    s->constants = (VkSpecializationInfo){ GPU_MATRIX_CONSTANTS, s->entry, sizeof(s->value), s->value };
    s->size = (VkPipelineShaderStageRequiredSubgroupSizeCreateInfoEXT){
        .sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_REQUIRED_SUBGROUP_SIZE_CREATE_INFO_EXT,
        .requiredSubgroupSize = m->group
    };
    info->flags = VK_PIPELINE_SHADER_STAGE_CREATE_REQUIRE_FULL_SUBGROUPS_BIT_EXT;
    info->pSpecializationInfo = &s->constants;
    info->pNext = &s->size;
}

/* What types of matrices refer to. Ids; 0: not declared so far */
struct ids {
    uint32_t int8, int32;
    uint32_t named[4]; /* constants by constant_id, as decorated */
    uint32_t constant[4];
};

static void note(struct ids *ids, uint32_t op, uint32_t words, const uint32_t *operand)
{
    if (op == OP_TYPE_INT && words == 4 && operand[2] == 1) {
        ids->int8 = operand[1] == 8 ? operand[0] : ids->int8;
        ids->int32 = operand[1] == 32 ? operand[0] : ids->int32;
    }
    if (op == OP_DECORATE && words == 4 && operand[1] == SPEC_ID && operand[2] < ARRAY_LEN(ids->named))
        ids->named[operand[2]] = operand[0];
    for (size_t i = 0; op == OP_SPEC_CONSTANT && words == 4 && i < ARRAY_LEN(ids->named); i++) {
        if (ids->named[i] == operand[1])
            ids->constant[i] = operand[1];
    }
}

/* Operands of a type: id, component, scope, rows, columns, use. */
static int complete(const struct ids *ids, uint32_t *operand)
{
    if ((operand[1] != 8 && operand[1] != 32) || operand[3] >= ARRAY_LEN(ids->constant) ||
        operand[4] >= ARRAY_LEN(ids->constant))
        return -EINVAL;
    operand[1] = operand[1] == 8 ? ids->int8 : ids->int32;
    operand[3] = ids->constant[operand[3]];
    operand[4] = ids->constant[operand[4]];
    return operand[1] && operand[3] && operand[4] ? 0 : -EINVAL;
}

int gpu_matrix_complete(uint32_t *code, size_t words)
{
    struct ids ids = { 0 };
    int err = words > HEADER && code[0] == MAGIC ? 0 : -EINVAL, types = 0;

    for (size_t at = HEADER, n; at < words && !err; at += n) {
        const uint32_t op = code[at] & 0xFFFF;

        n = code[at] >> 16;
        if (!n || n > words - at)
            return -EINVAL;
        if (op == OP_TYPE_MATRIX) {
            err = n == 7 ? complete(&ids, code + at + 1) : -EINVAL;
            types++;
        } else {
            note(&ids, op, (uint32_t)n, code + at + 1);
        }
    }
    return err || types ? err : -EINVAL;
}

/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/method/network/onnx.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int by_count(const void *a, const void *b)
{
    const struct sst_op_count *x = a, *y = b;

    return x->count != y->count ? (x->count < y->count) - (x->count > y->count) : strcmp(x->name, y->name);
}

static void count_op(struct sst_summary *s, const struct sst_onnx_node *node)
{
    const bool standard = !node->domain.n || sst_onnx_str_is(node->domain, "ai.onnx");
    char name[sizeof(s->ops[0].name)];

    snprintf(name, sizeof(name), "%.*s%s%.*s", standard ? 0 : sst_min_int((int)node->domain.n, 16),
             node->domain.n ? node->domain.p : "", standard ? "" : ".", sst_min_int((int)node->op.n, 24),
             node->op.n ? node->op.p : "");
    for (int i = 0; i < s->n_ops; i++) {
        if (!strcmp(s->ops[i].name, name)) {
            s->ops[i].count++;
            return;
        }
    }
    if (s->n_ops == SST_SUMMARY_MAX_OPS)
        return;
    strcpy(s->ops[s->n_ops].name, name);
    s->ops[s->n_ops++].count = 1;
}

void sst_onnx_summary(struct sst_summary *out, const struct sst_onnx *model)
{
    *out = (struct sst_summary){ .opset = model->opset, .n_nodes = model->n_nodes };
    for (int i = 0; i < model->n_nodes; i++)
        count_op(out, &model->nodes[i]);
    for (int i = 0; i < model->n_tensors; i++)
        out->parameters += model->tensors[i].f ? model->tensors[i].count : 0;
    qsort(out->ops, (size_t)out->n_ops, sizeof(out->ops[0]), by_count);
}

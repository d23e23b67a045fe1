/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "cli/cli_internal.h"

#include "base/thread.h"
#include "pipeline/method/network/model_path.h"

int cli_matching_config(struct sst_disparity_config *cfg, const struct cli_matching *m, char model_path[SST_PATH_MAX])
{
    int err = sst_disparity_preset(cfg, m->preset);

    if (err)
        return err;
    cfg->census_suffices = cfg->census_suffices && !m->cost && !m->model && m->paths < 0;
    cfg->cost = m->cost ? m->cost : cfg->cost;
    cfg->precision = m->precision ? m->precision : cfg->precision;
    cfg->paths = m->paths > 0 ? m->paths : cfg->paths;
    cfg->p1 = m->p1 > 0 ? m->p1 : cfg->p1;
    cfg->p2 = m->p2 > 0 ? m->p2 : cfg->p2;
    cfg->rounds = m->rounds >= 0 ? m->rounds : cfg->rounds;
    cfg->scale = m->scale > 0 ? m->scale : cfg->scale;
    cfg->fill = cfg->fill && !m->no_fill;
    cfg->joint = cfg->joint && !m->pairs;
    cfg->threads = sst_thread_count(m->threads);
    if (cfg->cost & SST_COST_MCCNN) {
        err = m->model ? sst_model_resolve(model_path, m->model) : sst_model_path(model_path, "mccnn-fast.onnx");
        cfg->model = model_path;
    }
    return err;
}

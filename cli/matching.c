#include "cli/cli_internal.h"

#include <errno.h>
#include <string.h>

#include "base/log.h"
#include "base/thread.h"
#include "pipeline/method/network/model_path.h"

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

int cli_matching_config(struct sst_disparity_config *cfg, const struct cli_matching *m, char model_path[SST_PATH_MAX])
{
    int err = sst_disparity_preset(cfg, m->preset);

    if (err)
        return err;
    cfg->census_suffices = cfg->census_suffices && !m->cost && !m->model && m->paths < 0;
    if (m->cost && !strcmp(m->cost, "census")) {
        cfg->cost = SST_COST_CENSUS;
    } else if (m->cost && !strcmp(m->cost, "mccnn")) {
        cfg->cost = SST_COST_MCCNN;
    } else if (m->cost && !strcmp(m->cost, "both")) {
        cfg->cost = SST_COST_BOTH;
    } else if (m->cost) {
        sst_log_error("unknown matching cost `%s`; use census, mccnn or both", m->cost);
        return -EINVAL;
    }
    err = cli_precision(&cfg->precision, m->precision);
    if (err)
        return err;
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

/* A plain folder: rr_cc.* (row, column) in a grid set by the caller, and external maps. */
#include <errno.h>
#include <string.h>
#include <strings.h>

#include "base/log.h"
#include "pipeline/lightfield/lightfield_internal.h"

/* rr_cc with any extension: files that are no images are rejected when decoded. */
static bool parse_name(const char *name, int *row, int *col)
{
    const char *p = parse_index(name, row);

    p = p && *p == '_' ? parse_index(p + 1, col) : NULL;
    return p && *p == '.' && !strchr(p + 1, '.') && strcasecmp(p, ".pfm");
}

int import_folder(struct import_plan *plan)
{
    const struct sst_import_config *cfg = plan->cfg;
    int count = 0, err = import_set_grid(plan, cfg->rows, cfg->cols);

    for (int k = 0; !err && k < cfg->rows * cfg->cols; k++) {
        struct import_view *v = &plan->views[k];

        snprintf(v->expected, sizeof(v->expected), "%02d_%02d.*", k / cfg->cols, k % cfg->cols);
        v->pos_x = k % cfg->cols;
        v->pos_y = k / cfg->cols;
    }
    for (int i = 0; !err && i < plan->names.count; i++) {
        int row, col;

        if (!parse_name(plan->names.name[i], &row, &col))
            continue;
        if (row >= cfg->rows || col >= cfg->cols) {
            sst_log_error("%s/%s is outside the grid of %dx%d views; correct --grid or remove the file", cfg->source,
                          plan->names.name[i], cfg->rows, cfg->cols);
            return -EBADMSG;
        }
        err = import_place(plan, row, col, i);
        count++;
    }
    if (!err && !count) {
        sst_log_error("%s has no image named like 00_00.png (row, column); is it another format?", cfg->source);
        err = -EBADMSG;
    }
    return err;
}

/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "base/mem.h"
#include "pipeline/lightfield/lightfield_internal.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/log.h"
#include "base/stats.h"

#define MAX_NAMES 65536

static int compare_names(const void *a, const void *b)
{
    return strcmp(a, b);
}

/* Hidden files, folders and names too long to be a view are passed over. */
static bool wanted(DIR *d, const char *name)
{
    struct stat st;

    return name[0] != '.' && strlen(name) < SST_NAME_MAX && !fstatat(dirfd(d), name, &st, 0) && S_ISREG(st.st_mode);
}

int names_read(struct name_list *names, const char *dir)
{
    struct name_list made = { 0 };
    int capacity = 0, err = 0;
    struct dirent *e;
    DIR *d = opendir(dir);

    if (!d) {
        err = -errno;
        sst_log_error("cannot read the folder %s: %s", dir, strerror(-err));
        return err == -ENOTDIR || err == -EACCES ? err : -ENOENT;
    }
    while (!err && (e = readdir(d))) {
        if (!wanted(d, e->d_name))
            continue;
        if (made.count == MAX_NAMES || !sst_mem_grow(&made.name, made.count, &capacity, sizeof(*made.name))) {
            sst_log_error("the folder %s has more files than can be listed", dir);
            err = -ENOMEM;
            break;
        }
        snprintf(made.name[made.count++], SST_NAME_MAX, "%s", e->d_name);
    }
    closedir(d);
    made.used = calloc((size_t)made.count + 1, sizeof(*made.used));
    if (!err && !made.used)
        err = -ENOMEM;
    if (err) {
        names_fini(&made);
        return err;
    }
    if (made.count)
        qsort(made.name, (size_t)made.count, SST_NAME_MAX, compare_names);
    *names = made;
    return 0;
}

void names_fini(struct name_list *names)
{
    free(names->name);
    free(names->used);
    *names = (struct name_list){ 0 };
}

int names_find(const struct name_list *names, const char *name)
{
    for (int i = 0; i < names->count; i++) {
        if (!strcmp(names->name[i], name))
            return i;
    }
    return -1;
}

const char *parse_index(const char *s, int *value)
{
    int v = 0;

    if (!isdigit((unsigned char)*s))
        return NULL;
    for (; isdigit((unsigned char)*s); s++) {
        v = v * 10 + (*s - '0');
        if (v > 99999)
            return NULL;
    }
    *value = v;
    return s;
}

int distinct(int *v, int n)
{
    int count = 0;

    sst_stats_sort_int(v, n);
    for (int i = 0; i < n; i++) {
        if (!count || v[count - 1] != v[i])
            v[count++] = v[i];
    }
    return count;
}

int params_number(const char *text, const char *path, const char *key, double *value)
{
    const size_t n = strlen(key);

    for (const char *line = text; line; line = strchr(line, '\n'), line = line ? line + 1 : NULL) {
        const char *p = line + strspn(line, " \t");
        char *end;
        double v;

        if (strncmp(p, key, n))
            continue;
        p += n + strspn(p + n, " \t");
        if (*p != '=' && *p != ':')
            continue;
        p += 1 + strspn(p + 1, " \t");
        v = strtod(p, &end);
        if (*p != '\n' && *p != '\r' && end != p && isfinite(v) && (!*end || isspace((unsigned char)*end))) {
            *value = v;
            return 1;
        }
        sst_log_error("%s: %s is not a number; write one after the equals sign", path, key);
        return -EBADMSG;
    }
    return 0;
}

int params_off_centre(struct sst_lightfield *lf, const char *text, const char *path)
{
    const int err = params_number(text, path, "off_centre_x_px", &lf->off_centre_px[0]);

    return err < 0 ? err : params_number(text, path, "off_centre_y_px", &lf->off_centre_px[1]);
}

int import_set_grid(struct import_plan *plan, int rows, int cols)
{
    const struct sst_import_config *cfg = plan->cfg;
    int err;

    if (cfg->rows && (cfg->rows != rows || cfg->cols != cols)) {
        sst_log_error("%s holds a grid of %dx%d views, not %dx%d; correct --grid or the files", cfg->source, rows, cols,
                      cfg->rows, cfg->cols);
        return -EBADMSG;
    }
    err = sst_lightfield_init_files(&plan->lf, rows, cols);
    if (err == -EINVAL) {
        sst_log_error("a grid of %dx%d views in %s is outside 1 to %d views; use fewer", rows, cols, cfg->source,
                      SST_MAX_VIEWS);
        return -EBADMSG;
    }
    if (!err)
        plan->views = calloc((size_t)(rows * cols), sizeof(*plan->views));
    if (!plan->views)
        return -ENOMEM;
    for (int k = 0; k < rows * cols; k++)
        plan->views[k].name = plan->views[k].truth = -1;
    return 0;
}

int import_place(struct import_plan *plan, int row, int col, int i)
{
    struct import_view *v = &plan->views[row * plan->lf.cols + col];

    if (v->name >= 0) {
        sst_log_error("%s: %s and %s are both row %d, column %d; remove one of them", plan->cfg->source,
                      plan->names.name[v->name], plan->names.name[i], row, col);
        return -EBADMSG;
    }
    v->name = i;
    plan->names.used[i] = true;
    plan->lf.views[row * plan->lf.cols + col].present = true;
    return 0;
}

int import_take_part(struct import_plan *plan)
{
    const int *part = plan->cfg->part, row = part[0], col = part[1], rows = part[2], cols = part[3];
    struct sst_lightfield *lf = &plan->lf;
    const struct import_view *ref;

    if (row > lf->rows - rows || col > lf->cols - cols) {
        sst_log_error("the grid of %dx%d views in %s has no %dx%d views from row %d, column %d on; correct --part",
                      lf->rows, lf->cols, plan->cfg->source, rows, cols, row, col);
        return -EINVAL;
    }
    if (sst_lightfield_choose_ref(lf))
        return -EBADMSG;
    ref = &plan->views[lf->ref_view];
    plan->moved[0] = ref->pos_x;
    plan->moved[1] = ref->pos_y;
    for (int k = 0; k < rows * cols; k++) { /* never from behind k */
        const int from = (row + k / cols) * lf->cols + col + k % cols;

        plan->views[k] = plan->views[from];
        lf->views[k].present = lf->views[from].present;
    }
    lf->rows = rows;
    lf->cols = cols;
    if (sst_lightfield_choose_ref(lf)) {
        sst_log_error("%s has no view in the %dx%d of --part; correct it", plan->cfg->source, rows, cols);
        return -EBADMSG;
    }
    ref = &plan->views[lf->ref_view];
    plan->moved[0] -= ref->pos_x;
    plan->moved[1] -= ref->pos_y;
    return 0;
}

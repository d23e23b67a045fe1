/* A plain folder: pictures rr_cc.* (row, column) in a grid set by the caller, and external maps. Cameras and photo
 * programs leave other files beside them. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <string.h>
#include <strings.h>

#include "base/log.h"
#include "base/text.h"
#include "pipeline/image/codec.h"
#include "pipeline/lightfield/lightfield_internal.h"

#define MAX_NAMED 3 /* files in one message */

enum kind {
    BESIDE = 0, /* not a view: maps, texts, small pictures of cameras */
    PICTURE = 1,
    RAW = 2,
};

static bool is_raw(const char *ending)
{
    static const char *const raw[] = { "3fr", "arw", "cr2", "cr3", "crw", "dcr", "dng", "erf", "fff", "gpr",
                                       "iiq", "k25", "kdc", "mef", "mos", "mrw", "nef", "nrw", "orf", "pef",
                                       "raf", "raw", "rw2", "rwl", "sr2", "srf", "srw", "x3f" };

    for (size_t i = 0; i < ARRAY_LEN(raw); i++) {
        if (!strcasecmp(ending, raw[i]))
            return true;
    }
    return false;
}

/* By the ending: the content is judged when it is read. @return false: not named rr_cc.* */
static bool parse_name(const char *name, int *row, int *col, enum kind *kind)
{
    const char *p = parse_index(name, row);

    p = p && *p == '_' ? parse_index(p + 1, col) : NULL;
    if (!p || *p != '.')
        return false;
    *kind = strchr(p + 1, '.') ? BESIDE : sst_image_is_picture(name) ? PICTURE : is_raw(p + 1) ? RAW : BESIDE;
    return true;
}

/* Kinds of the views' files, before one is placed. */
struct found {
    bool has[SST_MAX_VIEWS][3]; /* by kind */
    int files[3];
    char beside[MAX_NAMED * (SST_NAME_MAX + 2) + 8]; /* names */
};

static int look(struct found *f, const struct import_plan *plan)
{
    const struct sst_import_config *cfg = plan->cfg;

    for (int i = 0; i < plan->names.count; i++) {
        const char *name = plan->names.name[i];
        enum kind kind;
        int row, col;

        if (!parse_name(name, &row, &col, &kind))
            continue;
        if (kind == BESIDE && f->files[BESIDE] <= MAX_NAMED)
            sst_text_add(f->beside, sizeof(f->beside), "%s%s", f->files[BESIDE] ? ", " : "",
                         f->files[BESIDE] < MAX_NAMED ? name : "...");
        f->files[kind]++;
        if (kind == BESIDE)
            continue;
        if (row >= cfg->rows || col >= cfg->cols) {
            sst_log_error("%s/%s is outside the grid of %dx%d views; correct --grid or remove the file", cfg->source,
                          name, cfg->rows, cfg->cols);
            return -EBADMSG;
        }
        f->has[row * cfg->cols + col][kind] = true;
    }
    if (f->files[PICTURE] || f->files[RAW])
        return 0;
    sst_log_error("%s has no image named like 00_00.png (row, column)%s%s; %s", cfg->source,
                  f->files[BESIDE] ? ", only " : "", f->beside,
                  f->files[BESIDE] ? "convert images to PNG, JPEG or TIFF" : "is it another format?");
    return -EBADMSG;
}

/* One kind for all views: raw files and their camera's JPEGs differ in colour and lens correction. */
static int choose(enum kind *kind, const struct found *f, const struct sst_import_config *cfg)
{
    enum kind other;

    *kind = f->files[RAW] && (cfg->prefer_raw || !f->files[PICTURE]) ? RAW : PICTURE;
    other = *kind == RAW ? PICTURE : RAW;
    for (int k = 0; k < cfg->rows * cfg->cols; k++) {
        if (!f->has[k][other] || f->has[k][*kind])
            continue;
        sst_log_error(
            "%s: row %d, column %d has only a %s, others a %s, and the two differ in colour and lens; add the "
            "file, remove this one, or choose with --prefer jpeg or raw",
            cfg->source, k / cfg->cols, k % cfg->cols, other == RAW ? "raw file" : "picture",
            *kind == RAW ? "raw file" : "picture");
        return -EBADMSG;
    }
    if (f->files[other])
        sst_log_warning("%s: of raw files and pictures of the same views the %s are used; --prefer %s uses the others",
                        cfg->source, *kind == RAW ? "raw files" : "pictures", *kind == RAW ? "jpeg" : "raw");
    if (f->files[BESIDE])
        sst_log_warning("%s: %d files are neither pictures nor raw files by their endings and are left out: %s",
                        cfg->source, f->files[BESIDE], f->beside);
    return 0;
}

int import_folder(struct import_plan *plan)
{
    const struct sst_import_config *cfg = plan->cfg;
    struct found found = { .files = { 0 } };
    enum kind chosen = PICTURE, kind;
    int row, col, err = import_set_grid(plan, cfg->rows, cfg->cols);

    for (int k = 0; !err && k < cfg->rows * cfg->cols; k++) {
        struct import_view *v = &plan->views[k];

        snprintf(v->expected, sizeof(v->expected), "%02d_%02d.*", k / cfg->cols, k % cfg->cols);
        v->pos_x = k % cfg->cols;
        v->pos_y = k / cfg->cols;
    }
    err = err ? err : look(&found, plan);
    err = err ? err : choose(&chosen, &found, cfg);
    for (int i = 0; !err && i < plan->names.count; i++) {
        if (!parse_name(plan->names.name[i], &row, &col, &kind))
            continue;
        if (kind == chosen)
            err = import_place(plan, row, col, i);
        else
            plan->names.used[i] = true; /* reported already */
    }
    plan->raw = chosen == RAW;
    return err;
}

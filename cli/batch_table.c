/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/file.h"
#include "cli/cli_internal.h"
#include "cli/shard_internal.h"

/* Figures of a piece: a member of a report. */
static const struct column {
    const char *name, *file, *member;
} columns[] = {
    { "rows", "process.json", "rows" },
    { "cols", "process.json", "cols" },
    { "width", "process.json", "width" },
    { "height", "process.json", "height" },
    { "confirmed_percent", "process.json", "confirmed_percent" },
    { "plausible", "process.json", "plausible" },
    { "labels_percent", "process.json", "coverage_refined" },
    { "focus_px", "see-through.json", "focus_px" },
    { "cut_px", "clear.json", "cut_px" },
    { "seen_percent", "clear.json", "seen_percent" },
    { "seconds", "process.json", "seconds.total" },
    { "cpu_seconds", "process.json", "cpu_seconds.total" },
    { "bad1_percent", "eval.json", "disparity.bad1" },
    { "bad2_percent", "eval.json", "disparity.bad2" },
    { "miou_percent", "eval.json", "labels.miou_refined" },
    { "see_through_occluded_db", "eval.json", "render.psnr_occluded" },
    { "clear_occluded_db", "eval.json", "clear.psnr_occluded" },
};

/* A name as CSV has it. Spreadsheets compute cells that begin like a formula: an apostrophe makes it a text. */
static void print_name(FILE *f, const char *name)
{
    const bool formula = *name && strchr("=+-@\t\r", *name);
    const bool quoted = formula || strpbrk(name, ",;\"\r\n\t") != NULL;

    fputs(quoted ? "\"" : "", f);
    fputs(formula ? "'" : "", f);
    for (; *name; name++) {
        if (*name == '"')
            fputc('"', f);
        fputc(*name, f);
    }
    fputs(quoted ? "\"" : "", f);
}

/* Figures of one piece, from its reports or as they were kept. */
struct figures {
    const char *folder;
    json_t *kept;     /* or NULL */
    const char *open; /* report that is read, or NULL */
    json_t *report;
};

static json_t *read_json(const char *folder, const char *name)
{
    char path[SST_PATH_MAX];

    return sst_path_join(path, folder, name) ? NULL : json_load_file(path, 0, NULL);
}

/* NAN: there is none */
static double figure(struct figures *f, const struct column *c)
{
    if (f->kept)
        return cli_number(f->kept, c->name);
    if (!f->open || strcmp(f->open, c->file)) {
        json_decref(f->report);
        f->open = c->file;
        f->report = read_json(f->folder, c->file);
    }
    return f->report ? cli_number(f->report, c->member) : NAN;
}

int cli_batch_keep_figures(const char *dir)
{
    struct figures f = { .folder = dir };
    json_t *kept = json_object();
    char path[SST_PATH_MAX];
    int err;

    for (size_t i = 0; i < ARRAY_LEN(columns); i++) {
        const double v = figure(&f, &columns[i]);

        if (isfinite(v))
            json_object_set_new(kept, columns[i].name, json_real(v));
    }
    json_decref(f.report);
    err = cli_write_json(kept, dir, CLI_BATCH_FIGURES);
    json_decref(kept);
    for (size_t i = 0; !err && i < ARRAY_LEN(columns); i++) {
        err = sst_path_join(path, dir, columns[i].file);
        if (!err)
            (void)unlink(path);
    }
    return err;
}

static void print_piece(FILE *f, const char *dir, const char *name)
{
    char folder[SST_PATH_MAX];
    struct figures figures = { .folder = folder };

    if (sst_path_join(folder, dir, name) || !sst_path_is_dir(folder))
        return;
    figures.kept = read_json(folder, CLI_BATCH_FIGURES);
    print_name(f, name);
    for (size_t i = 0; i < ARRAY_LEN(columns); i++) {
        const double v = figure(&figures, &columns[i]);

        if (isfinite(v))
            fprintf(f, ",%.6g", v);
        else
            fputc(',', f);
    }
    json_decref(figures.report);
    json_decref(figures.kept);
    fputc('\n', f);
}

int cli_batch_write_table(const char *out, char *const *name, int count)
{
    struct sst_outfile file;
    const int err = sst_outfile_open_in(&file, out, CLI_BATCH_TABLE);

    if (err)
        return err;
    fputs("name", file.stream);
    for (size_t i = 0; i < ARRAY_LEN(columns); i++)
        fprintf(file.stream, ",%s", columns[i].name);
    fputc('\n', file.stream);
    for (int i = 0; i < count; i++)
        print_piece(file.stream, out, name[i]);
    return sst_outfile_commit(&file);
}

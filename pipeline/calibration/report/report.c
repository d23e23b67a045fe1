/* The report's page: report.html with the figures in it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "pipeline/calibration/report/report.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/calibration/report/report_internal.h"

#define MARK "@DATA@" /* where report.html expects the JSON */

/* The assembler reads the file: a string in read-only data. */
__asm__(".section .rodata\nreport_html: .incbin \"pipeline/calibration/report/report.html\"\n.byte 0\n.previous");
extern const char report_html[];

/* JSON inside a script element: with < escaped nothing of the user's can end the element. */
static void write_escaped(FILE *out, const char *json)
{
    for (size_t n; *json; json += n) {
        n = strcspn(json, "<");
        fwrite(json, 1, n, out);
        if (json[n]) {
            fputs("\\u003c", out);
            n++;
        }
    }
}

static int write_page(const char *path, const char *figures, const char *drawing)
{
    const char *mark = strstr(report_html, MARK);
    struct sst_outfile file;
    int err = sst_outfile_open(&file, path);

    if (err)
        return err;
    fwrite(report_html, 1, (size_t)(mark - report_html), file.stream);
    fputs("{\"figures\":", file.stream);
    write_escaped(file.stream, figures);
    fputs(",\n\"drawing\":", file.stream);
    write_escaped(file.stream, drawing);
    fputs("}", file.stream);
    fputs(mark + strlen(MARK), file.stream);
    return sst_outfile_commit(&file);
}

/* One object as text; the object is released. @return NULL: no memory; logged */
static char *dump(json_t *o, size_t flags)
{
    char *out = o ? json_dumps(o, flags) : NULL;

    if (!out)
        sst_log_error("no memory for the report's JSON; close other programs");
    json_decref(o);
    return out;
}

int sst_calibration_report_write(const char *path, const struct sst_calibration_report *report)
{
    struct report_figures f;
    char *figures, *drawing;
    int err = report_figures_init(&f, report);

    if (err)
        return err;
    figures = dump(report_figures_json(report, &f), JSON_COMPACT | JSON_REAL_PRECISION(12));
    drawing = figures ? dump(report_drawing_json(report, &f), JSON_COMPACT | JSON_REAL_PRECISION(5)) : NULL;
    err = drawing ? write_page(path, figures, drawing) : -ENOMEM;
    free(figures);
    free(drawing);
    report_figures_fini(&f);
    return err;
}

char *sst_calibration_report_json(const struct sst_calibration_report *report)
{
    struct report_figures f;
    char *out;

    if (report_figures_init(&f, report))
        return NULL;
    out = dump(report_figures_json(report, &f), JSON_INDENT(1) | JSON_REAL_PRECISION(12));
    report_figures_fini(&f);
    return out;
}

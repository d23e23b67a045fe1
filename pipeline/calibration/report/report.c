/* The report's page: head, sections in their order, foot. */
#include "pipeline/calibration/report/report.h"

#include <errno.h>
#include <string.h>

#include "base/file.h"
#include "base/log.h"
#include "pipeline/calibration/report/report_internal.h"

static void head(const struct calib_page *page)
{
    const struct sst_calib *calib = &page->report->solution->calib;
    FILE *out = page->out;

    fputs(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
        "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"/>\n"
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; img-src "
        "data:\"/>\n<title>Calibration report</title>\n<style>\n",
        out);
    fputs(calib_style, out);
    fprintf(out,
            "</style>\n</head>\n<body>\n<header>\n<h1>Calibration report</h1>\n<p class=\"sub\">%d \xC3\x97 %d %s, "
            "%d calibrated, pictures of %d \xC3\x97 %d px",
            calib->rows, calib->cols, calib->rig ? "poses of a rig" : "cameras", page->figures->known, calib->width,
            calib->height);
    if (calib->source[0]) {
        fputs("; made from ", out);
        html_text(out, calib->source);
    }
    if (calib->created_wall_ns > 0)
        fprintf(out, " on %s", calib_date(calib->created_wall_ns).text);
    fputs("</p>\n<nav>", out);
}

/* One section of the page and its place in the navigation. */
struct part {
    const char *id, *title;
    bool there;
};

static void navigate(const struct calib_page *page)
{
    const struct part parts[] = {
        { "summary", "Summary", true },
        { "array", "Array", page->figures->known > 1 },
        { "cameras", "Cameras", true },
        { "frames", "Frames", true },
        { "worst", "Worst pictures", page->figures->worst_count > 0 },
        { "links", "Links", page->figures->known > 1 },
        { "spread", "Residuals", true },
        { "rig", "Rig", page->report->solution->drive_residual_mm != NULL },
        { "light", "Light", page->report->light != NULL },
        { "table", "Table", true },
    };

    for (size_t i = 0; i < ARRAY_LEN(parts); i++) {
        if (parts[i].there)
            fprintf(page->out, "<a href=\"#%s\">%s</a>", parts[i].id, parts[i].title);
    }
    fputs("</nav>\n</header>\n<main>\n", page->out);
}

static int write_page(const struct calib_page *page)
{
    int err;

    head(page);
    navigate(page);
    calib_page_summary(page);
    calib_page_array(page);
    err = calib_page_cameras(page);
    if (!err)
        err = calib_page_frames(page);
    if (err) {
        sst_log_error("no memory for the report's maps; close other programs");
        return err;
    }
    calib_page_worst(page);
    calib_page_links(page);
    calib_page_spread(page);
    calib_page_rig(page);
    calib_page_light(page);
    calib_page_table(page);
    calib_page_cards(page);
    fprintf(page->out,
            "<footer>Written by sst %s. Residuals are measured minus predicted; all figures are in pixels of "
            "the untouched pictures unless they say otherwise.</footer>\n</main>\n</body>\n</html>\n",
            SST_VERSION);
    return 0;
}

int sst_calib_report_write(const char *path, const struct sst_calib_report *report)
{
    struct calib_figures figures;
    struct sst_outfile file;
    int err = calib_figures_init(&figures, report);

    if (err)
        return err;
    err = sst_outfile_open(&file, path);
    if (!err) {
        struct calib_shown shown;
        const struct calib_page page = { .out = file.stream, .shown = &shown, .report = report, .figures = &figures };

        err = write_page(&page);
        if (err)
            sst_outfile_abort(&file);
        else
            err = sst_outfile_commit(&file);
    }
    calib_figures_fini(&figures);
    return err;
}

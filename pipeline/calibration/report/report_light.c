/* Light: what the photometric correction found. */
#include "pipeline/calibration/report/report_internal.h"

void calib_page_light(const struct calib_page *page)
{
    const struct sst_light_report *l = page->report->light;
    FILE *out = page->out;

    if (!l)
        return;
    html_section(out, "light", "Light",
                 "The same white patch of the board should be equally bright in all cameras. Gains and fall-off of "
                 "each camera make it so; each camera's fall-off is among the pictures above.");
    fprintf(
        out,
        "<div class=\"keys\">\n<div class=\"key\"><span class=\"name\">Cameras differ by</span><b>%s %% \xE2\x86\x92 "
        "%s %%</b><span>RMS of the relative difference of a patch between cameras in linear light, before and "
        "after the correction.</span></div>\n",
        SST_NUM(100 * l->before, 2), SST_NUM(100 * l->after, 2));
    fprintf(out,
            "<div class=\"key\"><span class=\"name\">Largest fall-off</span><b>%s %%</b><span>of the light is lost in "
            "the corner of the worst camera.</span></div>\n",
            SST_NUM(100 * l->worst_falloff, 2));
    fprintf(out,
            "<div class=\"key\"><span class=\"name\">Largest gain</span><b>%s %%</b><span>off the mean camera: the "
            "camera and colour that differ most.</span></div>\n",
            SST_NUM(100 * l->worst_gain, 2));
    fprintf(out,
            "<div class=\"key\"><span class=\"name\">From</span><b>%s samples</b><span>of white patches, in %s cameras."
            "</span></div>\n</div>\n</section>\n",
            SST_COUNT(l->samples), SST_COUNT(l->cameras));
}

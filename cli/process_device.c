/* Device of `sst process`: counts of its work, for people and programs. */
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "cli/cli_internal.h"

json_t *cli_process_device_json(const struct sst_disparity_device_report *d)
{
    json_t *root, *stages = json_array();

    if (!*d->step.name) {
        json_decref(stages);
        return json_string("cpu");
    }
    for (int i = 0; i < SST_DISPARITY_STAGES; i++) {
        if (d->step.stages_on_cpu >> i & 1)
            json_array_append_new(stages, json_string(sst_disparity_stage_name((enum sst_disparity_stage)i)));
    }
    root = json_pack("{s:o, s:o, s:I, s:I, s:I, s:I, s:I, s:o, s:o}", "name", cli_text_json(d->step.name), "driver",
                     cli_text_json(d->step.driver), "views", (json_int_t)d->views, "on_cpu", (json_int_t)d->on_cpu,
                     "tested", (json_int_t)d->tested, "tested_on_cpu", (json_int_t)d->tested_on_cpu, "failures",
                     (json_int_t)d->step.failures, "why_cpu", *d->step.why ? cli_text_json(d->step.why) : json_null(),
                     "stages_on_cpu", stages);
    if (root)
        json_object_update_new(
            root,
            json_pack("{s:I, s:I, s:I, s:I, s:f, s:f, s:f, s:f}", "in_bands", (json_int_t)d->in_bands, "dispatches",
                      (json_int_t)d->step.dispatches, "uploads", (json_int_t)d->step.uploads, "upload_bytes",
                      (json_int_t)d->step.upload_bytes, "seconds", (double)d->step.total_ns * 1e-9, "upload_seconds",
                      (double)d->step.upload_ns * 1e-9, "wait_seconds", (double)d->step.wait_ns * 1e-9,
                      "download_seconds", (double)d->step.download_ns * 1e-9));
    return root;
}

void cli_process_report_device(const struct sst_disparity_device_report *d)
{
    char stages[256] = "";

    if (!*d->step.name)
        return;
    for (int i = 0; i < SST_DISPARITY_STAGES; i++) {
        const size_t used = strlen(stages);

        if (d->step.stages_on_cpu >> i & 1)
            snprintf(stages + used, sizeof(stages) - used, "%s%s",
                     used ? ", " : "; on the CPU: ", sst_disparity_stage_name((enum sst_disparity_stage)i));
    }
    if (d->on_cpu)
        sst_log_warning("%lld of %lld views were matched on the CPU instead of %s: %s", (long long)d->on_cpu,
                        (long long)(d->on_cpu + d->views), d->step.name, d->step.why);
    else if (d->tested_on_cpu)
        sst_log_warning("the hypotheses of %lld of %lld views were tested on the CPU instead of %s: %s",
                        (long long)d->tested_on_cpu, (long long)(d->tested_on_cpu + d->tested), d->step.name,
                        d->step.why);
    else
        sst_log_info("%lld views matched on %s%s", (long long)d->views, d->step.name, stages);
}

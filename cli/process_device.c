/* Devices of `sst process`: counts of their work, for people and programs. */
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "cli/cli_internal.h"

/* "cpu" without a device. */
static json_t *matching_json(const struct sst_disparity_device_report *d)
{
    json_t *root, *stages = json_array();

    if (!*d->name) {
        json_decref(stages);
        return json_string("cpu");
    }
    for (int i = 0; i < SST_DISPARITY_STAGES; i++) {
        if (d->stages_on_cpu >> i & 1)
            json_array_append_new(stages, json_string(sst_disparity_stage_name((enum sst_disparity_stage)i)));
    }
    root = json_pack("{s:o, s:o, s:I, s:I, s:I, s:I, s:I, s:o, s:o}", "name", cli_text_json(d->name), "driver",
                     cli_text_json(d->driver), "views", (json_int_t)d->views, "on_cpu", (json_int_t)d->on_cpu, "tested",
                     (json_int_t)d->tested, "tested_on_cpu", (json_int_t)d->tested_on_cpu, "failures",
                     (json_int_t)d->failures, "why_cpu", *d->why ? cli_text_json(d->why) : json_null(), "stages_on_cpu",
                     stages);
    if (root)
        json_object_update_new(
            root, json_pack("{s:I, s:I, s:I, s:I, s:f, s:f, s:f, s:f}", "in_bands", (json_int_t)d->in_bands,
                            "dispatches", (json_int_t)d->dispatches, "uploads", (json_int_t)d->uploads, "upload_bytes",
                            (json_int_t)d->upload_bytes, "seconds", (double)d->total_ns * 1e-9, "upload_seconds",
                            (double)d->upload_ns * 1e-9, "wait_seconds", (double)d->wait_ns * 1e-9, "download_seconds",
                            (double)d->download_ns * 1e-9));
    return root;
}

static void report_matching(const struct sst_disparity_device_report *d)
{
    char stages[256] = "";

    if (!*d->name)
        return;
    for (int i = 0; i < SST_DISPARITY_STAGES; i++) {
        const size_t used = strlen(stages);

        if (d->stages_on_cpu >> i & 1)
            snprintf(stages + used, sizeof(stages) - used, "%s%s",
                     used ? ", " : "; on the CPU: ", sst_disparity_stage_name((enum sst_disparity_stage)i));
    }
    if (d->on_cpu)
        sst_log_warning("%lld of %lld views were matched on the CPU instead of %s: %s", (long long)d->on_cpu,
                        (long long)(d->on_cpu + d->views), d->name, d->why);
    else if (d->tested_on_cpu)
        sst_log_warning("the hypotheses of %lld of %lld views were tested on the CPU instead of %s: %s",
                        (long long)d->tested_on_cpu, (long long)(d->tested_on_cpu + d->tested), d->name, d->why);
    else
        sst_log_info("%lld views matched on %s%s", (long long)d->views, d->name, stages);
}

static json_t *refinement_json(const struct sst_refine_device_report *d)
{
    json_t *stages = json_array();
    json_t *root = json_pack("{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:o, s:I, s:I, s:I}", "views", (json_int_t)d->views,
                             "on_cpu", (json_int_t)d->on_cpu, "voted", (json_int_t)d->voted, "voted_on_cpu",
                             (json_int_t)d->voted_on_cpu, "carried", (json_int_t)d->carried, "carried_on_cpu",
                             (json_int_t)d->carried_on_cpu, "failures", (json_int_t)d->failures, "why_cpu",
                             *d->why ? cli_text_json(d->why) : json_null(), "dispatches", (json_int_t)d->dispatches,
                             "uploads", (json_int_t)d->uploads, "upload_bytes", (json_int_t)d->upload_bytes);

    for (int i = 0; i < SST_REFINE_STAGES; i++) {
        if (d->stages_on_cpu >> i & 1)
            json_array_append_new(stages, json_string(sst_refine_stage_name((enum sst_refine_stage)i)));
    }
    if (root) {
        json_object_set_new(root, "in_parts", json_integer((json_int_t)d->in_parts));
        json_object_set_new(root, "enlarged_in_parts", json_integer((json_int_t)d->enlarged_in_parts));
        json_object_set_new(root, "voted_in_parts", json_integer((json_int_t)d->voted_in_parts));
        json_object_set_new(root, "carried_in_parts", json_integer((json_int_t)d->carried_in_parts));
        json_object_set_new(root, "enlarged", json_integer((json_int_t)d->enlarged));
        json_object_set_new(root, "enlarged_on_cpu", json_integer((json_int_t)d->enlarged_on_cpu));
        json_object_set_new(root, "stages_on_cpu", stages);
    } else {
        json_decref(stages);
    }
    if (root)
        json_object_update_new(root,
                               json_pack("{s:f, s:f, s:f, s:f}", "seconds", (double)d->total_ns * 1e-9,
                                         "upload_seconds", (double)d->upload_ns * 1e-9, "wait_seconds",
                                         (double)d->wait_ns * 1e-9, "download_seconds", (double)d->download_ns * 1e-9));
    return root;
}

json_t *cli_process_devices_json(const struct cli_process_devices *d)
{
    json_t *root = matching_json(&d->matching);

    if (json_is_object(root))
        json_object_set_new(root, "refinement", refinement_json(&d->refinement));
    return root;
}

static void report_refinement(const struct sst_refine_device_report *d)
{
    char stages[128] = "";

    for (int i = 0; i < SST_REFINE_STAGES; i++) {
        const size_t used = strlen(stages);

        if (d->stages_on_cpu >> i & 1)
            snprintf(stages + used, sizeof(stages) - used, "%s%s",
                     used ? ", " : "; on the CPU: ", sst_refine_stage_name((enum sst_refine_stage)i));
    }
    if (d->on_cpu)
        sst_log_warning("the labels of %lld of %lld views were refined on the CPU instead of %s: %s",
                        (long long)d->on_cpu, (long long)(d->on_cpu + d->views), d->name, d->why);
    else if (d->voted_on_cpu)
        sst_log_warning("the votes about the labels of %lld of %lld views were counted on the CPU instead of %s: %s",
                        (long long)d->voted_on_cpu, (long long)(d->voted_on_cpu + d->voted), d->name, d->why);
    else if (d->enlarged_on_cpu)
        sst_log_warning("the labels of %lld of %lld views were enlarged on the CPU instead of %s: %s",
                        (long long)d->enlarged_on_cpu, (long long)(d->enlarged_on_cpu + d->enlarged), d->name, d->why);
    else if (d->carried_on_cpu)
        sst_log_warning("labels were carried to %lld of %lld views on the CPU instead of %s: %s",
                        (long long)d->carried_on_cpu, (long long)(d->carried_on_cpu + d->carried), d->name, d->why);
    else if (d->views)
        sst_log_info("the labels of %lld views refined on %s%s", (long long)d->views, d->name, stages);
}

void cli_process_report_devices(const struct cli_process_devices *d)
{
    report_matching(&d->matching);
    report_refinement(&d->refinement);
}

/* Networks on a device: counts of their runs there, for people and programs. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>

#include "base/log.h"
#include "cli/cli_internal.h"

/* Mean of the runs on the device. */
static json_t *mean_ms(int64_t ns, int64_t runs)
{
    return cli_real_json(runs ? (double)ns * 1e-6 / (double)runs : NAN);
}

json_t *cli_network_device_json(struct sst_runner_user *d)
{
    struct sst_network_device_report r;
    json_t *root;

    if (!d)
        return json_string("cpu");
    sst_network_device_get_report(d, &r);
    root = json_pack("{s:o, s:o, s:I, s:I, s:I, s:I, s:I}", "name", cli_text_json(r.step.name), "driver",
                     cli_text_json(r.step.driver), "runs", (json_int_t)r.runs, "fed", (json_int_t)0, "kept",
                     (json_int_t)r.kept, "on_cpu", (json_int_t)r.on_cpu, "failures", (json_int_t)r.step.failures);
    json_object_set_new(root, "why_cpu", r.on_cpu ? cli_text_json(r.step.why) : json_null());
    json_object_update_new(root, json_pack("{s:i, s:I, s:I}", "plans", r.plans, "memory_bytes",
                                           (json_int_t)r.memory_bytes, "dispatches", (json_int_t)r.step.dispatches));
    json_object_set_new(root, "conv8", *r.conv8 ? json_string(r.conv8) : json_null());
    json_object_set_new(root, "run_ms", mean_ms(r.step.total_ns - r.step.upload_ns - r.step.download_ns, r.runs));
    json_object_set_new(root, "upload_ms", mean_ms(r.step.upload_ns, r.runs));
    json_object_set_new(root, "download_ms", mean_ms(r.step.download_ns, r.runs));
    return root;
}

void cli_network_report_device(struct sst_runner_user *d)
{
    struct sst_network_device_report r;

    if (!d)
        return;
    sst_network_device_get_report(d, &r);
    if (r.on_cpu)
        sst_log_warning("%lld of %lld runs of a network were on the CPU instead of %s: %s", (long long)r.on_cpu,
                        (long long)(r.on_cpu + r.runs), r.step.name, r.step.why);
    else
        sst_log_info("networks ran on %s", r.step.name);
}

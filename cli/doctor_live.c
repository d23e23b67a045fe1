/* Device of the service's live picture: the one of the configuration, and the steps that fall back to the CPU. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/text.h"
#include "cli/cli_internal.h"
#include "cli/doctor_internal.h"
#include "config/sstd.h"
#include "pipeline/gpu/gpu.h"
#include "pipeline/live/live.h"

#define AREA_LIVE "live"

void cli_steps_text(char *out, size_t size, const char *const *steps)
{
    *out = 0;
    for (int i = 0; steps[i]; i++)
        sst_text_add(out, size, "%s%s", i ? ", " : "", steps[i]);
}

/* A device that opens is tested by doctor_check_gpu(). */
static void check_device(struct doctor *d, const char *name)
{
    char why[SST_LOG_MAX] = "", there[128], here[128];
    char *const before = sst_log_hold_errors(why);
    struct sst_gpu *g;
    const int err = sst_gpu_open(&g, name, NULL);

    sst_log_hold_errors(before);
    if (err == -ENOENT && !strcmp(name, "auto")) {
        doctor_add(d, DOCTOR_OK, AREA_LIVE, "live.device auto: there is no GPU, and the live picture is the CPU's");
    } else if (err) {
        doctor_add(d, DOCTOR_WARNING, AREA_LIVE, "live.device %s: %s; until then the live picture is the CPU's", name,
                   *why ? why : sst_gpu_error(err));
    } else {
        cli_steps_text(there, sizeof(there), sst_live_device_steps);
        cli_steps_text(here, sizeof(here), sst_live_cpu_steps);
        doctor_add(d, DOCTOR_OK, AREA_LIVE, "live.device %s: on %s are %s; on the CPU are %s", name,
                   sst_gpu_get_info(g)->name, there, here);
        sst_gpu_close(g);
    }
}

void doctor_check_live(struct doctor *d)
{
    struct sst_config *cfg = malloc(sizeof(*cfg));
    char why[SST_LOG_MAX] = "", *before;
    int err = cfg ? 0 : -ENOMEM;

    if (!err) {
        sst_config_defaults(cfg);
        before = sst_log_hold_errors(why);
        err = sst_config_read(cfg, d->config);
        sst_log_hold_errors(before);
    }
    if (err)
        doctor_add(d, DOCTOR_WARNING, AREA_LIVE, "the service does not start with this configuration: %s",
                   *why ? why : strerror(-err));
    else if (!cfg->live.enabled)
        doctor_add(d, DOCTOR_OK, AREA_LIVE, "live.enabled is false: there is no live picture");
    else if (!strcmp(cfg->live.device, "cpu"))
        doctor_add(d, DOCTOR_OK, AREA_LIVE, "live.device is cpu: all of the live picture is computed on the CPU");
    else
        check_device(d, cfg->live.device);
    free(cfg);
}

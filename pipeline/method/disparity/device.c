/* Matching on a device: its steps, its report. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/method/disparity/device.h"
#include "pipeline/method/disparity/device_internal.h"

_Static_assert(SST_MAX_VIEWS <= SST_PLANE_VIEWS, "a place each");

static const struct sst_step_shaders steps[] = {
    { &disparity_features_step, dispatch_features, NULL, NULL },
    { &disparity_match_step, dispatch_match, NULL, match_refuses },
    { &disparity_sweep_step, dispatch_sweep, visible_derive, NULL },
    { &disparity_surfaces_step, dispatch_surfaces, visible_derive, NULL },
    { &disparity_subpixel_step, dispatch_subpixel, subpixel_derive, NULL },
    { &disparity_carry_step, dispatch_carry, NULL, NULL },
    { &disparity_check_step, dispatch_check, NULL, NULL },
    { &disparity_fill_step, dispatch_fill, NULL, NULL },
    { &disparity_background_step, dispatch_background, NULL, NULL },
    /* of the shaders of disparity_match_step, which are compared there */
    { &disparity_compare_step, dispatch_compare, NULL, compare_refuses },
    { NULL, NULL, NULL, NULL },
};

#define X(STAGE, name) name,
static const char *const stage_names[SST_DISPARITY_STAGES] = { SST_DISPARITY_STAGE_LIST(X) };
#undef X

const char *sst_disparity_stage_name(enum sst_disparity_stage stage)
{
    return stage_names[stage];
}

int sst_disparity_device_create(struct sst_runner_user **out, struct sst_runner *shared)
{
    struct sst_runner_user *user = shared ? calloc(1, sizeof(*user)) : NULL;
    int err;

    *out = NULL;
    if (!shared)
        return 0;
    if (!user) {
        sst_log_error("not enough memory for a device");
        return -ENOMEM;
    }
    *user = (struct sst_runner_user){ .steps = steps, .step_count = ARRAY_LEN(steps) - 2, .work = "match" };
    err = sst_runner_join(shared, user);
    if (err)
        free(user);
    else
        *out = user;
    return err;
}

void sst_disparity_device_destroy(struct sst_runner_user *user)
{
    if (user)
        sst_runner_leave(user->runner, user);
    free(user);
}

void sst_disparity_device_report(struct sst_runner_user *user, struct sst_step_report *out)
{
    *out = user->report;
    user->report = (struct sst_step_report){ 0 };
    memcpy(user->report.name, out->name, sizeof(out->name));
    memcpy(user->report.driver, out->driver, sizeof(out->driver));
}

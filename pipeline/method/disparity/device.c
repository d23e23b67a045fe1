/* Matching on a device: its steps, its report. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "pipeline/method/disparity/device.h"
#include "pipeline/method/disparity/disparity_internal.h"

_Static_assert(SST_MAX_VIEWS <= SST_PLANE_VIEWS, "a place each");

#define X(STAGE, name)
#define S(STAGE, step, name) &disparity_##step##_step,
static const struct sst_step *const steps[] = { &disparity_features_step, &disparity_match_step, &disparity_sweep_step,
                                                SST_DISPARITY_STAGE_LIST(X, S) };
#undef X
#undef S

#define X(STAGE, name)       name,
#define S(STAGE, step, name) name,
static const char *const stage_names[SST_DISPARITY_STAGES] = { SST_DISPARITY_STAGE_LIST(X, S) };
#undef X
#undef S

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
    *user = (struct sst_runner_user){ .steps = steps, .step_count = ARRAY_LEN(steps), .work = "match" };
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

void sst_disparity_device_report(struct sst_runner_user *user, struct sst_disparity_device_report *out)
{
    const struct sst_step_items *matched = &user->report.items[SST_DISPARITY_MATCHED];
    const struct sst_step_items *tested = &user->report.items[SST_DISPARITY_TESTED];

    *out = (struct sst_disparity_device_report){ .step = user->report,
                                                 .views = matched->device,
                                                 .in_bands = matched->in_bands,
                                                 .on_cpu = matched->on_cpu,
                                                 .tested = tested->device,
                                                 .tested_on_cpu = tested->on_cpu };
    user->report = (struct sst_step_report){ 0 };
    memcpy(user->report.name, out->step.name, sizeof(out->step.name));
    memcpy(user->report.driver, out->step.driver, sizeof(out->step.driver));
}

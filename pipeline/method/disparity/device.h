/* pipeline/method/disparity/device.h - a device that matches light fields. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_DISPARITY_DEVICE_H
#define SST_PIPELINE_METHOD_DISPARITY_DEVICE_H

#include "pipeline/method/disparity/disparity.h"
#include "pipeline/step/runner.h"

/**
 * Match views on a device: the costs of each by census and features of its neighbours, their aggregation, the
 * optimisation, winners and filters; in the second pass its hypotheses and their tests; refinement between pixels,
 * carried maps, check and filling. The results are the bytes of the CPU. A view whose volume does not fit is matched in
 * bands of rows, costs computed twice; one of which no band fits on the CPU. A device that fails is logged as a warning
 * and counted; the view is then matched on the CPU, and the device is tried again later.
 *
 * @param shared  the device, which lives longer; NULL: *out is NULL
 * @param out     NULL: on the CPU
 * @return 0, -ENOMEM, or an error of sst_runner_join(); logged
 */
SST_MUST_CHECK int sst_disparity_device_create(struct sst_runner_user **out, struct sst_runner *shared);
void sst_disparity_device_destroy(struct sst_runner_user *d);

/** Its work since the last report, by enum sst_disparity_counter and enum sst_disparity_stage. */
void sst_disparity_device_report(struct sst_runner_user *d, struct sst_step_report *out);

#endif

/* pipeline/method/network/device.h - a device that runs networks: weights and activations stay in its memory.
 *
 * Needs a build with oneDNN, whose plans decide what is computed on 8 bits. The shaders compute the same numbers,
 * with VNNI and without: equal bytes after convolutions on 8 bits, and sums in another order in those on floats, of
 * which a network on 8 bits has the first one alone.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_METHOD_NETWORK_DEVICE_H
#define SST_PIPELINE_METHOD_NETWORK_DEVICE_H

#include "pipeline/step/runner.h"

/* Users of a runner for networks: any number of threads and networks; one network runs at a time. */

/**
 * Open a device for networks.
 *
 * @param name          as of sst_gpu_open(), or "cpu": no device; "auto" without a GPU as well: *out is NULL then
 * @param memory_bytes  that it may use of the device's memory; 0: three quarters. A network that does not fit runs on
 *                      the CPU
 * @return 0, as sst_gpu_open(), or -ENOTSUP (a shader of convolutions is refused, or built without oneDNN); logged
 */
SST_MUST_CHECK int sst_network_device_open(struct sst_runner_user **out, const char *name, uint64_t memory_bytes);

/** The same on a device that other kinds of work use as well. @param shared  lives longer; NULL: *out is NULL */
SST_MUST_CHECK int sst_network_device_open_on(struct sst_runner_user **out, struct sst_runner *shared);

/**
 * The same for labels of live pictures: a wait for the device is shorter (struct sst_gpu_config, `prompt`), and a
 * device that cannot be opened now is tried again later, as one that fails; one that computes something else is not. Of
 * failures in a row only the first is logged, and that the device works again. Pictures share the device: memory_bytes
 * of 0 is SST_GPU_LABELS_PERCENT of it.
 *
 * @return 0, also where there is no such device (*out is NULL for "cpu", for "auto" without a GPU, and in a build
 * without oneDNN, which a warning says); -ENOMEM (logged)
 */
SST_MUST_CHECK int sst_network_device_open_live(struct sst_runner_user **out, const char *name,
                                                uint64_t memory_bytes);

/** After all networks that use it. NULL is fine. */
void sst_network_device_close(struct sst_runner_user *user);

/** Work of networks on a device. */
struct sst_network_device_report {
    struct sst_step_report step; /* the name as asked for, if it was never opened; times are of runs */
    int64_t runs;                /* of networks, there */
    int64_t kept;                /* of them: whose result was not copied to the host */
    int64_t on_cpu;              /* others; the last one's reason: step.why */
    int plans;                   /* networks times sizes that lie there now */
    char conv8[32];              /* shader of convolutions on 8 bits in the last plan; "": none yet */
    int64_t memory_bytes;        /* of the plans */
};
void sst_network_device_get_report(struct sst_runner_user *user, struct sst_network_device_report *out);

/** Count from 0 from now on. */
void sst_network_device_clear_report(struct sst_runner_user *user);

#endif

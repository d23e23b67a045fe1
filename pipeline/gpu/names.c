/* Names of kinds of devices and of errors, for messages. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>

#include "pipeline/gpu/gpu.h"

const char *sst_gpu_kind_name(enum sst_gpu_kind kind)
{
    static const char *const names[] = { "software", "other", "virtual", "integrated", "discrete" };

    return names[kind];
}

const char *sst_gpu_error(int err)
{
    switch (err) {
    case -ENODEV:
        return "the device is lost";
    case -ETIMEDOUT:
        return "the device does not answer";
    case -ENOMEM:
        return "not enough memory on the device";
    case -ENOTSUP:
        return "a shader is refused";
    case -ENOENT:
        return "the device is not found";
    default:
        return "the driver fails";
    }
}

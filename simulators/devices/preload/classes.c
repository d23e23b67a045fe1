/* Table of the device classes. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "simulators/devices/preload/preload_internal.h"

#include <stddef.h>

const struct sim_class *const sim_classes[] = { &sim_class_v4l2, &sim_class_gpio, &sim_class_usb, &sim_class_attribute,
                                                &sim_class_uevent };
const int sim_class_count = (int)ARRAY_LEN(sim_classes);

const struct sim_class *sim_class_find(char letter)
{
    for (int i = 0; i < sim_class_count; i++)
        if (sim_classes[i]->letter == letter)
            return sim_classes[i];
    return NULL;
}

/* Frames lost, by the numbers of frames. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/genicam/genicam_internal.h"

#define ID_16 65535

uint32_t genicam_lost_before(struct genicam_ids *ids, uint64_t id)
{
    const uint32_t unknown = ids->unknown;
    uint64_t step;

    if (!id) {
        ids->unknown += ids->any;
        return 0;
    }
    /* Backwards from a high number of 16 bits to a low one is the wrap, which leaves 0 out. */
    step = id - ids->last;
    if (ids->any && id < ids->last && ids->last <= ID_16 && ids->last - id > ID_16 / 2)
        step = id + ID_16 - ids->last;
    if (!ids->any || !step || step > ID_16 / 2)
        step = 1 + unknown;
    *ids = (struct genicam_ids){ true, id, 0 };
    return step > 1 + (uint64_t)unknown ? (uint32_t)(step - 1 - unknown) : 0;
}

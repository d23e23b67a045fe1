/* GPIO of builds without libgpiod: opening a chip always fails, so the other functions are never called. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "drivers/trigger/trigger_internal.h"

#include <errno.h>

int gpio_chip_open(struct trigger_chip **out SST_UNUSED, const char *path SST_UNUSED)
{
    return -ENOSYS;
}

const char *gpio_chip_label(const struct trigger_chip *c SST_UNUSED)
{
    return "";
}

int gpio_chip_lines(const struct trigger_chip *c SST_UNUSED)
{
    return 0;
}

int gpio_chip_line(struct trigger_chip *c SST_UNUSED, unsigned offset SST_UNUSED, struct trigger_line *out SST_UNUSED)
{
    return -ENOSYS;
}

int gpio_chip_request(struct trigger_chip *c SST_UNUSED, const struct gpio_request *r SST_UNUSED)
{
    return -ENOSYS;
}

int gpio_chip_set(struct trigger_chip *c SST_UNUSED, uint64_t active SST_UNUSED)
{
    return -ENOSYS;
}

int gpio_chip_edge(struct trigger_chip *c SST_UNUSED, int64_t timeout_ns SST_UNUSED, struct gpio_edge *out SST_UNUSED)
{
    return -ENOSYS;
}

void gpio_chip_close(struct trigger_chip *c SST_UNUSED)
{
}

/* Built without libgpiod: no chip opens, so that nothing below the opening is ever reached. */
#if WITH_GPIOD == 0
#include "drivers/trigger/gpio.h"

#include <errno.h>

int sst_gpio_chip_open(struct sst_gpio_chip **out SST_UNUSED, const char *path SST_UNUSED)
{
    return -ENOSYS;
}

const char *sst_gpio_chip_label(const struct sst_gpio_chip *c SST_UNUSED)
{
    return "";
}

int sst_gpio_chip_lines(const struct sst_gpio_chip *c SST_UNUSED)
{
    return 0;
}

int sst_gpio_chip_line(struct sst_gpio_chip *c SST_UNUSED, unsigned offset SST_UNUSED,
                       struct sst_gpio_line *out SST_UNUSED)
{
    return -ENOSYS;
}

int sst_gpio_chip_request(struct sst_gpio_chip *c SST_UNUSED, const struct sst_gpio_request *r SST_UNUSED)
{
    return -ENOSYS;
}

int sst_gpio_chip_set(struct sst_gpio_chip *c SST_UNUSED, uint64_t active SST_UNUSED)
{
    return -ENOSYS;
}

int sst_gpio_chip_edge(struct sst_gpio_chip *c SST_UNUSED, int64_t timeout_ns SST_UNUSED,
                       struct sst_gpio_edge *out SST_UNUSED)
{
    return -ENOSYS;
}

void sst_gpio_chip_close(struct sst_gpio_chip *c SST_UNUSED)
{
}
#else
typedef int sst_gpio_none_not_built; /* a translation unit holds something */
#endif

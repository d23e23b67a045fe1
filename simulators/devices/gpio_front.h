/* simulators/devices/gpio_front.h - simulated GPIO chips as programs of a session see them. */
#ifndef SST_SIMULATORS_DEVICES_GPIO_FRONT_H
#define SST_SIMULATORS_DEVICES_GPIO_FRONT_H

#include "simulators/devices/faults.h"
#include "simulators/devices/sysfs.h"

struct sst_sim_gpio_front; /* opaque; simulator's thread */

struct sst_sim_gpio_front_config {
    struct sst_sim_sysfs *sysfs;
    struct sst_sim_faults *faults;
    int lines;     /* trigger lines TRIG0.., 1..16 */
    uint64_t seed;
    void *arg;
    /** A trigger line rose. */
    void (*edge)(void *arg, int line, int64_t t_ns);
};

/**
 * Make the chips appear: gpiochip0 "sst-board", gpiochip1 "sst-trigger" with lines TRIG0.. and the input LOOP0 that is
 * wired to TRIG0. @return 0 or -errno, logged.
 */
SST_MUST_CHECK int sst_sim_gpio_front_open(struct sst_sim_gpio_front **out,
                                           const struct sst_sim_gpio_front_config *cfg);
void sst_sim_gpio_front_close(struct sst_sim_gpio_front *front);

#endif

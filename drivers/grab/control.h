/* drivers/grab/control.h - V4L2 controls by name. Only for drivers/grab and its tests. */
#ifndef SST_DRIVERS_GRAB_CONTROL_H
#define SST_DRIVERS_GRAB_CONTROL_H

#include "drivers/grab/grab.h"

/** "White Balance, Automatic" as v4l2-ctl writes it: white_balance_automatic. */
void sst_control_name(char *out, size_t size, const char *title);

/**
 * Set controls: switches and menus first (a value under an automatic mode does not take), each group in the given
 * order; then read all back.
 *
 * @param why  out [size]: one sentence that names every control that is not as asked; "" when all are
 */
void sst_controls_apply(int fd, const struct sst_grab_control *control, int count, char *why, size_t size);

#endif

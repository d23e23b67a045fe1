/* Cameras of a build without libudev: none is listed or opened, and a monitor is closed at most. */
#include "drivers/grab/grab_internal.h"

#include <errno.h>

#include "base/log.h"

static int refuse(void)
{
    sst_log_error("this build has no libudev, by which cameras are found: install libudev-dev and build again");
    return -ENOPKG;
}

int grab_scan(struct grab_node **nodes SST_UNUSED, int *count SST_UNUSED)
{
    return refuse();
}

int grab_monitor_open(struct grab_monitor **out SST_UNUSED)
{
    return refuse();
}

int grab_monitor_fd(const struct grab_monitor *watch SST_UNUSED)
{
    return -1;
}

int grab_monitor_next(struct grab_monitor *watch SST_UNUSED, struct grab_node *node SST_UNUSED)
{
    return 0;
}

void grab_monitor_close(struct grab_monitor *watch SST_UNUSED)
{
}

/* One rung of drivers/usb on one device.   usb reset|authorise|power PORT */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include "drivers/usb/usb.h"

int main(int argc, char **argv)
{
    int err;

    if (argc != 3)
        return 2;
    err = !strcmp(argv[1], "reset")       ? sst_usb_reset(argv[2])
          : !strcmp(argv[1], "authorise") ? sst_usb_reauthorise(argv[2])
                                          : sst_usb_power_cycle(argv[2], 500);
    printf("%s %d\n", argv[1], err);
    return err ? 1 : 0;
}

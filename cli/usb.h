/* cli/usb.h - the cameras of a configuration on the USB tree, and the plan of their bandwidth. */
#ifndef SST_CLI_USB_H
#define SST_CLI_USB_H

#include <jansson.h>

#include "config/array.h"
#include "drivers/usb/plan.h"

struct cli_usb {
    struct sst_usb_device *devices;
    int count;
    struct sst_usb_stream *streams; /* a camera each, in the order of `bind`, else of the tree */
    int stream_count;
    int64_t needed_bytes_s; /* of each; 0: unknown */
    struct sst_usb_plan plan;
};

/** List devices, choose the cameras that cfg binds (all of them without `bind`), plan them. @return 0 or -errno,
 * logged. */
SST_MUST_CHECK int cli_usb_open(struct cli_usb *usb, const struct sst_array_config *cfg);
void cli_usb_close(struct cli_usb *usb); /* a zeroed one is fine */

/**
 * What would make the refused cameras fit, in sentences: a free port elsewhere, less data from each camera.
 * @param text  out, "" if all fit
 */
void cli_usb_advise(const struct cli_usb *usb, const struct sst_array_config *cfg, char *text, size_t size);

/** A text of a device, which may end within a character. */
json_t *cli_text_json(const char *text);

#endif

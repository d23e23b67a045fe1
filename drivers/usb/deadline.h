/* drivers/usb/deadline.h - a call into the kernel that may block for long, waited for no longer than agreed. */
#ifndef SST_DRIVERS_USB_DEADLINE_H
#define SST_DRIVERS_USB_DEADLINE_H

#include "base/base.h"

typedef int sst_deadline_fn(void *arg);

/**
 * Call fn on a thread of its own and wait for it up to timeout_ms. After that the call is left to end by itself.
 *
 * @param arg  copied, arg_size bytes: fn's copy lives as long as fn runs
 * @return what fn returns, -ETIMEDOUT, -ENOMEM or -EAGAIN (no thread)
 */
SST_MUST_CHECK int sst_deadline_call(sst_deadline_fn *fn, const void *arg, size_t arg_size, int timeout_ms);

#endif

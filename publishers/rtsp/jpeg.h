/* publishers/rtsp/jpeg.h - which JPEGs RTP can carry as they are. */
#ifndef SST_PUBLISHERS_RTSP_JPEG_H
#define SST_PUBLISHERS_RTSP_JPEG_H

#include <stdbool.h>

#include "base/base.h"

/** Does this JPEG fit RFC 2435? @param why  out, a phrase if it does not */
bool rtsp_jpeg_fits(const uint8_t *data, size_t bytes, char *why, size_t room);

#endif

/* capture/recording/pixel_format.h - the formats that are recorded, and their names. */
#ifndef SST_CAPTURE_RECORDING_PIXEL_FORMAT_H
#define SST_CAPTURE_RECORDING_PIXEL_FORMAT_H

#include <stdbool.h>

#include "base/base.h"

/** Can frames of this V4L2 format be recorded? MJPG, JPEG, YUYV, GREY, Y16 and 8-bit Bayer are. */
bool sst_recording_format_known(uint32_t fourcc);

/** "MJPG", "Y16" ... (no blanks at the end; what cannot be printed is '?'), and the way back; 0: not 1 to 4 letters. */
void sst_recording_format_name(uint32_t fourcc, char out[5]);
uint32_t sst_recording_format_parse(const char *name);

#endif

/* capture/recording/ebml.h - heads of Matroska elements, as far as finding frames and ends of files needs them. */
#ifndef SST_CAPTURE_RECORDING_EBML_H
#define SST_CAPTURE_RECORDING_EBML_H

#include "base/base.h"

#define SST_EBML_HEAD         0x1A45DFA3u
#define SST_EBML_SEGMENT      0x18538067u
#define SST_EBML_CLUSTER      0x1F43B675u
#define SST_EBML_BLOCK_GROUP  0xA0u
#define SST_EBML_BLOCK        0xA1u
#define SST_EBML_SIMPLE_BLOCK 0xA3u

#define SST_EBML_UNKNOWN  UINT64_MAX /* size of an element that was not finished */
#define SST_EBML_HEAD_MAX 12         /* bytes of an id and a size at most */

struct sst_ebml {
    uint32_t id;
    uint64_t size; /* of what follows the head, or SST_EBML_UNKNOWN */
    size_t head;   /* bytes */
};

/** Read a number of 1 to 8 bytes. @param value  without the length's marker. All ones is a value here: libavformat
 * writes track 127 so. @return its bytes, 0 when data ends before it or it is none. */
size_t sst_ebml_number(const uint8_t *data, size_t n, uint64_t *value);

/** Read an element's head. @return 0 or -EBADMSG (not logged). */
SST_MUST_CHECK int sst_ebml_head(const uint8_t *data, size_t n, struct sst_ebml *out);

#endif

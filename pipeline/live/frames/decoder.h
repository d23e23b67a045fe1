/* pipeline/live/frames/decoder.h - what live views need of a camera's frame: a small picture to see change in, and parts of
 * the frame decoded. Inside pipeline/live only. */
#ifndef SST_PIPELINE_LIVE_FRAMES_DECODER_H
#define SST_PIPELINE_LIVE_FRAMES_DECODER_H

#include <stdbool.h>

#include "base/base.h"

/** Means over blocks of samples, in 1/8 levels (0 .. 2047). */
struct sst_cells {
    int planes; /* 1 or 3: brightness, then two of colour; 0: not read yet */
    struct {
        int cols, rows;
        int step_x, step_y; /* px of the frame in a cell */
        int zero;           /* value of no light (brightness, a colour's own) or of no colour */
        int16_t *mean;      /* [rows * cols] */
    } plane[3];
};

/** Room for frames of a size: cells of 8x8 px at the smallest. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_cells_init(struct sst_cells *c, int width, int height);
void sst_cells_fini(struct sst_cells *c);
/** The same planes of the same sizes? */
bool sst_cells_alike(const struct sst_cells *a, const struct sst_cells *b);
/** @param to  of the same size of frame */
void sst_cells_copy(struct sst_cells *to, const struct sst_cells *from);

struct sst_decoder; /* one thread at a time */

/** @param fourcc  V4L2: MJPG, JPEG, or what pipeline/image/raw.h reads @return 0, -EINVAL (format, size), -ENOMEM */
SST_MUST_CHECK int sst_decoder_create(struct sst_decoder **out, uint32_t fourcc, int width, int height);
void sst_decoder_destroy(struct sst_decoder *d);

/** Is this format JPEG? */
bool sst_decoder_is_jpeg(uint32_t fourcc);

/** A camera's bytes; stride 0: rows without padding, or JPEG. */
struct sst_decoder_frame {
    const uint8_t *data;
    size_t bytes, stride;
};

/**
 * The small picture of a frame.
 *
 * @param cells  of sst_cells_init() for this size; partly written when it fails
 * @return 0, -ENOTSUP (a kind of JPEG that is only read by decoding), -EBADMSG (damaged, or of another size: see
 *         sst_decoder_fault())
 */
SST_MUST_CHECK int sst_decoder_look(struct sst_decoder *d, const struct sst_decoder_frame *frame,
                                    struct sst_cells *cells);

/**
 * Decode columns x0 .. x1-1 of rows y0 .. y1-1: the pixels that decoding the whole frame gives.
 *
 * @param pixels  out, borrowed until the next call: the frame's pixel (0, 0), R, G, B and a byte of no meaning each;
 * only the part is set
 * @param stride  out, bytes
 * @return 0, -EBADMSG (damaged, or of another size), -ENOMEM
 */
SST_MUST_CHECK int sst_decoder_decode(struct sst_decoder *d, const struct sst_decoder_frame *frame, int x0, int y0,
                                      int x1, int y1, const uint8_t **pixels, size_t *stride);

/** What was wrong with the last frame that was refused. */
const char *sst_decoder_fault(const struct sst_decoder *d);

#endif

/* capture/link/pieces.h - a message cut into pieces, one for each datagram, with parity: any that are enough restore
 * it.
 *
 * A message of n bytes has ceil(n / SST_PIECE_BYTES) data pieces of equal size, the last one filled with zeros. They
 * are dealt out to blocks, piece i to block i % blocks, so that neighbours, which are lost together, are of different
 * blocks. Each block of k data pieces has m parity pieces, and any k of its k + m pieces restore it. Parity row r is
 *
 *   p_r = sum over j of d_j / ((k + r) ^ j)        in GF(2^8) with the polynomial 0x11d,
 *
 * a Cauchy matrix, of which every square part can be inverted. The whole message is coded, not each picture by itself:
 * a picture of 7 pieces needs 3 more to survive a loss of 2 % in all but 1 of 30000 cases; of the 120 pieces of 18
 * pictures 11 more do that.
 *
 * Data pieces are numbered from 0, parity piece r of block b follows as data + r * blocks + b. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_LINK_PIECES_H
#define SST_CAPTURE_LINK_PIECES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/base.h"
#include "base/mem.h"

#define SST_PIECE_BYTES        1152 /* at most: with all headers below 1280, which every IPv6 path carries */
#define SST_PIECE_HEAD         24
#define SST_PIECES_BLOCK_MAX   128       /* data pieces of a block */
#define SST_PIECES_PARITY_MAX  112       /* parity pieces of a block */
#define SST_PIECES_MESSAGE_MAX (4 << 20) /* bytes of a message: longer ones are not cut */
#define SST_PIECES_DATA_MAX    (SST_PIECES_MESSAGE_MAX / SST_PIECE_BYTES + 1)
#define SST_PIECES_BLOCKS_MAX  (SST_PIECES_DATA_MAX / SST_PIECES_BLOCK_MAX + 1)

/** How a message is cut. */
struct sst_pieces_shape {
    uint32_t bytes;
    int parity; /* pieces of each block */
    int data, blocks, all;
    size_t piece; /* bytes of each */
};

/** A datagram: SST_PIECE_HEAD bytes (session, seq, bytes of the message, index, parity; little-endian), then its data.
 */
struct sst_piece {
    uint64_t session, seq;
    uint32_t bytes;
    int index, parity;
    const uint8_t *data; /* [shape.piece] */
};

/** Can this build code at all (ISA-L)? */
bool sst_pieces_built(void);

/** Parity pieces that each block of a message has: a share of its data pieces, and two. @param percent  0 .. 80 */
int sst_pieces_parity(size_t bytes, int percent);

/** @return 0, -EINVAL (no bytes, too many bytes or too much parity); `out` untouched then */
SST_MUST_CHECK int sst_pieces_shape(struct sst_pieces_shape *out, size_t bytes, int parity);

void sst_piece_put(uint8_t out[SST_PIECE_HEAD], const struct sst_piece *piece);
/** @param in  a datagram from anywhere @return 0, -EBADMSG (it is no piece) */
SST_MUST_CHECK int sst_piece_get(const uint8_t *in, size_t bytes, struct sst_piece *piece,
                                 struct sst_pieces_shape *shape);

struct sst_pieces_coder; /* opaque: tables and room to compute; one thread */

/** @return 0, -ENOMEM, -ENOSYS (built without ISA-L) */
SST_MUST_CHECK int sst_pieces_coder_create(struct sst_pieces_coder **out);
/** NULL is fine. */
void sst_pieces_coder_destroy(struct sst_pieces_coder *coder);

/** Add parity. @param pieces  [shape->all][shape->piece]: in, the message and zeros up to shape->data; out, the rest */
void sst_pieces_encode(struct sst_pieces_coder *coder, const struct sst_pieces_shape *shape, uint8_t *pieces);

/** A message that is being received. Zeroed: none. One thread. */
struct sst_pieces {
    struct sst_pieces_shape shape;
    struct sst_mem_kept kept;
    uint8_t *buffer; /* [shape.all][shape.piece] in it */
    uint8_t *have;   /* [SST_PIECES_DATA_MAX + SST_PIECES_BLOCKS_MAX * SST_PIECES_PARITY_MAX] */
    int got[SST_PIECES_BLOCKS_MAX], blocks_whole; /* pieces of each block */
};

/** Begin a message; memory of an earlier one is used again. @return 0, -ENOMEM */
SST_MUST_CHECK int sst_pieces_begin(struct sst_pieces *p, const struct sst_pieces_shape *shape);
/** @param index  of a piece of its shape @return true: it is new and of use */
bool sst_pieces_add(struct sst_pieces *p, int index, const uint8_t *data);
/** Enough has come to restore it. */
bool sst_pieces_complete(const struct sst_pieces *p);
/** Restore the missing pieces of a complete message; its bytes are then the first shape.bytes of p->buffer. */
void sst_pieces_restore(struct sst_pieces *p, struct sst_pieces_coder *coder);
/** Data pieces that would complete it. @param index  out, [SST_PIECES_DATA_MAX] @return how many */
int sst_pieces_wanted(const struct sst_pieces *p, uint16_t *index);
/** Free its memory. */
void sst_pieces_fini(struct sst_pieces *p);

#endif

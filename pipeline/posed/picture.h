/* pipeline/posed/picture.h - pictures of a posed light field as samples of 16 bits. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_PICTURE_H
#define SST_PIPELINE_POSED_PICTURE_H

#include "pipeline/image/deep.h"
#include "pipeline/posed/posed.h"

/** Read a view's picture, levels as they are in its file, or copy it. @param dir  of the light field. Thread: any
 *  @return 0, -ENOENT, -EBADMSG (damaged, of another size, or other bytes than its hash), -ENOMEM, -EIO; logged */
SST_MUST_CHECK int sst_posed_picture(struct sst_deep *out, const struct sst_posed *posed, const char *dir, int view);

/** Keep pictures that sst_posed_borrow() reads, if all placed views have at most `most` bytes and a quarter of the
 *  memory (the machine's, or RLIMIT_AS); without memory none is kept. */
void sst_posed_keep(struct sst_posed *posed, double most);

/**
 * A view's picture without a copy: from memory if the light field has no folder, a kept one, or else `own`, which is read.
 * A view's picture that is kept may be borrowed by one thread at once until it was read.
 *
 * @param own  zeroed; freed by the caller, whether it was needed or not
 * @return as sst_posed_picture()
 */
SST_MUST_CHECK int sst_posed_borrow(const struct sst_deep **out, struct sst_deep *own, const struct sst_posed *posed,
                                    const char *dir, int view);

#endif

/* pipeline/posed/posed_internal.h - private declarations of this folder and of its imports. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_PIPELINE_POSED_POSED_INTERNAL_H
#define SST_PIPELINE_POSED_POSED_INTERNAL_H

#include "base/file.h"
#include "pipeline/posed/posed.h"

#define POSED_MAX_POINTS  200000
#define POSED_VIEW_BYTES  ((size_t)1 << 30) /* of one picture's file */
#define POSED_POINTS_NAME 64                /* bytes of the name of the points' file */

/** Points' file: its name, which has a part of its hash, so that a new one never replaces the one in use. */
struct points_file {
    char name[POSED_POINTS_NAME];
    char sha256[65];
    int count; /* 0: there is none */
};

/** Validate after reading and before writing. @return NULL, or the fault as a clause (thread-local storage) */
const char *posed_fault(const struct sst_posed *posed);

/** Text of lightfield.json. @param hashes  [count][65], of views without one @return NULL: no memory, or a text is not
 *  UTF-8. Free with free(). */
char *posed_to_json(const struct sst_posed *posed, char (*hashes)[65], const struct points_file *points);

/** Read lightfield.json strictly: every field of its type and in its range, none unknown; not the points.
 *  @return 0, -ENOENT, -EBADMSG, -ENOMEM, -EIO; logged */
SST_MUST_CHECK int posed_read_json(struct sst_posed *posed, struct points_file *points, const char *path);

/** Write the points into a folder. @param file  out @return 0, -ENOMEM or an output error; logged */
SST_MUST_CHECK int points_write(struct points_file *file, const struct sst_posed *posed, const char *dir);

/** Read the points of a folder. @return 0, -ENOENT, -EBADMSG (another hash or length), -ENOMEM, -EIO; logged */
SST_MUST_CHECK int points_read(struct sst_posed *posed, const struct points_file *file, const char *dir);

/** Bytes of a view's picture in a folder. @param path  out, for messages @return as sst_file_read() */
SST_MUST_CHECK int posed_read_view(char path[SST_PATH_MAX], uint8_t **data, size_t *size,
                                   const struct sst_posed_view *v, const char *dir);

#endif

/* capture/access/access_internal.h - owners of the files of this folder. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_CAPTURE_ACCESS_ACCESS_INTERNAL_H
#define SST_CAPTURE_ACCESS_ACCESS_INTERNAL_H

#include "base/file.h"
#include "capture/access/access.h"

/** The folder of a file. */
void access_folder(const char *path, char out[SST_PATH_MAX]);
/** Where root writes, give a new file to the owner of the one at `path`, else of its folder. @return 0 or -errno */
SST_MUST_CHECK int access_give(int fd, const char *path);

#endif

/* tests/folder.h - a folder for a test program's files, removed with them at the end. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_FOLDER_H
#define SST_TESTS_FOLDER_H

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/file.h"
#include "tests/test.h"

static char test_folder[32];

/** Setup and teardown of a test or of a group. */
static inline int test_folder_create(void **state SST_UNUSED)
{
    snprintf(test_folder, sizeof(test_folder), "/tmp/sst-test-XXXXXX");
    return mkdtemp(test_folder) ? 0 : -1;
}

static inline int test_folder_remove(void **state SST_UNUSED)
{
    sst_path_remove_tree(test_folder);
    return 0;
}

/** Path of a file in the folder; valid until the next but seven. */
static inline const char *test_path(const char *fmt, ...) SST_PRINTF(1, 2);
static inline const char *test_path(const char *fmt, ...)
{
    static char path[8][SST_PATH_MAX];
    static int next;
    char name[256];
    va_list args;

    next = (next + 1) % 8;
    va_start(args, fmt);
    vsnprintf(name, sizeof(name), fmt, args);
    va_end(args);
    assert_int_equal(sst_path_join(path[next], test_folder, name), 0);
    return path[next];
}

#endif

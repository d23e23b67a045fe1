/* base/absent.h - functions of a part that the build leaves out, for the #else of its source. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_BASE_ABSENT_H
#define SST_BASE_ABSENT_H

/** Define a function that only returns the value (of a void one: nothing); its parameters follow the name. */
#define SST_ABSENT(type, value, name, ...)                                                                             \
    type name(__VA_ARGS__)                                                                                             \
    {                                                                                                                  \
        return value;                                                                                                  \
    }

#pragma GCC diagnostic ignored "-Wunused-parameter"

#endif

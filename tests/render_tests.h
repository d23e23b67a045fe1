/* tests/render_tests.h - how many dispatches a device has in the tests of a renderer that opens it. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SST_TESTS_RENDER_TESTS_H
#define SST_TESTS_RENDER_TESTS_H

#include "pipeline/method/render/device.h"
#include "tests/self_tests.h"

static inline bool render_opens(const char *name)
{
    struct sst_view view = { 0 };
    const struct sst_lightfield lf = { .rows = 1, .cols = 1, .width = 8, .height = 8, .views = &view };
    struct sst_renderer *r;
    int err = sst_renderer_create(&r, &lf, 1);

    if (err)
        return false;
    err = sst_renderer_use_device(r, name, 0);
    sst_renderer_destroy(r);
    return !err;
}

/** Dispatches before the first picture. */
static inline int render_tests(void)
{
    static int tests;

    tests = tests ? tests : self_tests(render_opens);
    return tests;
}

/** Name of a dummy device that needs no tests, with a fault at the at-th dispatch. */
static inline const char *render_fault(const char *fault, int at)
{
    static char name[48];

    snprintf(name, sizeof(name), "dummy:known=1,%s=%d", fault, at);
    return name;
}

#endif

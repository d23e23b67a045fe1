/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/edit_distance.h"
#include "base/text.h"
#include "daemon/publish/api.h"

int sst_api_known(const char *kind, const char *name, const char *const *known, char error[512])
{
    const char *near;
    int i = 0;

    while (known[i] && strcmp(known[i], name) != 0)
        i++;
    if (known[i])
        return 0;
    near = sst_edit_nearest(name, known);
    snprintf(error, 512, "unknown %s `%.64s`; %s%s%s", kind, name,
             near       ? "did you mean `"
             : known[0] ? known[1] ? "there are " : "there is "
                        : "it has none",
             near ? near : "", near ? "`?" : "");
    for (i = 0; !near && known[i]; i++)
        sst_text_add(error, 512, "%s%s", i == 0 ? "" : known[i + 1] ? ", " : " and ", known[i]);
    return -EINVAL;
}

int sst_api_members(const json_t *request, const char *const *known, char error[512])
{
    const char *key;
    json_t *value;

    if (request && !json_is_object(request))
        return sst_api_refuse(error, -EINVAL, "the request must be an object of JSON");
    json_object_foreach((json_t *)(uintptr_t)request, key, value)
    {
        const int err = sst_api_known("member", key, known, error);

        if (err)
            return err;
    }
    return 0;
}

int sst_api_refuse(char error[512], int err, const char *fmt, ...)
{
    va_list args;

    va_start(args, fmt);
    vsnprintf(error, 512, fmt, args);
    va_end(args);
    return err;
}

json_t *sst_api_real(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

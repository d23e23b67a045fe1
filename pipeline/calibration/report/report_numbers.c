/* Numbers and text of the report: significant digits, valid UTF-8. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "pipeline/calibration/report/report_internal.h"
#include "pipeline/camera/format_parts.h"

struct report_number report_number(double value, int digits)
{
    struct report_number n;
    int decimals;

    if (!isfinite(value) || value == 0) {
        snprintf(n.text, sizeof(n.text), "%s", value == 0 ? "0" : "unknown");
        return n;
    }
    if (fabs(value) >= 1e9 || fabs(value) < 1e-5) {
        snprintf(n.text, sizeof(n.text), "%.*e", digits - 1, value);
        return n;
    }
    /* The digits are counted after rounding: 0.0999 with two is 0.10. */
    snprintf(n.text, sizeof(n.text), "%.*e", digits - 1, value);
    decimals = digits - 1 - (int)strtol(strchr(n.text, 'e') + 1, NULL, 10);
    snprintf(n.text, sizeof(n.text), "%.*f", sst_clamp_int(decimals, 0, 12), value);
    return n;
}

struct report_number report_figure(double value)
{
    /* Below a billionth of a pixel or millimetre only rounding is left. */
    return report_number(fabs(value) < 1e-9 ? 0 : value, fabs(value) < 0.1 ? 2 : 3);
}

struct report_number report_count(int64_t count)
{
    struct report_number n;
    char digits[24];
    int used = 0;
    const int length = snprintf(digits, sizeof(digits), "%" PRId64, count);

    for (int i = 0; i < length; i++) {
        if (i && (length - i) % 3 == 0 && digits[i - 1] != '-')
            n.text[used++] = ',';
        n.text[used++] = digits[i];
    }
    n.text[used] = '\0';
    return n;
}

struct report_number report_date(int64_t wall_ns)
{
    struct report_number n = { "unknown" };
    const time_t seconds = (time_t)(wall_ns / 1000000000);
    struct tm tm;

    if (wall_ns > 0 && gmtime_r(&seconds, &tm))
        strftime(n.text, sizeof(n.text), "%Y-%m-%d %H:%M:%S UTC", &tm);
    return n;
}

void report_utf8(char *out, const char *text)
{
    for (const unsigned char *s = (const unsigned char *)text; *s;) {
        uint32_t code;
        const int n = sst_utf8_character(s, &code);

        memcpy(out, n ? (const char *)s : "\xEF\xBF\xBD", (size_t)(n ? n : 3));
        out += n ? n : 3;
        s += n ? n : 1;
    }
    *out = '\0';
}

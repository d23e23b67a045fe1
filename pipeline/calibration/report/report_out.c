/* Numbers and text of the report: digits that mean something, and nothing of the user's that could be taken as HTML. */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "pipeline/calibration/report/report_internal.h"
#include "pipeline/camera/format_parts.h"

struct calib_number calib_number(double value, int digits)
{
    struct calib_number n;
    int decimals;

    if (!isfinite(value) || value == 0) {
        snprintf(n.text, sizeof(n.text), "%s", value == 0 ? "0" : "unknown");
        return n;
    }
    if (fabs(value) >= 1e9 || fabs(value) < 1e-5) {
        snprintf(n.text, sizeof(n.text), "%.*e", digits - 1, value);
        return n;
    }
    /* The digits are counted after rounding: 0.0999 with two of them is 0.10. */
    snprintf(n.text, sizeof(n.text), "%.*e", digits - 1, value);
    decimals = digits - 1 - (int)strtol(strchr(n.text, 'e') + 1, NULL, 10);
    snprintf(n.text, sizeof(n.text), "%.*f", sst_clamp_int(decimals, 0, 12), value);
    return n;
}

struct calib_number calib_figure(double value)
{
    /* Below a billionth of a pixel or millimetre only rounding is left. */
    return calib_number(fabs(value) < 1e-9 ? 0 : value, fabs(value) < 0.1 ? 2 : 3);
}

struct calib_number calib_count(int64_t count)
{
    struct calib_number n;
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

struct calib_number calib_date(int64_t wall_ns)
{
    struct calib_number n = { "unknown" };
    const time_t seconds = (time_t)(wall_ns / 1000000000);
    struct tm tm;

    if (wall_ns > 0 && gmtime_r(&seconds, &tm))
        strftime(n.text, sizeof(n.text), "%Y-%m-%d %H:%M:%S UTC", &tm);
    return n;
}

void calib_utf8(char *out, const char *text)
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

void html_text(FILE *out, const char *text)
{
    for (const unsigned char *s = (const unsigned char *)text; *s;) {
        uint32_t code;
        const int n = sst_utf8_character(s, &code);

        switch (n ? *s : 0) {
        case 0:
            fputs("\xEF\xBF\xBD", out);
            break;
        case '<':
            fputs("&lt;", out);
            break;
        case '>':
            fputs("&gt;", out);
            break;
        case '&':
            fputs("&amp;", out);
            break;
        case '"':
            fputs("&quot;", out);
            break;
        case '\'':
            fputs("&#39;", out);
            break;
        default:
            fwrite(s, 1, (size_t)n, out);
        }
        s += n ? n : 1;
    }
}

void encode_base64(FILE *out, const uint8_t *data, size_t size)
{
    static const char sign[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

    for (size_t i = 0; i < size; i += 3) {
        const size_t left = size - i;
        const uint32_t three =
            (uint32_t)data[i] << 16 | (left > 1 ? (uint32_t)data[i + 1] << 8 : 0) | (left > 2 ? data[i + 2] : 0u);
        const char four[4] = { sign[three >> 18], sign[three >> 12 & 63], left > 1 ? sign[three >> 6 & 63] : '=',
                               left > 2 ? sign[three & 63] : '=' };

        fwrite(four, 1, 4, out);
    }
}

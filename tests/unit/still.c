/* tests/unit/still.c - still cameras: which choice a text stands for, and whether a JPEG is complete. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <turbojpeg.h>

#include "drivers/still/still_internal.h"
#include "tests/test.h"

static int find(const char *const *choices, int count, const char *text)
{
    static struct still_setting setting;

    setting.choices = count;
    for (int i = 0; i < count; i++)
        strcpy(setting.choice[i], choices[i]);
    return still_choice_find(&setting, text);
}

static void choices_are_found_by_words_and_by_numbers(void **state SST_UNUSED)
{
    static const char *const times[] = { "30", "1", "0.5", "1/60", "1/125", "bulb" };
    static const char *const seconds[] = { "0.0050s", "0.0080s", "0.0166s", "1.0000s" };
    static const char *const apertures[] = { "f/2.8", "f/8", "f/11" };
    static const char *const formats[] = { "Large Fine JPEG", "RAW", "RAW + Large Fine JPEG", "Unknown value 0010" };

    assert_int_equal(find(times, 6, "1/125"), 4);
    assert_int_equal(find(times, 6, "0.008"), 4);
    assert_int_equal(find(times, 6, "1/2"), 2);
    assert_int_equal(find(times, 6, "BULB"), 5);
    assert_int_equal(find(times, 6, "1/250"), -1);
    assert_int_equal(find(times, 6, "1/0"), -1);
    assert_int_equal(find(times, 6, ""), -1);
    assert_int_equal(find(seconds, 4, "1/125"), 1);
    assert_int_equal(find(seconds, 4, "1/60"), 2); /* rounded by the camera */
    assert_int_equal(find(seconds, 4, "1/50"), -1);
    assert_int_equal(find(apertures, 3, "8"), 1);
    assert_int_equal(find(apertures, 3, "F11"), 2);
    assert_int_equal(find(formats, 4, "raw"), 1);
    assert_int_equal(find(formats, 4, "16"), 3); /* hexadecimal in libgphoto2's words */
    assert_int_equal(find(formats, 4, "jpeg"), -1);
}

/* A picture with detail, so that its coded data fill most of the file. */
static unsigned char *picture(unsigned long *bytes)
{
    enum { WIDTH = 64, HEIGHT = 48 };
    unsigned char pixels[WIDTH * HEIGHT * 3], *jpeg = NULL;
    tjhandle tj = tjInitCompress();

    for (size_t i = 0; i < sizeof(pixels); i++)
        pixels[i] = (unsigned char)(i * 2654435761u >> 24);
    assert_non_null(tj);
    assert_int_equal(tjCompress2(tj, pixels, WIDTH, 0, HEIGHT, TJPF_RGB, &jpeg, bytes, TJSAMP_422, 90, 0), 0);
    tjDestroy(tj);
    return jpeg;
}

static void only_whole_jpegs_pass(void **state SST_UNUSED)
{
    int width = -1, height = -1;
    unsigned long bytes = 0;
    unsigned char *jpeg = picture(&bytes);

    assert_int_equal(sst_still_check_jpeg(jpeg, bytes, &width, &height), 0);
    assert_int_equal(width, 64);
    assert_int_equal(height, 48);
    for (size_t cut = 0; cut < bytes - 2; cut += 97)
        assert_int_equal(sst_still_check_jpeg(jpeg, cut, &width, &height), -EBADMSG);
    memset(jpeg + bytes / 2, 0xff, 64);
    assert_int_equal(sst_still_check_jpeg(jpeg, bytes, &width, &height), -EBADMSG);
    assert_int_equal(sst_still_check_jpeg((const uint8_t *)"II*\0....", 8, &width, &height), -EBADMSG);
    tjFree(jpeg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(choices_are_found_by_words_and_by_numbers),
        cmocka_unit_test(only_whole_jpegs_pass),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}

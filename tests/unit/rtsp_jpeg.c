/* Which JPEGs RTP carries. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if WITH_RTSP
#include <jpeglib.h>

#include "publishers/rtsp/rtsp_internal.h"
#include "tests/test.h"

struct form {
    int width, components, across, down;
    bool optimized, progressive;
    const char *why; /* NULL: fits */
};

static void encode(const struct form *form, uint8_t **data, unsigned long *bytes)
{
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    uint8_t *row = calloc((size_t)form->width, 3);

    assert_non_null(row);
    for (int x = 0; x < form->width * 3; x++)
        row[x] = (uint8_t)(x * x);
    jpeg.err = jpeg_std_error(&errors);
    jpeg_create_compress(&jpeg);
    *data = NULL;
    jpeg_mem_dest(&jpeg, data, bytes);
    jpeg.image_width = (JDIMENSION)form->width;
    jpeg.image_height = 64;
    jpeg.input_components = form->components;
    jpeg.in_color_space = form->components == 3 ? JCS_RGB : JCS_GRAYSCALE;
    jpeg_set_defaults(&jpeg);
    jpeg.comp_info[0].h_samp_factor = form->across;
    jpeg.comp_info[0].v_samp_factor = form->down;
    jpeg.optimize_coding = form->optimized;
    if (form->progressive)
        jpeg_simple_progression(&jpeg);
    jpeg_start_compress(&jpeg, TRUE);
    while (jpeg.next_scanline < 64)
        jpeg_write_scanlines(&jpeg, &row, 1);
    jpeg_finish_compress(&jpeg);
    jpeg_destroy_compress(&jpeg);
    free(row);
}

static void forms_that_fit(void **state)
{
    static const struct form forms[] = {
        { 320, 3, 2, 2, false, false, NULL },     { 320, 3, 2, 1, false, false, NULL },
        { 2040, 3, 2, 2, false, false, NULL },    { 2041, 3, 2, 2, false, false, "2040" },
        { 320, 3, 1, 1, false, false, "4:2:0" },  { 320, 1, 1, 1, false, false, "colour" },
        { 320, 3, 2, 2, true, false, "Huffman" }, { 320, 3, 2, 2, false, true, "baseline" },
    };
    char why[96];

    (void)state;
    for (size_t i = 0; i < ARRAY_LEN(forms); i++) {
        unsigned long bytes = 0;
        uint8_t *data;
        bool fits;

        encode(&forms[i], &data, &bytes);
        why[0] = 0;
        fits = rtsp_jpeg_fits(data, bytes, why, sizeof(why));
        if (fits != !forms[i].why || (!fits && !strstr(why, forms[i].why)))
            fail_msg("form %zu: %d, \"%s\"", i, fits, why);
        for (unsigned long n = 0; n < 700 && n < bytes; n++) /* damaged ones do no harm */
            (void)rtsp_jpeg_fits(data, n, why, sizeof(why));
        free(data);
    }
    assert_false(rtsp_jpeg_fits((const uint8_t *)"hello", 5, why, sizeof(why)));
}

#endif

int main(void)
{
#if WITH_RTSP
    const struct CMUnitTest tests[] = { cmocka_unit_test(forms_that_fit) };

    return cmocka_run_group_tests(tests, NULL, NULL);
#else
    puts("this build has no RTSP");
    return 77;
#endif
}

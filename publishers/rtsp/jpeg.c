/* JPEG as RFC 2435 can carry it: baseline, three components, 4:2:0 or 4:2:2, Huffman tables of annex K, small enough.
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include "publishers/rtsp/rtsp_internal.h"

#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#include <jpeglib.h>

#define SIDE_MAX 2040 /* 255 blocks of 8 */

struct errors {
    struct jpeg_error_mgr mgr;
    jmp_buf escape;
};

static _Noreturn void fail(j_common_ptr jpeg)
{
    longjmp(((struct errors *)(void *)jpeg->err)->escape, 1);
}

static void ignore_message(j_common_ptr jpeg SST_UNUSED)
{
}

static bool same_table(const JHUFF_TBL *table, const JHUFF_TBL *standard)
{
    size_t codes = 0;

    if (!table) /* frames of video leave them out */
        return true;
    for (int i = 1; i <= 16; i++)
        codes += standard->bits[i];
    return !memcmp(table->bits + 1, standard->bits + 1, 16) && !memcmp(table->huffval, standard->huffval, codes);
}

static bool standard_tables(struct jpeg_decompress_struct *jpeg, struct jpeg_compress_struct *standard)
{
    for (int i = 0; i < 3; i++) {
        const jpeg_component_info *c = &jpeg->comp_info[i];

        if (c->dc_tbl_no > 1 || c->ac_tbl_no > 1 ||
            !same_table(jpeg->dc_huff_tbl_ptrs[c->dc_tbl_no], standard->dc_huff_tbl_ptrs[i > 0]) ||
            !same_table(jpeg->ac_huff_tbl_ptrs[c->ac_tbl_no], standard->ac_huff_tbl_ptrs[i > 0]))
            return false;
    }
    return true;
}

static const char *fault(struct jpeg_decompress_struct *jpeg, struct jpeg_compress_struct *standard)
{
    const jpeg_component_info *c = jpeg->comp_info;

    if (jpeg->progressive_mode || jpeg->arith_code || jpeg->data_precision != 8)
        return "they are not baseline JPEGs";
    if (jpeg->num_components != 3)
        return "they have no colour";
    if (c[0].h_samp_factor != 2 || c[0].v_samp_factor > 2 || c[1].h_samp_factor != 1 || c[1].v_samp_factor != 1 ||
        c[2].h_samp_factor != 1 || c[2].v_samp_factor != 1)
        return "their colours are neither 4:2:0 nor 4:2:2";
    if (jpeg->image_width > SIDE_MAX || jpeg->image_height > SIDE_MAX)
        return "a side is longer than 2040 pixels";
    return standard_tables(jpeg, standard) ? NULL : "their Huffman tables are their own";
}

bool rtsp_jpeg_fits(const uint8_t *data, size_t bytes, char *why, size_t room)
{
    struct jpeg_compress_struct standard = { 0 };
    struct jpeg_decompress_struct jpeg = { 0 };
    struct errors errors;
    const char *volatile reason = "they cannot be read";

    standard.err = jpeg.err = jpeg_std_error(&errors.mgr);
    errors.mgr.error_exit = fail;
    errors.mgr.output_message = ignore_message;
    if (!setjmp(errors.escape)) {
        jpeg_create_compress(&standard);
        standard.in_color_space = JCS_RGB;
        standard.input_components = 3;
        jpeg_set_defaults(&standard);
        jpeg_create_decompress(&jpeg);
        jpeg_mem_src(&jpeg, data, (unsigned long)bytes);
        if (jpeg_read_header(&jpeg, TRUE) == JPEG_HEADER_OK)
            reason = fault(&jpeg, &standard);
    }
    jpeg_destroy_decompress(&jpeg);
    jpeg_destroy_compress(&standard);
    if (reason)
        snprintf(why, room, "%s", reason);
    return !reason;
}

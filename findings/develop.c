/* develop FILE: what LibRaw makes of a raw picture with the camera's white balance and without automatic brightness: the
 * pixel at 52,52, red, green and blue. */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <libraw/libraw.h>
#include <stdio.h>

int main(int argc, char **argv)
{
    libraw_data_t *raw = libraw_init(0);
    libraw_processed_image_t *picture;
    int err = 0;

    raw->params.use_camera_wb = 1;
    raw->params.no_auto_bright = 1;
    raw->params.gamm[0] = 1 / 2.4;
    raw->params.gamm[1] = 12.92;
    if (argc != 2 || libraw_open_file(raw, argv[1]) || libraw_unpack(raw) || libraw_dcraw_process(raw))
        return 2;
    picture = libraw_dcraw_make_mem_image(raw, &err);
    if (!picture)
        return 2;
    const unsigned char *p = picture->data + 3 * (52 * picture->width + 52);
    printf("%d %d %d\n", p[0], p[1], p[2]);
    return 0;
}

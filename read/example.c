/* Example of sst/read.h: prints a light field's views, and writes the picture and the distances of the reference view.
 *
 * cc example.c $(pkg-config --cflags --libs sst-read) -o example && ./example scene.lf picture.ppm
 */
/* SPDX-FileCopyrightText: 2026 The sst contributors */
/* SPDX-License-Identifier: Apache-2.0 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <sst/read.h>

static int write_picture(struct sst_read *lf, const struct sst_read_info *info, const char *path)
{
    const size_t bytes = 3 * (size_t)info->width * (size_t)info->height;
    uint8_t *rgb = malloc(bytes);
    FILE *f = NULL;
    int failed = !rgb || sst_read_rgb8(lf, info->reference, rgb, 0);

    if (!failed) {
        f = fopen(path, "wb");
        failed = !f || fprintf(f, "P6 %d %d 255\n", info->width, info->height) < 0 || fwrite(rgb, 1, bytes, f) != bytes;
    }
    if (f)
        failed |= fclose(f) != 0;
    free(rgb);
    return failed;
}

/* Depth in the middle of the reference view, where there is a disparity. */
static void print_depth(struct sst_read *lf, const struct sst_read_info *info)
{
    const size_t middle = (size_t)info->height / 2 * (size_t)info->width + (size_t)info->width / 2;
    float *px = malloc((size_t)info->width * (size_t)info->height * sizeof(*px));

    if (px && !sst_read_disparity(lf, info->reference, px, 0) && !isnan(px[middle]))
        printf("middle: %.2f px, %.0f mm\n", (double)px[middle],
               info->focal_px * info->spacing_mm / ((double)px[middle] - info->infinity_px));
    free(px);
}

int main(int argc, char **argv)
{
    struct sst_read_info info = { .size = sizeof(info) };
    struct sst_read *lf = NULL;
    int failed;

    if (argc != 3) {
        fprintf(stderr, "usage: %s LF PICTURE.ppm\n", argv[0]);
        return 2;
    }
    failed = sst_read_open(&lf, argv[1]) || sst_read_get_info(lf, &info);
    for (int k = 0; !failed && k < info.views; k++) {
        struct sst_read_view view = { .size = sizeof(view) };

        failed = sst_read_get_view(lf, k, &view);
        if (!failed && view.present)
            printf("%s at %.1f %.1f %.1f mm\n", view.name, view.position_mm[0], view.position_mm[1], view.position_mm[2]);
    }
    if (!failed) {
        print_depth(lf, &info);
        failed = write_picture(lf, &info, argv[2]);
    }
    if (failed && sst_read_error()[0])
        fprintf(stderr, "%s\n", sst_read_error());
    else if (failed)
        fprintf(stderr, "cannot write %s\n", argv[2]);
    sst_read_close(lf);
    return failed;
}

#include "simulators/world/photo.h"

#include <math.h>

/* sRGB (IEC 61966-2-1), 0..1. */
static double to_light(double v)
{
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

static double to_code(double light)
{
    return light <= 0.0031308 ? 12.92 * light : 1.055 * pow(light, 1 / 2.4) - 0.055;
}

void sst_sim_expose(struct sst_image *img, double factor)
{
    uint8_t table[256];

    for (int i = 0; i < 256; i++)
        table[i] = (uint8_t)(255 * to_code(fmin(1, factor * to_light(i / 255.0))) + 0.5);
    for (int c = 0; c < 3; c++) {
        for (int y = 0; y < img->height; y++) {
            for (int x = 0; x < img->width; x++)
                sst_image_row(img, c, y)[x] = table[sst_image_row(img, c, y)[x]];
        }
    }
}

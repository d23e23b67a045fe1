#!/usr/bin/env bash
# libtiff 4.5.0: floats that are written with the floating-point predictor (3) in the byte order that is not the machine's ("wb" on a
# little-endian one) are stored swapped, without an error: swapping comes before the predictor, which swaps for itself. With predictor 1, or in
# the machine's order, the same numbers come back.
# SPDX-FileCopyrightText: 2026 The sst contributors
# SPDX-License-Identifier: Apache-2.0
. "$(dirname "$0")/../scripts/finding.sh"
unpack libtiff6=4.5.0-6+deb12u4 libtiff-dev=4.5.0-6+deb12u4
ln -sf libtiff.so.6 "$lib/libtiff.so"
cat >floats.c <<'C'
#include <stdio.h>
#include <tiffio.h>

static float back(const char *mode, int predictor)
{
    float line[64];
    TIFF *t = TIFFOpen("floats.tif", mode);

    for (int i = 0; i < 64; i++)
        line[i] = 200 + i;
    TIFFSetField(t, TIFFTAG_IMAGEWIDTH, 64);
    TIFFSetField(t, TIFFTAG_IMAGELENGTH, 1);
    TIFFSetField(t, TIFFTAG_BITSPERSAMPLE, 32);
    TIFFSetField(t, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
    TIFFSetField(t, TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(t, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    TIFFSetField(t, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE);
    TIFFSetField(t, TIFFTAG_PREDICTOR, predictor);
    TIFFWriteEncodedStrip(t, 0, line, sizeof(line));
    TIFFClose(t);
    t = TIFFOpen("floats.tif", "r");
    TIFFReadEncodedStrip(t, 0, line, sizeof(line));
    TIFFClose(t);
    return line[1];
}

int main(void)
{
    printf("machine's order, predictor 3: %g\n", back("wl", 3));
    printf("other order, predictor 1: %g\n", back("wb", 1));
    printf("other order, predictor 3: %s\n", back("wb", 3) == 201 ? "201" : "another number");
    return 0;
}
C
compile floats -ltiff
./floats | tee seen
printf '%s\n' "machine's order, predictor 3: 201" 'other order, predictor 1: 201' 'other order, predictor 3: another number' >expected
holds "predictor 3 in the other byte order stores other numbers" cmp -s seen expected
# Seen: these three lines, with 3.2e-41 in the last one

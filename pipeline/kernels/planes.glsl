// Words of a view's map (SST_PLANE_MAP in pipeline/step/planes.h): disparity, 8 bits of confidence, flags.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

const int NONE = 0xFFFF; // disparity of a pixel that has none; larger than all others
const uint AGREED = 1 << 24; // carried: the sources agree
const uint CORRECT = 0, MISMATCH = 1, OCCLUSION = 2; // result of the check

int disparity_of(uint word)
{
    return int(word & 0xFFFF);
}

uint checked_of(uint word)
{
    return word >> 25 & 3;
}

uint with_disparity(uint word, uint disparity)
{
    return (word & 0xFFFF0000) | disparity;
}

uint with_check(uint word, uint checked)
{
    return (word & ~(3u << 25)) | checked << 25;
}

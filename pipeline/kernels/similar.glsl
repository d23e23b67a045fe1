// Whether no channel of two colours differs by more than `most`.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0
bool similar(uint a, uint b, int most)
{
    const ivec3 off = abs(ivec3(a & 0xFF, (a >> 8) & 0xFF, (a >> 16) & 0xFF) -
                          ivec3(b & 0xFF, (b >> 8) & 0xFF, (b >> 16) & 0xFF));

    return max(max(off.x, off.y), off.z) <= most;
}

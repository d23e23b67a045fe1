// Whether a pixel decides about one that is left to votes: for shaders that declare the buffer `share`.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

// True if a pixel of the rows from .. to - 1 around (x, y) is left to votes.
bool needed(int x, int y)
{
    for (int j = max(y - 1, from); j <= min(y + 1, to - 1); j++) {
        for (int i = max(x - 1, 0); i <= min(x + 1, width - 1); i++) {
            if (share[(j - top) * width + i] > 0.0)
                return true;
        }
    }
    return false;
}

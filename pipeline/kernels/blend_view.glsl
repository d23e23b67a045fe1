// Labels and views of a picture, as in pipeline/gpu/blend.h.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

struct Label {
    uint row, ends;
};

struct View {
    int ix, iy, nx, ny;
    int x0, x1, y0, y1;
    int tap[4];
    float aperture;
    uint first, flags, index;
};

const uint VIEW_RIGHT = 1, VIEW_BELOW = 2, VIEW_VALID = 4, VIEW_LABELS = 8, VIEW_CONFIDENCE = 16;

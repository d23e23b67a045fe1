// Mean colour of a view under a cell, or its sample there, as resample_row() has it. Included after `view`, `table` and the
// constants width, height, across, across_words, down and down_words.
vec3 mean_colour(int x, int y)
{
    const uint tx = across + uint(x) * across_words, ty = down + uint(y) * down_words;
    const uint colours = uint(width * height) + table[ty] * uint(width) + table[tx];
    precise vec3 sum = vec3(0.0);

    for (uint i = 0; i < table[tx + 1]; i++) {
        precise vec3 column = vec3(0.0);

        for (uint k = 0; k < table[ty + 1]; k++) {
            const uint pixel = view[colours + k * uint(width) + i];

            column = column + uintBitsToFloat(table[ty + 2 + k]) *
                                  vec3(pixel & 0xFF, (pixel >> 8) & 0xFF, (pixel >> 16) & 0xFF);
        }
        sum = sum + uintBitsToFloat(table[tx + 2 + i]) * column;
    }
    return sum;
}

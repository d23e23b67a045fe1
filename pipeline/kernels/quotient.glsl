// Quotients that are the same on every device.
// SPDX-FileCopyrightText: 2026 The sst contributors
// SPDX-License-Identifier: Apache-2.0

// a / b for b > 0, rounded to the nearest number, to an even one of two: devices may be off by more than that. Numbers
// below 2^-126 are 0. Digits are estimated in floats, twice, and what is left of `a` is computed in whole numbers: it is
// small, so that its lower 32 bits are enough, and says what the digits are off by.
float quotient(float a, float b)
{
    const uint bits_a = floatBitsToUint(a), bits_b = floatBitsToUint(b), by = (bits_b & 0x7FFFFF) | 0x800000;
    uint of = (bits_a & 0x7FFFFF) | 0x800000, digits;
    int exponent = int((bits_a >> 23) & 0xFF) - int((bits_b >> 23) & 0xFF) + 127, rest, more;
    float each;

    if ((bits_a & 0x7F800000) == 0)
        return 0.0;
    if (of < by) {
        of <<= 1;
        exponent--;
    }
    // 24 digits, and one to round by; the first estimate is off by less than 64.
    each = 1.0 / float(by);
    digits = uint(float(of) * each * 16777216.0);
    rest = int((of << 24) - digits * by);
    more = int(floor(float(rest) * each));
    digits += uint(more);
    rest -= more * int(by);
    if (rest < 0) {
        rest += int(by);
        digits--;
    } else if (rest >= int(by)) {
        rest -= int(by);
        digits++;
    }
    digits = (digits >> 1) + ((digits & 1) != 0 && (rest != 0 || (digits & 2) != 0) ? 1 : 0);
    if (exponent < 1)
        return 0.0;
    // The leading digit counts in the exponent, as does what rounding carries over.
    return uintBitsToFloat((bits_a & 0x80000000) | ((uint(exponent - 1) << 23) + digits));
}

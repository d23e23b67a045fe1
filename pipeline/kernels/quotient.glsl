// Quotients that are the same on every device.

// a / b for b > 0, rounded to the nearest number, to an even one of two: devices may be off by more than that. Numbers
// below 2^-126 are 0.
float quotient(float a, float b)
{
    const uint bits_a = floatBitsToUint(a), bits_b = floatBitsToUint(b), by = (bits_b & 0x7FFFFF) | 0x800000;
    uint rest = (bits_a & 0x7FFFFF) | 0x800000, digits = 0;
    int exponent = int((bits_a >> 23) & 0xFF) - int((bits_b >> 23) & 0xFF) + 127;

    if ((bits_a & 0x7F800000) == 0)
        return 0.0;
    if (rest < by) {
        rest <<= 1;
        exponent--;
    }
    // 24 digits, and one to round by; `rest` stays below twice `by`.
    for (int i = 0; i < 25; i++) {
        digits <<= 1;
        if (rest >= by) {
            rest -= by;
            digits |= 1;
        }
        rest <<= 1;
    }
    digits = (digits >> 1) + ((digits & 1) != 0 && (rest != 0 || (digits & 2) != 0) ? 1 : 0);
    if (exponent < 1)
        return 0.0;
    // The leading digit counts in the exponent, as does what rounding carries over.
    return uintBitsToFloat((bits_a & 0x80000000) | ((uint(exponent - 1) << 23) + digits));
}

// exp(-t), as exp_neg.h has it.
float exp_neg(float t)
{
    precise float steps = t * 1.44269504 + 0.5;
    const int k = int(steps);
    const float n = float(k);
    precise float r = (n * 0.693359375 - t) + n * -2.12194440e-4;
    precise float p =
        1.0 +
        r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0)))))));
    precise float scaled = p * intBitsToFloat((127 - k) << 23);

    return scaled;
}

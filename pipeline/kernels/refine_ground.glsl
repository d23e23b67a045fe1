// Planes of grounds, in whole numbers of 64 bits, the lower half first: struct sst_gpu_refine_ground.

struct Ground {
    uvec2 a, b, d0, limit;
};

uvec2 add(uvec2 a, uvec2 b)
{
    uint carry;
    const uint low = uaddCarry(a.x, b.x, carry);

    return uvec2(low, a.y + b.y + carry);
}

uvec2 subtract(uvec2 a, uvec2 b)
{
    uint borrow;
    const uint low = usubBorrow(a.x, b.x, borrow);

    return uvec2(low, a.y - b.y - borrow);
}

// Modulo 2^64, which is right for negative a as well.
uvec2 times(uvec2 a, uint n)
{
    uint high, low;

    umulExtended(a.x, n, high, low);
    return uvec2(low, high + a.y * n);
}

// Of numbers that are not negative.
bool is_at_most(uvec2 a, uvec2 b)
{
    return a.y < b.y || (a.y == b.y && a.x <= b.x);
}

// Residual of a pixel with disparity q.
uvec2 miss_of(Ground g, uvec2 at, uint q)
{
    const uvec2 plane = add(add(g.d0, times(g.a, at.x)), times(g.b, at.y));
    const uvec2 off = subtract(uvec2(q << 24, q >> 8), plane);

    return (off.y & 0x80000000u) != 0 ? subtract(uvec2(0), off) : off;
}

bool has_label(uvec2 labels, uint i)
{
    return ((i < 32 ? labels.x >> i : labels.y >> (i - 32)) & 1) != 0;
}

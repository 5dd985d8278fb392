"""SIMD tests of sixteen pairs of one world at a time in C++: those of `nuno.contact.self.narrow_phase` by other means.

Pieces of functions, for a Warp function in C++ stands by itself. `PRELUDE` opens an #if that whoever uses it closes.
"""

PRELUDE = """
#if !defined(__CUDACC__)
typedef float V __attribute__((vector_size(64), aligned(4)));
typedef int I __attribute__((vector_size(64), aligned(4)));
typedef float Q __attribute__((vector_size(16), aligned(4)));
typedef int J __attribute__((vector_size(16), aligned(4)));
typedef bool B __attribute__((ext_vector_type(16)));
// compiled once, and loops as they stand: the compiler's time is the user's
#define ALONE __attribute__((noinline))
#define ROLLED _Pragma("nounroll")
const I OWN = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
auto minimum = [](V a, V b) { return (V)((a < b) ? (I)a : (I)b); };
auto maximum = [](V a, V b) { return (V)((a > b) ? (I)a : (I)b); };
auto smaller = [](I a, int b) { return (a < b) ? a : (I){} + b; };
auto larger = [](I a, int b) { return (a > b) ? a : (I){} + b; };
auto bits = [](I mask) {
    const B set = __builtin_convertvector(mask, B);
    unsigned short found;
    __builtin_memcpy(&found, &set, 2);
    return unsigned(found);
};
// the portable loops do what AVX-512 has instructions for
auto take = [](const float* x, I i) {
    V r = {};
#if defined(__AVX512F__)
    r = (V)__builtin_ia32_gathersiv16sf(r, x, i, (unsigned short)0xffff, 4);
#else
    for (int l = 0; l < 16; ++l) r[l] = x[i[l]];
#endif
    return r;
};
auto take_int = [](const int* x, I i) {
    I r = {};
#if defined(__AVX512F__)
    r = (I)__builtin_ia32_gathersiv16si(r, x, i, (unsigned short)0xffff, 4);
#else
    for (int l = 0; l < 16; ++l) r[l] = x[i[l]];
#endif
    return r;
};
// writes those of 16 integers whose bit is set, one after the other from `count` on, where there is room for all 16
auto pack = [](int* to, int count, I values, unsigned set) {
#if defined(__AVX512F__)
    *(I*)(to + count) = (I)__builtin_ia32_compresssi512_mask(values, (I){}, (unsigned short)set);
    return count + __builtin_popcount(set);
#else
    for (; set; set &= set - 1) to[count++] = values[__builtin_ctz(set)];
    return count;
#endif
};
"""

NEAR_TRIANGLES = """
// positive where vertex i may be nearer to triangle f g h than the root of far2, as nearness.near_triangle, and none of
// its weights over the triangle is less than -rim
auto near_triangles = [&](const float* x, const float* y, const float* z, int step, I i, I f, I g, I h, V far2,
                          float rim) ALONE {
    i *= step, f *= step, g *= step, h *= step;
    const V px = take(x, f), py = take(y, f), pz = take(z, f);
    const V ax = take(x, g) - px, ay = take(y, g) - py, az = take(z, g) - pz;
    const V bx = take(x, h) - px, by = take(y, h) - py, bz = take(z, h) - pz;
    const V dx = take(x, i) - px, dy = take(y, i) - py, dz = take(z, i) - pz;
    const V cx = bx - ax, cy = by - ay, cz = bz - az;
    const V nx = ay * bz - az * by, ny = az * bx - ax * bz, nz = ax * by - ay * bx;
    const V high = dx * nx + dy * ny + dz * nz, nn = nx * nx + ny * ny + nz * nz;
    const V v = (dy * bz - dz * by) * nx + (dz * bx - dx * bz) * ny + (dx * by - dy * bx) * nz;
    const V w = (ay * dz - az * dy) * nx + (az * dx - ax * dz) * ny + (ax * dy - ay * dx) * nz;
    const V outside = minimum(minimum(nn - v - w, (V){}), minimum(v, w));
    const V aa = ax * ax + ay * ay + az * az, bb = bx * bx + by * by + bz * bz, cc = cx * cx + cy * cy + cz * cz;
    return minimum(maximum(aa, maximum(bb, cc)) * (far2 * nn - high * high) - outside * outside, outside + rim * nn);
};
"""

NEAR_EDGES = """
// positive where edges e f and g h are nearer to each other than the root of far2: nearness.near_edges
auto near_edges = [&](const float* x, const float* y, const float* z, int step, I e, I f, I g, I h, V far2) ALONE {
    e *= step, f *= step, g *= step, h *= step;
    const V px = take(x, e), py = take(y, e), pz = take(z, e), qx = take(x, g), qy = take(y, g), qz = take(z, g);
    const V rx = px - qx, ry = py - qy, rz = pz - qz;
    const V ax = take(x, f) - px, ay = take(y, f) - py, az = take(z, f) - pz;
    const V bx = take(x, h) - qx, by = take(y, h) - qy, bz = take(z, h) - qz;
    const V zero = {}, one = zero + 1.f;
    const V aa = ax * ax + ay * ay + az * az + 1e-16f, bb = bx * bx + by * by + bz * bz + 1e-16f;
    const V ab = ax * bx + ay * by + az * bz, ar = ax * rx + ay * ry + az * rz, br = bx * rx + by * ry + bz * rz;
    V s = (ab * br - ar * bb) / maximum(aa * bb - ab * ab, aa * bb * 1e-6f);
    s = minimum(maximum(s, zero), one);
    const V q = minimum(maximum((ab * s + br) / bb, zero), one);
    s = minimum(maximum((ab * q - ar) / aa, zero), one);
    const V cx = rx + s * ax - q * bx, cy = ry + s * ay - q * by, cz = rz + s * az - q * bz;
    return far2 - cx * cx - cy * cy - cz * cz;
};
"""

KEEP = """
// adds those of 16 pairs whose bit is set to a list with number c of pair k at k * next + c * row; what does not fit is
// only counted
auto keep = [&](unsigned set, I a, I b, I c, I d, int& count, int* list, int next, int row, int room) ALONE {
    if (next == 1 && count + 16 <= room) {
        pack(list, count, a, set), pack(list + row, count, b, set), pack(list + 2 * row, count, c, set);
        count = pack(list + 3 * row, count, d, set);
        return;
    }
    for (; set; set &= set - 1) {
        const int l = __builtin_ctz(set), k = count++;
        int* to = list + k * next;
        if (k < room) to[0] = a[l], to[row] = b[l], to[2 * row] = c[l], to[3 * row] = d[l];
    }
};
"""

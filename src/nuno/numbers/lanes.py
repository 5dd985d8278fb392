"""One source for two machines: arithmetic on a float, or on sixteen worlds in the lanes of a vector.

On CUDA a thread handles one constraint of one world and every quantity is a ``float``. On the CPU a batch puts
sixteen worlds into the lanes of a vector: the same constraint functions, typed ``Any``, then compile to SIMD.
The functions here are the few elementwise operations that Warp spells differently for the two.
"""

import warp as wp

LANES = 16
"""Worlds in one vector: one AVX-512 register of floats."""

lane = wp.types.vector(length=LANES, dtype=float)
lane_int = wp.types.vector(length=LANES, dtype=int)

_LANE = "wp::vec_t<16,wp::float32>"
# Clang's vector extension: what it compiles to is SIMD by construction, not by the optimiser's grace.
_SIMD = (
    "typedef float V __attribute__((vector_size(64), aligned(4)));"
    "typedef int I __attribute__((vector_size(64), aligned(4)));"
    "const I OWN = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};"
)


def _native(body: str, result: str = "{}") -> str:
    """C++ for the CPU; CUDA's compiler sees these functions where a module holds both kinds, but never calls them."""
    return f"\n#if defined(__CUDACC__)\nreturn {result};\n#else\n{_SIMD}{body}\n#endif\n"


def _simd(expression: str, *arguments: str) -> str:
    """C++ for a function of lanes: ``expression`` of the arguments' capitals."""
    loads = "".join(f"V {a.upper()} = *(const V*)&{a};" for a in arguments)
    return _native(f"{loads} {_LANE} r; *(V*)&r = {expression}; return r;")


# Warp takes add, sub, mul and div for the operators + - * / where a module imports them by these names, so that one
# text serves a float and a lane: a * b, a / b, and a number that is the same in all lanes on either side. Its own loop
# over the elements of a vector, which would be compiled twice as slowly to much the same code, is left to the rest.
# What Warp keeps of compiled modules does not see that an operator changed: clear its cache (wp.clear_kernel_cache).
@wp.func_native(_simd("A + B", "a", "b"))
def add(a: lane, b: lane) -> lane: ...


@wp.func_native(_simd("A + b", "a"))
def add(a: lane, b: float) -> lane: ...


@wp.func_native(_simd("a + B", "b"))
def add(a: float, b: lane) -> lane: ...


@wp.func_native(_simd("A - B", "a", "b"))
def sub(a: lane, b: lane) -> lane: ...


@wp.func_native(_simd("A - b", "a"))
def sub(a: lane, b: float) -> lane: ...


@wp.func_native(_simd("a - B", "b"))
def sub(a: float, b: lane) -> lane: ...


@wp.func_native(_simd("A * B", "a", "b"))
def mul(a: lane, b: lane) -> lane: ...


@wp.func_native(_simd("A * b", "a"))
def mul(a: lane, b: float) -> lane: ...


@wp.func_native(_simd("a * B", "b"))
def mul(a: float, b: lane) -> lane: ...


@wp.func_native(_simd("A / B", "a", "b"))
def div(a: lane, b: lane) -> lane: ...


@wp.func_native(_simd("A / b", "a"))
def div(a: lane, b: float) -> lane: ...


@wp.func_native(_simd("a / B", "b"))
def div(a: float, b: lane) -> lane: ...


# The next two tell coordinates from other numbers, for those may be doubles: see `nuno.numbers.doubles`.
@wp.func
def to_float(a: float):
    """A coordinate as a float."""
    return a


@wp.func
def to_float(a: lane):
    return a


@wp.func
def relative_to(a: float, base: float):
    """A coordinate in a sum whose weights add up to zero; where it is a double, what it exceeds ``base`` by."""
    return a


@wp.func
def relative_to(a: lane, base: lane):
    return a


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return __fmul_rn(a, b);
#else
return a * b;
#endif
""")
def product(a: float, b: float) -> float:
    """The product, rounded by itself: CUDA's compiler does not make it part of a sum that it comes into.

    It would do so in some plans and not in others, which then had other bits.
    """
    ...


@wp.func
def product(a: lane, b: float):
    return a * b


@wp.func
def product(a: lane, b: lane):
    return a * b


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return fmaf(a, b, c);
#else
return __builtin_fmaf(a, b, c);
#endif
""")
def fused(a: float, b: float, c: float) -> float:
    """The elementwise a b + c, rounded once; CUDA, a core and its vectors give the same bits."""
    ...


@wp.func_native(_simd("__builtin_elementwise_fma(A, B, C)", "a", "b", "c"))
def fused(a: lane, b: lane, c: lane) -> lane: ...


@wp.func_native(_simd("__builtin_elementwise_fma(A, (V){} + b, C)", "a", "c"))
def fused(a: lane, b: float, c: lane) -> lane: ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
return fmaf(-a, b, c);
#else
return __builtin_fmaf(-a, b, c);
#endif
""")
def fused_subtract(a: float, b: float, c: float) -> float:
    """The elementwise c - a b, rounded once."""
    ...


@wp.func_native(_simd("__builtin_elementwise_fma(-A, B, C)", "a", "b", "c"))
def fused_subtract(a: lane, b: lane, c: lane) -> lane: ...


@wp.func
def sqrt(a: float):
    """The elementwise square root."""
    return wp.sqrt(a)


@wp.func_native(_simd("__builtin_elementwise_sqrt(A)", "a"))
def sqrt(a: lane) -> lane: ...


@wp.func
def full_like(like: float, value: float):
    """A constant, in the type of ``like``."""
    return value


@wp.func_native(_simd("(V){} + value"))
def full_like(like: lane, value: float) -> lane: ...


@wp.func
def choose(sign: float, a: float, b: float):
    """``a`` where ``sign`` is positive, else ``b``."""
    return wp.where(sign > 0.0, a, b)


@wp.func_native(_simd("(V)((SIGN > 0.f) ? (I)A : (I)B)", "sign", "a", "b"))
def choose(sign: lane, a: lane, b: lane) -> lane: ...


@wp.func_native(_simd("(V)((SIGN > 0.f) ? (I)((V){} + a) : (I)B)", "sign", "b"))
def choose(sign: lane, a: float, b: lane) -> lane: ...


@wp.func_native(_simd("(V)((SIGN > 0.f) ? (I)A : (I)((V){} + b))", "sign", "a"))
def choose(sign: lane, a: lane, b: float) -> lane: ...


@wp.func_native(_simd("(V)((SIGN > 0.f) ? (I)((V){} + a) : (I)((V){} + b))", "sign"))
def choose(sign: lane, a: float, b: float) -> lane: ...


@wp.func
def minimum(a: float, b: float):
    """The elementwise minimum."""
    return wp.min(a, b)


@wp.func_native(_simd("(V)((A < B) ? (I)A : (I)B)", "a", "b"))
def minimum(a: lane, b: lane) -> lane: ...


@wp.func_native(_simd("(V)((A < b) ? (I)A : (I)((V){} + b))", "a"))
def minimum(a: lane, b: float) -> lane: ...


@wp.func_native(_simd("(V)((a < B) ? (I)((V){} + a) : (I)B)", "b"))
def minimum(a: float, b: lane) -> lane: ...


@wp.func
def maximum(a: float, b: float):
    """The elementwise maximum."""
    return wp.max(a, b)


@wp.func_native(_simd("(V)((A > B) ? (I)A : (I)B)", "a", "b"))
def maximum(a: lane, b: lane) -> lane: ...


@wp.func_native(_simd("(V)((A > b) ? (I)A : (I)((V){} + b))", "a"))
def maximum(a: lane, b: float) -> lane: ...


@wp.func_native(_simd("(V)((a > B) ? (I)((V){} + a) : (I)B)", "b"))
def maximum(a: float, b: lane) -> lane: ...


@wp.func
def absolute(a: float):
    """The elementwise absolute value."""
    return wp.abs(a)


@wp.func_native(_simd("(V)((A > 0.f) ? (I)A : (I)(-A))", "a"))
def absolute(a: lane) -> lane: ...


@wp.func
def anywhere(a: float):
    """Return True if a lane is positive."""
    return a > 0.0


@wp.func_native(_native("V A = *(const V*)&a; return __builtin_reduce_or((I)(A > 0.f)) != 0;"))
def anywhere(a: lane) -> bool: ...


@wp.func
def lane_max(a: float):
    """The largest lane."""
    return a


@wp.func_native(_native("V A = *(const V*)&a; return __builtin_reduce_max(A);"))
def lane_max(a: lane) -> float: ...


@wp.func
def lane_max_int(a: int):
    """The largest lane of an integer."""
    return a


@wp.func
def lane_max_int(a: lane_int):
    return wp.max(a)


@wp.func
def gather(x: wp.array(dtype=float), i: int):
    """Element i of ``x``; with lanes, each lane reads its own element."""
    return x[i]


@wp.func_native(
    _native(f"""{_LANE} r;
#if defined(__AVX512F__)
V R = {{}};
*(V*)&r = (V)__builtin_ia32_gathersiv16sf(R, x.data, *(const I*)&i * 16 + OWN, (unsigned short)0xffff, 4);
#else
for (int l = 0; l < 16; ++l) r[l] = x.data[i[l]][l];
#endif
return r;""")
)
def gather(x: wp.array(dtype=lane), i: lane_int) -> lane: ...


@wp.func
def gather(x: wp.array(dtype=lane), i: int):
    return x[i]


@wp.func
def place(x: wp.array(dtype=float), i: int, value: float):
    """Write ``value`` to element i of ``x``; with lanes, each lane writes its own element."""
    x[i] = value


@wp.func_native(
    _native(
        """
#if defined(__AVX512F__)
__builtin_ia32_scattersiv16sf(x.data, (unsigned short)0xffff, *(const I*)&i * 16 + OWN, *(const V*)&value, 4);
#else
for (int l = 0; l < 16; ++l) x.data[i[l]][l] = value[l];
#endif""",
        "",
    )
)
def place(x: wp.array(dtype=lane), i: lane_int, value: lane): ...


@wp.func
def index_mask(like: float, i: int):
    """1 where the index i is not negative, else 0."""
    return wp.where(i < 0, 0.0, 1.0)


@wp.func_native(_simd("(V)((*(const I*)&i >= 0) & (I)((V){} + 1.f))"))
def index_mask(like: lane, i: lane_int) -> lane: ...


@wp.func
def within(like: float, k: int, count: int):
    """1 where k is below ``count``, else 0."""
    return wp.where(k < count, 1.0, 0.0)


@wp.func_native(_simd("(V)((*(const I*)&count > k) & (I)((V){} + 1.f))"))
def within(like: lane, k: int, count: lane_int) -> lane: ...


@wp.func
def clipped(i: int):
    """The index i, or 0 where it is negative."""
    return wp.max(i, 0)


@wp.func_native("wp::vec_t<16,wp::int32> r; for (int l=0; l<16; ++l) r[l] = i[l] < 0 ? 0 : i[l]; return r;")
def clipped(i: lane_int) -> lane_int: ...


@wp.func
def subarray(a: wp.array(dtype=float), first: int, count: int):
    """The ``count`` elements of ``a`` from ``first`` on, without a copy."""
    return wp.array(ptr=a.ptr + wp.uint64(first) * wp.uint64(4), shape=(count,), dtype=float)


@wp.func
def subarray(a: wp.array(dtype=lane), first: int, count: int):
    return wp.array(ptr=a.ptr + wp.uint64(first) * wp.uint64(4 * 16), shape=(count,), dtype=lane)


@wp.func
def subarray(a: wp.array(dtype=int), first: int, count: int):
    return wp.array(ptr=a.ptr + wp.uint64(first) * wp.uint64(4), shape=(count,), dtype=int)


@wp.func
def subarray(a: wp.array(dtype=lane_int), first: int, count: int):
    return wp.array(ptr=a.ptr + wp.uint64(first) * wp.uint64(4 * 16), shape=(count,), dtype=lane_int)


@wp.func
def per_world(like: float, table: wp.array(dtype=float), group: int, stride: int, worlds: int, entry: int):
    """Entry of a table that holds one row for all worlds (stride 0) or a row per world."""
    return table[group * stride + entry]


@wp.func
def per_world(like: lane, table: wp.array(dtype=float), group: int, stride: int, worlds: int, entry: int):
    r = lane(table[entry])
    if stride > 0:
        for k in range(16):
            r[k] = table[wp.min(group * 16 + k, worlds - 1) * stride + entry]
    return r

"""Coordinates in double precision, of which constraints see differences as floats.

A float has steps of 3e-8 m at half a metre. Where substeps are short, that is not little beside what a vertex moves in
one, and what each write of a coordinate rounds off ends up in velocities. So coordinates may be `float64` numbers: then
a difference of two is a float that has all of its digits, and a move, a float, is added without loss. The constraint
functions are the same for both: what follows are overloads of the functions of `nuno.numbers.lanes` and
`nuno.numbers.element_access` (Warp adds a function to those of its name), so that where coordinates are floats nothing
changes.
"""

import warp as wp

from nuno.numbers.element_access import at, put
from nuno.numbers.lanes import (
    add,
    choose,
    full_like,
    fused,
    fused_subtract,
    gather,
    lane,
    lane_int,
    place,
    relative_to,
    sub,
    subarray,
    to_float,
)

float64 = wp.float64
"""One world's, or one element's coordinate."""
double_lane = wp.types.vector(length=16, dtype=wp.float64)
"""Those of the sixteen worlds or elements in the lanes of a vector."""

_TYPES = (
    "typedef float V __attribute__((vector_size(64), aligned(4)));"
    "typedef int I __attribute__((vector_size(64), aligned(4)));"
    "typedef double D __attribute__((vector_size(128), aligned(8)));"
    "typedef long long L __attribute__((vector_size(128), aligned(8)));"
)
_FLOAT_LANES, _DOUBLE_LANES = "wp::vec_t<16,wp::float32>", "wp::vec_t<16,wp::float64>"
_GATHERED = """
typedef double H __attribute__((vector_size(64), aligned(8)));
typedef int J __attribute__((vector_size(32), aligned(4)));
const I at = INDEX;
const J low = __builtin_shufflevector(at, at, 0, 1, 2, 3, 4, 5, 6, 7);
const J high = __builtin_shufflevector(at, at, 8, 9, 10, 11, 12, 13, 14, 15);
"""


def _native(body: str, result: str = "{}") -> str:
    """C++ for the CPU; CUDA's compiler sees it where a module holds both kinds, but never calls it."""
    return f"\n#if defined(__CUDACC__)\nreturn {result};\n#else\n{_TYPES}{body}\n#endif\n"


def _floats(expression: str) -> str:
    """C++ of sixteen floats: ``expression``, of doubles, rounded."""
    return _native(f"{_FLOAT_LANES} r; *(V*)&r = __builtin_convertvector({expression}, V); return r;")


def _doubles(expression: str) -> str:
    """C++ of sixteen doubles."""
    return _native(f"{_DOUBLE_LANES} r; *(D*)&r = {expression}; return r;")


_A, _B = "*(const D*)&a", "__builtin_convertvector(*(const V*)&b, D)"
# a product is rounded to a float before it is added, in all of these
_AB = "__builtin_convertvector(*(const V*)&a * *(const V*)&b, D)"


@wp.func
def sub(a: float64, b: float64):
    return float(wp.sub(a, b))


@wp.func_native(_floats(f"{_A} - *(const D*)&b"))
def sub(a: double_lane, b: double_lane) -> lane: ...


@wp.func
def sub(a: float64, b: float):
    return wp.sub(a, float64(b))


@wp.func_native(_doubles(f"{_A} - {_B}"))
def sub(a: double_lane, b: lane) -> double_lane: ...


@wp.func_native(_doubles(f"{_A} - (double)b"))
def sub(a: double_lane, b: float) -> double_lane: ...


@wp.func
def add(a: float64, b: float):
    return wp.add(a, float64(b))


@wp.func_native(_doubles(f"{_A} + {_B}"))
def add(a: double_lane, b: lane) -> double_lane: ...


@wp.func_native(_doubles(f"{_A} + (double)b"))
def add(a: double_lane, b: float) -> double_lane: ...


@wp.func
def to_float(a: float64):
    return float(a)


@wp.func_native(_floats(_A))
def to_float(a: double_lane) -> lane: ...


@wp.func
def relative_to(a: float64, base: float64):
    return float(wp.sub(a, base))


@wp.func
def relative_to(a: double_lane, base: double_lane):
    return sub(a, base)


@wp.func
def relative_to(a: float, base: float64):
    return -to_float(base - a)


@wp.func
def relative_to(a: lane, base: double_lane):
    return -to_float(base - a)


@wp.func
def fused(a: float, b: float, c: float64):
    return wp.add(c, float64(a * b))


@wp.func_native(_doubles(f"*(const D*)&c + {_AB}"))
def fused(a: lane, b: lane, c: double_lane) -> double_lane: ...


@wp.func
def fused_subtract(a: float, b: float, c: float64):
    return wp.sub(c, float64(a * b))


@wp.func_native(_doubles(f"*(const D*)&c - {_AB}"))
def fused_subtract(a: lane, b: lane, c: double_lane) -> double_lane: ...


@wp.func
def full_like(like: float64, value: float):
    return value


@wp.func
def full_like(like: double_lane, value: float):
    return lane(value)


@wp.func
def choose(sign: float, a: float, b: float64):
    return wp.where(sign > 0.0, float64(a), b)


_SIGN = "__builtin_convertvector(*(const V*)&sign > 0.f, L)"
_CHOSEN = "(L)__builtin_convertvector(*(const V*)&a, D)"


@wp.func_native(_doubles(f"(D)({_SIGN} ? {_CHOSEN} : *(const L*)&b)"))
def choose(sign: lane, a: lane, b: double_lane) -> double_lane: ...


def _gather(index: str, element: str) -> str:
    gathered = _GATHERED.replace("INDEX", index)
    return _native(f"""{_DOUBLE_LANES} r;
#if defined(__AVX512F__)
{gathered}
*(H*)&r = __builtin_ia32_gathersiv8df(H{{}}, x.data, low, (unsigned char)0xff, 8);
*((H*)&r + 1) = __builtin_ia32_gathersiv8df(H{{}}, x.data, high, (unsigned char)0xff, 8);
#else
for (int l = 0; l < 16; ++l) r[l] = {element};
#endif
return r;""")


def _scatter(index: str, element: str) -> str:
    gathered = _GATHERED.replace("INDEX", index)
    return _native(
        f"""
#if defined(__AVX512F__)
{gathered}
__builtin_ia32_scattersiv8df(x.data, (unsigned char)0xff, low, *(const H*)&value, 8);
__builtin_ia32_scattersiv8df(x.data, (unsigned char)0xff, high, *((const H*)&value + 1), 8);
#else
for (int l = 0; l < 16; ++l) {element} = value[l];
#endif""",
        "",
    )


_ELEMENT = "*(const I*)&i"
_OWN = f"{_ELEMENT} * 16 + (I){{{', '.join(str(k) for k in range(16))}}}"


@wp.func
def at(x: wp.array(dtype=float64), i: int):
    return x[i]


@wp.func_native("return x.data[i];")
def at(x: wp.array(dtype=double_lane), i: int) -> double_lane: ...


@wp.func_native(_gather(_ELEMENT, "x.data[i[l]]"))
def at(x: wp.array(dtype=float64), i: lane_int) -> double_lane: ...


@wp.func
def put(x: wp.array(dtype=float64), i: int, value: float64):
    x[i] = value


@wp.func_native("x.data[i] = value;")
def put(x: wp.array(dtype=double_lane), i: int, value: double_lane): ...


@wp.func_native(_scatter(_ELEMENT, "x.data[i[l]]"))
def put(x: wp.array(dtype=float64), i: lane_int, value: double_lane): ...


@wp.func
def gather(x: wp.array(dtype=float64), i: int):
    return x[i]


@wp.func_native(_gather(_OWN, "x.data[i[l]][l]"))
def gather(x: wp.array(dtype=double_lane), i: lane_int) -> double_lane: ...


@wp.func
def place(x: wp.array(dtype=float64), i: int, value: float64):
    x[i] = value


@wp.func_native(_scatter(_OWN, "x.data[i[l]][l]"))
def place(x: wp.array(dtype=double_lane), i: lane_int, value: double_lane): ...


@wp.func
def subarray(a: wp.array(dtype=float64), first: int, count: int):
    return wp.array(ptr=a.ptr + wp.uint64(first) * wp.uint64(8), shape=(count,), dtype=float64)


@wp.func
def subarray(a: wp.array(dtype=double_lane), first: int, count: int):
    return wp.array(ptr=a.ptr + wp.uint64(first) * wp.uint64(8 * 16), shape=(count,), dtype=double_lane)

"""Coordinates in double precision, of which constraints see differences as floats.

A float has steps of 3e-8 m at half a metre. Where substeps are short, that is not little beside what a vertex moves in
one, and what each write of a coordinate rounds off ends up in velocities. So coordinates may be `fine` numbers: then a
difference of two is a float that has all of its digits, and a move, a float, is added without loss. The constraint
functions are the same for both: what follows are overloads of the functions of `nuno.solver.lanes` and
`nuno.solver.vector` (Warp adds a function to those of its name), so that where coordinates are floats nothing changes.
"""

import warp as wp

from nuno.solver.lanes import (
    add,
    beside,
    choose,
    fill,
    fused,
    gather,
    lane,
    lane_int,
    lessened,
    place,
    rough,
    sub,
    window,
)
from nuno.solver.vector import at, put, spread

fine = wp.float64
"""One world's, or one element's coordinate."""
fine_lane = wp.types.vector(length=16, dtype=wp.float64)
"""Those of the sixteen worlds or elements in the lanes of a vector."""

_TYPES = (
    "typedef float V __attribute__((vector_size(64), aligned(4)));"
    "typedef int I __attribute__((vector_size(64), aligned(4)));"
    "typedef double D __attribute__((vector_size(128), aligned(8)));"
    "typedef long long L __attribute__((vector_size(128), aligned(8)));"
)
_FLOATS, _DOUBLES = "wp::vec_t<16,wp::float32>", "wp::vec_t<16,wp::float64>"
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
    return _native(f"{_FLOATS} r; *(V*)&r = __builtin_convertvector({expression}, V); return r;")


def _doubles(expression: str) -> str:
    """C++ of sixteen doubles."""
    return _native(f"{_DOUBLES} r; *(D*)&r = {expression}; return r;")


_A, _B = "*(const D*)&a", "__builtin_convertvector(*(const V*)&b, D)"
# a product is rounded to a float before it is added, in all of these
_AB = "__builtin_convertvector(*(const V*)&a * *(const V*)&b, D)"


@wp.func
def sub(a: fine, b: fine):
    return float(wp.sub(a, b))


@wp.func_native(_floats(f"{_A} - *(const D*)&b"))
def sub(a: fine_lane, b: fine_lane) -> lane: ...


@wp.func
def sub(a: fine, b: float):
    return wp.sub(a, fine(b))


@wp.func_native(_doubles(f"{_A} - {_B}"))
def sub(a: fine_lane, b: lane) -> fine_lane: ...


@wp.func_native(_doubles(f"{_A} - (double)b"))
def sub(a: fine_lane, b: float) -> fine_lane: ...


@wp.func
def add(a: fine, b: float):
    return wp.add(a, fine(b))


@wp.func_native(_doubles(f"{_A} + {_B}"))
def add(a: fine_lane, b: lane) -> fine_lane: ...


@wp.func_native(_doubles(f"{_A} + (double)b"))
def add(a: fine_lane, b: float) -> fine_lane: ...


@wp.func
def rough(a: fine):
    return float(a)


@wp.func_native(_floats(_A))
def rough(a: fine_lane) -> lane: ...


@wp.func
def beside(a: fine, base: fine):
    return float(wp.sub(a, base))


@wp.func
def beside(a: fine_lane, base: fine_lane):
    return sub(a, base)


@wp.func
def beside(a: float, base: fine):
    return -rough(base - a)


@wp.func
def beside(a: lane, base: fine_lane):
    return -rough(base - a)


@wp.func
def fused(a: float, b: float, c: fine):
    return wp.add(c, fine(a * b))


@wp.func_native(_doubles(f"*(const D*)&c + {_AB}"))
def fused(a: lane, b: lane, c: fine_lane) -> fine_lane: ...


@wp.func
def lessened(a: float, b: float, c: fine):
    return wp.sub(c, fine(a * b))


@wp.func_native(_doubles(f"*(const D*)&c - {_AB}"))
def lessened(a: lane, b: lane, c: fine_lane) -> fine_lane: ...


@wp.func
def fill(like: fine, value: float):
    return value


@wp.func
def fill(like: fine_lane, value: float):
    return lane(value)


@wp.func
def choose(sign: float, a: float, b: fine):
    return wp.where(sign > 0.0, fine(a), b)


_SIGN = "__builtin_convertvector(*(const V*)&sign > 0.f, L)"
_CHOSEN = "(L)__builtin_convertvector(*(const V*)&a, D)"


@wp.func_native(_doubles(f"(D)({_SIGN} ? {_CHOSEN} : *(const L*)&b)"))
def choose(sign: lane, a: lane, b: fine_lane) -> fine_lane: ...


def _gather(index: str, element: str) -> str:
    gathered = _GATHERED.replace("INDEX", index)
    return _native(f"""{_DOUBLES} r;
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
def at(x: wp.array(dtype=fine), i: int):
    return x[i]


@wp.func_native("return x.data[i];")
def at(x: wp.array(dtype=fine_lane), i: int) -> fine_lane: ...


@wp.func_native(_gather(_ELEMENT, "x.data[i[l]]"))
def at(x: wp.array(dtype=fine), i: lane_int) -> fine_lane: ...


@wp.func
def put(x: wp.array(dtype=fine), i: int, value: fine):
    x[i] = value


@wp.func_native("x.data[i] = value;")
def put(x: wp.array(dtype=fine_lane), i: int, value: fine_lane): ...


@wp.func_native(_scatter(_ELEMENT, "x.data[i[l]]"))
def put(x: wp.array(dtype=fine), i: lane_int, value: fine_lane): ...


@wp.func
def gather(x: wp.array(dtype=fine), i: int):
    return x[i]


@wp.func_native("return x.data[i];")
def gather(x: wp.array(dtype=fine_lane), i: int) -> fine_lane: ...


@wp.func_native(_gather(_OWN, "x.data[i[l]][l]"))
def gather(x: wp.array(dtype=fine_lane), i: lane_int) -> fine_lane: ...


@wp.func
def place(x: wp.array(dtype=fine), i: int, value: fine):
    x[i] = value


@wp.func_native(_scatter(_OWN, "x.data[i[l]][l]"))
def place(x: wp.array(dtype=fine_lane), i: lane_int, value: fine_lane): ...


@wp.func
def spread(like: fine, value: float):
    return value


@wp.func
def spread(like: fine_lane, value: float):
    return lane(value)


@wp.func
def spread(like: fine_lane, value: lane):
    return value


@wp.func
def window(a: wp.array(dtype=fine), first: int, count: int):
    return wp.array(ptr=a.ptr + wp.uint64(first) * wp.uint64(8), shape=(count,), dtype=fine)


@wp.func
def window(a: wp.array(dtype=fine_lane), first: int, count: int):
    return wp.array(ptr=a.ptr + wp.uint64(first) * wp.uint64(8 * 16), shape=(count,), dtype=fine_lane)

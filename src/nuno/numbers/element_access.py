"""Sixteen elements of one world in the lanes of a vector: how they reach particles that stand anywhere in memory.

`nuno.numbers.lanes` puts sixteen worlds into a vector, and all of them have the same particle at the same index. One
world alone on the CPU puts sixteen elements of one colour into it instead, each with its own particles. The same
constraint functions serve both and the plain float: an index is an ``int`` or a vector of them, and the functions here
read and write particles by either. Elements of a colour share no particle, so that the order does not matter and the
bits are the same in all three.

Lanes and tables are read in C++: Warp's own brackets look whether an index is negative and ask the array for its
strides, which is more work than what a constraint does with the number.
"""

import warp as wp

from nuno.numbers.lanes import lane, lane_int, mul  # noqa: F401 (mul: Warp takes it for the operator)

_TYPES = (
    "typedef float V __attribute__((vector_size(64), aligned(4)));"
    "typedef int I __attribute__((vector_size(64), aligned(4)));"
)
# the portable loops do what AVX-512 has instructions for
_GATHER = f"""
wp::vec_t<16,wp::float32> r;
#if defined(__AVX512F__) && !defined(__CUDACC__)
{_TYPES}
*(V*)&r = __builtin_ia32_gathersiv16sf(V{{}}, x.data, *(const I*)&i, (unsigned short)0xffff, 4);
#else
for (int l = 0; l < 16; ++l) r[l] = x.data[i[l]];
#endif
return r;
"""
_SCATTER = f"""
#if defined(__AVX512F__) && !defined(__CUDACC__)
{_TYPES}
__builtin_ia32_scattersiv16sf(x.data, (unsigned short)0xffff, *(const I*)&i, *(const V*)&value, 4);
#else
for (int l = 0; l < 16; ++l) x.data[i[l]] = value[l];
#endif
"""


@wp.func
def at(x: wp.array(dtype=float), i: int):
    """Element i of ``x``; with a vector of indices, a vector of elements."""
    return x[i]


@wp.func_native("return x.data[i];")
def at(x: wp.array(dtype=lane), i: int) -> lane: ...


@wp.func
def at(x: wp.array(dtype=int), i: int):
    return x[i]


@wp.func_native("return x.data[i];")
def at(x: wp.array(dtype=lane_int), i: int) -> lane_int: ...


@wp.func_native(_GATHER)
def at(x: wp.array(dtype=float), i: lane_int) -> lane: ...


@wp.func
def put(x: wp.array(dtype=float), i: int, value: float):
    """Write element i of ``x``; with a vector of indices, a vector of elements."""
    x[i] = value


@wp.func_native("x.data[i] = value;")
def put(x: wp.array(dtype=lane), i: int, value: lane): ...


@wp.func_native(_SCATTER)
def put(x: wp.array(dtype=float), i: lane_int, value: lane): ...


@wp.func_native("return table.data[k][which];")
def corner(table: wp.array(dtype=wp.vec2i), k: int, which: int, count: int) -> int:
    """Column ``which`` of row k of a table of ``count`` columns: an element's own, or those of sixteen elements."""
    ...


@wp.func_native("return table.data[k][which];")
def corner(table: wp.array(dtype=wp.vec3i), k: int, which: int, count: int) -> int: ...


@wp.func_native("return table.data[k][which];")
def corner(table: wp.array(dtype=wp.vec4i), k: int, which: int, count: int) -> int: ...


@wp.func_native("return table.data[k][which];")
def corner(table: wp.array(dtype=wp.vec3), k: int, which: int, count: int) -> float: ...


@wp.func
def corner(table: wp.array(dtype=lane_int), k: int, which: int, count: int):
    return table[k * count + which]


@wp.func
def corner(table: wp.array(dtype=lane), k: int, which: int, count: int):
    return table[k * count + which]


@wp.func
def factor_like(like: float, value: float):
    """A factor in the type of ``like``."""
    return value


@wp.func
def factor_like(like: lane, value: float):
    return lane(value)


@wp.func
def factor_like(like: lane, value: lane):
    return value


@wp.func
def is_set(value: float):
    """Return True if a factor is not zero, or not zero in every lane."""
    return value != 0.0


@wp.func
def is_set(value: lane):
    return wp.dot(value, value) > 0.0

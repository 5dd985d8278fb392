"""Linear systems of three diagonals by many threads: d_k y_k = r_k + c_k y_k-1 + c_k+1 y_k+1, c the couplings.

In cyclic reduction (Hockney and Jesshope, "Parallel Computers", 1981) a row stands as y_k = r + low y_k-s + high y_k+s.
In each step every row is freed of its two neighbours and linked to those twice as far, until none is left.
"""

import warp as wp


@wp.func
def free_row(
    low: float, high: float, right: float, low_before: float, high_before: float, right_before: float,
    low_after: float, high_after: float, right_after: float,
):  # fmt: skip
    """One step of cyclic reduction: a row with those that it is linked to put in.

    Where it is linked to none, ``low`` or ``high`` is zero, and anything finite may stand for the other row.

    Returns:
        The row: ``low``, ``high`` and ``right``.
    """
    s = 1.0 / (1.0 - low * high_before - high * low_after)
    return (
        low * low_before * s, high * high_after * s, (right + low * right_before + high * right_after) * s
    )  # fmt: skip

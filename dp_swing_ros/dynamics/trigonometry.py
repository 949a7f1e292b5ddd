# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Sine and cosine that vectorise.

In double precision these are the library's. In single precision they are polynomials without a
branch or a call, so that the compiler runs 8 or 16 samples at once: the argument is brought to
[-π/2, π/2] by n half turns, and sin x = (-1)ⁿ sin(x - nπ), likewise the cosine. There Taylor's
polynomials of degree 11 and 12 are exact to 6e-8, half a unit in the last place.
"""

import math

from numba import types
from numba.extending import overload
import numpy as np

F = np.float32
ONE, TWO, HALF = F(1.0), F(2.0), F(0.5)
PER_HALF_TURN = F(1 / math.pi)
PI_HIGH = F(3.140625)                  # few bits, so that n times it is exact
PI_LOW = F(math.pi - 3.140625)
ROUNDER = F(1.5 * 2 ** 23)             # adding and taking it away rounds to an integer
S_3, S_5, S_7, S_9, S_11 = (F((-1) ** (n // 2) / math.factorial(n)) for n in (3, 5, 7, 9, 11))
C_4, C_6, C_8, C_10, C_12 = (F((-1) ** (n // 2) / math.factorial(n)) for n in (4, 6, 8, 10, 12))


def sincos(x):
    """Return sin x and cos x."""
    return math.sin(x), math.cos(x)


def sincos_single(x):
    """Return sin x and cos x in single precision, for |x| up to some 10 000 rad."""
    n = (x * PER_HALF_TURN + ROUNDER) - ROUNDER
    y = (x - n * PI_HIGH) - n * PI_LOW
    half_n = n * HALF
    odd = TWO * (half_n - ((half_n + ROUNDER) - ROUNDER))  # 0 or ±1
    sign = ONE - TWO * odd * odd
    z = y * y
    s = y + y * z * (S_3 + z * (S_5 + z * (S_7 + z * (S_9 + z * S_11))))
    c = ONE - HALF * z + z * z * (C_4 + z * (C_6 + z * (C_8 + z * (C_10 + z * C_12))))
    return sign * s, sign * c


@overload(sincos, inline='always')
def choose(x):
    return sincos_single if x == types.float32 else sincos

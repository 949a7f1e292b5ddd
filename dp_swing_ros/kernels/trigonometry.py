# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Sine and cosine that vectorise: polynomials without a branch or a call.

So the compiler runs 4, 8 or 16 of them at once, or both angles of one state side by side. In
single precision the argument is brought to [-π/2, π/2] by n half turns, and sin x = (-1)ⁿ
sin(x - nπ), likewise the cosine. There the polynomials of least error of degree 9 and 8 are exact
to 5e-9 of sin y and to 5.3e-8 of 1, less than a unit in the last place. In double precision
quarter turns bring it to [-π/4, π/4], where Taylor's of degree 17 and 16 are exact to 1e-17, and
every odd one swaps sine and cosine.
"""

import math

from numba import types
from numba.extending import overload
import numpy as np

from dp_swing_ros.kernels.compilation import kernel

F = np.float32
ONE = F(1.0)
PER_HALF_TURN = F(1 / math.pi)
PI_HIGH = F(3.140625)                  # few bits, so that n times it is exact
PI_LOW = F(math.pi - 3.140625)
ROUNDER = F(1.5 * 2 ** 23)             # adding it rounds to an integer, in the last bits
S_3, S_5, S_7, S_9 = map(F, (-1.6666660462e-1, 8.3330881668e-3, -1.9811112711e-4, 2.6089325624e-6))
C_2, C_4, C_6, C_8 = map(F, (-4.9999932293e-1, 4.1663989449e-2, -1.3855927135e-3, 2.3194385308e-5))

PER_QUARTER = 2 / math.pi
ROUNDER_64 = 1.5 * 2.0 ** 52
# π/2 in three parts; n times the first two is exact up to n = 2^20
QUARTER_HIGH = 6746518852 / 2 ** 32
QUARTER_MIDDLE = 2242054355 / 2 ** 65
QUARTER_LOW = 2.0222662487959506e-21
D_3, D_5, D_7, D_9, D_11, D_13, D_15, D_17 = (
    (-1) ** (n // 2) / math.factorial(n) for n in range(3, 18, 2))
E_4, E_6, E_8, E_10, E_12, E_14, E_16 = (
    (-1) ** (n // 2) / math.factorial(n) for n in range(4, 17, 2))


@kernel
def bits(x):
    """Return the bits of a number in double precision."""
    return np.float64(x).view(np.int64)


@kernel
def of_bits(i):
    """Return the number in double precision that has these bits."""
    return np.int64(i).view(np.float64)


def sincos(x):
    """Return sin x and cos x; in a kernel, one of the two below."""
    return np.sin(x), np.cos(x)


def sincos_double(x):
    """Return sin x and cos x to 2e-16, for |x| up to a million rad."""
    shifted = x * PER_QUARTER + ROUNDER_64
    n, i = shifted - ROUNDER_64, bits(shifted)
    y = ((x - n * QUARTER_HIGH) - n * QUARTER_MIDDLE) - n * QUARTER_LOW
    z = y * y
    w = z * z    # two terms at a time, for what is done one after the other takes longest
    s = bits(y + y * z * ((D_3 + z * D_5) + w * ((D_7 + z * D_9) + w * (
        (D_11 + z * D_13) + w * (D_15 + z * D_17)))))
    c = bits((1.0 - 0.5 * z) + w * ((E_4 + z * E_6) + w * ((E_8 + z * E_10) + w * (
        (E_12 + z * E_14) + w * E_16))))
    # an odd quarter swaps them; the sine changes its sign every two, the cosine one before
    swapped = (s ^ c) & -(i & 1)
    return of_bits(s ^ swapped ^ ((i >> 1) << 63)), of_bits(c ^ swapped ^ (((i + 1) >> 1) << 63))


@kernel
def signed(number, n):
    """Return the number, with the other sign where the last bit of n is set."""
    sign = np.int32(np.float32(n).view(np.int32) << 31)
    return np.int32(np.float32(number).view(np.int32) ^ sign).view(np.float32)


@kernel
def sincos_ahead(y):
    """Return sin y and cos y in single precision, for y from -π/2 to π/2."""
    z = y * y
    s = y + y * z * (S_3 + z * (S_5 + z * (S_7 + z * S_9)))
    c = ONE + z * (C_2 + z * (C_4 + z * (C_6 + z * C_8)))
    return s, c


def sincos_single(x):
    """Return sin x and cos x in single precision, for |x| up to some 10 000 rad."""
    shifted = x * PER_HALF_TURN + ROUNDER
    n = shifted - ROUNDER
    s, c = sincos_ahead((x - n * PI_HIGH) - n * PI_LOW)
    return signed(s, shifted), signed(c, shifted)


@overload(sincos, inline='always')
def choose(x):
    return sincos_single if x == types.float32 else sincos_double

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Normal numbers in single precision, many at once.

Each of LANES generators side by side is a xoshiro128++, with a state of its own drawn from a NumPy
generator; the compiler runs 8 or 16 of them in one vector register. Box and Muller's transform
makes two normal numbers of two whole ones. Which number lands where depends on nothing but the
state of that generator.

Sources: Blackman and Vigna, "Scrambled linear pseudorandom number generators", ACM TOMS 47(4),
2021; Box and Muller, Annals of Mathematical Statistics 29(2), 1958.
"""

import math

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.trigonometry import signed, sincos_ahead
from dp_swing_ros.pendulum.state import Array

LANES = 64
F, U = np.float32, np.uint32
ONE, MINUS_TWO, LN_2 = F(1), F(-2), F(math.log(2))
ULP = F(2 ** -24)                       # of the uniform numbers in (0, 1]
PER_BIT = F(math.pi / 2 ** 32)          # [rad] of the whole ones: they span half a circle
THREE_QUARTERS = np.int32(0x3f400000)   # the bits of 0.75
# log(1 + f) = f + f² (L_2 + L_3 f + ...) to 4.4e-8, for f from -1/4 to 1/2
L_2, L_3, L_4, L_5, L_6, L_7, L_8 = map(F, (
    -0.50000234854, 0.33329569147, -0.24976500037, 0.20121770393, -0.17385995951, 0.14019663988,
    -0.064710395430))


@kernel
def logarithm(x):
    """Return log x of a normal positive number in single precision."""
    bits = F(x).view(np.int32)
    exponent = np.int32(np.int32(bits - THREE_QUARTERS) >> 23)
    f = np.int32(bits - np.int32(exponent << 23)).view(np.float32) - ONE
    polynomial = L_2 + f * (L_3 + f * (L_4 + f * (L_5 + f * (L_6 + f * (L_7 + f * L_8)))))
    return F(exponent) * LN_2 + (f + f * f * polynomial)


@kernel
def rotated(x, by):
    """Return the 32 bits of x, turned left."""
    return U(U(x << U(by)) | U(x >> U(32 - by)))


@kernel
def drawn(a, b, c, d):
    """Return a whole number of 32 bits, and the state that follows."""
    bits = U(rotated(U(a + d), 7) + a)
    c, d, e = U(c ^ a), U(d ^ b), U(b << U(9))
    b, a = U(b ^ c), U(a ^ d)
    return bits, a, b, U(c ^ e), rotated(d, 11)


@kernel
def fill(state, out):
    """
    Write normal numbers of mean zero and unit variance, none beyond 5.8, and turn the state on.

    Shapes: state (4, LANES) of 32 bits, out (n,) float32.
    """
    a, b, c, d = state[0], state[1], state[2], state[3]
    pairs = np.empty((2, LANES), F)
    for first in range(0, len(out), 2 * LANES):
        for i in range(LANES):
            size, a_i, b_i, c_i, d_i = drawn(a[i], b[i], c[i], d[i])
            turn, a[i], b[i], c[i], d[i] = drawn(a_i, b_i, c_i, d_i)
            uniform = F(np.int32(size >> U(8)) + np.int32(1)) * ULP
            radius = np.sqrt(MINUS_TWO * logarithm(uniform))
            # the lowest bit, unused so far, chooses the half of the circle
            radius = signed(radius, U(size).view(F))
            s, c_turn = sincos_ahead(F(U(turn).view(np.int32)) * PER_BIT)
            pairs[0, i], pairs[1, i] = radius * c_turn, radius * s
        for j in range(2):
            begin = first + j * LANES
            width = min(LANES, len(out) - begin)
            for i in range(width):
                out[begin + i] = pairs[j, i]


def state_from(random: np.random.Generator) -> Array:
    """Draw a state to begin with (4, LANES), from a generator of 64 bits, as default_rng's is."""
    return random.bit_generator.random_raw(2 * LANES).view(U).reshape(4, LANES)

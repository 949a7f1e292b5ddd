# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The single-precision sine and cosine against the library's."""

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.trigonometry import sincos


@kernel
def over(X, S, C):
    for i in range(len(X)):
        S[i], C[i] = sincos(X[i])


def test_single_precision_is_exact_to_the_last_places():
    X = np.linspace(-100, 100, 200_001, dtype=np.float32)
    S, C = np.empty_like(X), np.empty_like(X)
    over(X, S, C)
    np.testing.assert_allclose(S, np.sin(X.astype(float)), atol=3e-7)
    np.testing.assert_allclose(C, np.cos(X.astype(float)), atol=3e-7)


def test_double_precision_is_the_library_s(rng):
    for bound, exact in ((1.0, 2.3e-16), (10.0, 2.3e-16), (1e4, 2.3e-16), (1e6, 2.3e-16)):
        X = rng.uniform(-bound, bound, 200_000)
        S, C = np.empty_like(X), np.empty_like(X)
        over(X, S, C)
        np.testing.assert_allclose(S, np.sin(X), atol=exact, rtol=0)
        np.testing.assert_allclose(C, np.cos(X), atol=exact, rtol=0)


def test_double_precision_keeps_its_places_near_a_zero():
    X = np.pi / 2 * np.arange(-2000, 2001) + 1e-9
    S, C = np.empty_like(X), np.empty_like(X)
    over(X, S, C)
    np.testing.assert_allclose(S, np.sin(X), rtol=4e-16)
    np.testing.assert_allclose(C, np.cos(X), rtol=4e-16)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The single-precision sine and cosine against the library's."""

import numpy as np

from dp_swing_ros.dynamics.trigonometry import sincos
from dp_swing_ros.kernels import kernel


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


def test_double_precision_is_the_library_s():
    X = np.linspace(-10, 10, 1001)
    S, C = np.empty_like(X), np.empty_like(X)
    over(X, S, C)
    np.testing.assert_allclose(S, np.sin(X), atol=1e-15)
    np.testing.assert_allclose(C, np.cos(X), atol=1e-15)

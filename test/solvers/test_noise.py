# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The normal numbers against the normal distribution, with the errors of so many numbers."""

import math

import numpy as np
import pytest
from scipy import stats

from dp_swing_ros.kernels import kernel
from dp_swing_ros.solvers import noise
from dp_swing_ros.solvers.noise import LANES, logarithm

COUNT = 4_000_000
ALLOWED = 4.0   # standard errors


def normal(random, shape):
    out = np.full(shape, np.nan, np.float32)
    noise.fill(noise.state_from(random), out.reshape(-1))
    return out


@pytest.fixture(scope='module')
def numbers():
    return normal(np.random.default_rng(5), (COUNT,)).astype(float)


def double_factorial(n):
    return math.prod(range(n, 0, -2))


@pytest.mark.parametrize('power', range(1, 9))
def test_moments_are_those_of_the_normal_distribution(numbers, power):
    expected = 0 if power % 2 else double_factorial(power - 1)
    variance = double_factorial(2 * power - 1) - expected ** 2
    error = np.mean(numbers ** power) - expected
    assert abs(error) < ALLOWED * math.sqrt(variance / COUNT)


def test_the_distribution_is_normal(numbers):
    assert stats.kstest(numbers, 'norm').pvalue > 1e-4


@pytest.mark.parametrize('size', [1.0, 2.0, 3.0, 4.0, 4.5])
def test_the_tails_are_as_heavy(numbers, size):
    expected = 2 * stats.norm.sf(size) * COUNT
    assert abs(np.sum(np.abs(numbers) > size) - expected) < ALLOWED * math.sqrt(expected)


@pytest.mark.parametrize('lag', [1, 2, LANES - 1, LANES, LANES + 1, 2 * LANES, 1024])
def test_numbers_and_their_squares_are_uncorrelated(numbers, lag):
    """One lane is the sine to another's cosine; both come of one radius."""
    a, b = numbers[:-lag], numbers[lag:]
    assert abs(np.mean(a * b)) < ALLOWED / math.sqrt(COUNT)
    assert abs(np.mean((a ** 2 - 1) * (b ** 2 - 1))) < ALLOWED * 2 / math.sqrt(COUNT)


def test_the_same_generator_gives_the_same_numbers():
    first, second = (normal(np.random.default_rng(3), (30, 100)) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    random = np.random.default_rng(3)
    assert not np.any(normal(random, (30, 100)) == normal(random, (30, 100)))


@pytest.mark.parametrize('count', [1, LANES - 1, LANES + 1, 2 * LANES + 1])
def test_a_shorter_draw_is_the_beginning_of_a_longer_one(count):
    whole = normal(np.random.default_rng(3), (4 * LANES,))
    np.testing.assert_array_equal(normal(np.random.default_rng(3), (count,)), whole[:count])


@kernel
def over(X, L):
    for i in range(len(X)):
        L[i] = logarithm(X[i])


def test_the_logarithm_is_exact_to_the_last_places():
    X = np.concatenate([np.linspace(2 ** -24, 1, 100_001),
                        2.0 ** -np.arange(25)]).astype(np.float32)
    L = np.empty_like(X)
    over(X, L)
    np.testing.assert_allclose(L, np.log(X.astype(float)), rtol=2e-7, atol=1e-7)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Functions written out for their arguments' types: what they compute, and what they refuse."""

import importlib.util
from typing import Any, NamedTuple

from numba import typeof
import numpy as np
import pytest

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.compilation import Constant, same_type_by
from dp_swing_ros.kernels.symbols import (
    called, clamp, cos, dot, fixed, gradient, is_nonzero, sin, total)
from dp_swing_ros.kernels.unrolling import unrolled, written_out

F = np.float32


def f(x: Any) -> Any:
    """Return a number that takes every operation with a derivative."""
    a, b, c = x
    y = clamp(1.5 * b, -1.0, 1.0)   # smooth at the bounds, as what is clamped must be
    return ((sin(a * b) - cos(b - c) / (2.0 + c * c)) * (a - 3 * c) + 1 / (1 - -b * b) - a / 4
            + a * (y * (15 - 10 * y * y + 3 * y * y * y * y)))


@unrolled
def value(x):
    return f(x)


@unrolled
def slopes(x):
    return tuple(gradient(f(x), x))


@unrolled
def second_slopes(x):
    return tuple(tuple(gradient(slope, x)) for slope in gradient(f(x), x))


@kernel
def all_in_a_kernel(x):
    return value(x), slopes(x), second_slopes(x)


def differences(function, x, step=1e-5):
    """Return the derivatives of a function of numbers, those by each number a column."""
    x = np.array(x)
    return np.stack([(np.array(function(tuple((x + step * e).tolist())))
                      - function(tuple((x - step * e).tolist()))) / (2 * step)
                     for e in np.eye(len(x))], -1)


def test_gradients_meet_finite_differences(rng):
    for _ in range(20):
        x = tuple(rng.normal(size=3).tolist())
        of_value, first, second = all_in_a_kernel(x)
        assert of_value == pytest.approx(f(x), rel=1e-12)
        np.testing.assert_allclose(first, differences(f, x), rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(second, differences(slopes, x), rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(np.array(second), np.array(second).T, atol=1e-12)


def test_called_from_python_it_computes_the_same(rng):
    x = tuple(rng.normal(size=3).tolist())
    for mine, compiled in zip((value(x), slopes(x), second_slopes(x)), all_in_a_kernel(x)):
        np.testing.assert_allclose(mine, compiled, rtol=1e-12, atol=1e-14)


def test_what_has_no_numba_type_goes_through_the_function_as_it_is():
    torch = pytest.importorskip('torch')
    x = torch.tensor([0.1, 0.2, -0.4], dtype=torch.float64)
    assert float(value(tuple(x))) == pytest.approx(f(tuple(x.tolist())), rel=1e-12)


@unrolled
def half_fixed(x):
    return gradient(fixed(x) * x, [x])[0]


@kernel
def run_half_fixed(x):
    return half_fixed(x)


def test_what_is_fixed_is_a_constant_to_a_gradient():
    assert run_half_fixed(3.0) == half_fixed(3.0) == 3.0


def test_what_does_not_matter_has_no_slope():
    @unrolled
    def of_other(x, y):
        return tuple(gradient(sin(x), [x, y]))
    np.testing.assert_allclose(of_other(0.0, 5.0), [1.0, 0.0])


@unrolled
def clamped(x, low, high):
    return clamp(x, low, high)


@kernel
def run_clamped(x, low, high):
    return clamped(x, low, high)


@pytest.mark.parametrize('x, expected', [(-7.0, -2.0), (-2.0, -2.0), (0.5, 0.5), (3.0, 3.0),
                                         (4.0, 3.0)])
@pytest.mark.parametrize('run', [run_clamped, clamped, clamp],
                         ids=['kernel', 'python', 'numbers'])
def test_a_clamp_has_two_bounds(run, x, expected):
    assert run(x, -2.0, 3.0) == expected


def test_what_has_no_derivative_is_refused():
    def slope(x):
        return gradient(is_nonzero(x), [x])[0]
    with pytest.raises(ValueError, match='has no derivative here'):
        written_out(slope, [typeof(1.0)])


@unrolled
def turned(x):
    return cos(x[0]), sin(x[1])


@unrolled
def twice_by_calls(x):
    once = called(turned, 2, tuple(x))
    return tuple(called(turned, 2, tuple(once)))


@kernel
def run_twice(x):
    return twice_by_calls(x)


def test_a_call_is_the_function_called():
    x = (0.3, -0.8)
    expected = np.cos(np.cos(0.3)), np.sin(np.sin(-0.8))
    np.testing.assert_allclose(run_twice(x), expected, rtol=1e-14)
    np.testing.assert_allclose(twice_by_calls(x), expected, rtol=1e-14)


def test_a_call_cannot_be_differentiated():
    def slope(x):
        return gradient(called(turned, 2, (x, x))[0], [x])[0]
    with pytest.raises(ValueError, match='has no derivative here'):
        written_out(slope, [typeof(1.0)])


@unrolled
def with_constants(x, bound):
    return clamp((x / 3 + 0.1) * 2.5 - sin(x), -bound, bound) + is_nonzero(x) + 1 / x


@kernel
def run_with_constants(x, bound):
    return with_constants(x, bound)


def test_constants_do_not_widen_single_precision():
    run_with_constants(F(0.7), F(2))
    run_with_constants(0.7, 2.0)
    returned = {signature.args[0].name: signature.return_type.name
                for signature in run_with_constants.nopython_signatures}
    assert returned == {'float32': 'float32', 'float64': 'float64'}
    exact = run_with_constants(0.7, 2.0)
    assert run_with_constants(F(0.7), F(2)) == pytest.approx(exact, rel=1e-6)
    assert with_constants(F(0.7), F(2)).dtype == np.float32


@unrolled
def swap(x, out):
    first, second = x[0], x[1]
    out[0] = second
    out[1] = first + 0.0 * second


@kernel
def run_swap(x, out):
    swap(x, out)


@pytest.mark.parametrize('run', [run_swap, swap], ids=['kernel', 'python'])
def test_all_is_read_before_anything_is_written(run):
    x = np.array([1.0, 2.0])
    run(x, x)
    np.testing.assert_array_equal(x, [2.0, 1.0])


def test_what_was_written_cannot_be_read():
    def wrong(x):
        x[0] = 2 * x[1]
        return x[0]
    with pytest.raises(ValueError, match=r'x\[0\] is read after it was written'):
        written_out(wrong, [typeof(np.zeros(2))])


@unrolled
def set_place(x, t, i):
    x[t, i] = x[t, 0] + 1.0


@kernel
def run_set_place(x, t, i):
    set_place(x, t, i)


@pytest.mark.parametrize('run', [run_set_place, set_place], ids=['kernel', 'python'])
def test_elements_are_found_by_numbers_that_are_arguments(run):
    x = np.arange(6.0).reshape(2, 3)
    run(x, 1, 2)
    np.testing.assert_array_equal(x, [[0, 1, 2], [3, 4, 4]])


def test_sums_and_products_of_nothing_are_zero():
    assert total([]) == dot([], []) == 0.0


@pytest.mark.parametrize('count', range(1, 9))
def test_a_sum_is_that_of_all(count, rng):
    a, b = rng.normal(size=(2, count))
    assert total(a) == pytest.approx(a.sum(), rel=1e-12)
    assert dot(a, b) == pytest.approx(a @ b, rel=1e-12)


class Power(Constant):
    """A constant that says to which power."""

    def __init__(self, name, power, of):
        """Take the power."""
        super().__init__(name, of)
        self.power = power


@same_type_by(lambda raised: (raised.power, type(raised.x)))
class Raised(NamedTuple):
    """A number to a power."""

    power: Power
    x: float


@unrolled
def raised_of(numbers):
    product = 1.0
    for _ in range(numbers.power.power):
        product = product * numbers.x
    return product


@kernel
def run_raised(numbers):
    return raised_of(numbers)


def test_a_constant_is_known_when_a_kernel_is_compiled():
    square, cube = (Power(f'to {n}', n, f) for n in (2, 3))
    for power in (square, cube):
        numbers = Raised(power, 1.5)
        assert run_raised(numbers) == raised_of(numbers) == 1.5 ** power.power
    assert typeof(Raised(square, 1.5)) is typeof(Raised(square, 2.5))
    assert typeof(Raised(square, 1.5)) != typeof(Raised(cube, 1.5))
    assert typeof(Raised(square, 1.5)) != typeof(Raised(square, F(1.5)))


def function_in(path, text):
    """Return the function `step` of a module with this text."""
    path.write_text(text)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.step


def test_a_constant_is_another_where_its_source_is(tmp_path):
    """So that machine code in the cache is never that of an older source."""
    one = function_in(tmp_path / 'one.py', 'def step():\n    return 1\n')
    same = function_in(tmp_path / 'same.py', 'def step():\n    return 1\n')
    other = function_in(tmp_path / 'other.py', 'def step():\n    return 2\n')
    kind = typeof(Constant('name', one))
    assert kind == typeof(Constant('name', same))
    assert kind != typeof(Constant('name', other))
    assert kind != typeof(Constant('other name', one))

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Count the arithmetic of the rollout kernel, as its source does it; prints JSON.

With NUMBA_DISABLE_JIT=1 in the environment the kernels run as Python, so they run here on numbers
that remember what made them: one step of the model, and one sample through `follow` with its
feedback, noise and cost. Counted is what a result depends on, and once what is written twice: a
compiler finds both. Minima, maxima and absolute values are not counted.
"""

import argparse
from collections import Counter
from collections.abc import Iterable
import json
import sys
from typing import Any

import numpy as np

from dp_swing_ros.control import controllers
from dp_swing_ros.kernels import trigonometry
from dp_swing_ros.pendulum.model import advance
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.solvers import samples

made: dict[tuple, 'Remembering'] = {}   # by the operation and its operands


class Remembering(float):
    """A number that remembers the operation and the operands that made it."""

    __array_ufunc__ = None   # so that NumPy's numbers leave arithmetic with it to it
    origin: tuple = ()

    def __add__(self, other: Any) -> 'Remembering':
        return make('add', self, other)

    def __sub__(self, other: Any) -> 'Remembering':
        return make('subtract', self, other)

    def __rsub__(self, other: Any) -> 'Remembering':
        return make('subtract', other, self)

    def __mul__(self, other: Any) -> 'Remembering':
        return make('multiply', self, other)

    def __truediv__(self, other: Any) -> 'Remembering':
        return make('divide', self, other)

    def __rtruediv__(self, other: Any) -> 'Remembering':
        return make('divide', other, self)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> 'Remembering':
        return make('multiply', -1.0, self)

    def sin(self) -> 'Remembering':
        return trigonometry.sincos_single(self)[0]   # as for single precision

    def cos(self) -> 'Remembering':
        return trigonometry.sincos_single(self)[1]

    def clamp(self, low: float, high: float) -> 'Remembering':
        return self   # no arithmetic


DO = {'add': lambda a, b: a + b, 'subtract': lambda a, b: a - b, 'multiply': lambda a, b: a * b,
      'divide': lambda a, b: a / b}


def make(operation: str, left: Any, right: Any) -> Remembering:
    """Do an operation, or find its result where it was done before."""
    operands = [one if isinstance(one, Remembering) else float(one) for one in (left, right)]
    names = [id(one) if isinstance(one, Remembering) else ('constant', one) for one in operands]
    if operation in ('add', 'multiply'):
        names.sort(key=str)
    key = (operation, *names)
    if key not in made:
        made[key] = Remembering(DO[operation](float(left), float(right)))
        made[key].origin = (operation, *operands)
    return made[key]


def count(results: Iterable[Any]) -> dict[str, int]:
    """Count the operations that some results depend on."""
    counts, seen = Counter[str](), set[int]()
    waiting = [one for one in results if isinstance(one, Remembering)]
    while waiting:
        one = waiting.pop()
        if id(one) not in seen and one.origin:
            seen.add(id(one))
            operation, *operands = one.origin
            counts['add' if operation == 'subtract' else operation] += 1
            waiting += [other for other in operands if isinstance(other, Remembering)]
    return dict(counts)


def remembering(*shape: int) -> Array:
    """Return an array of different numbers."""
    numbers = np.random.default_rng(0).uniform(0.1, 0.2, shape)
    return np.vectorize(Remembering, otypes=[object])(numbers)


def of_step(problem: Problem) -> dict[str, int]:
    """Count one step of the model."""
    *x, u = remembering(len(problem.cost.S) + 1)
    return count(advance(problem.model, x, u))


def of_sample(problem: Problem) -> dict[str, float]:
    """Count a sample, per step of the horizon."""
    N, n = problem.horizon, len(problem.cost.S)
    V, J = np.zeros((N, 1), object), np.zeros(1, object)
    samples.follow(problem.model, problem.cost, remembering(n), remembering(N),
                   remembering(N, n), remembering(N, 1), remembering(1), 0.8, problem.bounds,
                   np.zeros((n + 3, 1), object), V, J)
    return {kind: number / N for kind, number in count(J).items()}


def main() -> None:
    """Print both counts."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    problem = controllers.problem({})
    setattr(samples, 'LANES', 1)
    setattr(trigonometry, 'signed', lambda number, n: number)   # no arithmetic
    json.dump({'step': of_step(problem), 'sample': of_sample(problem)}, sys.stdout)


if __name__ == '__main__':
    main()

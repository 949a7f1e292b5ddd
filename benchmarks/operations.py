# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Count the arithmetic of the kernels, as their sources do it; prints JSON.

With NUMBA_DISABLE_JIT=1 in the environment kernels run as Python, here on numbers that count what
is done with them: what an algorithm needs, without the lanes that only fill vectors up, and once
what is done twice, for a compiler finds it. Numbers of model and cost are constants, and what is
made of constants alone is not counted; nor are minima, maxima and signs. A sum that has a product
takes it in, as a fused multiply-add.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
import json
import math
import sys
from typing import Any
from unittest.mock import patch

import numpy as np
from peers_gradient import first_plan, LINKS, OURS, problem

from dp_swing_ros.kernels import trigonometry, unrolling
from dp_swing_ros.pendulum import derivatives
from dp_swing_ros.pendulum.model import Model, rollout, size
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem import cost as costs
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.solvers import riccati, samples, SOLVERS

KINDS = 'fma', 'add', 'multiply', 'divide', 'sincos'
TYPEOF = unrolling.typeof
Counts = Mapping[str, float]


class Tally:
    """What has been counted: operations by kind, and when [s] the last result can be there."""

    def __init__(self, latencies: Counts) -> None:
        """Take how long each kind of result is waited for [s]."""
        self.latencies, self.counts, self.chain = latencies, Counter[str](), 0.0
        self.made: dict[tuple, tuple[Counted, tuple]] = {}   # with operands, whose ids stay theirs

    def done(self, kind: str, value: float, *operands: Any) -> 'Counted':
        """Return the result of an operation, and count it if it is new."""
        key = (kind, value, *sorted(id(one) if isinstance(one, Counted) else float(one)
                                    for one in operands))
        if key not in self.made:
            self.made[key] = self.new(kind, value, operands), operands
        return self.made[key][0]

    def new(self, kind: str, value: float, operands: tuple) -> 'Counted':
        """Count an operation; a sum takes a product in, if there is one."""
        known = [getattr(one, 'at', 0.0) for one in operands]
        found = Counted(value, self, kind, max(known) + self.latencies[kind], max(known))
        self.counts[kind] += 1
        products = [(one, more) for one, more in zip(operands, known[::-1])
                    if kind == 'add' and getattr(one, 'kind', '') == 'multiply']
        for one, more in products:
            found.at = min(found.at, max(one.factors, more) + self.latencies['fma'])
        for one in [one for one, _ in products if not one.taken][:1]:
            one.taken = True
            self.counts.update({'fma': 1, 'add': -1, 'multiply': -1})
        self.chain = max(self.chain, found.at)
        return found

    def numbers(self, values: Any) -> Array:
        """Return an array of numbers that count here."""
        return np.vectorize(partial(Counted, tally=self), otypes=[object])(values) if np.size(
            values) else cells(np.shape(values))


class Counted(float):
    """A number that counts what is done with it."""

    __array_ufunc__ = None   # so that NumPy's numbers leave arithmetic with it to it

    def __new__(cls, value: float, *_: Any, **__: Any) -> 'Counted':
        """Make the number."""
        return super().__new__(cls, value)

    def __init__(self, value: float, tally: Tally, kind: str = '', at: float = 0.0,
                 factors: float = 0.0) -> None:
        """Take who counts, what made it, and when [s] it and its operands can be known."""
        self.tally, self.kind, self.at, self.factors, self.taken = tally, kind, at, factors, False

    def __add__(self, other: Any) -> 'Counted':
        return self.tally.done('add', float(self) + float(other), self, other)

    def __sub__(self, other: Any) -> 'Counted':
        return self.tally.done('add', float(self) - float(other), self, other)

    def __rsub__(self, other: Any) -> 'Counted':
        return self.tally.done('add', float(other) - float(self), other, self)

    def __mul__(self, other: Any) -> 'Counted':
        return self.tally.done('multiply', float(self) * float(other), self, other)

    def __truediv__(self, other: Any) -> 'Counted':
        return self.tally.done('divide', float(self) / float(other), self, other)

    def __rtruediv__(self, other: Any) -> 'Counted':
        return self.tally.done('divide', float(other) / float(self), other, self)

    def __neg__(self) -> 'Counted':   # what it becomes an operand of changes the sign at no cost
        return Counted(-float(self), self.tally, self.kind, self.at, self.factors)

    __radd__, __rmul__ = __add__, __mul__


def counted_sincos(x: Any) -> tuple[Any, Any]:
    """Return a sine and a cosine, which count as one where the angle counts."""
    if not isinstance(x, Counted):
        return math.sin(x), math.cos(x)
    s = x.tally.done('sincos', math.sin(x), x)
    return s, Counted(math.cos(x), x.tally, 'sincos', s.at)


def cells(shape: Any, *_: Any, **__: Any) -> Array:
    """Return an array of places for numbers that count."""
    return np.full(shape, 0.0, object)


def typeof(value: Any) -> Any:
    """Return the Numba type that a value would have if its numbers did not count."""
    holds = isinstance(value, np.ndarray) and value.dtype.hasobject
    return TYPEOF(np.empty_like(value, float) if holds else value)


def part(latencies: Counts, function: Callable, *arguments: Any,
         times: float = 1) -> tuple[dict[str, float], list[Array]]:
    """Run a kernel; return its counts and chain, by how often it did it, and the arrays."""
    tally = Tally(latencies)
    given = [tally.numbers(one) if isinstance(one, np.ndarray) else one for one in arguments]
    with patch.multiple(np, empty=cells, zeros=cells):
        result = function(*given)
    return {'chain': tally.chain / times, **{
        kind: tally.counts[kind] / times for kind in KINDS}}, [
        np.asarray(one, float) for one in [*given, result] if isinstance(one, np.ndarray)]


def second_derivatives(model: Model, points: Array, costate: Array) -> None:
    """Do what DDP does at a step for all directions together."""
    stages, _, curved = derivatives.shapes(model)
    mu, M = np.empty((stages, len(costate) // 2)), np.empty((stages, curved))
    derivatives.stage_costates(model, derivatives.jacobians(model, points[0], 0), costate, mu)
    for stage in range(stages):
        derivatives.curvature_of_stage(model, points[0], stage, 0, mu, M)


def parts(of: Problem, latencies: Counts) -> dict[str, dict[str, float]]:
    """Count each part of the solvers on a problem."""
    plan, (model, cost, bounds), found = first_plan(of), (of.model, of.cost, of.bounds), {}
    X, U, K, (N, n) = plan.X, plan.U, plan.K, plan.K.shape
    run = partial(part, latencies)
    found['derivatives'], (*_, points) = run(derivatives.expand, model, X, U)
    for name in reversed(OURS):
        found[f'{name} backward'], (*_, k, gains) = run(
            riccati.backward, model, cost, points, X, U, X[:0], bounds, 0.0, SOLVERS[name].share,
            U, K)
    found['second derivatives'], _ = run(second_derivatives, model, points, X[0], times=1 / N)
    found['line_search'], _ = run(riccati.forward, model, cost, X, U, X[:0], k, gains, 1.0, bounds,
                                  X, U)
    found['rollout'], _ = run(rollout, model, X[0], U)
    found['sample'], _ = run(
        samples.follow, model, cost, X[0], U, K, np.ones((N, 1)), np.array([0.1]), 0.8, bounds,
        np.zeros((n + 3, 1)), np.zeros((N, 1)), np.zeros(1), times=N)
    return found


def count(latencies: Counts, *links: str) -> dict[str, dict[str, dict[str, float]]]:
    """Count for some numbers of links, or all; in a process that this spoils for others."""
    setattr(trigonometry, 'sincos', counted_sincos)
    setattr(unrolling, 'typeof', typeof)
    setattr(samples, 'LANES', 1)
    for module in (derivatives, costs, riccati):
        setattr(module, 'STEPS', problem().horizon)
        setattr(module, 'lanes', lambda model: size(model) + 1)
    return {each: parts(problem(links=int(each)), latencies)
            for each in links or map(str, LINKS)}


if __name__ == '__main__':
    json.dump(count(json.loads(sys.argv[1]), *sys.argv[2:]), sys.stdout)

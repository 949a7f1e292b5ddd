# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A smooth network of one hidden layer, and its derivatives by the variables of the dynamics.

    y = V σ(h) + c,    h = W i + b,    σ(h) = h / √(1 + h²)

The inputs i are sines and cosines of the angles and of the angles between links, the speeds of the
links and their products, the force and the speed of the cart. So it knows nothing of where the
cart is, a whole turn is none, and what turns a joint at a speed need not be learned from scratch.
σ has all derivatives, none of which is larger than 2, costs no exponential and saturates: far from
what it was trained on the output hardly changes. Source of σ: Carlile et al., "Improving deep
learning by inverse square root linear units", 2017.

Plain Python over numbers, symbols, arrays or tensors; see kernels/unrolling.py.
"""

import functools
from itertools import combinations, combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.kernels.compilation import Constant
from dp_swing_ros.kernels.symbols import dot, sqrt, total
from dp_swing_ros.pendulum.equations import Matrix, Numbers
from dp_swing_ros.pendulum.points import by_variables
from dp_swing_ros.pendulum.state import Array


class Widths(Constant):
    """How many links, hidden units and outputs a network is for."""

    def __init__(self, links: int, hidden: int, outputs: int) -> None:
        """Take the numbers; those that are made from equal ones should be the same: `widths`."""
        super().__init__(f'network-{links}-{hidden}-{outputs}', Widths)
        self.links, self.hidden, self.outputs = links, hidden, outputs

    @property
    def inputs(self) -> int:
        """Return the number of inputs."""
        n = self.links
        return len(inputs([0.0] * n, [0.0] * n, [0.0] * (n + 2)))


def inputs(s: Numbers, c: Numbers, rates: Numbers) -> list[Any]:
    """Return i for the sines and cosines of the angles, and for θ̇, u and ẋ."""
    n, w = len(s), rates[:-2]
    between = [each for i, j in combinations(range(n), 2)
               for each in (s[i] * c[j] - c[i] * s[j], c[i] * c[j] + s[i] * s[j])]
    products = [w[i] * w[j] for i, j in combinations_with_replacement(range(n), 2)]
    return [*s, *c, *between, *rates, *products]


widths = functools.cache(Widths)


class Network(NamedTuple):
    """The weights; shapes: W (hidden, inputs), b (hidden,), V (outputs, hidden), c (outputs,)."""

    widths: Widths
    W: Array
    b: Array
    V: Array
    c: Array

    @classmethod
    def of(cls, links: int, W: Array, b: Array, V: Array, c: Array) -> 'Network':
        """Return a network of some weights."""
        of_memory = (np.array(each, dtype=float, order='C') for each in (W, b, V, c))
        return cls(widths(links, len(b), len(c)), *of_memory)

    @property
    def last_layer(self) -> Array:
        """Return V and c in one vector (outputs (hidden + 1),)."""
        return np.concatenate((self.V.ravel(), self.c))

    def with_last_layer(self, p: Array) -> 'Network':
        """Return the same with another V and c."""
        V, c = np.split(p, [self.V.size])
        return self._replace(V=V.reshape(self.V.shape).copy(), c=c.copy())

    def hidden(self, s: Numbers, c: Numbers, rates: Numbers) -> list[Any]:
        """Return h."""
        i = inputs(s, c, rates)
        return [total([self.b[j], *(self.W[j, k] * each for k, each in enumerate(i))])
                for j in range(self.widths.hidden)]

    def outputs(self, s: Numbers, c: Numbers, rates: Numbers) -> list[Any]:
        """Return y."""
        squashed = [h * inverse_root(h) for h in self.hidden(s, c, rates)]
        return [self.c[i] + dot([self.V[i, j] for j in range(self.widths.hidden)], squashed)
                for i in range(self.widths.outputs)]

    def hidden_slopes(self, by_z: Matrix) -> Matrix:
        """Return ∂h/∂z, a column a row, from ∂i/∂z."""
        return [[dot([self.W[j, k] for k in range(len(column))], column)
                 for j in range(self.widths.hidden)] for column in zip(*by_z)]

    def slopes(self, s: Numbers, c: Numbers, rates: Numbers) -> Matrix:
        """Return ∂y/∂z of symbols, z = (θ, θ̇, u, ẋ)."""
        first = [cube(inverse_root(h)) for h in self.hidden(s, c, rates)]
        columns = self.hidden_slopes([by_variables(each, s, c, rates)
                                      for each in inputs(s, c, rates)])
        return [[dot([self.V[i, j] * each for j, each in enumerate(first)], column)
                 for column in columns] for i in range(self.widths.outputs)]

    def curvature(self, nu: Numbers, s: Numbers, c: Numbers, rates: Numbers) -> Matrix:
        """Return the upper triangle of Σ ν_i ∂²y_i/∂z² of symbols."""
        hidden = self.hidden(s, c, rates)
        roots = [inverse_root(h) for h in hidden]
        weight = [dot(nu, [self.V[i, j] for i in range(len(nu))]) for j in range(len(hidden))]
        first = [w * cube(r) for w, r in zip(weight, roots)]
        second = [-3.0 * (a * h) * (r * r) for a, h, r in zip(first, hidden, roots)]
        by_z = [by_variables(each, s, c, rates) for each in inputs(s, c, rates)]
        columns = self.hidden_slopes(by_z)
        found = []
        for k, column in enumerate(columns):
            weighted = [a * slope for a, slope in zip(second, column)]
            found.append([dot(weighted, other) for other in columns[k:]])
        for place, slopes in enumerate(by_z):   # what bends an input
            along = dot(first, [self.W[j, place] for j in range(len(hidden))])
            for k, slope in enumerate(slopes):
                for m, bent in enumerate(by_variables(slope, s, c, rates)[k:]):
                    found[k][m] = found[k][m] + along * bent
        return found


def inverse_root(h: Any) -> Any:
    """Return 1 / √(1 + h²)."""
    return 1.0 / sqrt(1.0 + h * h)


def cube(r: Any) -> Any:
    """Return r³."""
    return r * r * r

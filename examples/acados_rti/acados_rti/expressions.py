# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The problem in CasADi's symbols: dp_swing_ros's own equations, called with these for numbers.

All numbers of model and cost are parameters p, so that other masses, weights or goals need no
other code.
"""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from dp_swing_ros.kernels.compilation import Constant, mapped
from dp_swing_ros.kernels.symbols import flat
from dp_swing_ros.pendulum.model import advance, Model
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.cost import Cost, errors, excess

# what dp_swing_ros asks of a number beside arithmetic, sin and cos
setattr(ca.SX, 'clamp', lambda x, low, high: ca.fmin(ca.fmax(x, low), high))


class Squares(NamedTuple):
    """A cost rᵀ W r and its Gauss-Newton Hessian, 2 (∂r)ᵀ W ∂r."""

    value: Any
    hessian: Any

    @classmethod
    def of(cls, r: Any, W: Any, z: Any) -> 'Squares':
        """Take residuals (m, 1), weights (m, m), and by what to differentiate."""
        J = ca.jacobian(r, z)
        return cls(ca.bilin(W, r, r), 2 * ca.mtimes([J.T, W, J]))


class Expressions(NamedTuple):
    """The problem as acados takes it: all of CasADi's type SX."""

    x: Any            # (2n + 2, 1)
    u: Any
    p: Any            # all numbers of model and cost, in order
    step: Any         # x⁺ = f(x, u)
    running: Squares  # ℓ(x, u), by (u, x)
    terminal: Squares

    @classmethod
    def of(cls, model: Model, cost: Cost) -> 'Expressions':
        """Take a model and a cost for their structure; their numbers do not matter."""
        p: list[Any] = []

        def symbol(_: float) -> Any:
            p.append(ca.SX.sym(f'p_{len(p)}'))
            return p[-1]
        model, cost = mapped(np.frompyfunc(symbol, 1, 1), (model, cost))
        x, u = ca.SX.sym('x', len(cost.S)), ca.SX.sym('u')
        numbers = ca.vertsplit(x)
        e, beyond = errors(cost, numbers).e, excess(cost, numbers)
        limits, weights = ([part[i] for part in beyond] for i in (1, 2))
        P = ca.vertcat(*(ca.horzcat(*row) for row in cost.P))
        running = Squares.of(
            ca.vertcat(*e, u, *limits), ca.diag(ca.vertcat(*cost.S, cost.R, *weights)),
            ca.vertcat(u, x))
        terminal = Squares.of(
            ca.vertcat(*e, *limits), ca.diagcat(P, ca.diag(ca.vertcat(*weights))), x)
        return cls(x, u, ca.vertcat(*p), ca.vertcat(*advance(model, numbers, u)),
                   running, terminal)


def numbers_of(model: Model, cost: Cost) -> Array:
    """Return the values of p."""
    found: list[float] = []
    for each in flat((model, cost)):
        if isinstance(each, np.ndarray):
            found += each.ravel().tolist()
        elif not isinstance(each, Constant):
            found.append(each)
    return np.array(found)

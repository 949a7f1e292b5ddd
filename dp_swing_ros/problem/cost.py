# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The cost of a trajectory, and its derivatives.

    J(X, U) = Σ ℓ(x, u) + ℓ_f(x_N)
    ℓ(x, u) = e(x)ᵀ S e(x) + R u² + b(x),    ℓ_f(x) = e(x)ᵀ P e(x) + b(x)
    b(x) = w max(0, |x| - x_soft)² + w_v max(0, |ẋ| - v_soft)²

Source: the paper, (16)-(21); it has no ½. There e(x) = x - x_r, P = 1000 S and b = 0. The tuned
default measures the error δ of an angle by the chord e = 2 sin(δ/2): e² = 2 (1 - cos δ) is δ² near
the goal, has no jump at a whole turn, and its Gauss-Newton Hessian stays positive semi-definite.
The chord itself changes its sign from turn to turn, and with it P's products of an angle and a
velocity: P is right on the goal's own turn, which is for the receding horizon to choose.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.compilation import Constant, same_type_by
from dp_swing_ros.kernels.symbols import clamp, cos, dot, is_nonzero, sin, total
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.pendulum.derivatives import blocks, load, STEPS
from dp_swing_ros.pendulum.equations import Numbers
from dp_swing_ros.pendulum.state import Array


class AngleError(Constant):
    """How the error of an angle is measured, known when kernels are compiled."""

    def __init__(self, name: str, error: Callable[[Any], tuple[Any, Any, Any]],
                 squared: Callable[[Any, Any], Any], periodic: bool) -> None:
        """
        Take its name, and whether a whole turn is no error.

        error gives e and its two derivatives from a difference, squared e² from an angle and its
        reference.
        """
        super().__init__(name, error)
        self.error, self.squared, self.periodic = error, squared, periodic


# The chord is the distance of two points on the circle: the sine and cosine of the angle itself,
# which the model needs too, are then computed once for both.
ANGLE_ERRORS = {
    'chord': AngleError(
        'chord', lambda difference: (2 * sin(difference / 2), cos(difference / 2),
                                     -0.5 * sin(difference / 2)),
        lambda th, th_r: (sin(th) - sin(th_r)) * (sin(th) - sin(th_r))
        + (cos(th) - cos(th_r)) * (cos(th) - cos(th_r)), periodic=True),
    'angle': AngleError(
        'angle', lambda difference: (difference, 1.0, 0.0),
        lambda th, th_r: (th - th_r) * (th - th_r), periodic=False)}


@same_type_by(lambda cost: (cost.angle_error, len(cost.S), type(cost.R)))
class Cost(NamedTuple):
    """The numbers of the cost; n links, so 2n + 2 numbers of a state."""

    S: tuple[float, ...]       # diagonal of the state weights
    R: float                   # [1/N^2]
    P: Array                   # (2n + 2, 2n + 2) terminal weights
    x_r: tuple[float, ...]     # reference state
    angle_error: AngleError
    x_soft: float              # [m] where the soft margin of the track begins
    w: float                   # [1/m^2] weight of the squared distance into the margin
    v_soft: float              # [m/s] speed of the cart above which it costs
    w_v: float                 # [s^2/m^2] weight of the squared excess


def is_angle(cost: Cost, i: int) -> bool:
    """Return whether component i of the state is an angle."""
    return 0 < i < len(cost.S) // 2


@unrolled
def is_periodic(cost):
    """Return whether a whole turn is no error."""
    return int(cost.angle_error.periodic)


class Errors(NamedTuple):
    """The errors of the numbers of a state, and their derivatives."""

    e: Any        # (2n + 2,)
    slope: Any    # ∂e_i/∂x_i
    bend: Any     # ∂²e_i/∂x_i²


def errors(cost: Cost, x: Numbers) -> Errors:
    """Return the errors of the numbers of a state."""
    each = [cost.angle_error.error(x[i] - cost.x_r[i]) if is_angle(cost, i)
            else (x[i] - cost.x_r[i], 1.0, 0.0) for i in range(len(cost.S))]
    return Errors(*map(list, zip(*each)))


def excess(cost: Cost, x: Numbers) -> list[tuple[int, Any, Any]]:
    """Return which numbers of a state have a soft limit, how far each is beyond it, and w."""
    return [(i, x[i] - clamp(x[i], -soft, soft), w)
            for i, soft, w in ((0, cost.x_soft, cost.w),
                               (len(cost.S) // 2, cost.v_soft, cost.w_v))]


def barrier(cost: Cost, x: Numbers) -> Any:
    """Return b(x)."""
    return total([w * beyond * beyond for _, beyond, w in excess(cost, x)])


def squared_errors(cost: Cost, x: Numbers) -> list[Any]:
    """Return the squared errors of the numbers of a state."""
    return [cost.angle_error.squared(x[i], cost.x_r[i]) if is_angle(cost, i)
            else (x[i] - cost.x_r[i]) * (x[i] - cost.x_r[i]) for i in range(len(cost.S))]


def running_cost(cost: Cost, x: Numbers, u: Any) -> Any:
    """Return ℓ(x, u)."""
    return dot(cost.S, squared_errors(cost, x)) + cost.R * u * u + barrier(cost, x)


def terminal_cost(cost: Cost, x: Numbers) -> Any:
    """Return ℓ_f(x); of P, which is symmetric, the upper triangle is enough."""
    e, n = errors(cost, x).e, len(cost.S)
    products = [e[i] * (cost.P[i, i] * e[i]
                        + 2 * dot([cost.P[i, j] for j in range(i + 1, n)], e[i + 1:]))
                for i in range(n)]
    return total(products) + barrier(cost, x)


running, terminal = unrolled(running_cost), unrolled(terminal_cost)


@kernel
def trajectory_cost(cost, X, U):
    """
    Return J(X, U).

    Shapes: X (T + 1, 2n + 2), U (T,).
    """
    cost_so_far = terminal(cost, X[len(U)])
    for t in range(len(U)):
        cost_so_far += running(cost, X[t], U[t])
    return cost_so_far


class Terms(NamedTuple):
    """What a cost consists of."""

    position: float     # of the cart
    angles: float
    velocities: float
    force: float
    limits: float       # b(x) of track and speed, without the last state's
    terminal: float     # ℓ_f(x_N)


@unrolled
def running_terms(cost, x, u):
    """Return the terms of ℓ(x, u), without the terminal one."""
    weighted = [weight * square for weight, square in zip(cost.S, squared_errors(cost, x))]
    half = len(cost.S) // 2
    return (weighted[0], total(weighted[1:half]), total(weighted[half:]), cost.R * u * u,
            barrier(cost, x))


@kernel
def sums_of_terms(cost, X, U):
    """Return the terms of J(X, U) as an array; see `terms`."""
    sums = np.zeros(6)
    for t in range(len(U)):
        position, angles, velocities, force, limits = running_terms(cost, X[t], U[t])
        sums[0] += position
        sums[1] += angles
        sums[2] += velocities
        sums[3] += force
        sums[4] += limits
    sums[5] = terminal(cost, X[len(U)])
    return sums


def terms(cost: Cost, X: Array, U: Array) -> Terms:
    """Return the terms of J(X, U), whose sum it is; X (T + 1, 2n + 2), U (T,)."""
    return Terms(*sums_of_terms(cost, X, U).tolist())


@unrolled
def running_lane(cost, z, share, out, i):
    """Write the derivatives of ℓ of the step in lane i; see `running_derivatives`."""
    x = [z[j, i] for j in range(len(cost.S))]
    e, slope, bend = errors(cost, x)
    first = [2 * cost.S[j] * (e[j] * slope[j]) for j in range(len(e))]
    second = [2 * cost.S[j] * (slope[j] * slope[j]) for j in range(len(e))]
    if share is not None:
        second = [gauss_newton + 2 * cost.S[j] * share * (e[j] * bend[j])
                  for j, gauss_newton in enumerate(second)]
    for j, beyond, w in excess(cost, x):
        first[j] += 2 * w * beyond
        second[j] += 2 * w * is_nonzero(beyond)
    for row, number in enumerate([*first, *second]):
        out[row, i] = number


@kernel
def running_derivatives(cost, X, U, share):
    """
    Return ℓ_x and the diagonal of ℓ_xx of all steps; ℓ_u = 2 R u, ℓ_uu = 2 R.

    ℓ_xx is Gauss-Newton's and a share of what that leaves out, the curvature of the
    errors: with None it is Gauss-Newton's, with 1 exact. Those of step t are
    [t // STEPS, :, t % STEPS], ℓ_x first.
    Shapes: X (T or more, 2n + 2), U (T,) -> (blocks, 4n + 4, STEPS).
    """
    derivatives = np.empty((blocks(U), 2 * len(cost.S), STEPS))
    z = np.empty((len(cost.S) + 1, STEPS))
    for block in range(len(derivatives)):
        load(cost.S, X, U, block * STEPS, z)
        of_block = derivatives[block]
        for i in range(STEPS):
            running_lane(cost, z, share, of_block, i)
    return derivatives


@unrolled
def errors_at(cost, x):
    """Return the errors of a state, and both derivatives of b by cart and speed."""
    numbers = [x[i] for i in range(len(cost.S))]
    each = [tuple(1.0 * number for number in part) for part in errors(cost, numbers)]
    beyond = [(2 * w * by, 2 * w * is_nonzero(by)) for _, by, w in excess(cost, numbers)]
    return *each, *beyond


@kernel
def terminal_derivatives(cost, x, share, l_x, l_xx):
    """
    Write the gradient of ℓ_f, and its Hessian as `running_derivatives` has it.

    Shapes: l_x (2n + 2,), l_xx (2n + 2, 2n + 2).
    """
    e, slope, bend, of_cart, of_speed = errors_at(cost, x)
    for i in range(len(e)):
        l_x[i] = 0.0
        for j in range(len(e)):
            l_x[i] += 2 * slope[i] * cost.P[i, j] * e[j]
            l_xx[i, j] = 2 * slope[i] * cost.P[i, j] * slope[j]
    if share is not None:
        for i in range(len(e)):
            for j in range(len(e)):
                l_xx[i, i] += 2 * share * bend[i] * cost.P[i, j] * e[j]
    v = len(e) // 2
    l_x[0] += of_cart[0]
    l_xx[0, 0] += of_cart[1]
    l_x[v] += of_speed[0]
    l_xx[v, v] += of_speed[1]

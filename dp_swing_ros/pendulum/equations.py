# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The equations of motion of a cart with n links, once, for any n.

    D(θ) q̈ + C(θ, θ̇) q̇ + G(θ) = H u - friction,    q = [x, θ1 … θn]

With r = H u - C q̇ - G - friction, the accelerations a solve D a = r. In absolute angles

    D_00 = m    D_0i = a_i cos θi    D_ij = b_ij cos(θi - θj)
    r_0 = f + Σ a_i sin θi θ̇i²
    r_i = g a_i sin θi - Σ b_ij sin(θi - θj) θ̇j² - τ_i + τ_i+1

where f is the force on the cart less its friction φ_0(ẋ), and τ_i the torque by which joint i
holds link i back: φ_i(θ̇i - θ̇i-1), and that of a spring, stiffness_i (θi - θi-1) - preload_i, which
winds up with every turn. Source: the paper, (4)-(15), with the errata of docs/model.md.
Friction is viscous and dry, the latter made smooth, with two derivatives, over a creep:

    φ_i(v) = friction_i v + dry_i s(v / creep_i),    s(y) = y (15 - 10 y² + 3 y⁴) / 8, |y| ≤ 1

All of it is plain Python over numbers, symbols, arrays or tensors; see kernels/unrolling.py.
"""

from collections.abc import Sequence
import contextlib
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.kernels.symbols import clamp, cos, dot, sin, total
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array, errors
from dp_swing_ros.pendulum.units import scaled_speeds, Units

Numbers = Sequence[Any]
Matrix = list[list[Any]]
STANDARD_GRAVITY = 9.81   # [m/s²] of what has none, and with it no time of its own
STEPS_TO_REST, AT_REST = 20, 1e-9   # of Newton's method; share of the weight's torque that is none
DIGITS = 6          # [m, rad] of places that are the same
FARTHEST = 0.5      # [rad] by which springs may hold links from where they would rest without
CREEP = 0.2  # [m/s, rad/s] scaled, for steps as long as a plan's: with less they were not stable


class Pendulum(NamedTuple):
    """Coefficients of the equations of motion, from masses, lengths and frictions."""

    m: float                          # [kg]    of cart and links together
    a: tuple[float, ...]              # [kg m]  (c_i m_i + Σ_{k>i} m_k) l_i
    b: tuple[tuple[float, ...], ...]  # [kg m²] rows b_ii, b_ij … (c_j m_j + Σ_{k>j} m_k) l_i l_j
    g: float                          # [m/s²]
    friction: tuple[float, ...]       # of the cart [N s/m], and of the joints [N m s/rad]
    dry: tuple[float, ...]            # [N] and [N m]
    sharpness: tuple[float, ...]      # [s/m] and [s/rad] 1 / creep
    stiffness: tuple[float, ...]      # [N m/rad] of the springs of the joints
    preload: tuple[float, ...]        # [N m] their torques with all angles at zero

    @classmethod
    def of(cls, physical: PendulumParameters, creep: float = CREEP,
           scale: Units | None = None) -> 'Pendulum':
        """
        Compute the coefficients from physical parameters.

        creep is the speed [m/s, rad/s] from which on dry friction has its whole size, scaled as
        other bodies are, if others than these.
        """
        return coefficients(physical.masses, physical.lengths, physical.centres,
                            physical.inertia_factors, physical.gravity, physical.frictions,
                            physical.dry_frictions, [1 / speed for speed in scaled_speeds(
                                creep, scale or scale_of(physical), physical.links)],
                            physical.stiffnesses, physical.preloads)

    @property
    def links(self) -> int:
        """Return the number of links, n."""
        return len(self.a)

    @property
    def kind(self) -> int:
        """Return what the types of its numbers follow from."""
        return self.links

    def without_dry_friction(self) -> 'Pendulum':
        """Return the same pendulum without dry friction."""
        return self._replace(dry=(0.0,) * len(self.dry))

    def accelerations(self, x: Numbers, u: Any) -> list[Any]:
        """Return the accelerations of cart and links in a state (2n + 2,) under a force [N]."""
        _, th, v, w = Parts.of(self, x)
        return accelerations(self, th, w, u - friction(self, 0, v))


def coefficients(masses: Numbers, lengths: Numbers, centres: Numbers, inertia_factors: Numbers,
                 g: Any, friction: Numbers, dry: Numbers, sharpness: Numbers, stiffness: Numbers,
                 preload: Numbers) -> Pendulum:
    """
    Return the coefficients; b_ii is (m_i/3 + Σ_{k>i} m_k) l_i², if link i is a uniform rod.

    A centre c_i is how far along link i its mass is, as a share of its length. Shapes: masses,
    friction, dry and sharpness (n + 1,), of the cart first; all others (n,).
    Source: the paper, (8)-(10) and (14), corrected.
    """
    n, m, l = len(lengths), masses[1:], lengths  # noqa: E741
    carried = [total(m[i + 1:]) for i in range(n)]
    at_tip = [centres[i] * m[i] + carried[i] for i in range(n)]
    # of a rod about its end, and exactly that where the factor is one and the centre a half
    own = [m[i] / 3 + (inertia_factors[i] - 1) * m[i] / 12 + (
        centres[i] * centres[i] - 0.25) * m[i] + carried[i] for i in range(n)]
    return Pendulum(
        total(masses), tuple(at_tip[i] * l[i] for i in range(n)),
        tuple((own[i] * (l[i] * l[i]), *(at_tip[j] * l[i] * l[j] for j in range(i + 1, n)))
              for i in range(n)), g, tuple(friction), tuple(dry), tuple(sharpness),
        tuple(stiffness), tuple(preload))


def own_units(physical: PendulumParameters) -> Units:
    """
    Return the pendulum's own units, in which the defaults are the same for any size.

    Linearised about upright without friction, D q̈ = diag(0, g a1 … g an) q, so that motions grow
    as e^λt with the generalised eigenvalues λ². The unit of time is that of the fastest, 1/λ; at
    no other equilibrium is any faster, as there D has the same eigenvalues with some of the a
    negative. That of length, g/λ², is how long a pendulum of a point mass as fast would be; that
    of mass is all of it, so that of force is the whole weight, and of torques that of the links.
    """
    n, g = physical.links, physical.gravity or STANDARD_GRAVITY
    none = (0.0,) * (n + 1)
    p = coefficients(physical.masses, physical.lengths, physical.centres,
                     physical.inertia_factors, g, none, none, none, none[1:], none[1:])
    D: Any = np.array(mass_matrix(p, [0.0] * n, [1.0] * n))
    square = float(np.linalg.eigvals(np.linalg.solve(D, np.diag([0.0, *p.a]) * g)).real.max())
    return Units(g / square, square ** -0.5, p.m,
                 sum(physical.masses[1:]) / physical.lightness)


def scale_of(physical: PendulumParameters) -> Units:
    """Return how many times larger its units are than those of the default bodies."""
    usual = own_units(PendulumParameters(links=physical.links))
    return Units(*np.divide(own_units(physical), usual).tolist())


def friction(p: Any, i: int, speed: Any) -> Any:
    """Return φ_i, the force [N] or torque [N m] by friction of the cart or at joint i."""
    y = clamp(p.sharpness[i] * speed, -1.0, 1.0)
    square = y * y
    return p.friction[i] * speed + p.dry[i] * (
        y * (1.875 + square * (0.375 * square - 1.25)))


def mass_matrix(p: Pendulum, s: Numbers, c: Numbers) -> Matrix:
    """Return D(θ) from the sines and cosines of the angles, (7)-(10)."""
    n = len(p.a)
    D = [[p.m] * (n + 1) for _ in range(n + 1)]
    for i in range(n):
        D[0][i + 1] = D[i + 1][0] = p.a[i] * c[i]
        D[i + 1][i + 1] = p.b[i][0]
        for j in range(i + 1, n):
            D[i + 1][j + 1] = D[j + 1][i + 1] = p.b[i][j - i] * (c[i] * c[j] + s[i] * s[j])
    return D


def add_joint_friction(p: Any, i: int, w: Numbers, r: list[Any]) -> None:
    """Add to r what the friction of the joint below link i, from zero, does at the speeds w."""
    torque = friction(p, i + 1, w[i] - w[i - 1] if i > 0 else w[i])
    r[i + 1] = r[i + 1] - torque
    if i > 0:
        r[i] = r[i] + torque


def spring_torques(p: Pendulum, th: Numbers | Array) -> list[Any]:
    """Return what the springs of the joints do to the links [N m]."""
    of_joints = [p.preload[i] - p.stiffness[i] * (th[i] - th[i - 1] if i > 0 else th[i])
                 for i in range(len(p.a))]
    return [*(one - following for one, following in pairwise(of_joints)), of_joints[-1]]


def generalised_force(p: Pendulum, s: Numbers, c: Numbers, w: Numbers, f: Any) -> list[Any]:
    """Return r = H f - C q̇ - G - friction, of links at speeds w without springs, (11)-(15)."""
    n, squares = len(p.a), [w_i * w_i for w_i in w]
    r = [f + total([p.a[i] * s[i] * squares[i] for i in range(n)]),
         *(p.g * (p.a[i] * s[i]) for i in range(n))]
    for i in range(n):
        add_joint_friction(p, i, w, r)
        for j in range(i + 1, n):
            h = p.b[i][j - i] * (s[i] * c[j] - c[i] * s[j])
            r[i + 1], r[j + 1] = r[i + 1] - h * squares[j], r[j + 1] + h * squares[i]
    return r


def with_springs(p: Pendulum, th: Numbers, r: Numbers) -> list[Any]:
    """Return r with what springs add to it."""
    return [r[0], *(r_i + torque for r_i, torque in zip(r[1:], spring_torques(p, th)))]


def determinant(A: Matrix) -> Any:
    """Return the determinant of a small matrix, by its first row."""
    if not A:
        return 1.0
    return dot(A[0], [cofactor(A, 0, j) for j in range(len(A))])


def cofactor(A: Matrix, i: int, j: int) -> Any:
    """Return the signed determinant of what is left without a row and a column."""
    minor = determinant([row[:j] + row[j + 1:] for row in A[:i] + A[i + 1:]])
    return -minor if (i + j) % 2 else minor


class LinksAlone(NamedTuple):
    """The links where the cart moves freely: its Schur complement S in D, and D_i0 / D_00."""

    share: list[Any]
    adjugate: Matrix       # of S, symmetric
    per_determinant: Any   # the one division in all, for these take longest


def links_alone(D: Matrix) -> LinksAlone:
    """Eliminate the cart from D."""
    n = len(D) - 1
    share = [D[0][i + 1] * (1.0 / D[0][0]) for i in range(n)]
    S = [[D[i + 1][j + 1] - D[0][min(i, j) + 1] * share[max(i, j)] for j in range(n)]
         for i in range(n)]
    adjugate = [[cofactor(S, min(i, j), max(i, j)) for j in range(n)] for i in range(n)]
    return LinksAlone(share, adjugate, 1.0 / dot(S[0], adjugate[0]))


def solve(D: Matrix, r: Numbers) -> list[Any]:
    """Return D⁻¹ r."""
    share, adjugate, per_determinant = links_alone(D)
    reduced = [r[i + 1] - share[i] * r[0] for i in range(len(share))]
    links = [dot(row, reduced) * per_determinant for row in adjugate]
    return [r[0] * (1.0 / D[0][0]) - dot(share, links), *links]


def inverse_inertia(D: Matrix) -> Matrix:
    """Return D⁻¹."""
    share, adjugate, per_determinant = links_alone(D)
    of_links = [[entry * per_determinant for entry in row] for row in adjugate]
    beside = [-dot(row, share) for row in of_links]
    return [[1.0 / D[0][0] - dot(share, beside), *beside],
            *([first, *row] for first, row in zip(beside, of_links))]


def accelerations(p: Pendulum, th: Numbers, w: Numbers, f: Any) -> list[Any]:
    """Return the accelerations of cart and links, a = D⁻¹ r [m/s², rad/s²]."""
    s, c = [sin(th_i) for th_i in th], [cos(th_i) for th_i in th]
    return solve(mass_matrix(p, s, c), with_springs(p, th, generalised_force(p, s, c, w, f)))


class Parts(NamedTuple):
    """A state by its parts: positions and speeds of cart and links."""

    x: Any
    th: list[Any]
    v: Any
    w: list[Any]

    @classmethod
    def of(cls, p: Any, x: Numbers) -> 'Parts':
        """Take a state (2n + 2,) of some dynamics apart."""
        n = p.links
        return cls(x[0], [x[1 + i] for i in range(n)], x[n + 1], [x[n + 2 + i] for i in range(n)])


def derivative(p: Pendulum, x: Numbers, u: Any) -> list[Any]:
    """Return ẋ = f(x, u), (3), under a force u [N]; x and ẋ have 2n + 2 numbers."""
    return [*x[p.links + 1:], *p.accelerations(x, u)]


def energy(p: Pendulum, x: Numbers) -> Any:
    """Return the kinetic and potential energy [J] of a state (2n + 2,)."""
    _, th, v, w = Parts.of(p, x)
    D = mass_matrix(p, [sin(th_i) for th_i in th], [cos(th_i) for th_i in th])
    momenta = [dot(row, [v, *w]) for row in D]
    joints = [th[0], *(after - before for before, after in pairwise(th))]
    return (0.5 * dot(momenta, [v, *w]) + p.g * dot(p.a, [cos(th_i) for th_i in th])
            + total([(0.5 * p.stiffness[i] * joint - p.preload[i]) * joint
                     for i, joint in enumerate(joints)]))


def resting(p: Pendulum, x: Array) -> Array:
    """
    Return where the links rest by their springs, near where they would without; (2n + 2,).

    By Newton's method on the torques of weight and springs. Raises ValueError where they do not
    rest nearby.
    """
    if not any((*p.stiffness, *p.preload)):
        return x
    n, found = p.links, x.copy()
    th, weight = found[1:n + 1], p.g * np.array(p.a)
    stiffness = -np.transpose([spring_torques(p._replace(preload=(0.0,) * n), row)
                               for row in np.eye(n)])
    for _ in range(STEPS_TO_REST):
        slope = np.diag(weight * np.cos(th)) - stiffness
        th -= np.linalg.solve(slope, weight * np.sin(th) + spring_torques(p, th))
    left = weight * np.sin(th) + spring_torques(p, th)
    if not (np.abs(th - x[1:n + 1]).max() < FARTHEST
            and np.abs(left).max() < AT_REST * (weight[0] + max(p.stiffness))):
        raise ValueError(f'springs leave no rest within {FARTHEST:g} rad of {x.tolist()}')
    return found


def errors_from_rest(p: Pendulum, X: Array, x_r: Array) -> Array:
    """
    Return by how much states are off from a reference, on its nearest turn, as `errors` does.

    With springs that is from where the links rest near it, on that turn, if they do. Shapes: X
    (..., 2n + 2), x_r (2n + 2,).
    """
    found = errors(X, x_r)
    if not any((*p.stiffness, *p.preload)):
        return found
    references, turn = np.unique(np.round(X - found, DIGITS).reshape(-1, len(x_r)), axis=0,
                                 return_inverse=True)
    for rest in references:
        with contextlib.suppress(ValueError):
            rest[:] = resting(p, rest)
    return X - references[turn].reshape(X.shape)


def after_impact(p: Pendulum, x: Numbers) -> list[Any]:
    """
    Return the speeds of cart and links after the cart was stopped by an impulse.

    The impulse on the cart also turns the links: Δq̇ = D⁻¹ H impulse. Shapes: x (2n + 2,).
    """
    _, th, v, w = Parts.of(p, x)
    D = mass_matrix(p, [sin(th_i) for th_i in th], [cos(th_i) for th_i in th])
    share = solve(D, [1.0] + [0.0] * len(w))
    return [0.0 * v, *(w_i - share_i / share[0] * v for w_i, share_i in zip(w, share[1:]))]

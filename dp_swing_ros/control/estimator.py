# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The extended Kalman filter: state, force bias and bodies from noisy states and the forces sent.

    z = (x, b, p),   x⁺ = f(x, u + b; bodies(p)),   b⁺ = b,   p⁺ = p,   measured: x + noise

where p are the logarithms of masses and lengths over their nominal values, and what the frictions
are above theirs. Positions are measured well and the forces are known, so a swing-up tells all of
them. Source: Simon, Optimal State Estimation, 2006, 13.2 and 13.4; covariances by Joseph's form.
"""

from dataclasses import dataclass
import math
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.equations import coefficients, Pendulum
from dp_swing_ros.pendulum.model import expand, linearise, of_coefficients
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.trajectory import step, steps_in

SCALED = ('cart_mass', 'link1_mass', 'link2_mass', 'link1_length', 'link2_length')
ADDED = ('cart_friction', 'joint1_friction', 'joint2_friction')
CONSTANT = ('link1_inertia_factor', 'link2_inertia_factor', 'gravity')
BIAS, BODIES = 6, 7      # where they begin in z
FACTORS = len(SCALED)    # of p, before what is added
SIZE = BODIES + FACTORS + len(ADDED)

LONGEST_STEP = 0.01      # [s] of the model; at 50 ms its error would pass for one of the bodies
LONGEST_GAP = 0.5        # [s] without a state; beyond it the pendulum is too chaotic to predict
HELD = 0.05              # [s] for which the noises of the prediction stay as they are
SMALL = 1e-4             # difference of p for derivatives
LARGEST_FACTOR = 2.0     # of a mass or length, either way
MOVED = 0.1              # of their deviation at first: bodies further off are a new problem


@dataclass(frozen=True)
class EstimatorParameters(Parameters):
    """What the filter takes to be uncertain, and by how much; zero is certain."""

    position_noise: float = parameter(
        2e-3, 'standard deviation of measured positions', unit='m, rad', minimum=1e-6)
    velocity_noise: float = parameter(
        0.3, 'standard deviation of measured velocities', unit='m/s, rad/s', minimum=1e-6)
    force_noise: float = parameter(
        2.0, 'standard deviation of the force in a period', unit='N', minimum=0.0)
    acceleration_noise: float = parameter(
        0.5, 'standard deviation of what else accelerates cart and links',
        unit='m/s^2, rad/s^2', minimum=0.0)
    force_bias: float = parameter(
        1.0, 'standard deviation of a lasting force beside the one sent', unit='N', minimum=0.0)
    body_error: float = parameter(
        0.15, 'standard deviation of masses and lengths, as a share', minimum=0.0)
    friction_error: float = parameter(
        0.05, 'standard deviation of the frictions', unit='N s/m, N m s/rad', minimum=0.0)
    memory: float = parameter(
        60.0, 'bias and bodies become as uncertain as at first in this time', unit='s',
        minimum=1e-3, finite=False)
    gate: float = parameter(
        10.0, 'a state further from its prediction than this is refused', unit='deviations',
        minimum=0.0, finite=False)
    push: float = parameter(
        20.0, 'unless a push of this standard deviation explains it', unit='N', minimum=0.0)
    refusals: int = parameter(
        3, 'so many in a row, and the filter starts anew from the last', minimum=1)


class Force(NamedTuple):
    """A force and how long it acted."""

    u: float         # [N]
    duration: float  # [s]


class Estimate(NamedTuple):
    """
    What the filter says at a measurement's time.

    Shapes: x, deviation and innovation (6,). The innovation is what was measured less what was
    predicted; its distance is in standard deviations.
    """

    x: Array
    deviation: Array
    innovation: Array
    distance: float
    bias: float              # [N]
    bodies: dict[str, float]
    refused: int             # states since the last reset
    accepted: bool           # not refused, nor the state that a filter begins with after refusals


@kernel
def product(left, right, out):
    """
    Write left @ right; at this size a call of the linear algebra costs more.

    Shapes: left (a, n), right (n, b), out (a, b).
    """
    for i in range(out.shape[0]):
        for k in range(out.shape[1]):
            total = 0.0
            for j in range(left.shape[1]):
                total += left[i, j] * right[j, k]
            out[i, k] = total


@kernel
def pendulums(nominal, constants, z):
    """
    Return the coefficients of the pendulum as z has it, then with each of p a little larger.

    Shapes: nominal (8,) in the order of SCALED and ADDED, constants (3,), z (n,) -> (9, 10).
    """
    found, b = np.empty((len(nominal) + 1, 10)), np.empty(len(nominal))
    for k in range(len(found)):
        for i in range(len(b)):
            p = z[BODIES + i] + (SMALL if k == i + 1 else 0.0)
            b[i] = nominal[i] * math.exp(p) if i < FACTORS else nominal[i] + p
        row = coefficients(b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7],
                           constants[0], constants[1], constants[2])
        for i in range(len(row)):
            found[k, i] = row[i]
    return found


@kernel
def forget(prior, share, P):
    """Let bias and bodies become as uncertain as at first, by a share; prior (n - 6,)."""
    for i in range(len(prior)):
        P[BIAS + i, BIAS + i] += max(prior[i] - P[BIAS + i, BIAS + i], 0.0) * share


@kernel
def symmetrise(P):
    """Replace P by (P + Pᵀ) / 2."""
    for i in range(len(P)):
        for j in range(i):
            P[i, j] = P[j, i] = (P[i, j] + P[j, i]) / 2


@kernel
def predict(model, shifted, force_noise, acceleration_noise, u, steps, z, P):
    """
    Advance mean and covariance in place by some steps under a force.

    shifted are the coefficients at the mean, then with each of p a little larger, and model is one
    of the same steps; the noises are densities, squared. Shapes: shifted (n - 6, 10), z (n,),
    P (n, n).
    """
    n, x, h = len(z), z[:6], model.h
    model = of_coefficients(model, shifted[0])
    derivatives, mean, following = np.empty((6, 8)), np.empty(6), np.empty(6)
    F, FP = np.empty((6, n)), np.empty((6, n))   # the rows of x; the others stay as they are
    for _ in range(steps):
        force = u + z[6]
        linearise(model, expand(model, np.expand_dims(x, 0), np.array([force])), 0, derivatives)
        for k in range(len(shifted)):
            step(of_coefficients(model, shifted[k]), x, force, following)
            for i in range(6):
                if k == 0:
                    mean[i] = following[i]
                else:
                    F[i, 6 + k] = (following[i] - mean[i]) / SMALL
        for i in range(6):
            x[i] = mean[i]
            for k in range(7):      # A and B
                F[i, k] = derivatives[i, k]
        product(F, P, FP)
        for i in range(6):
            for k in range(6, n):
                P[i, k] = P[k, i] = FP[i, k]
        product(FP, F.T, P[:6, :6])
        for i in range(6):
            for k in range(6):
                P[i, k] += force_noise / h * F[i, 6] * F[k, 6]
        for i in range(3, 6):
            P[i, i] += acceleration_noise * h
    symmetrise(P)


@kernel
def correct(measured, R, z, P):
    """
    Correct mean and covariance in place, one measured number after the other.

    Returns the Mahalanobis distance of the innovation. Shapes: measured and R (6,), the
    variances of its noise; z (n,), P (n, n).
    """
    distance, n = 0.0, len(z)
    k, row = np.empty((2, n))
    for i in range(6):
        innovation, S = measured[i] - z[i], P[i, i] + R[i]
        distance += innovation * innovation / S
        for a in range(n):
            k[a], row[a] = P[a, i] / S, P[i, a]
            z[a] += innovation * k[a]
        # (I - k e_iᵀ) P (I - k e_iᵀ)ᵀ + k r kᵀ
        for a in range(n):
            for b in range(n):
                P[a, b] -= k[a] * row[b]
            column = R[i] * k[a] - P[a, i]
            for b in range(n):
                P[a, b] += column * k[b]
    symmetrise(P)
    return math.sqrt(distance)


class Estimator:
    """The filter and what it believes; deterministic."""

    def __init__(self, kind: Any, bodies: PendulumParameters,
                 parameters: EstimatorParameters) -> None:
        """Take the kind of model, of MODELS, the nominal bodies, and the noises."""
        self.kind, self.nominal, self.parameters = kind, bodies, parameters
        self.R = np.repeat((parameters.position_noise, parameters.velocity_noise), 3) ** 2
        self.deviations = np.repeat(
            (parameters.force_bias, parameters.body_error, parameters.friction_error),
            (1, len(SCALED), len(ADDED)))
        self.prior = self.deviations ** 2
        self.far = MOVED * self.deviations[BODIES - BIAS:]
        self.since, self.then = bodies, np.zeros(SIZE - BODIES)   # where the bodies were last
        bound = np.repeat((math.inf, math.log(LARGEST_FACTOR), math.inf),
                          (1, len(SCALED), len(ADDED)))
        self.lowest, self.highest = -bound, bound
        self.lowest[-len(ADDED):] = [-getattr(bodies, name) for name in ADDED]
        self.bodies_0 = np.array([getattr(bodies, name) for name in SCALED + ADDED])
        self.constants = np.array([getattr(bodies, name) for name in CONSTANT])
        self.reset()

    def reset(self) -> None:
        """Forget everything but the nominal bodies."""
        self.t, self.z, self.P = -math.inf, np.zeros(SIZE), np.zeros((SIZE, SIZE))
        self.refused = self.in_a_row = 0

    def update(self, t: float, x: Array, forces: list[Force]) -> Estimate:
        """
        Take the state measured at a time [s] after the last one, and say what is known of it.

        forces are those that acted in between. Shapes: x (6,), finite, angles on any one turn.
        """
        about = self.parameters
        if t - self.t > LONGEST_GAP:
            return self.begin(t, x)
        # a push is told from an outlier by what it does to all six numbers
        for push in (0.0, about.push):
            z, P = self.predicted(forces, push)
            known, variance = z.copy(), P.copy()
            distance = correct(x, self.R, known, variance)
            if distance <= about.gate:
                known[BIAS:] = np.clip(known[BIAS:], self.lowest, self.highest)
                self.in_a_row = 0
                return self.believe(t, known, variance, x - z[:6], distance)
        innovation = x - z[:6]
        self.refused, self.in_a_row = self.refused + 1, self.in_a_row + 1
        if self.in_a_row >= about.refusals or not np.all(np.isfinite(z)):
            return self.begin(t, x)._replace(innovation=innovation, distance=distance,
                                             accepted=False)
        return self.believe(t, z, P, innovation, distance)._replace(accepted=False)

    def moved(self, since: PendulumParameters) -> bool:
        """Tell whether the bodies are believed to be others now, by a share of their prior."""
        if since is not self.since:
            self.since, self.then = since, np.array(
                [*(math.log(getattr(since, name) / getattr(self.nominal, name))
                   for name in SCALED),
                 *(getattr(since, name) - getattr(self.nominal, name) for name in ADDED)])
        difference = np.abs(self.z[BODIES:] - self.then)
        return bool((difference > self.far).any())

    def begin(self, t: float, x: Array) -> Estimate:
        """Take a state as it is measured; bias and bodies stay, as uncertain as at first."""
        self.in_a_row = 0
        return self.believe(t, np.concatenate((x, self.z[BIAS:])),
                            np.diag(np.concatenate((self.R, self.prior))), np.zeros(6), 0.0)

    def believe(self, t: float, z: Array, P: Array, innovation: Array,
                distance: float) -> Estimate:
        """Keep a mean and a covariance, and report them."""
        self.t, self.z, self.P = t, z, P
        return Estimate(z[:6].copy(), np.sqrt(np.diag(P)[:6]), innovation, distance,
                        float(z[BIAS]), self.bodies(z), self.refused, accepted=True)

    def predicted(self, forces: list[Force], push: float) -> tuple[Array, Array]:
        """Return mean and covariance after some forces, and a push [N] of unknown size."""
        z, P, about = self.z.copy(), self.P.copy(), self.parameters
        passed = sum(force.duration for force in forces)
        forget(self.prior, min(passed / about.memory, 1.0), P)
        shifted = pendulums(self.bodies_0, self.constants, z)
        pendulum = Pendulum(*shifted[0].tolist())
        for u, duration in forces:
            steps = steps_in(duration, LONGEST_STEP)
            if steps < 1:
                continue
            predict(self.kind.of(pendulum, duration / steps), shifted,
                    HELD * (about.force_noise ** 2 + push ** 2),
                    HELD * about.acceleration_noise ** 2, u, steps, z, P)
        return z, P

    def bodies(self, z: Array) -> dict[str, float]:
        """Return masses, lengths and frictions, by their names."""
        p = z[BODIES:].tolist()
        nominal = vars(self.nominal)
        return {**{name: nominal[name] * math.exp(log) for name, log in zip(SCALED, p)},
                **{name: nominal[name] + more for name, more in zip(ADDED, p[len(SCALED):])}}

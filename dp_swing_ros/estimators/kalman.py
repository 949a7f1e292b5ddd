# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The extended Kalman filter: state, a force bias b and parameters p, estimated together.

    z = (x, b, p),   x⁺ = f(x, u + b; p),   b⁺ = b,   p⁺ = p,   measured: x + noise

where p are the logarithms of masses and lengths over their nominal values, and what the frictions
are above theirs. Positions are measured well and the forces are known, so a swing-up identifies
all of them. Source: Simon, Optimal State Estimation, 2006, 13.2 and 13.4; covariances by Joseph's
form.
"""

from dataclasses import dataclass
import math

import numpy as np

from dp_swing_ros.estimators.estimator import Estimate, Force
from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.derivatives import expand, identity, lanes, linearise
from dp_swing_ros.pendulum.equations import coefficients
from dp_swing_ros.pendulum.model import size, step, steps_in
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.problem import Problem

LONGEST_STEP = 0.01      # [s] of the model; at 50 ms its error would pass for one of p
LONGEST_GAP = 0.5        # [s] without a state; beyond it the pendulum is too chaotic to predict
HELD = 0.05              # [s] for which the noises of the prediction stay as they are
SMALL = 1e-4             # difference of p for derivatives
LARGEST_FACTOR = 2.0     # of a mass or length, either way
MOVED = 0.1              # of their deviation at first: parameters further off are a new problem


@dataclass(frozen=True)
class KalmanParameters(Parameters):
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
        60.0, 'bias and parameters become as uncertain as at first in this time', unit='s',
        minimum=1e-3, finite=False)
    gate: float = parameter(
        10.0, 'a state further from its prediction than this is refused', unit='deviations',
        minimum=0.0, finite=False)
    push: float = parameter(
        20.0, 'unless a push of this standard deviation explains it', unit='N', minimum=0.0)
    refusals: int = parameter(
        3, 'so many in a row, and the filter starts anew from the last', minimum=1)


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


@unrolled
def with_physical(model, b, constants):
    """
    Return the model of another pendulum.

    Shapes: b (3n + 2,), masses, lengths and frictions in order; constants (n + 1,), inertia
    factors and gravity.
    """
    n = len(model.pendulum.a)
    return model._replace(pendulum=coefficients(
        [b[i] for i in range(n + 1)], [b[n + 1 + i] for i in range(n)],
        [constants[i] for i in range(n)], constants[n],
        [b[2 * n + 1 + i] for i in range(n + 1)]))


@kernel
def physical_of(nominal, factors, z, first, b):
    """
    Write the physical parameters that z has, then with each of p a little larger.

    The first so many are nominal times exp(p), the others nominal + p; p begins in z at `first`.
    Shapes: nominal (m,), z (first + m,), b (m + 1, m).
    """
    for k in range(len(b)):
        for i in range(len(nominal)):
            p = z[first + i] + (SMALL if k == i + 1 else 0.0)
            b[k, i] = nominal[i] * math.exp(p) if i < factors else nominal[i] + p


@kernel
def forget(prior, share, P):
    """Let bias and parameters become as uncertain as at first, by a share; prior (m + 1,)."""
    first = len(P) - len(prior)
    for i in range(len(prior)):
        P[first + i, first + i] += max(prior[i] - P[first + i, first + i], 0.0) * share


@kernel
def symmetrise(P):
    """Replace P by (P + Pᵀ) / 2."""
    for i in range(len(P)):
        for j in range(i):
            P[i, j] = P[j, i] = (P[i, j] + P[j, i]) / 2


@kernel
def predict(model, constants, b, force_noise, acceleration_noise, u, steps, z, P):
    """
    Advance mean and covariance in place by some steps of the model under a force.

    b are the physical parameters at the mean, then with each of p a little larger; the noises are
    densities, squared. Shapes: b (m + 1, m), z (k,), P (k, k) with k = 2n + 3 + m.
    """
    n, k, h = size(model), len(z), model.h
    x, mean_model = z[:n], with_physical(model, b[0], constants)
    directions, derivatives = np.zeros((n + 1, lanes(model))), np.empty((n, lanes(model)))
    identity(directions)
    mean, following = np.empty(n), np.empty(n)
    F, FP = np.empty((n, k)), np.empty((n, k))   # the rows of x; the others stay as they are
    for _ in range(steps):
        force = u + z[n]
        linearise(mean_model, expand(mean_model, np.expand_dims(x, 0), np.array([force])), 0,
                  directions, derivatives)
        step(mean_model, x, force, mean)
        for j in range(1, len(b)):
            step(with_physical(model, b[j], constants), x, force, following)
            for i in range(n):
                F[i, n + j] = (following[i] - mean[i]) / SMALL
        for i in range(n):
            x[i] = mean[i]
            for j in range(n + 1):      # A and B
                F[i, j] = derivatives[i, j]
        product(F, P, FP)
        for i in range(n):
            for j in range(n, k):
                P[i, j] = P[j, i] = FP[i, j]
        product(FP, F.T, P[:n, :n])
        for i in range(n):
            for j in range(n):
                P[i, j] += force_noise / h * F[i, n] * F[j, n]
        for i in range(n // 2, n):
            P[i, i] += acceleration_noise * h
    symmetrise(P)


@kernel
def correct(measured, R, z, P):
    """
    Correct mean and covariance in place, one measured number after the other.

    Returns the Mahalanobis distance of the innovation. Shapes: measured and R (2n + 2,), the
    variances of its noise; z (k,), P (k, k).
    """
    distance, k = 0.0, len(z)
    gain, row = np.empty((2, k))
    for i in range(len(measured)):
        innovation, S = measured[i] - z[i], P[i, i] + R[i]
        distance += innovation * innovation / S
        for a in range(k):
            gain[a], row[a] = P[a, i] / S, P[i, a]
            z[a] += innovation * gain[a]
        # (I - k e_iᵀ) P (I - k e_iᵀ)ᵀ + k r kᵀ
        for a in range(k):
            for b in range(k):
                P[a, b] -= gain[a] * row[b]
            column = R[i] * gain[a] - P[a, i]
            for b in range(k):
                P[a, b] += column * gain[b]
    symmetrise(P)
    return math.sqrt(distance)


class ExtendedKalmanFilter:
    """The filter and what it believes."""

    Parameters = KalmanParameters

    def __init__(self, problem: Problem, parameters: KalmanParameters) -> None:
        """Take the nominal model, and the noises."""
        self.model, self.nominal, self.parameters = problem.model, problem.physical, parameters
        n = problem.physical.links
        self.size = len(problem.cost.S)             # of the state; z goes on with bias and p
        self.names, self.factors = parameter_names(n), 2 * n + 1   # of p; the masses and lengths
        self.R = np.repeat((parameters.position_noise, parameters.velocity_noise), n + 1) ** 2
        counts = 1, self.factors, n + 1             # bias, masses and lengths, frictions
        deviations = np.repeat(
            (parameters.force_bias, parameters.body_error, parameters.friction_error), counts)
        self.prior, self.far = deviations ** 2, MOVED * deviations[1:]
        self.highest = np.repeat((math.inf, math.log(LARGEST_FACTOR), math.inf), counts)
        self.lowest = -self.highest
        self.lowest[-(n + 1):] = [-friction for friction in self.nominal.frictions]
        self.nominal_b = np.array([getattr(self.nominal, name) for name in self.names])
        self.constants = np.array([*self.nominal.inertia_factors, self.nominal.gravity])
        self.compared, self.p_compared = self.nominal, self.p_of(self.nominal)
        self.reset()

    def reset(self) -> None:
        """Forget everything but the nominal parameters."""
        k = self.size + len(self.prior)
        self.t, self.z, self.P = -math.inf, np.zeros(k), np.zeros((k, k))
        self.refused = self.in_a_row = 0

    def update(self, t: float, x: Array, forces: list[Force]) -> Estimate:
        """Take a measured state; see Estimator.update."""
        about = self.parameters
        if t - self.t > LONGEST_GAP:
            return self.begin(t, x)
        # a push differs from an outlier by what it does to all numbers of the state
        for push in (0.0, about.push):
            z, P = self.predicted(forces, push)
            known, variance = z.copy(), P.copy()
            distance = correct(x, self.R, known, variance)
            if distance <= about.gate:
                known[self.size:] = np.clip(known[self.size:], self.lowest, self.highest)
                self.in_a_row = 0
                return self.believe(t, known, variance, x - z[:self.size], distance)
        innovation = x - z[:self.size]
        self.refused, self.in_a_row = self.refused + 1, self.in_a_row + 1
        if self.in_a_row >= about.refusals or not np.all(np.isfinite(z)):
            return self.begin(t, x)._replace(innovation=innovation, distance=distance,
                                             accepted=False)
        return self.believe(t, z, P, innovation, distance)._replace(accepted=False)

    def has_moved(self, physical: PendulumParameters) -> bool:
        """Return whether p is further from these parameters than a share of its prior."""
        if self.compared is not physical:    # which it is for many ticks on end
            self.compared, self.p_compared = physical, self.p_of(physical)
        difference = np.abs(self.z[self.size + 1:] - self.p_compared)
        return bool((difference > self.far).any())

    def p_of(self, physical: PendulumParameters) -> Array:
        """Return the p of physical parameters: logarithms of ratios, then differences."""
        values = np.array([getattr(physical, name) for name in self.names])
        with np.errstate(divide='ignore', invalid='ignore'):
            ratios = np.log(values[:self.factors] / self.nominal_b[:self.factors])
        return np.concatenate((ratios, (values - self.nominal_b)[self.factors:]))

    def begin(self, t: float, x: Array) -> Estimate:
        """Take a state as it is measured; bias and p stay, as uncertain as at first."""
        self.in_a_row = 0
        return self.believe(t, np.concatenate((x, self.z[self.size:])),
                            np.diag(np.concatenate((self.R, self.prior))), np.zeros(self.size),
                            0.0)

    def believe(self, t: float, z: Array, P: Array, innovation: Array,
                distance: float) -> Estimate:
        """Keep a mean and a covariance, and report them."""
        self.t, self.z, self.P = t, z, P
        p, b = z[self.size + 1:].tolist(), self.nominal_b.tolist()
        physical = {name: nominal * math.exp(each) if i < self.factors else nominal + each
                    for i, (name, nominal, each) in enumerate(zip(self.names, b, p))}
        return Estimate(z[:self.size].copy(), physical, float(z[self.size]), innovation,
                        distance, self.refused, accepted=True)

    def predicted(self, forces: list[Force], push: float) -> tuple[Array, Array]:
        """Return mean and covariance after some forces, and a push [N] of unknown size."""
        z, P, about = self.z.copy(), self.P.copy(), self.parameters
        passed = sum(force.duration for force in forces)
        forget(self.prior, min(passed / about.memory, 1.0), P)
        m = len(self.nominal_b)
        b = np.empty((m + 1, m))
        physical_of(self.nominal_b, self.factors, z, self.size + 1, b)
        for u, duration in forces:
            steps = steps_in(duration, LONGEST_STEP)
            if steps < 1:
                continue
            predict(self.model._replace(h=duration / steps), self.constants, b,
                    HELD * (about.force_noise ** 2 + push ** 2),
                    HELD * about.acceleration_noise ** 2, u, steps, z, P)
        return z, P


def parameter_names(links: int) -> list[str]:
    """Return the names of the estimated parameters: masses and lengths, then frictions."""
    count = range(1, links + 1)
    return ['cart_mass', *(f'link{i}_mass' for i in count), *(f'link{i}_length' for i in count),
            'cart_friction', *(f'joint{i}_friction' for i in count)]

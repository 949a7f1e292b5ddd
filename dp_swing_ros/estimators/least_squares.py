# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Recursive least squares: the free numbers p of structured dynamics, from one transition at a time.

    e = q̇⁺ - f(x, u; p),   H = ∂f/∂p,   S = H P Hᵀ + R,   K = P Hᵀ S⁻¹
    p ← p + K e,   P ← P - K S Kᵀ

f are the speeds after a transition, by the integrator from the measured state, as in the
regression over all of them at once; so it costs the same however much was seen. Source: Ljung,
System Identification, 1999, 11.
"""

import math

import numpy as np

from dp_swing_ros.dynamics.priors import Prior
from dp_swing_ros.dynamics.structured import Structured
from dp_swing_ros.estimators.gaussian import constrain, forget
from dp_swing_ros.kernels import kernel
from dp_swing_ros.pendulum.drive import follow_commands
from dp_swing_ros.pendulum.model import Model, size
from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import Array

DIFFERENCE = 1e-4   # of a free number for derivatives, in its deviations before any experience
GATE = 5.0          # deviations of a speed from its prediction: beyond, something pushed
NEWEST = 0.1        # share of the newest transition in what is learned of the noise


@kernel
def add(dynamics, i, change):
    """Add to the free number i of structured dynamics, in place."""
    count = len(dynamics.potential)
    of_potential = i - dynamics.inertia.size + 1
    of_friction = of_potential - count
    of_dry = of_friction - len(dynamics.friction)
    if of_potential < 1:
        dynamics.inertia[i // count, i % count] += change
    elif of_friction < 0:
        dynamics.potential[of_potential] += change
    elif of_dry < 0:
        dynamics.friction[of_friction] += change
    else:
        dynamics.dry[of_dry] += change


@kernel
def sensitivities(model, drive, ends, commands, x, duration, differences, H):
    """
    Return the state after a time [s], and write into H by how much its speeds go with p.

    Shapes: differences (P,), H (n + 1, P), the others as of follow_commands.
    """
    n = size(model)
    half, after, moved = n // 2, x.copy(), np.empty(n)
    follow_commands(model, drive, ends, commands, after, duration)
    for i in range(len(differences)):
        for k in range(n):
            moved[k] = x[k]
        add(model.pendulum, i, differences[i])
        follow_commands(model, drive, ends, commands, moved, duration)
        add(model.pendulum, i, -differences[i])
        for k in range(half):
            H[k, i] = (moved[half + k] - after[half + k]) / differences[i]
    return after


@kernel
def learn(e, H, R, gate, p, P):
    """
    Correct p and P in place by residuals, one after the other, unless one is beyond the gate.

    Return whether none is.

    Shapes: e and R (n + 1,), the variances; H (n + 1, P), p (P,), P (P, P).
    """
    m, left = len(p), e.copy()
    row, gain = np.empty(m), np.empty(m)
    for j in range(len(e)):
        S = R[j]
        for a in range(m):
            for b in range(m):
                S += H[j, a] * P[a, b] * H[j, b]
        if not e[j] ** 2 <= gate ** 2 * S:
            return False
    for j in range(len(e)):
        S = R[j]
        for a in range(m):
            row[a] = 0.0
            for b in range(m):
                row[a] += P[a, b] * H[j, b]
            S += H[j, a] * row[a]
        for a in range(m):
            gain[a] = row[a] / S
            p[a] += gain[a] * left[j]
        for a in range(m):
            for b in range(m):
                P[a, b] -= gain[a] * row[b]
        for k in range(j + 1, len(e)):   # what this change leaves of the others
            for a in range(m):
                left[k] -= H[k, a] * gain[a] * left[j]
    return True


class RecursiveLeastSquares:
    """The dynamics so far, how uncertain they are, and how large residuals are."""

    def __init__(self, model: Model, prior: Prior, noise: Array, floor: Array,
                 memory: float) -> None:
        """
        Take a model of structured dynamics, whose step is the longest; their prior; noises.

        What is learned becomes as uncertain as at first in the time `memory` [s].
        Shapes: noise and floor (n + 1,) [m/s, rad/s], deviations of speeds at first, and at least.
        """
        self.model, self.prior, self.memory = model, prior, memory
        self.noise, self.floor = noise, floor
        self.differences, self.variances = DIFFERENCE * prior.deviations, prior.deviations ** 2
        self.highest = np.full(len(prior.mean), math.inf)
        self.reset()

    def reset(self) -> None:
        """Forget all but the prior."""
        self.p, self.P = self.prior.mean.copy(), np.diag(self.variances)
        self.R = self.noise ** 2

    @property
    def dynamics(self) -> Structured:
        """Return the dynamics as they are known so far."""
        found: Structured = self.model.pendulum.with_free(self.p)
        return found

    def update(self, drive: Drive, ends: Array, commands: Array, x: Array, after: Array,
               duration: float) -> tuple[Array, bool]:
        """
        Learn from a transition; return by how much speeds were off before (n + 1,), and if it did.

        Nothing is learned of what is wild or was pushed. Shapes: x and after (2n + 2,) on one
        turn, ends [s] and commands [N] as of follow_commands.
        """
        half = len(x) // 2
        H = np.empty((half, len(self.p)))
        predicted = sensitivities(self.model._replace(pendulum=self.dynamics), drive, ends,
                                  commands, x, duration, self.differences, H)
        e: Array = (after - predicted)[half:]
        if not (np.all(np.isfinite(e)) and np.all(np.isfinite(H))):
            return e, False
        # where all is refused, because what moves is another, it becomes uncertain too
        forget(self.variances, min(duration / self.memory, 1.0), self.P)
        if not learn(e, H, self.R, GATE, self.p, self.P):
            return e, False
        constrain(self.prior.lowest, self.highest, self.p, self.P)
        self.R = np.maximum(self.R + NEWEST * (e ** 2 - self.R), self.floor ** 2)
        return e, True

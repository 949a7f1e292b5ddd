# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The parameters p with which the model comes closest to recorded motion, by multiple shooting.

    min over p and x_s of  Σ_s Σ_k ρ(W (q(t_k; x_s, p) - q_k))

Each segment s begins with a state x_s of its own, which is eliminated: for each p it is found
first, and the Jacobian of p is what remains beside that of x_s (variable projection: Golub and
Pereyra, Inverse Problems 19(2), 2003). ρ is soft_l1, so that what is no noise counts little; W
makes the residuals white. Source of multiple shooting: Bock, "Recent advances in parameter
identification techniques for O.D.E.", 1983.
"""

from collections.abc import Callable, Sequence
import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from dp_swing_ros.errors import UserError
from dp_swing_ros.identification.segments import Segments
from dp_swing_ros.identification.shooting import shoot, SMALL
from dp_swing_ros.identification.unknowns import Parametrisation
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import POSITIONS, Units

ROUGHLY = 2e-3        # [m, rad] scaled, standard deviation of a residual, at first
OUTLIER = 3.0         # [standard deviations] from which on a residual counts less
STEPS = 20            # to the states that segments begin with, at most
CLOSE = 1e-5          # to the least loss, at which they are found
DAMPING = 1e-6        # of those steps at first
ODD = 10.0            # a segment whose residuals are so many times the usual is left out
FAR = 1e3             # [m, rad] where a prediction is that has no end
UNTOLD = 1e-12        # of the largest singular value: a direction that nothing tells
WHITE = 0.2           # logarithm of a variance that is one, nearly
INSIDE = 0.1          # of a scale from a bound a parameter begins
QUANTILE = 0.975      # at the upper end of 95 %
FLOOR = 1e-6          # [m, rad] standard deviation of a residual at least: no encoder is finer


class Precision(NamedTuple):
    """How sharp the dry friction of the model is, and how finely it is integrated for that."""

    creep: float  # [m/s, rad/s] scaled
    step: float   # [s] scaled


ROUGH, FINE = Precision(2e-2, 1e-2), Precision(2e-3, 1e-3)
CREEPS = FINE.creep, 6e-3, ROUGH.creep   # of dry friction, of which nobody knows how it begins


class Part(NamedTuple):
    """
    One motion at p: what of its S segments is predicted, and how that changes.

    Shapes: residuals (S, r), with r = K (n + 1); of_states (S, r, 2n + 2), of_parameters
    (S, r, free) their Jacobians; weights (S, r), what the loss makes of squares, whose third power
    is how it is curved.
    """

    residuals: Array
    of_states: Array
    of_parameters: Array
    weights: Array

    def projected(self) -> Array:
        """Return of_parameters where the states follow the parameters (S, r, free)."""
        weighted = np.swapaxes(self.of_states * self.weights[..., None] ** 3, 1, 2)
        follow = solved(weighted @ self.of_states, weighted @ self.of_parameters)
        projected: Array = self.of_parameters - self.of_states @ follow
        return projected

    def normal_equations(self, scales: Array) -> tuple[Array, Array]:
        """Return H (S, free, free) and g (S, free) of each segment, of parameters in scales."""
        J = self.projected() * scales
        J_T, weights = np.swapaxes(J, 1, 2), self.weights[..., None]
        return J_T @ (weights ** 3 * J), (J_T @ (weights * self.residuals[..., None]))[..., 0]


class Fit:
    """Parameters and states; the states are remembered from one p to the next."""

    def __init__(self, motions: Sequence[Segments], parametrisation: Parametrisation,
                 on_step: Callable[[], object] = lambda: None) -> None:
        """Take the segments of each motion, what there is to find, and what to call at a step."""
        self.motions, self.about, self.on_step = list(motions), parametrisation, on_step
        self.use(ROUGH)
        self.states = [motion.X_0.copy() for motion in self.motions]
        self.p = parametrisation.first.copy()
        self.whitening = roughly(parametrisation.scale, parametrisation.links)
        self.free: Array = np.array([], dtype=int)
        self.untold: Array = np.array([], dtype=int)   # neither known nor told: held

    def use(self, precision: Precision) -> None:
        """Predict with this precision from now on."""
        links, scale = self.about.links, self.about.scale
        self.model = Model(
            Pendulum.of(PendulumParameters(links=links), precision.creep, scale),
            INTEGRATORS['rk4'], scale.sized(precision.step, 's'))

    def positions(self, motion: Segments, X_0: Array, P: Array, columns: int) -> Array:
        """Return what segments are predicted to do (S, columns, K, n + 1); see shoot."""
        out = np.empty((len(X_0), columns, *motion.Q.shape[1:]))
        shoot(self.model, motion, X_0, np.hstack((
            self.about.values(P), np.tile(self.about.centres, (len(P), 1)))), out)
        return np.nan_to_num(out, nan=FAR, posinf=FAR, neginf=-FAR)

    def white(self, positions: Array) -> Array:
        """Return positions (..., K, n + 1), or differences of them, in deviations (..., r)."""
        return (positions @ self.whitening).reshape(*positions.shape[:-2], -1)

    def fit_states(self, i: int) -> None:
        """Find the states with which the segments of motion i begin, by Levenberg-Marquardt."""
        motion, X = self.motions[i], self.states[i]
        size, damping = X.shape[1], np.full(len(X), DAMPING)
        shot, measured = self.along_states(motion, X), self.white(motion.Q)
        active = np.arange(len(X))
        for _ in range(STEPS):
            r = shot[active, 0] - measured[active]
            A = np.swapaxes(shot[active, 1:] - shot[active, :1], 1, 2) / SMALL
            weighted = np.swapaxes(A * weights(r)[..., None], 1, 2)
            H, g = weighted @ A, (weighted @ r[..., None])[..., 0]
            H[:, range(size), range(size)] *= 1 + damping[active, None]
            step = solved(H, g[..., None])[..., 0]
            going = np.sum(step * g, axis=1) > CLOSE
            if not going.any():
                break
            active, r, step = active[going], r[going], step[going]
            tried = self.along_states(motion.chosen(active), X[active] - step)
            better = losses(tried[:, 0] - measured[active]) < losses(r)
            X[active[better]] -= step[better]
            shot[active[better]] = tried[better]
            damping[active] *= np.where(better, 0.1, 10.0)

    def along_states(self, motion: Segments, X_0: Array) -> Array:
        """Return predictions from states and from a difference beside them (S, 2n + 3, r)."""
        return self.white(self.positions(motion, X_0, self.p[None], 1 + X_0.shape[1]))

    def part(self, i: int, which: Array) -> Part:
        """Return motion i at p, with what changes by some of the parameters (free,)."""
        differences = self.about.differences[which]
        P = np.tile(self.p, (1 + len(which), 1))
        P[np.arange(1, len(P)), which] += differences
        size = self.states[i].shape[1]
        shot = self.white(self.positions(self.motions[i], self.states[i], P, size + len(P)))
        residuals = shot[:, 0] - self.white(self.motions[i].Q)
        apart = np.swapaxes(shot[:, 1:] - shot[:, :1], 1, 2)
        return Part(residuals, apart[..., :size] / SMALL, apart[..., size:] / differences,
                    weights(residuals))

    def parts(self, which: Array) -> list[Part]:
        """Return all motions at p; see part."""
        return [self.part(i, which) for i in range(len(self.motions))]

    def differences(self) -> list[Array]:
        """Return by what the predictions differ from what was measured, (S, K, n + 1) each."""
        return [self.positions(motion, states, self.p[None], 1)[:, 0] - motion.Q
                for motion, states in zip(self.motions, self.states)]

    def take(self, p: Array) -> None:
        """Take the free parameters, and find the states that go with them."""
        self.on_step()
        self.p[self.free] = p
        for i in range(len(self.motions)):
            self.fit_states(i)

    def restart(self) -> None:
        """Begin with the states that positions alone give: others may lie far off."""
        self.states = [motion.X_0.copy() for motion in self.motions]
        self.take(self.p[self.free])

    def solve(self) -> None:
        """Find the free parameters, from the present ones."""
        def residuals(p: Array) -> Array:
            self.take(p)
            return np.concatenate([self.white(each).ravel() for each in self.differences()])

        def jacobian(p: Array) -> Array:
            if not np.array_equal(p, self.p[free]):   # else the states are those of p
                self.take(p)
            return np.concatenate([
                part.projected().reshape(-1, len(p)) for part in self.parts(free)])

        free, scales = self.free, self.about.scales[self.free]
        lowest, highest = self.about.lowest[free], self.about.highest[free]
        # from a bound on, the method takes only small steps
        begin = np.clip(self.p[free], lowest + INSIDE * scales, highest - INSIDE * scales)
        found = least_squares(
            residuals, begin, jacobian, bounds=(lowest, highest), x_scale=scales,
            loss='soft_l1', f_scale=OUTLIER, xtol=1e-5, ftol=1e-7)
        self.take(found.x)

    def normal_equations(self) -> tuple[Array, Array]:
        """Return H (free, free) and g (free,) of the free parameters, in their scales."""
        scales = self.about.scales[self.free]
        H, g = zip(*(part.normal_equations(scales) for part in self.parts(self.free)))
        return np.concatenate(H).sum(axis=0), np.concatenate(g).sum(axis=0)

    def choose_creep(self) -> float:
        """Return which of CREEPS explains the motions best, a step on; go on with that."""
        def loss(creep: float) -> float:
            self.use(Precision(creep, FINE.step))
            self.take(self.p[self.free])
            H, g = self.normal_equations()
            now = sum(losses(self.white(each)).sum() for each in self.differences())
            return float(OUTLIER ** 2 * now - g @ step_of(H, g) / 2)

        best = min(CREEPS, key=loss)
        self.use(Precision(best, FINE.step))
        return best

    def whiten(self) -> bool:
        """
        Let residuals count by what they are: independent, of a standard deviation of one.

        Returns whether they were that, nearly.
        """
        r = np.concatenate([each.reshape(-1, each.shape[-1]) for each in self.differences()])
        unknown = sum(states.size for states in self.states) + len(self.free)
        r *= math.sqrt(r.size / max(r.size - unknown, 1))
        w = 1 / (1 + np.mean((r @ self.whitening) ** 2, axis=1) / OUTLIER ** 2)
        S = (r * w[:, None]).T @ r / w.sum() + FLOOR ** 2 * np.eye(r.shape[1])
        variances = np.linalg.eigvalsh(self.whitening.T @ S @ self.whitening)
        self.whitening = np.linalg.inv(np.linalg.cholesky(S)).T
        return bool(np.all(np.abs(np.log(variances)) < WHITE))

    def leave_out_odd(self) -> bool:
        """
        Leave out segments that nothing explains: a push by hand, a reset, an obstacle.

        Returns whether there are any. Raises UserError where that is all of a motion.
        """
        rms = [np.sqrt(np.mean(self.white(each) ** 2, axis=1)) for each in self.differences()]
        usual = np.median(np.concatenate(rms))
        kept = [each < ODD * usual for each in rms]
        for number, which in enumerate(kept, 1):
            if not np.any(which):
                raise UserError(f'motion {number} of {len(kept)} fits no parameters that explain '
                                'the others; expected motions of one rig, by one clock')
        self.motions = [motion.chosen(which) for motion, which in zip(self.motions, kept)]
        self.states = [states[which] for states, which in zip(self.states, kept)]
        return not all(map(np.all, kept))

    @property
    def searched(self) -> Array:
        """Return which parameters are not known: the free ones, then those untold."""
        return np.concatenate((self.free, self.untold))

    @property
    def segments(self) -> int:
        """Return how many segments there are."""
        return sum(map(len, self.states))

    def covariance(self) -> Array:
        """
        Return the covariance of what is searched (k, k), by the jackknife over S segments.

        What the model lacks shows in many samples on end, so what counts is by how much a segment
        moves all that is found: (S - 1)/S Σ_s d_s d_sᵀ with d_s = H⁻¹ g - (H - H_s)⁻¹ (g - g_s),
        between the steps that are left to do with and without it. Source: the CV3 of MacKinnon,
        Nielsen and Webb, "Cluster-robust inference: A guide to empirical practice", Journal of
        Econometrics 232(2), 2023. Of one segment it is H⁻¹. What is untold is off by its scale,
        and the free parameters make up for that.
        """
        scales, free = self.about.scales[self.searched], np.s_[:len(self.free)]
        if not len(self.free):   # then all are off by their scales
            return np.diag(scales ** 2)
        H, g = map(np.concatenate, zip(*(
            part.normal_equations(scales) for part in self.parts(self.searched))))
        whole, gradient, S = H.sum(axis=0), g.sum(axis=0)[free], len(H)
        of_whole, found = inverse(whole[free, free]), np.zeros_like(whole)
        if S == 1:
            found[free, free] = of_whole
        else:
            without = inverse((whole - H)[:, free, free]) @ (gradient - g[:, free])[..., None]
            d = of_whole @ gradient - without[..., 0]
            found[free, free] = (S - 1) / S * d.T @ d
        follow = np.eye(len(scales))[:, len(self.free):]
        follow[free] = -of_whole @ whole[free, len(self.free):]
        found += follow @ follow.T
        scaled: Array = np.outer(scales, scales) * found
        return scaled

    def halves(self, covariance: Array, J: Array | None = None) -> Array:
        """Return half the intervals of 95 % of what is searched, or J (m, k) times that (m,)."""
        J = np.eye(len(self.searched)) if J is None else J
        found: Array = stdtrit(self.segments - 1 or np.inf, QUANTILE) * np.sqrt(
            np.einsum('ki,ij,kj->k', J, covariance, J))
        return found


def roughly(scale: Units, links: int) -> Array:
    """Return the whitening (n + 1, n + 1) of residuals of which nothing is known yet."""
    return np.eye(links + 1) / scale.each_joint(ROUGHLY, POSITIONS, links)


def weights(r: Array) -> Array:
    """Return what soft_l1 makes of the squares of residuals."""
    return 1 / np.sqrt(1 + (r / OUTLIER) ** 2)


def losses(r: Array) -> Array:
    """Return the loss of each segment; shapes: (S, r) -> (S,), infinite for what is not finite."""
    with np.errstate(over='ignore', invalid='ignore'):
        loss = (np.sqrt(1 + (r / OUTLIER) ** 2) - 1).sum(axis=1)
    found: Array = np.where(np.isfinite(loss), loss, np.inf)
    return found


def step_of(H: Array, g: Array) -> Array:
    """Return H⁻¹ g, where H may be singular; (k, k), (k,)."""
    return solved(H[None], g[None, :, None])[0, :, 0] if len(g) else g


def inverse(H: Array) -> Array:
    """Return H⁻¹ (..., k, k), large along directions that nothing tells."""
    told, directions = np.linalg.eigh(H)
    told = np.maximum(told, UNTOLD * told[..., -1:])
    found: Array = directions / told[..., None, :] @ np.swapaxes(directions, -1, -2)
    return found


def solved(H: Array, b: Array) -> Array:
    """Return H⁻¹ b for each of many, where H may be singular; (S, k, k), (S, k, m)."""
    scale = np.einsum('skk->sk', H).max(axis=1)[:, None, None]
    x: Array = np.linalg.solve(H + 1e-12 * scale * np.eye(H.shape[-1]), b)
    return x

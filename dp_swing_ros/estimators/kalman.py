# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The extended Kalman filter: the state and what is unknown of pendulum and drive, together.

    z = (x, p),   x⁺ = φ(x, p),   p⁺ = p,   measured: x + noise, or a part of it

Positions are measured well and the commands are known, so a swing-up identifies p (unknowns.py).
How large the noises are is not known either: they are scaled until the innovations are as large as
the filter expects. Source: Simon, Optimal State Estimation, 2006, 13.2; Mehra, "On the
identification of variances and adaptive Kalman filtering", IEEE TAC 15(2), 1970.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.estimators.estimator import Commands, Estimate
from dp_swing_ros.estimators.gaussian import constrain, correct, forget, predict
from dp_swing_ros.estimators.unknowns import Unknowns, UnknownsParameters
from dp_swing_ros.parameters import parameter
from dp_swing_ros.pendulum.drive import HISTORY
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import Drive, PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import ACCELERATIONS, POSITIONS, scaled_speeds, SPEEDS, STATES
from dp_swing_ros.problem.problem import Problem

LONGEST_STEP = 0.01      # [s] scaled, of the model; at 50 ms its error would pass for one of p
CREEP = 0.02             # [m/s, rad/s] scaled, in such steps
LONGEST_GAP = 0.5        # [s] scaled, without a state; beyond, chaos leaves no prediction
HELD = 0.05              # [s] scaled, for which the noises of the prediction stay as they are
UNMEASURED = 3.0         # [m/s, rad/s] scaled, deviation at first of a speed that is not measured
MOVED = 0.1              # of their deviation at first: parameters further off are a new problem
SCALES = (0.1, 5.0)      # of a noise's standard deviation, smallest and largest
SMALL = 1e-4             # difference of x, p and time for derivatives, in own units
EXACT = 1e-6             # [m, rad] scaled, of a change of a position that is no step
NEARLY = 0.9             # of HELD, after which another measurement is remembered
SAME_STEP, OFTEN = 1e-4, 5   # of a step, within which another is the same; then it is one
JUDGED = 1.0             # [s] scaled, over which it is seen whether the model explains the motion
LARGE, COLOURED = 2.0, 0.5   # times the variance expected; of that, what goes on from one to next
REMEMBERED, ENOUGH = 64, 20   # measurements, HELD apart, that are taken anew then: most, least
BETTER = 0.4             # of the squared errors without springs, below which there are some
REFUSALS = 3             # so many in a row, and the filter starts anew from the last


@dataclass(frozen=True)
class KalmanParameters(UnknownsParameters):
    """What the filter takes to be uncertain, and by how much."""

    position_noise: float = parameter(
        2e-3, 'standard deviation of measured positions; from a tenth to five times of it is '
        'learned, but no less than half a step of an encoder that is not finer. A number of cart '
        'and joints alike is that of the joints, and the cart has the same in own units',
        unit='m, rad', minimum=1e-6)
    velocity_noise: float = parameter(
        0.3, 'standard deviation of measured velocities; likewise', unit='m/s, rad/s',
        minimum=1e-6, scaled=True)
    force_noise: float = parameter(
        2.0, 'standard deviation of the force in a period; goes with that of the positions',
        unit='N', minimum=0.0, scaled=True)
    acceleration_noise: float = parameter(
        0.5, 'standard deviation of what else accelerates cart and links; goes with it, too',
        unit='m/s^2, rad/s^2', minimum=0.0, scaled=True)
    adaptation: float = parameter(
        0.1, 'share of the newest innovation in what is learned of the noises; 0: they are as '
        'given', minimum=0.0, maximum=1.0)
    memory: float = parameter(
        60.0, 'what is estimated beside the state becomes as uncertain as at first in this time',
        unit='s', minimum=1e-3, finite=False, scaled=True)
    push_gate: float = parameter(
        3.0, 'a state further from its prediction than this is explained by a push',
        unit='deviations', minimum=0.0, finite=False)
    push: float = parameter(
        20.0, 'standard deviation of the force of such a push', unit='N', minimum=0.0, scaled=True)
    gate: float = parameter(
        10.0, 'a state that with such a push is further than this from its prediction is refused',
        unit='deviations', minimum=0.0, finite=False)


NOTHING = np.empty(0), np.empty(0)


class Taken(NamedTuple):
    """A measurement, and what was sent since the one before."""

    t: float                     # [s]
    x: Array                     # (2n + 2,)
    sent: tuple[Array, Array]    # see Commands.since
    time_noise: float            # [s]


class ExtendedKalmanFilter:
    """The filter and what it believes."""

    Parameters = KalmanParameters

    def __init__(self, problem: Problem, drive: Drive, parameters: KalmanParameters) -> None:
        """Take the nominal model and drive, and the noises."""
        if problem.learned is not None:   # where experience has told all but the drive
            parameters = replace(parameters, body_error=0.0, inertia_error=0.0, friction_error=0.0,
                                 cart_dry_friction_error=0.0, joint_dry_friction_error=0.0,
                                 balance_error=0.0, stiffness_error=0.0, preload_error=0.0)
        self.nominal, self.parameters = problem.physical, parameters
        scale = problem.scale
        self.model = problem.model._replace(h=scale.sized(LONGEST_STEP, 's'))
        if problem.learned is None:
            self.model = self.model._replace(
                pendulum=Pendulum.of(self.nominal, CREEP, scale))
        self.longest_gap, self.held, self.judged = (
            scale.sized(each, 's') for each in (LONGEST_GAP, HELD, JUDGED))
        self.unknowns = Unknowns(self.nominal, drive, parameters, scale)
        self.of_pendulum = [name for name in self.unknowns.names if hasattr(self.nominal, name)]
        self.balances = [name for name in self.unknowns.names if name.endswith('_balance')]
        self.size = len(problem.cost.S)             # of the state; z goes on with p
        half = self.size // 2
        self.R = np.concatenate([scale.each_joint(noise, unit, half - 1) for noise, unit in (
            (parameters.position_noise, POSITIONS), (parameters.velocity_noise, SPEEDS))]) ** 2
        self.unmeasured = np.array(
            [*[0.0] * half, *scaled_speeds(UNMEASURED, scale, half - 1)]) ** 2
        self.disturbed = self.held * np.array(scale.each_joint(
            parameters.acceleration_noise, ACCELERATIONS, half - 1)) ** 2
        self.exact = EXACT * np.array(scale.factors(POSITIONS, half))
        self.differences = SMALL * np.array(
            [*scale.factors(STATES, self.size), *self.unknowns.sizes, scale.time])
        self.compared, self.p_compared = self.nominal, self.unknowns.of(self.nominal)
        self.reset()

    def reset(self) -> None:
        """Forget everything but the nominal parameters."""
        # springs only once something is missing: with what is not there the rest is told less well
        self.with_springs = not self.unknowns.deviations[self.unknowns.of_springs].any()
        k = self.size + len(self.prior)
        self.t, self.z, self.P = -math.inf, np.zeros(k), np.zeros((k, k))
        self.refused = self.in_a_row = 0
        self.remembered = deque[Taken](maxlen=REMEMBERED)
        self.looks_at, self.patience = -math.inf, REMEMBERED * self.held   # [s] for springs
        self.take_noises_as_given()
        self.seen = np.full(self.size, math.nan)   # the last measurement
        # the smallest changes of positions, and how often they were just those
        self.steps, self.times = np.full(self.size // 2, math.inf), np.zeros(self.size // 2)

    def take_noises_as_given(self) -> None:
        """Forget how large innovations were."""
        self.scales = np.ones(2)   # of the variances of positions and velocities, learned
        self.power = self.colour = 0.0   # of innovations in deviations: squares, and with the last
        self.last_whitened = np.zeros(self.size // 2)

    def continue_from(self, before: 'ExtendedKalmanFilter') -> None:
        """Believe what another one did; see Estimator.continue_from."""
        self.t, self.z, self.P, self.scales = before.t, before.z, before.P, before.scales
        self.with_springs, self.remembered = before.with_springs, before.remembered
        self.looks_at, self.patience = before.looks_at, before.patience
        self.refused, self.in_a_row = before.refused, before.in_a_row
        self.seen, self.steps, self.times = before.seen, before.steps, before.times
        self.power, self.colour, self.last_whitened = (
            before.power, before.colour, before.last_whitened)

    def update(self, t: float, x: Array, commands: Commands,
               time_noise: float = 0.0) -> Estimate:
        """Take a measured state; see Estimator.update."""
        self.note_steps(x)
        if t - self.t > self.longest_gap:
            self.remembered = deque([Taken(t, x, NOTHING, 0.0)], maxlen=REMEMBERED)
            return self.begin(t, x)

        def taken(since: float) -> Taken:
            return Taken(t, x, commands.since(since, HISTORY), time_noise)

        measured = taken(self.t)
        # not one that comes soon after another that is kept
        if not self.with_springs and t - self.remembered[-1].t > self.held * NEARLY:
            last = self.remembered[-1].t
            self.remembered.append(measured if last == self.t else taken(last))
        estimate = self.take(measured)
        if (estimate.accepted and self.lacks_something and t >= self.looks_at
                and len(self.remembered) >= ENOUGH):
            last = self.remembered[-1].t
            newest = [taken(last)] if last < t else []
            return self.look_for_springs([*self.remembered, *newest], estimate)
        return estimate

    def take(self, measured: Taken) -> Estimate:
        """Take a state that was measured soon after the last."""
        about, (t, x, sent, time_noise) = self.parameters, measured
        # one that is not told would pass for a delay or a gain; it differs from an outlier by what
        # it does to all numbers of the state
        for push, gate in ((0.0, about.push_gate), (about.push, about.gate)):
            z, P, rate = self.predicted(t, sent, push)
            innovation, known, variance = x - z[:self.size], z.copy(), P.copy()
            whitened = self.corrected(x, rate, time_noise, known, variance)
            if push == 0:
                scales = self.scales
                if np.all(np.isfinite(whitened)):
                    scales = self.adapted(x, whitened)
                    self.judge(t, whitened)
            distance = float(np.linalg.norm(whitened))
            if distance <= gate:
                self.scales = scales
                constrain(self.unknowns.lowest, self.unknowns.highest, known, variance)
                self.in_a_row = 0
                return self.set_posterior(t, known, variance, innovation, distance)
        self.refused, self.in_a_row = self.refused + 1, self.in_a_row + 1
        if self.in_a_row >= REFUSALS or not np.all(np.isfinite(z)):
            return self.begin(t, x)._replace(innovation=innovation, distance=distance,
                                             accepted=False)
        return self.set_posterior(t, z, P, innovation, distance)._replace(accepted=False)

    def look_for_springs(self, measurements: Sequence[Taken], estimate: Estimate) -> Estimate:
        """
        Take measurements anew, without springs and with; go on with what predicts better.

        What a model without has made of it is forgotten. If it is something else that is missing,
        all stays as it is estimated, and it takes ever longer until it is looked for again.
        """
        before = vars(self).copy()
        without, _ = self.taken_anew(measurements, with_springs=False)
        errors, found = self.taken_anew(measurements, with_springs=True)
        if errors < BETTER * without:
            self.refused = before['refused']
            return found
        vars(self).update(before)
        self.looks_at, self.patience = self.t + self.patience, 2 * self.patience
        return estimate

    def taken_anew(self, measurements: Sequence[Taken],
                   with_springs: bool) -> tuple[float, Estimate]:
        """Begin with these; return the squared errors of the later half, and the last estimate."""
        (first, *later), half, squares = measurements, self.size // 2, list[float]()
        self.with_springs, self.z = with_springs, np.zeros(self.size + len(self.prior))
        found = self.begin(first.t, first.x)
        for measured in later:
            found = self.take(measured)
            squares.append(float(np.sum(found.innovation[:half] ** 2 / self.R[:half])))
        return sum(squares[len(squares) // 2:]), found

    def corrected(self, x: Array, rate: Array, time_noise: float, z: Array, P: Array) -> Array:
        """Correct in place; return the innovations in standard deviations (2n + 2,)."""
        found: Array = correct(x, self.R * np.repeat(self.scales, self.size // 2), rate,
                               time_noise ** 2, z, P)
        return found

    def judge(self, t: float, whitened: Array) -> None:
        """Take by how much positions are not as predicted, and how much of that goes on."""
        now, half = whitened[:self.size // 2], self.size // 2
        share = 1 - math.exp((self.t - t) / self.judged)
        self.power += share * (float(now @ now) / half - self.power)
        self.colour += share * (float(now @ self.last_whitened) / half - self.colour)
        self.last_whitened = now

    @property
    def prior(self) -> Array:
        """Return the variances of the unknowns at first (m,)."""
        found: Array = self.unknowns.deviations ** 2
        return found if self.with_springs else np.where(self.unknowns.of_springs, 0.0, found)

    @property
    def lacks_something(self) -> bool:
        """Return whether innovations go on from one to the next, by as much as noise may be."""
        return bool(not self.with_springs and self.colour > COLOURED * max(self.power, 1.0))

    @property
    def is_explained(self) -> bool:
        """
        Return whether states are as predicted, within the largest noise.

        Innovations of a model that is right are white, however large its noises; those of one
        that is wrong in kind go on from one to the next. Source: Mehra, as above.
        """
        return bool(self.scales[0] < SCALES[1] ** 2 or self.power < LARGE
                    or self.colour < COLOURED * self.power)

    def note_steps(self, x: Array) -> None:
        """Take by how little positions change; those of encoders do by just a step, often."""
        changes = np.abs(x - self.seen)[:self.size // 2]
        changes[~(changes > self.exact)] = math.inf
        smaller = changes < self.steps * (1 - SAME_STEP)
        again = changes <= self.steps * (1 + SAME_STEP)
        self.times = np.where(smaller, 1.0, self.times + (again & np.isfinite(changes)))
        self.steps = np.where(smaller, changes, self.steps)
        self.seen = x

    def adapted(self, x: Array, whitened: Array) -> Array:
        """
        Return the scales with which innovations would be more as large as expected.

        An encoder that stands still shows no noise, but is off by up to half a step all the same.
        """
        half, scales = self.size // 2, []
        shares = ((self.steps / 2) ** 2 / self.R[:half])[self.times >= OFTEN].tolist()
        lowest = max(SCALES[0] ** 2, min(max(shares, default=0.0), 1.0))
        for part, scale, off, least in zip((x[:half], x[half:]), self.scales.tolist(), (
                whitened[:half], whitened[half:]), (lowest, SCALES[0] ** 2)):
            measured = half - np.count_nonzero(np.isnan(part))
            ratio = float(off @ off) / measured if measured else 1.0
            scale *= 1 + self.parameters.adaptation * (ratio - 1)
            scales.append(min(max(scale, least), SCALES[1] ** 2))
        return np.array(scales)

    def has_moved(self, physical: PendulumParameters) -> bool:
        """Return whether p is further from these parameters than a share of its prior."""
        if self.compared is not physical:    # which it is for many ticks on end
            self.compared, self.p_compared = physical, self.unknowns.of(physical)
        far = np.abs(self.z[self.size:] - self.p_compared) > MOVED * self.unknowns.deviations
        return bool(far[self.unknowns.of_pendulum].any())

    def begin(self, t: float, x: Array) -> Estimate:
        """Take a state as it is measured; the unknowns stay, as uncertain as at first."""
        self.in_a_row = 0
        self.take_noises_as_given()
        unmeasured = np.isnan(x)
        variances = np.where(unmeasured, self.unmeasured, self.R)
        return self.set_posterior(
            t, np.concatenate((np.where(unmeasured, 0.0, x), self.z[self.size:])),
            np.diag(np.concatenate((variances, self.prior))), np.zeros(self.size), 0.0)

    def set_posterior(self, t: float, z: Array, P: Array, innovation: Array,
                      distance: float) -> Estimate:
        """Keep a mean and a covariance, and report them."""
        self.t, self.z, self.P = t, z, P
        found = self.unknowns.values(z[self.size:])
        drive = Drive(found['actuation_delay'], found['motor_time_constant'],
                      found['force_gain'], found['force_bias'])
        physical = {name: found[name] for name in self.of_pendulum}
        balance = np.array([found[name] for name in self.balances])
        return Estimate(z[:self.size].copy(), physical, drive, innovation, distance, self.refused,
                        accepted=True, balance=balance, explained=self.is_explained)

    def predicted(self, t: float, sent: tuple[Array, Array],
                  push: float) -> tuple[Array, Array, Array]:
        """Return mean and covariance after the commands and a push [N] of unknown size, and ẋ."""
        z, P, about, unknowns = self.z.copy(), self.P.copy(), self.parameters, self.unknowns
        passed = t - self.t
        forget(self.prior, min(passed / about.memory, 1.0), P)
        rate = predict(self.model, unknowns.constants, unknowns.nominal, unknowns.factors,
                       *sent, passed, self.differences,
                       self.held * (about.force_noise ** 2 * self.scales[0] + push ** 2),
                       self.disturbed * self.scales[0], z, P)
        return z, P, rate

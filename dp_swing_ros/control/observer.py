# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From measurements to a belief: message filter, estimator, and the problem as estimated."""

import contextlib
from dataclasses import dataclass, replace
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.control.adaptive_dynamics import AdaptiveDynamics
from dp_swing_ros.control.message_filter import MessageFilter, Predict
from dp_swing_ros.estimators import ESTIMATORS
from dp_swing_ros.estimators.estimator import Commands, Estimate, Estimator
from dp_swing_ros.parameters import parameter, ParameterError, Parameters
from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import Array, is_state, to_turn_of, turned
from dp_swing_ros.problem.parameters import ADAPTIVE, PredictionParameters
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.problem.problem import Bounds, Problem

OVERTAKEN = 0.5  # [s] a state older than the last by more than this is none that was overtaken
NEARLY = 0.01    # of the limit of the force, by which bounds may be off


@dataclass(frozen=True)
class ObserverParameters(Parameters):
    """Who estimates the state."""

    estimator: str = parameter(
        'ekf', 'none: a state is taken as it is measured; ekf: an extended Kalman filter on the '
        'model, which also estimates physical parameters and a force bias',
        choices=lambda: sorted(ESTIMATORS))


class Belief(NamedTuple):
    """
    State, pendulum and drive as estimated at the time of the last accepted measurement.

    Angles are counted from where links stand balanced; a measurement's are larger by `balance`.
    Shapes: x (2n + 2,), NaN before the first.
    """

    t: float             # [s]
    x: Array
    problem: Problem     # of the pendulum as it is estimated
    drive: Drive
    rejection: str       # why the last measurement was not accepted; empty where it was
    estimate: Estimate | None   # None where the state is taken as it is measured

    @property
    def balance(self) -> Array | float:
        """Return the angles (n,) [rad] at which the links stand balanced."""
        return 0.0 if self.estimate is None else self.estimate.balance

    def as_measured(self, plan: Plan) -> Plan:
        """Return a plan with its angles as the sensors would measure them."""
        return replace(plan, X=turned(plan.X, self.balance))


def is_of_another_run(t: float, first: float, latest: float) -> bool:
    """Return whether a time [s] is before the first of a run, or long before its latest."""
    return t < latest and t <= max(first, latest - OVERTAKEN)


class Observer:
    """
    Holds the estimator, the belief, and the states before, which tell dead sensors.

    Where asked to, also dynamics that it learns beside the equations; see adaptive_dynamics.py.
    """

    def __init__(self, problem: Problem, parameters: ObserverParameters, estimator: Parameters,
                 drive: Drive) -> None:
        """Take the nominal problem and drive, and the parameters of the estimator."""
        self.nominal, self.nominal_drive = problem, drive
        self.parameters, self.estimator_parameters = parameters, estimator
        self.estimator: Estimator = ESTIMATORS[parameters.estimator](problem, drive, estimator)
        self.message_filter = MessageFilter(
            problem.physical.links, problem.parameters.limits.track_limit, problem.scale)
        is_adaptive = problem.parameters.prediction.dynamics == ADAPTIVE
        self.adaptive = AdaptiveDynamics(problem, drive) \
            if is_adaptive and problem.learned is None else None
        self.reset()

    def reset(self) -> None:
        """Forget all measurements."""
        self.estimator.reset()
        self.message_filter.reset()
        if self.adaptive is not None:
            self.adaptive.reset()
        self.first, self.latest = math.inf, -math.inf   # [s] times of measurements
        nothing = np.full(len(self.nominal.cost.S), np.nan)
        self.belief = Belief(-math.inf, nothing, driven_by(self.nominal_drive, self.nominal),
                             self.nominal_drive, '', None)
        self.estimated = self.belief   # by the estimator, whatever drives

    def reconfigure(self, other: 'Observer') -> None:
        """Go on with the parameters of another one, and with its estimator if they differ."""
        estimated, problem = self.estimated, other.nominal
        if self.adaptive is None or other.adaptive is None or (
                other.adaptive.inputs != self.adaptive.inputs):
            self.adaptive = other.adaptive
        if other.inputs != self.inputs:
            self.estimator, self.message_filter = other.estimator, other.message_filter
            estimated = estimated._replace(drive=other.nominal_drive, estimate=None)
        elif problem.learned is not None:
            other.estimator.continue_from(self.estimator)
            self.estimator = other.estimator
        else:
            with contextlib.suppress(ParameterError):   # springs may hold nothing at another goal
                problem = problem.with_physical(estimated.problem.physical)
        self.nominal, self.nominal_drive = other.nominal, other.nominal_drive
        self.parameters, self.estimator_parameters = other.parameters, other.estimator_parameters
        self.estimated = estimated._replace(problem=driven_by(estimated.drive, problem))
        belief = self.belief
        self.belief = self.believed(turned(belief.x, belief.balance))._replace(
            rejection=belief.rejection)

    def predict_as(self, prediction: PredictionParameters) -> None:
        """
        Go on with the same belief for a problem in other steps.

        Raises ParameterError, and changes nothing, where no regulator holds the reference state.
        """
        nominal, estimated = (problem.with_prediction(prediction) for problem in (
            self.nominal, self.estimated.problem))
        drives = estimated if self.belief.problem is self.estimated.problem else (
            self.belief.problem.with_prediction(prediction))
        self.nominal, self.estimated = nominal, self.estimated._replace(problem=estimated)
        self.belief = self.belief._replace(problem=drives)

    @property
    def inputs(self) -> tuple[object, ...]:
        """Return what estimator and message filter are built from, but for learned numbers."""
        limits, _, prediction = self.nominal.parameters
        return (self.parameters.estimator, self.estimator_parameters, self.nominal.physical,
                self.nominal_drive, limits.track_limit, prediction.integrator,
                self.nominal.learned is not None)

    def is_another_run(self, t: float) -> bool:
        """Return whether a time [s] is before all measurements, or long before the last."""
        return is_of_another_run(t, self.first, self.latest)

    def update(self, t: float, x: Array, time_noise: float, commands: Commands) -> Belief:
        """
        Return the belief with a measurement x at a time t [s], uncertain by time_noise [s].

        One that a later one overtook adds nothing. Shapes: x (2n + 2,), NaN where a velocity is
        not measured. Raises ValueError where one is not, and the estimator does not do without.
        """
        if t <= self.latest:
            return self.belief
        self.first, self.latest = min(self.first, t), t
        # a pendulum that hangs still would be refused for ever where a bias is estimated that is
        # not there any more, for what is refused cannot correct it
        rejection = self.message_filter.rejection(
            t, x, prediction(commands, self.belief.problem, self.belief.drive,
                             self.belief.balance),
            prediction(commands, self.nominal, self.nominal_drive))
        if rejection:
            self.belief = self.belief._replace(rejection=rejection)
            return self.belief
        if math.isfinite(self.belief.t):
            # where an encoder wraps, the angle goes on
            x = to_turn_of(x, turned(self.belief.x, self.belief.balance))
        measured = self.message_filter.with_velocities_measured(x)
        estimate = self.estimator.update(t, measured, commands, time_noise)
        if estimate is not None:
            self.estimated = self.belief_of(t, estimate)
        elif np.all(np.isfinite(x)):
            self.estimated = Belief(t, x, self.estimated.problem, self.nominal_drive, '', None)
        else:
            self.belief = self.belief._replace(rejection='')
            raise ValueError(f'the state is {x}, without velocities; estimator ekf does without')
        self.message_filter.accept(measured, turned(self.estimated.x, self.estimated.balance))
        self.belief = self.adapted(measured, commands)
        return self.belief

    def adapted(self, measured: Array, commands: Commands) -> Belief:
        """
        Learn from a state (2n + 2,), and return what is believed of it.

        Of one that the estimator refuses nothing is learned; what drives predicts it.
        """
        before, estimated, adaptive = self.belief, self.estimated, self.adaptive
        if adaptive is None:
            return estimated
        t, x = estimated.t, turned(estimated.x, estimated.balance)
        if not estimated.rejection:
            x = np.where(np.isnan(measured), x, measured)
            adaptive.update(t, x, prediction(commands, estimated.problem, estimated.drive,
                                             estimated.balance), commands)
        elif adaptive.drives:
            x = prediction(commands, before.problem, before.drive, before.balance)(
                turned(before.x, before.balance), before.t, t)
        return self.believed(x)

    def believed(self, x: Array) -> Belief:
        """
        Return what is estimated, or what was learned where that predicts better.

        That has no balance, and takes the state x (2n + 2,) as it is measured.
        """
        estimated, adaptive = self.estimated, self.adaptive
        problem = None if adaptive is None else adaptive.problem_of(self.nominal)
        if adaptive is None or problem is None:
            return estimated
        estimate = estimated.estimate
        return estimated._replace(
            x=x, problem=problem, drive=adaptive.drive,
            estimate=None if estimate is None else estimate._replace(balance=0.0))

    def belief_of(self, t: float, estimate: Estimate) -> Belief:
        """Return what an estimate says of state, pendulum and drive."""
        problem = self.estimated.problem
        if self.estimator.has_moved(problem.physical):
            with contextlib.suppress(ParameterError):   # of what no pendulum can be held with
                problem = self.nominal.with_physical(
                    self.nominal.physical.estimated(estimate.physical))
        problem = driven_by(estimate.drive, problem)
        return Belief(t, turned(estimate.x, -estimate.balance), problem, estimate.drive,
                      '' if estimate.accepted else
                      f'the state is {estimate.distance:.3g} deviations from its prediction; the '
                      'estimator refuses it', estimate)


def prediction(commands: Commands, problem: Problem, drive: Drive,
               balance: Array | float = 0.0) -> Predict:
    """Return what predicts a measurement under the commands sent to a later time."""
    return lambda x, t, until: turned(commands.predict(
        problem.model, drive, turned(x, -balance), t, until)[0], balance)


def checked(x: Array, size: int) -> Array:
    """Return a copy of a measured state (size,); raises ValueError where it is none."""
    x = np.array(x, dtype=float)
    if x.shape != (size,) or not is_state(x):
        raise ValueError(f'the state is {x}; expected {size} finite numbers')
    return x


def driven_by(drive: Drive, problem: Problem) -> Problem:
    """Return a problem within what a drive can do; the same where that is nearly what it has."""
    u_max = problem.parameters.limits.input_limit(problem.physical.drive)
    bounds = Bounds(drive.bias - drive.gain * u_max, drive.bias + drive.gain * u_max)
    near = all(abs(b - old) <= NEARLY * u_max for b, old in zip(bounds, problem.bounds))
    return problem if near else replace(problem, bounds=bounds)

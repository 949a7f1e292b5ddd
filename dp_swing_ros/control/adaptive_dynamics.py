# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Dynamics that are learned while the equations drive, and drive once they predict better.

They begin with the equations as told, and learn from measured states alone: what an estimator
explains away is in none of them. Each transition is first predicted, by both, and then learned
from. What drives depends on these predictions and on counts, so a run repeats to the bit.
"""

import contextlib
import copy
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.control.message_filter import Predict
from dp_swing_ros.dynamics import priors
from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.dynamics.structured import Structured
from dp_swing_ros.estimators.estimator import Commands
from dp_swing_ros.estimators.least_squares import RecursiveLeastSquares
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.drive import HISTORY
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model
from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import Array, to_turn_of
from dp_swing_ros.pendulum.units import scaled_speeds, SPEEDS
from dp_swing_ros.problem.problem import Problem

TRANSITION = 0.05   # [s] scaled, about; of states that come faster some are left out
NEARLY = 0.9        # of it, from which on one is as long
GAP = 3.0           # times as long: beyond, it is not known what happened
STEP = 0.01         # [s] scaled, longest of a prediction
NOISE, FLOOR = 0.3, 1e-3   # [m/s, rad/s] scaled, deviation of a residual at first, and at least
MEMORY = 60.0       # [s] scaled
END = 0.1           # [m] scaled, from that of the track: there it is no motion of a pendulum
JUDGED = 20         # transitions by which both are judged, and before which nothing is
BETTER = 0.25       # of the equations' mean square error, below which what is learned drives
EVEN = 2e-3         # [m/s, rad/s] scaled, RMS of errors that are too small to tell them apart
EVERY = 5           # transitions, after which plans are made with what was learned since


class Errors(NamedTuple):
    """Mean squares of the errors of speeds after a transition, in units of the default size."""

    equations: float
    learned: float


class AdaptiveDynamics:
    """Holds what was learned, how well it and the equations predict, and which of them drives."""

    def __init__(self, problem: Problem, drive: Drive) -> None:
        """Take the nominal problem, of the equations, and the nominal drive."""
        self.inputs = problem.physical, drive, problem.parameters.limits.track_limit
        scale, links = problem.scale, problem.physical.links
        # learned dynamics make up for the gain, and know no bias
        self.drive = Drive(drive.delay, drive.time_constant)
        about = Structured.of(Pendulum.of(problem.physical, scale=scale))
        prior, sizes = priors.known(about.sized(scale.inverse)), priors.sizes(links, scale)
        self.longest, self.end = scale.sized(TRANSITION, 's'), (
            problem.parameters.limits.track_limit - scale.sized(END, 'm'))
        self.to_default = np.array(scale.inverse.factors(SPEEDS, links + 1))
        self.learner = RecursiveLeastSquares(
            Model(about, INTEGRATORS['rk4'], scale.sized(STEP, 's')),
            prior._replace(mean=about.free / drive.gain,
                           deviations=prior.deviations * sizes / drive.gain),
            np.array(scaled_speeds(NOISE, scale, links)),
            np.array(scaled_speeds(FLOOR, scale, links)), scale.sized(MEMORY, 's'))
        self.reset()

    def reset(self) -> None:
        """Forget all that was learned; the equations drive."""
        self.learner.reset()
        self.t, self.x = math.inf, np.empty(0)   # [s] where a transition begins
        self.seconds, self.since = 0.0, -math.inf   # of experience; since when it is as it is
        self.count, self.errors = 0, Errors(0.0, 0.0)
        self.drives = False
        self.problem: Problem | None = None   # with what was learned

    def warm_up(self) -> None:
        """Compile what it takes to learn; what it has learned goes on."""
        x, twin = np.zeros(2 * len(self.to_default)), copy.copy(self.learner)
        twin.reset()
        twin.update(self.drive, np.full(1, math.inf), np.zeros(1), x, x, self.longest)

    def update(self, t: float, x: Array, predict: Predict, commands: Commands) -> None:
        """
        Take a state as it is measured at a time [s]; `predict` is what the equations do.

        Shapes: x (2n + 2,), a speed that is not measured as it is estimated.
        """
        begin, before, passed = self.t, self.x, t - self.t
        if 0 <= passed < NEARLY * self.longest:
            return
        self.t, self.x = t, x
        if not 0 <= passed < GAP * self.longest or max(abs(before[0]), abs(x[0])) > self.end:
            return
        after, half = to_turn_of(x, before), len(x) // 2
        by_equations = (after - predict(before, begin, t))[half:]
        by_learned, is_learned = self.learner.update(
            self.drive, *commands.since(begin, HISTORY), before, after, passed)
        if not np.all(np.isfinite(by_learned)):   # wild
            self.reset()
        if not is_learned:   # what pushed says nothing of either
            return
        self.seconds, self.count = self.seconds + passed, self.count + 1
        share = 1 / min(self.count, JUDGED)
        self.errors = Errors(*(old + share * (self.square(e) - old) for old, e in zip(
            self.errors, (by_equations, by_learned))))
        self.judge(t)

    @property
    def ratio(self) -> float:
        """Return the mean square error of what was learned by that of the equations."""
        equations, learned = (each + EVEN ** 2 for each in self.errors)
        return learned / equations

    def square(self, e: Array) -> float:
        """Return the mean square of errors of speeds (n + 1,), in units of the default size."""
        return float(np.mean((e * self.to_default) ** 2))

    def judge(self, t: float) -> None:
        """Say which drives from a time on [s]."""
        drives = self.ratio < (1.0 if self.drives else BETTER)
        if drives != self.drives and self.count >= JUDGED:
            self.drives, self.since, self.problem = drives, t, None
        if self.count % EVERY == 0:
            self.problem = None

    def problem_of(self, nominal: Problem) -> Problem | None:
        """Return a problem with what was learned where that drives; None where it cannot."""
        if not self.drives:
            return None
        if self.problem is None or self.problem.parameters != nominal.parameters:
            self.problem = None
            with contextlib.suppress(ParameterError):   # of what no regulator holds
                self.problem = Problem.of(nominal.physical, *nominal.parameters, self.model,
                                          nominal.scale)
        return self.problem

    @property
    def model(self) -> LearnedModel:
        """Return what was learned, to plan with."""
        learner = self.learner
        return LearnedModel(learner.dynamics, np.sqrt(learner.R), {'seconds': self.seconds},
                            self.drive)

    def words(self, t: float) -> str:
        """Return for how long it drives at a time [s], and why; nothing where it does not."""
        if self.problem is None:
            return ''
        return (f'learned dynamics have driven for {t - self.since:.1f} s: their predictions are '
                f'off by {math.sqrt(self.ratio):.2g} times what those of the equations are')

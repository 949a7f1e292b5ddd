# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How far ahead plans look, and in which steps: as the states come, and as far as the goal is.

A force acts from state to state, so a step is a whole number of periods: a plan in other steps
could not be followed, nor begin the next one. It is as long as physics allow, for that of which
nothing new can be seen or done within a step needs no solve.
"""

from collections import deque
from dataclasses import replace
import math
from statistics import median

from dp_swing_ros.pendulum.equations import own_units
from dp_swing_ros.problem.parameters import LONGEST_HORIZON, PredictionParameters
from dp_swing_ros.problem.problem import Problem

PERIODS, ENOUGH = 31, 3   # that are remembered, some of which may be those of losses; to go by
SLOWEST = 0.6   # period in the pendulum's own units of time: beyond, it is easily dropped
NEAR = 0.05     # of its periods, by which a step may be off
FINE = 0.4      # step in those units, at most, where states come often enough: with more, samples
#                 swing up no three links
LONGER = 1.15   # times what is given, until another number of periods is better
FURTHER = 4 / 3   # times as far, where no plan comes to the goal
PATIENCE = 2      # horizons without one, before: where a limit makes a swing-up long, plans of
#                   samples that look further hold less


class Lookahead:
    """Learns the period of the states, and whether plans come to the goal; fits them to both."""

    def __init__(self, problem: Problem) -> None:
        """Take the problem as it is given; a step that is not the default one stays."""
        self.given = problem.parameters.prediction
        self.time = own_units(problem.physical).time   # [s]
        self.fitted = self.given.step == problem.scale.sized(PredictionParameters.step, 's')
        self.reset()

    def reset(self) -> None:
        """Forget the period, and what plans came to."""
        self.t = -math.inf         # [s] of the last measurement
        self.periods = deque[float](maxlen=PERIODS)
        self.period = math.nan     # [s] from state to state, until it is known
        self.step = self.given.step
        self.arrived = math.inf    # [s] of the last plan that came to the goal, or of a first
        self.steps = self.given.horizon   # of the given length
        self.prediction = self.given

    @property
    def last_period(self) -> float:
        """Return the period, until it is known by the last two states; zero of a first."""
        return self.period if len(self.periods) >= ENOUGH else sum(list(self.periods)[-1:])

    @property
    def warning(self) -> str:
        """Return what is wrong with the period, or nothing."""
        longest = SLOWEST * self.time
        return '' if len(self.periods) < PERIODS or self.period <= longest else (
            f'states are answered every {1e3 * self.period:.3g} ms, while the pendulum falls '
            f'{math.exp(self.period / self.time):.2g} times as far; expected one at least every '
            f'{1e3 * longest:.3g} ms, {1 / longest:.3g} Hz')

    def add(self, t: float) -> None:
        """Take the time of a measurement [s]; what another overtook says nothing."""
        if t > self.t:
            if math.isfinite(self.t):
                self.periods.append(t - self.t)
                if len(self.periods) >= ENOUGH:
                    self.period = median(self.periods)
            self.t = t
            self.fit()

    def look(self, t: float, arrives: bool, is_there: bool) -> None:
        """
        Take the time of a tick [s], whether its plan comes to the goal, and whether it is there.

        Where none has come there for PATIENCE horizons, they look further until it is there.
        """
        given = self.given
        if arrives or is_there or t < self.arrived:
            self.arrived = t
        if is_there:
            self.steps = given.horizon
        elif (t - self.arrived > PATIENCE * self.steps * given.step
              and self.steps < given.longest_horizon):
            self.arrived = t
            self.steps = min(round(FURTHER * self.steps), given.longest_horizon)

    def reconfigure(self, other: 'Lookahead') -> None:
        """Go on as another one is given; bodies that change do not change what fits."""
        if other.given.step != self.given.step:
            self.fitted, self.step = other.fitted, other.given.step
        if other.given != self.given:
            self.steps = other.given.horizon
        self.given, self.time = other.given, other.time
        self.fit()

    def fit(self) -> None:
        """Find other steps where these do not go with the period, and as many as are needed."""
        given, period = self.given, self.period
        if self.fitted and not (math.isnan(period) or self.fits(self.step)):
            step = period * max(math.floor(self.longest / period + NEAR), 1)
            # one so long that the pendulum falls over in it would make no plan at all
            self.step = min(step, max(SLOWEST * self.time, given.step))
        if (self.step, self.steps) != (given.step, given.horizon) or self.prediction is not given:
            horizon = max(round(self.steps * given.step / self.step), 1)
            self.prediction = replace(given, step=self.step,
                                      horizon=min(horizon, LONGEST_HORIZON))

    def fits(self, step: float) -> bool:
        """Return whether a step [s] is of whole periods, and none more would fit in it."""
        periods = max(round(step / self.period), 1)
        return (abs(step / self.period - periods) <= NEAR * periods
                and (periods == 1 or step <= LONGER * self.longest)
                and step + self.period > self.longest / LONGER)

    @property
    def longest(self) -> float:
        """Return how long a step of several periods may be [s]."""
        return min(self.given.step, FINE * self.time)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A controller that learns what it moves while it moves it.

It knows the number of links and the limits, and of the bodies that it is told their scale. It
begins with random forces. From then on it plans with what it has learned, and learns from every
transition: in trials, or without a break.
"""

from collections.abc import Mapping
import math
from typing import Any

import numpy as np

from dp_swing_ros.control import controllers
from dp_swing_ros.control.adaptive_dynamics import END, TRANSITION
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.models import Online
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.model import ROUNDING
from dp_swing_ros.pendulum.parameters import LimitParameters
from dp_swing_ros.pendulum.state import Array, to_turn_of
from dp_swing_ros.pendulum.units import SAME, Units
from dp_swing_ros.problem.plan import Plan, Status
from dp_swing_ros.problem.problem import plan_of, Problem

FIRST = 5.0          # [s] scaled, of random forces
LEARNING = 0.25      # [s] scaled, between two times at which it learns
LOUD = 0.6           # of the largest force, standard deviation of the random ones
CORRELATION = 0.6    # of a random force with that a TRANSITION before
HOME = 0.5           # [1/m] scaled, of the largest force, off the middle
BRAKE = 0.15         # [s/m] scaled, of it, against the speed
GAP = 1.5            # periods without a state: beyond, it is not known what happened


class Explorer:
    """Random forces that keep the cart away from the ends of the track."""

    def __init__(self, u_max: float, random: np.random.Generator, scale: Units = SAME) -> None:
        """Take the largest force [N]; where there is none, that of default bodies is taken."""
        usual = scale.sized(LimitParameters().force_limit, 'N')
        self.u_max = u_max if math.isfinite(u_max) else usual
        self.random, self.coloured = random, 0.0
        self.home, self.brake = scale.sized(HOME, '1/m'), scale.sized(BRAKE, 's/m')
        self.lasts = scale.sized(TRANSITION, 's')

    def force(self, x: Array, passed: float) -> float:
        """Return the force [N] in a measured state (2n + 2,), a time [s] after the last."""
        correlation = CORRELATION ** (passed / self.lasts)
        fresh = math.sqrt(1 - correlation ** 2) * self.random.standard_normal()
        self.coloured = correlation * self.coloured + fresh
        home = self.home * x[0] + self.brake * x[len(x) // 2]
        return self.u_max * min(max(LOUD * self.coloured - home, -1.0), 1.0)


class Learner:
    """The controller, for `simulate`."""

    def __init__(self, values: Mapping[str, Any], first: float | None = None) -> None:
        """
        Take the parameters of an mpc; of those of the pendulum their scale alone matters.

        first [s] is how long forces are random, else FIRST. Raises ParameterError.
        """
        self.prototype = controllers.controller(values)
        self.nominal, scale = self.prototype.nominal, self.prototype.nominal.scale
        self.first = scale.sized(FIRST, 's') if first is None else first
        self.random = np.random.default_rng(self.prototype.parameters.seed)
        self.explorer = Explorer(self.nominal.u_max, self.random, scale)
        self.online = Online(self.nominal.physical.links, scale)
        self.model: LearnedModel | None = None
        self.experience = list[tuple[Array, Array, float, float]]()   # x, x⁺, u, h
        self.controller: RecedingHorizon | None = None
        self.begin(self.nominal.dt)

    def begin(self, period: float) -> None:
        """Begin another trial, with a state every so often [s]."""
        self.period = period
        self.last: tuple[float, Array, float] | None = None   # time, state, force
        if self.controller is not None:
            self.controller.reset()

    @property
    def noise(self) -> Array:
        """Return the standard deviations (n + 1,) of what is predicted; none before it is."""
        return np.empty(0) if self.model is None else self.model.noise

    @property
    def duration(self) -> float:
        """Return how long the experience is [s]."""
        return sum(h for *_, h in self.experience)

    def update(self, t: float, x: Array, delay: float = 0.0) -> Plan:
        """Return the plan for a state measured at a time [s]; see RecedingHorizon.update."""
        x = np.array(x, dtype=float)
        if self.last is not None:
            before, x_before, u = self.last
            if 0 < t - before < GAP * self.period:
                self.experience.append((x_before, to_turn_of(x, x_before), u, t - before))
        if self.duration >= self.first - ROUNDING and self.is_due():
            self.learn()
        plan = self.explore(x) if self.controller is None else self.controller.update(t, x, delay)
        self.last = t, x, plan.first_force(self.nominal.u_max)
        return plan

    def fallback(self, acts_at: float) -> Plan:
        """Return a plan where no state came."""
        self.last = None
        if self.controller is None:
            return self.explore(self.nominal.x_r)
        return self.controller.fallback(acts_at)

    def explore(self, x: Array) -> Plan:
        """Return a plan of one random force."""
        u = self.explorer.force(x, self.period)
        return plan_of(self.nominal, np.array([x, x]), np.array([u]), Status.COMPLETE)

    def is_due(self) -> bool:
        """Return whether it is time to learn."""
        learning = self.nominal.scale.sized(LEARNING, 's')
        return self.controller is None or (
            len(self.experience) % max(round(learning / self.period), 1) == 0)

    def learn(self) -> None:
        """Learn from all that was seen, and plan with that from now on."""
        X, Y, U, h = map(np.array, zip(*self.experience))
        seen = Experience(X, Y, U, h)
        end = self.nominal.scale.sized(END, 'm')
        limit = self.nominal.parameters.limits.track_limit - end
        seen = seen.chosen((np.abs(X[:, 0]) < limit) & (np.abs(Y[:, 0]) < limit))
        try:
            model = self.online.model(seen)
            problem = Problem.of(self.nominal.physical, *self.nominal.parameters, model)
        except (FloatingPointError, np.linalg.LinAlgError, ParameterError):
            return   # more experience will tell
        self.model, informed = model, self.prototype.anew(problem)
        if self.controller is None:
            self.controller = informed
        else:
            self.controller.reconfigure(informed)

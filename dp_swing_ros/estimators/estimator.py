# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an estimator is: state and pendulum, from noisy states and the forces sent."""

from typing import Any, NamedTuple, Protocol

from dp_swing_ros.parameters import Parameters
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.problem import Problem


class Force(NamedTuple):
    """A force and how long it acted."""

    u: float         # [N]
    duration: float  # [s]


class Estimate(NamedTuple):
    """
    What is believed at a measurement's time.

    Shapes: x and innovation (2n + 2,). The innovation is what was measured less what was
    predicted; its distance is in standard deviations.
    """

    x: Array
    physical: dict[str, Any]         # by name, those of the physical parameters it estimates
    bias: float                      # [N] a lasting force beside the one sent
    innovation: Array
    distance: float
    refused: int                     # states since the last reset
    accepted: bool                   # not refused, nor the one to start anew from after refusals


class Estimator(Protocol):
    """
    Estimates the state; deterministic.

    Built as ESTIMATORS[name](problem, parameters), where parameters are an
    ESTIMATORS[name].Parameters and the problem has the nominal model.
    """

    def reset(self) -> None:
        """Forget all measurements."""

    def update(self, t: float, x: Array, forces: list[Force]) -> Estimate | None:
        """
        Take the state measured at a time [s] after the last one; return what is believed of it.

        forces are those that acted in between, none at the first. Returns None where the state is
        taken as it is measured.
        Shapes: x (2n + 2,), finite, angles on any one turn.
        """

    def has_moved(self, physical: PendulumParameters) -> bool:
        """Return whether the pendulum is believed to be another than these parameters'."""


class Direct:
    """No estimator: a state is taken as it is measured, the pendulum for the nominal one."""

    Parameters = Parameters   # none

    def __init__(self, problem: Problem, parameters: object) -> None:
        """Take nothing of it."""

    def reset(self) -> None:
        """Forget nothing, for nothing is remembered."""

    def update(self, t: float, x: Array, forces: list[Force]) -> Estimate | None:
        """Believe the measurement."""
        return None

    def has_moved(self, physical: PendulumParameters) -> bool:
        """Return False."""
        return False

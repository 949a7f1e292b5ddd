# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an estimator is: state and pendulum, from noisy states and the forces sent."""

from typing import Any, NamedTuple, Protocol

from dp_swing_ros.parameters import Parameters
from dp_swing_ros.pendulum.model import Model
from dp_swing_ros.pendulum.parameters import Drive, PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.problem import Problem


class Commands(Protocol):
    """The commands that were sent."""

    def since(self, t: float, history: float) -> tuple[Array, Array]:
        """
        Return them from a while before a time on [s]: when each ends, after that time, and which.

        The last ends never. Shapes: (M,) [s], (M,) [N].
        """

    def predict(self, model: Model, drive: Drive, x: Array, t: float,
                until: float) -> tuple[Array, float]:
        """Return state and force of the motor [N] at a later time [s]; shapes: x (2n + 2,)."""


class Estimate(NamedTuple):
    """
    What is estimated at a measurement's time.

    Angles of x count as they are measured; from balance they are less by those of `balance`.
    Shapes: x and innovation (2n + 2,). The innovation is what was measured less what was
    predicted; its distance is in standard deviations.
    """

    x: Array
    physical: dict[str, Any]         # by name, those of the physical parameters it estimates
    drive: Drive
    innovation: Array
    distance: float
    refused: int                     # states since the last reset
    accepted: bool                   # not refused, nor the one to start anew from after refusals
    balance: Array | float = 0.0     # (n,) [rad] angles at which links stand balanced
    explained: bool = True           # the motion, to within the noises, by some pendulum


class Estimator(Protocol):
    """
    Estimates the state; deterministic.

    Built as ESTIMATORS[name](problem, drive, parameters), where parameters are an
    ESTIMATORS[name].Parameters, problem and drive the nominal ones.
    """

    def reset(self) -> None:
        """Forget all measurements."""

    def continue_from(self, before: Any) -> None:
        """Go on from the estimate of another one, with other dynamics and all else equal."""

    def update(self, t: float, x: Array, commands: Commands,
               time_noise: float = 0.0) -> Estimate | None:
        """
        Take the state measured at a time [s] after the last one; return the estimate of it.

        The time is right but for a standard deviation of time_noise [s].
        Returns None where the state is taken as it is measured.
        Shapes: x (2n + 2,), angles on any one turn; speeds that are not measured are NaN.
        """

    def has_moved(self, physical: PendulumParameters) -> bool:
        """Return whether the pendulum is estimated to be another than these parameters'."""


class Direct:
    """No estimator: a state is taken as it is measured, the pendulum for the nominal one."""

    Parameters = Parameters   # none

    def __init__(self, problem: Problem, drive: Drive, parameters: object) -> None:
        """Take nothing of it."""

    def reset(self) -> None:
        """Forget nothing, for nothing is remembered."""

    def continue_from(self, before: Any) -> None:
        """Go on without any estimate."""

    def update(self, t: float, x: Array, commands: Commands,
               time_noise: float = 0.0) -> Estimate | None:
        """Believe the measurement."""
        return None

    def has_moved(self, physical: PendulumParameters) -> bool:
        """Return False."""
        return False

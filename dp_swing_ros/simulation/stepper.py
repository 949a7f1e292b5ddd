# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The order of a period, in one place: measure, push, be late, obey, advance.

A period begins with what was measured and a push, and is finished under the force that answers
it. In lockstep whoever answers is waited for between the two.
"""

from typing import NamedTuple

from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.simulation.plant import Plant


class Observation(NamedTuple):
    """What a plant gives away of itself: when it was measured, what, and the force before it."""

    t: float       # [s]
    x: Array       # (2n + 2,)
    force: float   # [N] mean of the actuator over the period that ends


class Stepper:
    """Takes a plant from period to period."""

    def __init__(self, plant: Plant) -> None:
        """Take the plant, which may also be advanced in between."""
        self.plant = plant

    @property
    def period(self) -> float:
        """Return how long a period lasts [s]."""
        return 1 / self.plant.parameters.rate

    def begin(self, push: float = 0.0) -> Observation | None:
        """Begin a period: measure, which may be lost, and push the cart through it [N]."""
        measured, force = self.plant.measure(), self.plant.mean_force
        self.plant.begin_period(push)
        return None if measured is None else Observation(*measured, force)

    def finish(self, force: float | None, late: float = 0.0) -> bool:
        """
        Advance to the period's end under a force [N], which comes a time [s] late.

        None leaves the one before. Returns whether the command was received.
        """
        if late:
            self.plant.advance(late)
        received = force is None or self.plant.obey(force)
        self.plant.advance(self.period - late)
        return received

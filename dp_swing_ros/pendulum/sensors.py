# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
From what the sensors of a rig measure to the state, and back to where their zero is.

    q = signs (measured - offsets),   relative angles summed: θᵢ = q₁ + … + qᵢ

The offsets are given, or follow from the pendulum's hanging at rest, where θ = π.
"""

from collections import deque
import dataclasses
import math

import numpy as np

from dp_swing_ros.parameters import parameter, ParameterError, Parameters
from dp_swing_ros.pendulum.state import (
    Array, DEFAULT_LINKS, from_joints, hanging, JOINT_COUNTS, joints, to_joints, to_turn_of)
from dp_swing_ros.pendulum.units import POSITIONS, SAME, Units

REST = 1.0      # [s] scaled, of standing still; for half of it a slow swing seems to
STILL = 0.005   # [m, rad] scaled, at most between the means of the quarters of it
QUARTERS = 4    # of it
GIVEN, HANGING = ZEROS = ('given', 'hanging')   # where the offsets are from


def default_sensors(links: int) -> dict[str, tuple]:
    """Return the defaults that hold a value for the cart and each joint."""
    count = JOINT_COUNTS[links]
    return {'joint_names': joints(links), 'joint_signs': (1.0,) * count,
            'joint_offsets': (0.0,) * count}


@dataclasses.dataclass(frozen=True)
class SensorParameters(Parameters):
    """What the numbers of joint_states mean; +x is where a positive force pushes the cart."""

    joint_names: tuple[str, ...] = parameter(
        joints(DEFAULT_LINKS), 'names of the cart and the joints in joint_states, in the order of '
        'the state; there they may come in any order, and others with them', size=JOINT_COUNTS,
        live=False)
    joint_signs: tuple[float, ...] = parameter(
        (1.0,) * JOINT_COUNTS[DEFAULT_LINKS], 'of cart and joints, -1 where a sensor counts down '
        'towards +x, else 1', minimum=-1.0, maximum=1.0, size=JOINT_COUNTS,
        live=False)
    joint_offsets: tuple[float, ...] = parameter(
        (0.0,) * JOINT_COUNTS[DEFAULT_LINKS], 'what the sensors of cart and joints measure where '
        'the state is zero: at the middle of the track, all links upright', unit='m, rad',
        size=JOINT_COUNTS, live=False)
    relative_angles: bool = parameter(
        False, 'the angle and the velocity of a joint are measured from the link before it, not '
        'from the vertical', live=False)
    zero: str = parameter(
        GIVEN, 'where the offsets are from: given, joint_offsets; hanging, those of the joints '
        'from the first second in which the pendulum stands still, taken to hang (no force is '
        'sent before)', choices=lambda: list(ZEROS), live=False)

    def __post_init__(self) -> None:
        """Check also what concerns several at once; raises ParameterError."""
        super().__post_init__()
        if any(abs(sign) != 1 for sign in self.joint_signs):
            raise ParameterError(f"parameter 'joint_signs' is {self.joint_signs}; expected 1 or "
                                 '-1 for each of cart and joints')
        if len(set(self.joint_names)) < len(self.joint_names):
            raise ParameterError(f"parameter 'joint_names' is {self.joint_names}; expected "
                                 'another name for each of cart and joints')

    def state_of(self, measured: Array) -> Array:
        """Return the state; measured (2n + 2,), positions and velocities as the names are."""
        both = np.asarray(measured, dtype=float)
        q, v = both[:len(both) // 2], both[len(both) // 2:]
        signs = np.array(self.joint_signs)
        q, v = signs * (q - self.joint_offsets), signs * v
        if self.relative_angles:
            q, v = from_joints(q), from_joints(v)
        return np.concatenate((q, v))

    def hanging_at(self, measured: Array) -> 'SensorParameters':
        """Return the sensors whose pendulum hangs where the joints are measured; (n + 1,)."""
        q, _ = np.hsplit(hanging(len(measured) - 1), 2)
        if self.relative_angles:
            q = to_joints(q)
        offsets = (measured - self.joint_signs * q)[1:]
        return dataclasses.replace(
            self, joint_offsets=(self.joint_offsets[0], *offsets.tolist()))

    def balanced_at(self, balance: Array) -> 'SensorParameters':
        """Return the sensors to whom states that have these angles (n,) [rad] are upright."""
        off = np.append(0.0, balance)
        if self.relative_angles:
            off = to_joints(off)
        offsets = np.array(self.joint_offsets) + np.array(self.joint_signs) * off
        return dataclasses.replace(self, joint_offsets=tuple(offsets.tolist()))


class Standstill:
    """Takes measured positions; finds out where they stand still for a while."""

    def __init__(self, links: int, scale: Units = SAME) -> None:
        """Begin with none, of a pendulum with so many links and of a scale."""
        self.duration = scale.sized(REST, 's') / QUARTERS   # [s] of a quarter
        self.still = np.array(scale.each_joint(STILL, POSITIONS, links))
        self.means = deque[Array](maxlen=QUARTERS)   # of the last quarters
        self.quarter: list[Array] = []
        self.t = self.began = -math.inf              # [s] of the newest, and of the quarter

    def place(self, t: float, measured: Array) -> Array | None:
        """
        Return the mean of the positions where they stand still, t [s] being the newest's time.

        Shapes: measured (2n + 2,), of which the velocities do not count -> (n + 1,).
        """
        if not np.isfinite(np.hsplit(measured, 2)[0]).all():
            self.t = -math.inf
            return None
        if not 0 < t - self.t < self.duration:
            self.means.clear()
            self.quarter, self.began, self.reference = [], t, measured
        self.t = t
        near = to_turn_of(measured, self.reference)   # an encoder may wrap just here
        self.quarter.append(np.hsplit(near, 2)[0])
        if t - self.began < self.duration:
            return None
        self.means.append(np.mean(self.quarter, axis=0))
        self.quarter, self.began = [], t
        still = len(self.means) == QUARTERS and np.all(np.ptp(self.means, axis=0) <= self.still)
        return np.mean(self.means, axis=0) if still else None

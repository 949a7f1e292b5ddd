# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the plant beside the pendulum itself and its limits."""

import dataclasses

from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.state import hanging, SIZES


@dataclasses.dataclass(frozen=True)
class PlantParameters(Parameters):
    """The plant beside the pendulum and its limits: schedule, start, integrator, disturbances."""

    rate: float = parameter(20.0, 'states published per second', unit='Hz', minimum=1.0,
                            maximum=1000.0)
    initial_state: tuple[float, ...] = parameter(
        tuple(hanging().tolist()), 'state at the start and after a reset [x, θ1 …, ẋ, θ̇1 …]',
        unit='m, rad, m/s, rad/s', size=SIZES)
    physics_step: float = parameter(0.005, 'longest step of the integrator', unit='s',
                                    minimum=1e-5, maximum=1.0)
    integrator: str = parameter(
        'rk4', 'integrator of the plant', choices=lambda: list(INTEGRATORS))
    lockstep: bool = parameter(
        False, 'wait for one force after each state instead of running in real time')
    duration: float = parameter(0.0, 'the plant ends itself after this time (0: never)', unit='s',
                                minimum=0.0)
    command_timeout: float = parameter(
        0.2, 'without a command for this long the force is zero (real time only)', unit='s',
        minimum=1e-3)
    position_noise: float = parameter(
        0.0, 'standard deviation of the measured positions', unit='m, rad', minimum=0.0)
    velocity_noise: float = parameter(
        0.0, 'standard deviation of the measured velocities', unit='m/s, rad/s', minimum=0.0)
    force_noise: float = parameter(
        0.0, 'standard deviation of the applied force, drawn once a period', unit='N',
        minimum=0.0)
    actuator_response: float = parameter(
        1.0, 'share k of the way to the commanded force that the actuator goes in a physics step; '
        'above 1 it overshoots', minimum=1e-3, maximum=2.0)
    delay: float = parameter(0.0, 'age of a measurement when it is published', unit='s',
                             minimum=0.0, maximum=1.0)
    command_jitter: float = parameter(
        0.0, 'a command acts late by a time drawn from 0 to this', unit='s', minimum=0.0,
        maximum=1.0)
    command_loss: float = parameter(
        0.0, 'probability that a command is lost', minimum=0.0, maximum=1.0)
    state_loss: float = parameter(
        0.0, 'probability that a state is lost', minimum=0.0, maximum=1.0)
    disturbance_limit: float = parameter(
        100.0, 'a disturbance is refused where those of a period would exceed this', unit='N',
        minimum=0.0)
    seed: int = parameter(0, 'seed of all noises, losses and latenesses', minimum=0)

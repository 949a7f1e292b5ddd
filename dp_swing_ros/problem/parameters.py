# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the optimal control problem: cost and prediction."""

import dataclasses

from dp_swing_ros.parameters import parameter, ParameterError, Parameters
from dp_swing_ros.pendulum.integrators import Integrator, INTEGRATORS
from dp_swing_ros.pendulum.parameters import at_equilibrium, EQUILIBRIA, GIVEN
from dp_swing_ros.pendulum.state import Array, SIZES, upright

ANALYTIC, LEARNED, ADAPTIVE = 'analytic', 'learned', 'adaptive'   # dynamics


@dataclasses.dataclass(frozen=True)
class CostParameters(Parameters):
    """The cost. Source: the paper, II-B; the tuned defaults are explained in docs/model.md."""

    goal: str = parameter(
        GIVEN, 'equilibrium to go to and hold, link 1 first, whose angles stand for those of the '
        'reference (given: the reference as it is)', choices=lambda: EQUILIBRIA)
    reference: tuple[float, ...] = parameter(
        tuple(upright().tolist()),
        'reference state x_r; an equilibrium, so angles are 0 or π and speeds 0',
        unit='m, rad, m/s, rad/s', size=SIZES)
    state_weights: tuple[float, ...] = parameter(
        (10.0, 100.0, 100.0, 2.0, 6.0, 0.1), 'diagonal of S, the weights of the state error',
        unit='1/m^2, 1/rad^2, s^2/m^2, s^2/rad^2', minimum=0.0, size=SIZES, scaled=True)
    force_weight: float = parameter(0.001, 'R, the weight of the force', unit='1/N^2',
                                    minimum=1e-9, scaled=True)
    angle_error: str = parameter(
        'chord', 'error of an angle: chord = 2 sin(θ/2), periodic; angle = θ, as in the paper',
        choices=lambda: ['chord', 'angle'])
    terminal_cost: str = parameter(
        'lqr', 'lqr = the infinite-horizon LQR value; scaled = terminal_scale S, as in the paper',
        choices=lambda: ['lqr', 'scaled'])
    terminal_scale: float = parameter(
        1000.0, 'factor of S in the scaled terminal cost', minimum=0.0)
    track_weight: float = parameter(
        10_000.0, 'weight of the squared distance into the margin of the track', unit='1/m^2',
        minimum=0.0, scaled=True)
    track_margin: float = parameter(
        0.4, 'width of the soft margin inside the track limit; less than half of it', unit='m',
        minimum=0.0, scaled=True)
    speed_weight: float = parameter(
        1e5, 'weight of the squared excess of a speed over nine tenths of its limit',
        unit='s^2/m^2', minimum=0.0, scaled=True)

    @property
    def x_r(self) -> Array:
        """Return the reference state (2n + 2,) at the goal; raises ParameterError."""
        return at_equilibrium('goal', self.goal, self.reference)


LONGEST_HORIZON = 1000   # steps


@dataclasses.dataclass(frozen=True)
class PredictionParameters(Parameters):
    """How the controller looks ahead."""

    horizon: int = parameter(30, 'number of steps of a plan, N', minimum=1,
                             maximum=LONGEST_HORIZON)
    longest_horizon: int = parameter(
        53, 'steps to which plans are lengthened, a third more at a time, while none comes to the '
        'goal; as many as horizon has, where that is given at the start', minimum=1,
        maximum=LONGEST_HORIZON)
    step: float = parameter(
        0.05, 'duration of one step of a plan; the default is fitted to the period of the states, '
        'and the horizon lasts as long; another one stays', unit='s', minimum=1e-4, maximum=1.0,
        scaled=True)
    dynamics: str = parameter(
        ANALYTIC, 'what accelerates cart and links: analytic, the equations of a chain of rigid '
        'links; learned, what was learned from experience; adaptive, the equations, and, where '
        'speeds are measured, what is learned beside them while it predicts better',
        choices=lambda: [ANALYTIC, LEARNED, ADAPTIVE])
    model: str = parameter(
        'rk4', 'how one step is predicted: the integrator, rk4 or euler; with dynamics learned, '
        'the file of the learned model, which rk4 integrates')

    def __post_init__(self) -> None:
        """Check also what concerns two at once; raises ParameterError."""
        super().__post_init__()
        if self.dynamics != LEARNED and self.model not in INTEGRATORS:
            raise ParameterError(
                f"parameter 'model' is {self.model!r}; expected one of "
                f'{", ".join(INTEGRATORS)}, or the file of a learned model with dynamics learned')

    @property
    def integrator(self) -> Integrator:
        """Return what steps the dynamics."""
        return INTEGRATORS['rk4' if self.dynamics == LEARNED else self.model]

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller, and the problem that it solves, from parameters by their names."""

from collections.abc import Iterable
from typing import Any

from dp_swing_ros.control.receding_horizon import MpcParameters, RecedingHorizon
from dp_swing_ros.dynamics.files import load
from dp_swing_ros.estimators import ESTIMATORS
from dp_swing_ros.parameters import group, ParameterError, Values
from dp_swing_ros.pendulum.declaration import Declaration, Group
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.parameters import (
    Drive, DRIVEN, DriveParameters, LimitParameters, PendulumParameters, VELOCITY)
from dp_swing_ros.pendulum.sensors import default_sensors, SensorParameters
from dp_swing_ros.pendulum.state import LINKS, upright
from dp_swing_ros.problem.parameters import ADAPTIVE, CostParameters, LEARNED, PredictionParameters
from dp_swing_ros.problem.problem import growth, Problem
from dp_swing_ros.solvers import SOLVERS

GROWTH = 1.001   # of what hangs at rest, in a step of a plan: more than rounding
WEIGHTS: dict[int, dict[str, Any]] = {
    1: {'state_weights': (10.0, 100.0, 2.0, 6.0)}, 2: {},
    3: {'state_weights': (10.0, 100.0, 100.0, 100.0, 2.0, 6.0, 6.0, 6.0), 'mppi.samples': 1024}}


def _groups() -> Iterable[Group]:
    yield from (('', MpcParameters), ('', SensorParameters), ('', PredictionParameters),
                ('', CostParameters))
    for kinds in (ESTIMATORS, SOLVERS):
        for name in sorted(kinds):
            yield f'{name}.', kinds[name].Parameters


def _beside(given: Values) -> dict[str, Any]:
    return {
        # who gives a horizon gets that
        **({'longest_horizon': given['horizon']} if 'horizon' in given else {}),
        # what is driven moves as it is told
        **({'ekf.gain_error': 0.0, 'ekf.force_bias': 0.0}
           if given.get('drive') in DRIVEN else {})}


MPC = Declaration('mpc', _groups, {
    links: {'reference': tuple(upright(links).tolist()), **default_sensors(links),
            **WEIGHTS[links]} for links in LINKS},
    beside=_beside)


def controller(values: Values) -> RecedingHorizon:
    """
    Build the controller that an mpc with these parameters would be.

    Raises ParameterError.
    """
    values = MPC.complete(values)
    parameters = group(MpcParameters, values)
    solver, estimator = parameters.solver, parameters.estimator
    problem = _problem(values)
    drive = Drive.of(group(DriveParameters, values))
    if problem.physical.drive == VELOCITY and drive.bias:
        raise ParameterError(
            f"parameter 'force_bias' is {drive.bias:g} with the drive {VELOCITY!r}; expected 0: "
            'the cart comes to the velocity that it is told, whatever pushes it')
    if values['dynamics'] == ADAPTIVE and problem.physical.is_driven:
        raise ParameterError(
            f"parameter 'dynamics' is {ADAPTIVE!r} with the drive {problem.physical.drive!r}; "
            'expected analytic: what is learned beside the equations are forces')
    if values['dynamics'] == ADAPTIVE and any(
            problem.physical.stiffnesses + problem.physical.preloads):
        raise ParameterError(
            f"parameter 'dynamics' is {ADAPTIVE!r} with joint*_stiffness or joint*_preload; "
            'expected analytic: what is learned beside the equations has no springs')
    return RecedingHorizon(problem, parameters,
                           group(SOLVERS[solver].Parameters, values, f'{solver}.'),
                           group(ESTIMATORS[estimator].Parameters, values, f'{estimator}.'),
                           drive if problem.learned is None else problem.learned.drive)


def problem(values: Values) -> Problem:
    """
    Build the problem that an mpc with these parameters would solve.

    Raises ParameterError.
    """
    return _problem(MPC.complete(values))


def cost(values: Values) -> CostParameters:
    """Return the cost of an mpc with these parameters; raises ParameterError."""
    return group(CostParameters, MPC.complete(values))


def _problem(values: Values) -> Problem:
    physical, prediction = group(PendulumParameters, values), group(PredictionParameters, values)
    learned = load(prediction.model, physical.links) if prediction.dynamics == LEARNED else None
    problem = Problem.of(physical, group(LimitParameters, values), group(CostParameters, values),
                         prediction, learned)
    # Euler's steps grow always
    if learned is None and prediction.integrator is INTEGRATORS['rk4'] and (
            growth(problem.model) > GROWTH):
        raise ParameterError(
            f"parameter 'step' is {prediction.step:g}; expected a shorter one: with these masses, "
            'lengths and frictions what swings while it hangs grows in each step by a factor of '
            f'{growth(problem.model):.3g}')
    return problem

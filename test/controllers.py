# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Controllers and plants for the tests, from parameters by name."""

from dp_swing_ros.control.receding_horizon import MpcParameters, RecedingHorizon
from dp_swing_ros.estimators import ESTIMATORS
from dp_swing_ros.pendulum.parameters import DIRECT, LimitParameters, PendulumParameters
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.simulation.plant import Plant, PlantParameters
from dp_swing_ros.solvers import SOLVERS

LIMITS = LimitParameters()


def controller(name='ilqr', seed=0, horizon=30, cost=CostParameters(), of_solver=None,
               drive=DIRECT, limits=LIMITS, **mpc):
    """Build a controller of the default problem."""
    problem = Problem.of(PendulumParameters(), limits, cost, PredictionParameters(horizon=horizon))
    parameters = MpcParameters(solver=name, seed=seed, **mpc)
    return RecedingHorizon(problem, parameters, SOLVERS[name].Parameters(**(of_solver or {})),
                           ESTIMATORS[parameters.estimator].Parameters(), drive)


def plant(seed=0, physical=PendulumParameters(), limits=LIMITS, **parameters):
    """Build a plant."""
    return Plant(physical, limits, PlantParameters(seed=seed, **parameters))

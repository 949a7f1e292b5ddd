# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Model predictive control of a pendulum of one, two or three links on a cart.

What PUBLIC names may be imported from here, and will stay; docs/api.md describes it. A name is
imported when it is first asked for, so that the import of the package itself takes no time.
"""

from importlib import import_module
import os
from typing import Any

# Matrices are small here. Threads of the linear algebra would wait for each other, on a busy
# machine for 20 ms at times; it reads this when NumPy is imported for the first time.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

MODULES = {   # below this package: the names that each defines
    'simulation.plants': ('plant',),
    'control.controllers': ('controller',),
    'simulation.closed_loop': ('simulate', 'Controller'),
    'evaluation.metrics': ('measure',),
    'bags': ('read_episode',),
    'simulation.episode': ('Episode',),
    'problem.problem': ('Problem', 'policy_rollout', 'Rollout'),
    'problem.plan': ('Plan', 'SolverStats', 'Status'),
    'solvers': ('SOLVERS',),
    'solvers.solver': ('Solver', 'policy_of', 'generator'),
    'estimators': ('ESTIMATORS',),
    'estimators.estimator': ('Estimator', 'Estimate', 'Commands'),
    'pendulum.integrators': ('INTEGRATORS', 'Integrator', 'moved'),
    'pendulum.model': ('hold',),
    'pendulum.parameters': ('PendulumParameters', 'Drive'),
    'parameters': ('Parameters', 'parameter', 'ParameterError'),
    'errors': ('UserError',)}
PUBLIC = {name: module for module, names in MODULES.items() for name in names}
__all__ = list(PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in PUBLIC:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{PUBLIC[name]}'), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *PUBLIC})

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

PUBLIC = {   # name: the module below this package that defines it
    'plant': 'configuration',
    'controller': 'configuration',
    'simulate': 'simulation.closed_loop',
    'Controller': 'simulation.closed_loop',
    'measure': 'evaluation.metrics',
    'read_episode': 'bags',
    'Episode': 'simulation.episode',
    'Problem': 'problem.problem',
    'Plan': 'problem.plan',
    'SolverStats': 'problem.plan',
    'Status': 'problem.plan',
    'SOLVERS': 'solvers',
    'ESTIMATORS': 'estimators',
    'INTEGRATORS': 'pendulum.integrators',
    'Solver': 'solvers.solver',
    'Estimator': 'estimators.estimator',
    'Estimate': 'estimators.estimator',
    'Force': 'estimators.estimator',
    'hold': 'pendulum.model',
    'PendulumParameters': 'pendulum.parameters',
    'Integrator': 'pendulum.integrators',
    'moved': 'pendulum.integrators',
    'Parameters': 'parameters',
    'parameter': 'parameters',
    'policy_of': 'solvers.solver',
    'policy_rollout': 'problem.problem',
    'Rollout': 'problem.problem',
    'generator': 'solvers.solver',
    'ParameterError': 'parameters',
    'UserError': 'errors',
}
__all__ = list(PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in PUBLIC:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{PUBLIC[name]}'), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *PUBLIC})

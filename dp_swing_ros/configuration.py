# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Plant and controller from ROS parameters, without ROS.

A node is told its parameters by name ({'horizon': 30, 'mppi.samples': 512}), on the command line
or in a YAML file; here the same names and files make the same objects without a node.
"""

from collections.abc import Iterable, Mapping
import dataclasses
from pathlib import Path
from typing import Any

from dp_swing_ros.control.estimator import EstimatorParameters
from dp_swing_ros.control.receding_horizon import MpcParameters, RecedingHorizon
from dp_swing_ros.parameters import checked, ParameterError, Parameters, unknown
from dp_swing_ros.parameters.files import ANY_NODE, is_of_rclpy, sections
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.simulation.parameters import PlantParameters
from dp_swing_ros.simulation.plant import Plant
from dp_swing_ros.solvers import SOLVERS

Values = Mapping[str, Any]               # by the full name of the parameter
Groups = list[tuple[str, type[Parameters]]]  # with the prefix of their names

SHARED: Groups = [('', PendulumParameters), ('', LimitParameters)]
OF_PLANT: Groups = [('', PlantParameters)]
OF_MPC: Groups = [('', MpcParameters), ('', PredictionParameters), ('', CostParameters),
                  ('ekf', EstimatorParameters),
                  *((name, SOLVERS[name].Parameters) for name in sorted(SOLVERS))]
NODES: dict[str, Groups] = {'plant': SHARED + OF_PLANT, 'mpc': SHARED + OF_MPC}
PACKAGE = Path(__file__).parent
# where config/ lies: beside the package in a checkout, below share/ where it is installed
HOMES = [PACKAGE.parent, *(folder / 'share' / PACKAGE.name for folder in PACKAGE.parents[:4])]


def plant(values: Values) -> Plant:
    """
    Build the plant that a node with these parameters would run.

    Raises ParameterError.
    """
    bodies, limits, parameters = _groups('plant', values)
    return Plant(bodies, limits, parameters)


def problem(values: Values) -> Problem:
    """
    Build the problem that an mpc with these parameters would solve.

    Raises ParameterError.
    """
    bodies, limits, _, prediction, cost, *_ = _groups('mpc', values)
    return Problem.of(bodies, limits, cost, prediction)


def controller(values: Values) -> RecedingHorizon:
    """
    Build the controller that an mpc with these parameters would be.

    Raises ParameterError.
    """
    _, _, parameters, _, _, estimator, *solvers = _groups('mpc', values)
    return RecedingHorizon(problem(values), parameters,
                           dict(zip(sorted(SOLVERS), solvers))[parameters.solver], estimator)


def _groups(node: str, values: Values) -> list[Any]:
    """Return the groups of a node, in the order of NODES, and refuse names that it lacks."""
    fields = [_fields(prefix, group) for prefix, group in NODES[node]]
    known = _names(node)
    for name in sorted(set(values) - known):
        raise unknown(name, node, known)
    return [group(**{field.name: checked(field, values[name], name)
                     for name, field in named.items() if name in values})
            for (_, group), named in zip(NODES[node], fields)]


def locate(path: Path) -> Path:
    """Return where a parameter file is: as named from here, or else among the package's own."""
    places = (path, *(home / path for home in HOMES))
    return next((place for place in places if place.is_file()), path)


def read(paths: Iterable[Path]) -> dict[str, dict[str, Any]]:
    """
    Return what ROS parameter files tell each of NODES, where files differ the later's.

    Of what is for any node (/**) each takes what is its own, as the nodes do.
    Raises ParameterError where a file is none, or is for other nodes.
    """
    found: dict[str, dict[str, Any]] = {node: {} for node in NODES}
    for path in map(locate, paths):
        for pattern, values in sections(path):
            # /**/mpc and /second/mpc are for an mpc, /** is for any node
            name = pattern.rsplit('/', 1)[-1]
            if name in ANY_NODE:
                for node in NODES:
                    found[node].update({key: values[key] for key in _names(node) & set(values)})
            elif name in NODES:
                found[name].update({key: value for key, value in values.items()
                                    if not is_of_rclpy(key)})
            else:
                raise ParameterError(f'{path} has parameters for {pattern!r}; expected nodes '
                                     f'called {" or ".join(NODES)}')
    return found


def _names(node: str) -> set[str]:
    return {name for prefix, group in NODES[node] for name in _fields(prefix, group)}


def _fields(prefix: str, group: type[Parameters]) -> dict[str, Any]:
    """Return the fields of a group by the full names of their parameters."""
    return {f'{prefix}.{field.name}' if prefix else field.name: field
            for field in dataclasses.fields(group)}

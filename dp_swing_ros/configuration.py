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
import re
from typing import Any

import yaml

from dp_swing_ros.estimator import EstimatorParameters
from dp_swing_ros.mpc import MpcParameters, RecedingHorizon
from dp_swing_ros.parameters import (
    checked, CostParameters, LimitParameters, ParameterError, Parameters, PendulumParameters,
    PlantParameters, PredictionParameters, unknown)
from dp_swing_ros.problem import Problem
from dp_swing_ros.simulation import Plant
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
OF_EVERY_NODE = ('use_sim_time', 'start_type_description_service')  # rclpy's own


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
    fields = [{f'{prefix}.{field.name}' if prefix else field.name: field
               for field in dataclasses.fields(group)} for prefix, group in NODES[node]]
    known = {name for group in fields for name in group}
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

    Raises ParameterError where a file is none, or is for other nodes.
    """
    found: dict[str, dict[str, Any]] = {node: {} for node in NODES}
    for path in map(locate, paths):
        for pattern, values in _sections(path):
            # /**/mpc and /second/mpc are for an mpc, /** is for any node
            name = pattern.rsplit('/', 1)[-1]
            if name not in (*NODES, '**'):
                raise ParameterError(f'{path} has parameters for {pattern!r}; expected nodes '
                                     f'called {" or ".join(NODES)}')
            for node in NODES if name == '**' else (name,):
                found[node].update(values)
    return found


class _Loader(yaml.SafeLoader):
    """YAML as rcl reads it: 1e-4 is a number too, though YAML 1.1 wants 1.0e-4."""


_Loader.add_implicit_resolver('tag:yaml.org,2002:float', re.compile(r'[-+]?\d+[eE][-+]?\d+$'),
                              list('-+0123456789'))


def value_of(text: str) -> Any:
    """
    Return the value of a parameter given as text, as on the command line of ROS.

    Raises ParameterError.
    """
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError:
        raise ParameterError(f'{text!r} is not the value of a parameter') from None


def _sections(path: Path) -> list[tuple[str, dict[str, Any]]]:
    """Return the patterns of nodes in a file, and the parameters for each."""
    try:
        content = yaml.load(path.read_text(encoding='utf-8'), _Loader)
    except (OSError, UnicodeError) as error:
        raise ParameterError(f'cannot read the parameter file {path}: {error}') from None
    except yaml.YAMLError as error:
        raise ParameterError(f'the parameter file {path} is not YAML: '
                             f'{" ".join(str(error).split())}') from None
    sections = content.items() if isinstance(content, dict) else ()
    if not sections or not all(isinstance(section, dict) and isinstance(
            section.get('ros__parameters'), dict) for _, section in sections):
        raise ParameterError(f'{path} is not a ROS parameter file; expected '
                             '`/**/mpc:` with `ros__parameters:` below, as in config/paper.yaml')
    return [(str(pattern), {name: value for name, value in _flat(section['ros__parameters'])
                            if name not in OF_EVERY_NODE}) for pattern, section in sections]


def _flat(values: Mapping[str, Any], prefix: str = '') -> Iterable[tuple[str, Any]]:
    """Name what is nested as ROS does: mppi: {samples: 9} is mppi.samples."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f'{prefix}{name}.')
        else:
            yield f'{prefix}{name}', value

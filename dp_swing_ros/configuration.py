# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Plant and controller from ROS parameters, without ROS.

A node takes its parameters by name ({'horizon': 30, 'mppi.samples': 512}), from the command line
or a YAML file; here the same names and files make the same objects without a node.
"""

from collections.abc import Iterable, Mapping
import copy
import dataclasses
from pathlib import Path
from types import MappingProxyType
from typing import Any

from dp_swing_ros.control.receding_horizon import MpcParameters, RecedingHorizon
from dp_swing_ros.dynamics.files import load
from dp_swing_ros.estimators import ESTIMATORS
from dp_swing_ros.parameters import (
    complete as completed, fields_of, group, ParameterError, Parameters)
from dp_swing_ros.parameters.files import ANY_NODE, is_of_rclpy, locate, sections
from dp_swing_ros.parameters.scheduling import SchedulingParameters
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.parameters import (
    Drive, DriveParameters, LimitParameters, PendulumParameters)
from dp_swing_ros.pendulum.sensors import default_sensors, SensorParameters
from dp_swing_ros.pendulum.state import DEFAULT_LINKS, hanging, LINKS, upright
from dp_swing_ros.problem.parameters import CostParameters, LEARNED, PredictionParameters
from dp_swing_ros.problem.problem import growth, Problem
from dp_swing_ros.simulation.plant import Plant, PlantParameters
from dp_swing_ros.solvers import SOLVERS

Values = Mapping[str, Any]               # by the full name of the parameter

NODES = ('plant', 'mpc')
GROWTH = 1.001   # of what hangs at rest, in a step of a plan: more than rounding


def _states_and_joints(links: int) -> dict[str, Any]:
    """Return the defaults that hold a number for each of state or joints."""
    return {'initial_state': tuple(hanging(links).tolist()),
            'reference': tuple(upright(links).tolist()), **default_sensors(links)}


# By the number of links, what differs from the defaults that are declared, those of two.
DEFAULTS: dict[int, dict[str, Any]] = {
    1: {**_states_and_joints(1), 'state_weights': (10.0, 100.0, 2.0, 6.0)},
    2: {},
    3: {**_states_and_joints(3),
        'state_weights': (10.0, 100.0, 100.0, 100.0, 2.0, 6.0, 6.0, 6.0), 'force_limit': 40.0,
        'mppi.samples': 1024}}


def declared(node: str, links: int) -> dict[str, dataclasses.Field]:
    """Return a plant's or an mpc's parameters by full names, with defaults for so many links."""
    groups: list[tuple[str, type[Parameters]]] = [
        ('', PendulumParameters), ('', DriveParameters), ('', LimitParameters)]
    if node == 'plant':
        groups += [('', PlantParameters)]
    else:
        groups += [('', MpcParameters), ('', SensorParameters), ('', PredictionParameters),
                   ('', CostParameters),
                   *((f'{name}.', kinds[name].Parameters) for kinds in (ESTIMATORS, SOLVERS)
                     for name in sorted(kinds))]
    groups += [('', SchedulingParameters)]
    found = {}
    for prefix, kind in groups:
        for field in map(copy.copy, fields_of(kind, links)):
            sizes = field.metadata['size']
            field.metadata = MappingProxyType(
                {**field.metadata, 'size': sizes and {links: sizes[links]}})
            field.default = DEFAULTS[links].get(prefix + field.name, field.default)
            found[prefix + field.name] = field
    return found


def declared_for(node: str, values: Values) -> dict[str, dataclasses.Field]:
    """
    Return the parameters of a node by their full names, with as many links as values ask for.

    Raises ParameterError where one of the values is of a pendulum with more links.
    """
    links = links_in(values)
    fields = declared(node, links)
    for name in sorted(set(values) - set(fields)):
        there = [n for n in LINKS if name in declared(node, n)]
        if there:
            raise ParameterError(f'parameter {name!r} is one of a pendulum with {min(there)} '
                                 f'links; this one has {links} (parameter links)')
    return fields


def links_in(values: Values) -> int:
    """Return the number of links that parameters are for; raises ParameterError."""
    return PendulumParameters(links=values.get('links', DEFAULT_LINKS)).links


def complete(node: str, values: Values) -> dict[str, Any]:
    """
    Return the value of every parameter of a node, checked, where some are given.

    Raises ParameterError, also for names that the node lacks with so many links.
    """
    return completed(declared_for(node, values), values, node)


def plant(values: Values) -> Plant:
    """
    Build the plant that a node with these parameters would run.

    Raises ParameterError.
    """
    values = complete('plant', values)
    return Plant(group(PendulumParameters, values), group(LimitParameters, values),
                 group(PlantParameters, values), group(DriveParameters, values))


def problem(values: Values) -> Problem:
    """
    Build the problem that an mpc with these parameters would solve.

    Raises ParameterError.
    """
    return _problem(complete('mpc', values))


def cost(values: Values) -> CostParameters:
    """Return the cost of an mpc with these parameters; raises ParameterError."""
    return group(CostParameters, complete('mpc', values))


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


def controller(values: Values) -> RecedingHorizon:
    """
    Build the controller that an mpc with these parameters would be.

    Raises ParameterError.
    """
    values = complete('mpc', values)
    parameters = group(MpcParameters, values)
    solver, estimator = parameters.solver, parameters.estimator
    problem = _problem(values)
    drive = Drive.of(group(DriveParameters, values))
    return RecedingHorizon(problem, parameters,
                           group(SOLVERS[solver].Parameters, values, f'{solver}.'),
                           group(ESTIMATORS[estimator].Parameters, values, f'{estimator}.'),
                           drive if problem.learned is None else problem.learned.drive)


def default_cost(links: int) -> CostParameters:
    """Return the default cost of a pendulum with so many links."""
    return group(CostParameters, DEFAULTS[links])


def read(paths: Iterable[Path]) -> dict[str, dict[str, Any]]:
    """
    Return what ROS parameter files hold for each of NODES, where files differ the later's.

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
                    names = declared(node, max(LINKS)).keys() & values
                    found[node].update({key: values[key] for key in names})
                continue
            own = {key: value for key, value in values.items() if not is_of_rclpy(key)}
            # a node may be called otherwise: then what it is given tells what it is
            roles = [name] if name in NODES else [
                node for node in NODES if own.keys() <= declared(node, max(LINKS)).keys()]
            if len(roles) != 1:
                raise ParameterError(f'{path} has parameters for {pattern!r}; expected nodes '
                                     f'called {" or ".join(NODES)}, or such that one of them '
                                     'alone has')
            found[roles[0]].update(own)
    return found

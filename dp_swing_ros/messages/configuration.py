# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What each node runs with: the text of a message, so that any bag holds it."""

from typing import Any, NamedTuple

import yaml

from dp_swing_ros.parameters import group, Parameters
from dp_swing_ros.parameters.console import SECRETS
from dp_swing_ros.parameters.files import parse, YamlError
from dp_swing_ros.pendulum.parameters import (
    DriveParameters, LimitParameters, PendulumParameters, RhythmParameters)
from dp_swing_ros.pendulum.sensors import SensorParameters

# in Python alone a model takes a tick or two
Dumper = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)

BEFORE = -1   # [ns] where a plant has not begun
NODES = 2000  # of YAML in a text: so many values, names and lists
CONTROLLER, PLANT = 'mpc', 'plant'   # roles of nodes, whose names they are by default
CONTROLLER_PARAMETERS = {'horizon', 'solver'}   # by which one is known
OF_PLANT = 'lockstep'   # which only a plant has
# what others rely on where a node announces the first parameter of a group, so that it is checked
RELIED_ON: dict[str, tuple[type[Parameters], ...]] = {
    OF_PLANT: (RhythmParameters,), 'joint_names': (SensorParameters,),
    'links': (PendulumParameters, LimitParameters, DriveParameters)}


class Configuration(NamedTuple):
    """A node's parameters by their full names, and what ran where."""

    node: str                    # with its namespace: /mpc
    parameters: dict[str, Any]
    version: str
    commit: str
    sources: str                 # digest of the modules that decide a force
    machine: str
    packages: dict[str, str]     # versions
    revision: int = 0            # how often its parameters had changed
    since: int = 0               # [ns] of a plant's time, from when on the newest counts
    resets: int = 0              # of a plant, until then

    def to_text(self) -> str:
        """Return it as YAML; numbers read back the same."""
        return str(yaml.dump(self._asdict(), Dumper=Dumper, sort_keys=False, allow_unicode=True))


def role_of(configuration: Configuration) -> str:
    """
    Return what a node is by what it announced: plant, or mpc, however it is called.

    Of all others it is the last part of the name.
    """
    if is_of_plant(configuration):
        return PLANT
    if CONTROLLER_PARAMETERS <= configuration.parameters.keys():
        return CONTROLLER
    return configuration.node.rsplit('/', 1)[-1]


def is_of_plant(configuration: Configuration) -> bool:
    """Return whether it is a plant's, whose stamps are of one clock or another."""
    return OF_PLANT in configuration.parameters


def from_text(text: str) -> Configuration:
    """
    Read what `to_text` wrote, but for secrets, which older bags hold.

    What others rely on is checked as what users give is. Raises ValueError where the text is
    something else.
    """
    try:
        content = parse(text, nodes=NODES)
    except YamlError as error:
        raise ValueError(f'a configuration is not YAML: {error}') from None
    counts = Configuration._field_defaults   # which older ones do not have
    kinds: dict[str, type] = {**dict.fromkeys(Configuration._fields, str),
                              'parameters': dict, 'packages': dict, **dict.fromkeys(counts, int)}
    if isinstance(content, dict):
        content = {**counts, **content}
    if not isinstance(content, dict) or not all(
            isinstance(content.get(field), kind) for field, kind in kinds.items()):
        raise ValueError(f'a configuration is {text[:80]!r}; expected YAML with '
                         f'{", ".join(Configuration._fields)}')
    content['parameters'] = _checked(content['parameters'])
    return Configuration(**{field: content[field] for field in kinds})


def _checked(parameters: dict[Any, Any]) -> dict[str, Any]:
    for name, value in parameters.items():
        if not isinstance(name, str) or not all(
                isinstance(each, (int, float, str))   # and so true and false
                for each in (value if isinstance(value, list) else [value])):
            raise ValueError(f'a configuration has {repr(name)[:80]} as {repr(value)[:80]}; '
                             'expected what a parameter of ROS may be')
    for kind in (kind for sign, kinds in RELIED_ON.items() if sign in parameters
                 for kind in kinds):
        group(kind, parameters)
    return {name: value for name, value in parameters.items() if name not in SECRETS}

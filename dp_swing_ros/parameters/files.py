# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameter files and values as ROS reads them, without ROS."""

from collections.abc import Iterable, Mapping
from pathlib import Path
import re
from typing import Any

from dp_swing_ros.parameters.declaration import ParameterError
from dp_swing_ros.parameters.plain_yaml import parse, parse_file, PlainLoader, YamlError

OF_EVERY_NODE = ('use_sim_time', 'start_type_description_service')  # rclpy's own
QOS_OVERRIDES = 'qos_overrides.'  # how rclpy's parameters of a topic begin
ANY_NODE = ('**', '*')            # ends of a pattern that are no name of a node


def is_of_rclpy(name: str) -> bool:
    """Return whether a parameter is one that rclpy gives to every node or topic."""
    return name in OF_EVERY_NODE or name.startswith(QOS_OVERRIDES)


class _Loader(PlainLoader):
    """YAML as rcl reads it: 1e-4 is a number too, though YAML 1.1 wants 1.0e-4."""


_Loader.add_implicit_resolver('tag:yaml.org,2002:float', re.compile(r'[-+]?\d+[eE][-+]?\d+$'),
                              list('-+0123456789'))


def value_of(text: str) -> Any:
    """Return the value of a parameter given as text, as ROS does; raises ParameterError."""
    try:
        return parse(text, _Loader)
    except YamlError as error:
        raise ParameterError(f'{text[:80]!r} is not the value of a parameter: {error}') from None


def sections(path: Path) -> list[tuple[str, dict[str, Any]]]:
    """Return the node patterns of a parameter file, each with its values; or ParameterError."""
    try:
        content = parse_file(path, _Loader)
    except OSError as error:
        raise ParameterError(f'cannot read the parameter file {path}: {error}') from None
    except YamlError as error:
        raise ParameterError(f'the parameter file {path} is not YAML: {error}') from None
    found = list(_sections(content))
    if not found or not all(isinstance(values, dict) for _, values in found):
        raise ParameterError(f'{path} is not a ROS parameter file; expected '
                             '`/**/mpc:` with `ros__parameters:` below, as in config/paper.yaml')
    return [(pattern, dict(_flat(values))) for pattern, values in found]


def _sections(content: Any, pattern: str = '') -> Iterable[tuple[str, Any]]:
    """Yield the patterns and what is below ros__parameters, None where nothing is."""
    if not isinstance(content, dict):
        yield pattern, None
    elif 'ros__parameters' in content:
        yield pattern, content['ros__parameters']
    else:   # a namespace may be a level of its own
        for name, below in content.items():
            yield from _sections(below, f'{pattern}/{name}'.replace('//', '/') if pattern
                                 else str(name))


def _flat(values: Mapping[str, Any], prefix: str = '') -> Iterable[tuple[str, Any]]:
    """Name what is nested as ROS does: mppi: {samples: 9} is mppi.samples."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f'{prefix}{name}.')
        else:
            yield f'{prefix}{name}', value

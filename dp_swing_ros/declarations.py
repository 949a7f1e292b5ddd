# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of plant and mpc side by side, for those who read files or runs of both."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any
import warnings

from dp_swing_ros.control.controllers import MPC
from dp_swing_ros.parameters import near, ParameterError
from dp_swing_ros.parameters.files import ANY_NODE, is_of_rclpy, Key, locate, sections
from dp_swing_ros.pendulum.state import LINKS
from dp_swing_ros.simulation.plants import PLANT

DECLARATIONS = {each.node: each for each in (PLANT, MPC)}


def shared(links: int) -> set[str]:
    """Return the names of the parameters that plant and mpc both have with so many links."""
    return set.intersection(*(set(each.fields(links)) for each in DECLARATIONS.values()))


def misspelt(found: Iterable[tuple[Key, Mapping[str, Any]]]) -> Iterator[str]:
    """Say of what sections give to any node (/**) and no node of this package has where it is."""
    from dp_swing_ros.parameters.nodes import OWN   # which no episode depends on
    names = set[str]().union(*OWN.values(), *(
        each.fields(max(LINKS)) for each in DECLARATIONS.values()))
    for pattern, values in found:
        for name in sorted(set(values) - names if pattern.endswith(ANY_NODE) else ()):
            if not is_of_rclpy(name):
                yield f'line {pattern.line}: no node has {name!r}; {near(name, names)}'


def read(paths: Iterable[Path]) -> dict[str, dict[str, Any]]:
    """
    Return what ROS parameter files hold for plant and mpc, where files differ the later's.

    Of what is for any node (/**) each takes what is its own, as the nodes do; of what none has a
    warning tells. Raises ParameterError where a file is none, or is for other nodes.
    """
    known = {node: declaration.fields(max(LINKS)).keys()
             for node, declaration in DECLARATIONS.items()}
    found: dict[str, dict[str, Any]] = {node: {} for node in known}
    for path in map(locate, paths):
        of_file = sections(path)
        for words in misspelt(of_file):
            warnings.warn(f'{path}, {words}')
        for pattern, values in of_file:
            # /**/mpc and /second/mpc are for an mpc, /** is for any node
            name = pattern.rsplit('/', 1)[-1]
            if name in ANY_NODE:
                for node, names in known.items():
                    found[node].update({key: values[key] for key in names & values})
                continue
            own = {key: value for key, value in values.items() if not is_of_rclpy(key)}
            # a node may be called otherwise: then what it is given tells what it is
            roles = [name] if name in known else [
                node for node, names in known.items() if own.keys() <= names]
            if len(roles) != 1:
                raise ParameterError(f'{path} has parameters for {pattern!r}; expected nodes '
                                     f'called {" or ".join(known)}, or such that one of them '
                                     'alone has')
            found[roles[0]].update(own)
    return found

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What nodes ran with, as tables: against the defaults, and against each other."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.messages.configuration import Configuration

OF_ROS = {'use_sim_time': 'false', 'start_type_description_service': 'true'}  # in every node
Configurations = Mapping[str, Configuration]  # by node


class Setting(NamedTuple):
    """A parameter of a node, in words."""

    node: str
    name: str
    value: str
    default: str  # empty where it is not known
    about: str

    @property
    def changed(self) -> bool:
        """Return whether it is known to differ from its default."""
        return bool(self.default) and self.value != self.default


class Provenance(NamedTuple):
    """What ran where; nodes of one installation share it."""

    version: str
    commit: str
    sources: str
    packages: str
    machine: str


def settings(configurations: Configurations) -> list[Setting]:
    """Return every parameter of every node."""
    found = []
    for node, configuration in configurations.items():
        values = configuration.parameters
        known = DECLARATIONS[node].fields_of_run(values) if node in DECLARATIONS else {}
        for name, value in values.items():
            default, about = OF_ROS.get(name, ''), ''
            if name in known:
                unit = known[name].metadata['unit']
                default = in_words(known[name].default)
                about = known[name].metadata['description'] + (f' [{unit}]' if unit else '')
            found.append(Setting(node, name, in_words(value), default, about))
    return found


def in_words(value: Any) -> str:
    """Return the value of a parameter as it is written in YAML, or nearly so."""
    if isinstance(value, (list, tuple)):
        return f'[{", ".join(map(in_words, value))}]'
    if isinstance(value, bool):
        return str(value).lower()
    return f'{value:.12g}' if isinstance(value, float) else str(value) or "''"


def provenances(configurations: Configurations) -> dict[Provenance, list[str]]:
    """Return what ran where, and the nodes that ran so."""
    groups: dict[Provenance, list[str]] = {}
    for node, each in configurations.items():
        groups.setdefault(_provenance(each), []).append(node)
    return groups


def _provenance(one: Configuration) -> Provenance:
    packages = ', '.join(f'{name} {version}' for name, version in one.packages.items())
    return Provenance(one.version, one.commit, one.sources, packages, one.machine)


def differences(runs: Sequence[Configurations]) -> list[tuple[str, str, list[str]]]:
    """
    Return node and name of all that is not the same in all runs, and its value in each.

    A run that has no such node does not differ.
    """
    flat = [_flat(run) for run in runs]
    rows = []
    for node, name in dict.fromkeys(key for one in flat for key in one):
        values = [one.get((node, name), '-') for one in flat]
        if len({value for value, run in zip(values, runs) if node in run}) > 1:
            rows.append((node, name, values))
    return rows


def _flat(configurations: Configurations) -> dict[tuple[str, str], str]:
    ran = {(node, name): value for node, one in configurations.items()
           for name, value in _provenance(one)._asdict().items()}
    return ran | {(one.node, one.name): one.value for one in settings(configurations)}

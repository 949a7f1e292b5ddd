# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What each node runs with: the text of a message, so that any bag holds it."""

from typing import Any, NamedTuple

import yaml

from dp_swing_ros.parameters.files import parse, YamlError

BEFORE = -1   # [ns] where a plant has not begun


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
        return yaml.safe_dump(self._asdict(), sort_keys=False, allow_unicode=True)


def is_of_plant(configuration: Configuration) -> bool:
    """Return whether it is a plant's, whose stamps are of one clock or another."""
    return 'lockstep' in configuration.parameters


def from_text(text: str) -> Configuration:
    """Read what `to_text` wrote; raises ValueError where the text is something else."""
    try:
        content = parse(text)
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
    return Configuration(**{field: content[field] for field in kinds})

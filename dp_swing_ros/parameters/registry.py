# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Registries that other packages add to by entry points."""

from importlib.metadata import entry_points
from typing import Any
import warnings


def registry(group: str, **own: Any) -> dict[str, Any]:
    """
    Return what this package has by name, and what others offer as entry points of a group.

    Another package cannot replace what this one has; one that cannot be imported is left out, with
    a warning that says why.
    """
    found = dict(own)
    for entry in entry_points(group=group):
        if entry.name in found:
            warnings.warn(f'{entry.value} is left out: {group} has {entry.name!r} already')
            continue
        try:
            found[entry.name] = entry.load()
        except Exception as error:  # noqa: B902
            warnings.warn(f'{entry.value}, {entry.name!r} of {group}, cannot be imported: '
                          f'{type(error).__name__}: {error}')
    return found

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameter files of the package, by their names."""

from pathlib import Path
from typing import Any

from dp_swing_ros.messages.configuration import CONTROLLER, PLANT
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.parameters.files import ANY_NODE, HOMES, sections

NODES = (PLANT, CONTROLLER)
Preset = dict[str, dict[str, Any]]   # values by name, for each of NODES


def presets() -> dict[str, Preset]:
    """Return all that are for plant and mpc alone."""
    files = [file for home in HOMES for file in sorted((home / 'config').glob('*.yaml'))]
    found = {file.stem: preset for file in files if (preset := preset_of(file))}
    return dict(sorted(found.items()))


def preset_of(file: Path) -> Preset:
    """Return what a file has for plant and mpc; empty where it is of something else."""
    try:
        parts = sections(file)
    except ParameterError:
        return {}
    values: Preset = {node: {} for node in NODES}
    for pattern, given in parts:
        name = pattern.rsplit('/', 1)[-1]
        if name not in (*NODES, *ANY_NODE):
            return {}
        for node in NODES if name in ANY_NODE else (name,):
            values[node] |= given
    return values

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros parameters`: the reference of all parameters, as it is in docs/."""

import argparse
from collections.abc import Sequence

from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.nodes.parameters import OWN, shown, table
from dp_swing_ros.pendulum.state import DEFAULT_LINKS, LINKS
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.command_lines import OK, program

HEAD = """\
# Parameters

Made by `make docs` from the dataclasses that declare them. A parameter is given as
`--ros-args -p name:=value` or in a YAML file (`config/` has examples), and is checked when the
node starts. What is unknown, misspelt or out of range ends the node with one line that says what
is expected. Those of plant, mpc and console [change while the node
runs](nodes.md#live-parameters), unless it says that they stay; those of logger and replay stay.
The mpc gets the same physical parameters and limits as the plant unless a test of robustness wants
it otherwise. Defaults are those of two links; parameters of a link or a joint that is not there
are refused.

Where a unit has another one behind it, made of M, L and T, the default is that of the default
bodies; for others it is the same number of [the pendulum's own
units](theory.md#units-of-the-pendulum) of mass, length and time. What is in force says
`ros2 param get`.
"""


def reference() -> str:
    """Return the page as Markdown."""
    # those of the most links, with the defaults of two
    nodes = {node: each.fields(max(LINKS)) | each.fields(DEFAULT_LINKS)
             for node, each in DECLARATIONS.items()}
    shared = {name: field for name, field in nodes['plant'].items() if name in nodes['mpc']}
    own = {node: {name: field for name, field in fields.items() if name not in shared}
           for node, fields in nodes.items()}
    sections = {'The pendulum and its limits (plant and mpc)': shared, **own,
                **{node: fields for node, fields in OWN.items() if fields}}
    return '\n'.join([
        HEAD, *(f'## {name}\n\n{table(fields)}' for name, fields in sections.items()),
        '## Defaults by the number of links\n', other_defaults()])


def other_defaults() -> str:
    """Return the table of defaults that depend on the number of links."""
    names = dict.fromkeys(name for each in DECLARATIONS.values()
                          for values in each.defaults.values() for name in values)
    fields = {links: {name: field for each in DECLARATIONS.values()
                      for name, field in each.fields(links).items()} for links in LINKS}
    return compact([('parameter', *(f'links {links}' for links in LINKS)), *(
        (f'`{name}`', *(f'`{shown(fields[links][name].default)}`' for links in LINKS))
        for name in names)]) + '\n'


def main(argv: Sequence[str] | None = None) -> int:
    """Print the page."""
    argparse.ArgumentParser(
        prog=program('parameters'),
        description='Print all parameters of all nodes, with default, unit, range and '
                    'description, as Markdown.').parse_args(argv)
    print(reference(), end='')
    return OK

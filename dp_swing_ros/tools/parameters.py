# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros parameters`: the reference of all parameters, or those of a URDF."""

import argparse
from collections.abc import Mapping, Sequence
import dataclasses
from pathlib import Path

import yaml

from dp_swing_ros.declarations import DECLARATIONS, shared
from dp_swing_ros.errors import UserError
from dp_swing_ros.parameters import expected, shown
from dp_swing_ros.parameters.nodes import OWN
from dp_swing_ros.pendulum.description import Found, parameters_of
from dp_swing_ros.pendulum.state import DEFAULT_LINKS, LINKS
from dp_swing_ros.pendulum.units import in_words
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.command_lines import execute, OK, program

HEAD = """\
# Parameters

Made by `make docs` from the dataclasses that declare them. A parameter is given as
`--ros-args -p name:=value` or in a YAML file (`config/` has examples), and is checked when the
node starts. What is unknown, misspelt or out of range ends the node with one line that says what
is expected; of what a file gives to any node (`/**`) and none has, the mpc warns. Those of plant,
mpc and console [change while the node runs](nodes.md#live-parameters), unless it says that they
stay; those of logger, replay and relay stay.
The mpc gets the same physical parameters and limits as the plant unless a test of robustness wants
it otherwise. Defaults are those of two links; parameters of a link or a joint that is not there
are refused.

Where a unit has another one behind it, made of M, L and T, the default is that of the default
bodies; for others it is the same number of [the pendulum's own
units](theory.md#units-of-the-pendulum) of mass (m: of the links alone), length and time. What is
in force says `ros2 param get`.
"""


def reference() -> str:
    """Return the page as Markdown."""
    # those of the most links, with the defaults of two
    nodes = {node: each.fields(max(LINKS)) | each.fields(DEFAULT_LINKS)
             for node, each in DECLARATIONS.items()}
    both = {name: field for name, field in nodes['plant'].items() if name in nodes['mpc']}
    own = {node: {name: field for name, field in fields.items() if name not in both}
           for node, fields in nodes.items()}
    sections = {'The pendulum and its limits (plant and mpc)': both, **own,
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


def table(fields: Mapping[str, dataclasses.Field]) -> str:
    """Return the Markdown table of parameters by their full names."""
    return compact([('parameter', 'default', 'unit', 'range', 'description'), *(
        (f'`{name}`', f'`{shown(field.default)}`', unit_of(field), expected(field),
         field.metadata['description'] + ('' if field.metadata['live'] else '; stays')
         + ('; never shown' if field.metadata['secret'] else ''))
        for name, field in fields.items())]) + '\n'


def unit_of(field: dataclasses.Field) -> str:
    """Return the unit of a parameter, and after it in what own unit its default is the same."""
    unit: str = field.metadata['unit']
    if not field.metadata['scaled']:
        return unit
    kinds = unit.split(', ') if isinstance(field.default, tuple) else [unit]
    return f'{unit} ({", ".join(map(in_words, kinds))})'


def main(argv: Sequence[str] | None = None) -> int:
    """Print the page, or make a parameter file of the robot that the command line names."""
    parser = argparse.ArgumentParser(
        prog=program('parameters'),
        description='Print all parameters of all nodes, with default, unit, range and '
                    'description, as Markdown; or make a parameter file of a robot description '
                    'with a prismatic and one to three revolute joints: bodies, frictions, '
                    'limits, and how its joints count.',
        epilog=f'example: {program("parameters")} --urdf rig.urdf -o rig.yaml; then: ros2 run '
               'dp_swing_ros mpc --ros-args --params-file rig.yaml')
    parser.add_argument('--urdf', type=Path, metavar='FILE', help='robot description to read')
    parser.add_argument('-o', '--output', type=Path, metavar='FILE',
                        help='parameter file to write (default: print it)')
    return execute(parser, _parameters, argv)


def _parameters(arguments: argparse.Namespace) -> int:
    if arguments.urdf is None:
        text, left_out = reference(), list[str]()
    else:
        try:
            found = parameters_of(arguments.urdf.read_text(encoding='utf-8'))
        except ValueError as error:
            raise UserError(f'{arguments.urdf}: {error}') from None
        text, left_out = parameter_file(found, arguments.urdf.name), found.left_out
    if arguments.output is None:
        print(text, end='')
    else:
        arguments.output.parent.mkdir(parents=True, exist_ok=True)
        arguments.output.write_text(text, encoding='utf-8')
        print(*left_out, arguments.output, sep='\n')
    return OK


def parameter_file(found: Found, name: str) -> str:
    """Return a ROS parameter file of what a robot description says, for plant and mpc."""
    both = shared(found.values['links'])
    parts = {'/**': [name for name in found.values if name in both],
             '/**/mpc': [name for name in found.values if name not in both]}
    head = [f'# Of the robot description {name}.', *(f'# {each}' for each in found.left_out)]
    return '\n'.join(head) + '\n' + yaml.safe_dump(
        {node: {'ros__parameters': {each: found.values[each] for each in names}}
         for node, names in parts.items() if names}, sort_keys=False)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros import LOG -o BAG --columns t=time ...`: a table of a rig as a bag."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dp_swing_ros import declarations
from dp_swing_ros.control.controllers import MPC
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.tables import aligned
from dp_swing_ros.tools.command_lines import execute, OK, program, progress, within

if TYPE_CHECKING:
    from dp_swing_ros.bags.logs import Column, Log


def main(argv: Sequence[str] | None = None) -> int:
    """Import the log that the command line names; return the exit code."""
    parser = argparse.ArgumentParser(
        prog=program('import'),
        description='Make a bag of a log in CSV (.gz, too) or Parquet, which analyse, identify, '
                    'train and all else here read: joint_states, and force_command where there '
                    'is a force. For velocity_command and acceleration_command '
                    'there is no column: of a driven cart its motion is enough, to identify '
                    '--cart given. What a column is in says its name (x_mm, "x [mm]") or a unit '
                    'behind it; without one it is SI.',
        epilog=f'example: {program("import")} log.csv -o my_bag --columns t=time_ms cart=x_mm '
               'joint1=theta1:deg joint2=theta2:deg force=u --relative-angles --hangs-at-zero')
    parser.add_argument('log', type=Path, metavar='LOG', help='table with a row a sample')
    parser.add_argument('-o', '--output', type=Path, metavar='BAG',
                        help='folder of the bag to make (default: LOG_bag, beside the log)')
    parser.add_argument('--columns', nargs='+', action='extend', required=True, type=named,
                        metavar='NAME=COLUMN[:UNIT]',
                        help='t, cart, joint1 ..., cart_velocity, joint1_velocity ..., force; a '
                             'number in place of a column is one value throughout. Columns of a '
                             'file without names are #1, #2, ...')
    parser.add_argument('--rate', type=within(float, 1e-3), metavar='HZ',
                        help='rows are so far apart, whatever their times')
    parser.add_argument('--signs', nargs='+', type=float, choices=(-1.0, 1.0), metavar='SIGN',
                        help='of cart and joints, -1 where a sensor counts down towards +x')
    parser.add_argument('--relative-angles', action='store_true',
                        help='the angle of a joint is from the link before it, not from the '
                             'vertical')
    parser.add_argument('--hangs-at-zero', action='store_true',
                        help='all angles are zero where it hangs; else zero is upright')
    parser.add_argument('--params', type=Path, metavar='FILE', action='append', default=[],
                        help='YAML file with the bodies and limits of the rig, for its drawings '
                             'and measures (default: those of the mpc)')
    return execute(parser, _import, argv)


def named(text: str) -> tuple[str, str]:
    """Return name and column of NAME=COLUMN."""
    name, _, column = text.partition('=')
    if not name or not column:
        raise argparse.ArgumentTypeError(f'{text[:80]!r} is not NAME=COLUMN, as joint1=theta1')
    return name, column


def _import(arguments: argparse.Namespace) -> int:
    # here: pandas takes half a second, which --help should not wait for
    from dp_swing_ros.bags.logs import as_state, columns_of, read_log, write_log
    rate = arguments.rate or 0.0
    columns = columns_of(dict(arguments.columns), rate)
    log = read_log(arguments.log, columns, rate,
                   lambda parts: progress(parts, desc='reading', unit=' parts'))
    log = as_state(log, arguments.signs, arguments.relative_angles, arguments.hangs_at_zero)
    output = arguments.output or arguments.log.with_name(
        f'{arguments.log.name.partition(".")[0]}_bag')
    try:
        counts = write_log(log, output, description(arguments.params, log.links),
                           lambda rows: progress(rows, desc='writing', unit=' rows'))
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f'{output} holds a part') from None
    print(table(columns), report(log), sep='\n\n', end='\n\n')
    print(f'{output}: ' + ', '.join(f'{count} on {name}' for name, count in counts.items()))
    return OK


def description(files: Sequence[Path], links: int) -> str:
    """Return the URDF of a rig with so many links, by parameter files; raises ParameterError."""
    values = MPC.complete({**declarations.read(files)[MPC.node], 'links': links})
    return urdf(group(PendulumParameters, values), group(LimitParameters, values))


def table(columns: 'Mapping[str, Column]') -> str:
    """Return a table of what stands for what, and in which unit it was taken to be."""
    return aligned([('in the bag', 'from', 'in'), *(
        (name, column.name or f'{column.value:g} throughout', column.unit or 'SI')
        for name, column in columns.items())], names=3)


def report(log: 'Log') -> str:
    """Return in words what there is, and what was odd."""
    counts, gaps = log.counts, log.gaps
    lines = [f'{counts.rows} rows; {len(log.t)} states over {log.t[-1] - log.t[0]:.6g} s, one '
             f'every {1e3 * log.period:.4g} ms ({1 / log.period:.4g} Hz) in the median']
    for count, what in (
            (counts.without_time, 'without a time: left out'),
            (counts.out_of_order, 'before the one that they follow: put in order'),
            (counts.doubled, 'at the time of another: the first was taken')):
        if count:
            lines.append(f'rows {what}: {count}')
    if len(gaps):
        lines.append(f'gaps of more than three times that: {len(gaps)}, {gaps.sum():.4g} s in '
                     f'all, the longest {gaps.max():.4g} s')
    lines += [f'cells without a number in {name!r}: {count}'
              for name, count in counts.missing.items()]
    return '\n'.join(lines)

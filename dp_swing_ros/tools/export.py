# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros export BAG`: a recorded run as tables, in Parquet or CSV."""

import argparse
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import UserError
from dp_swing_ros.tools.command_lines import bag_parser, beside, execute, OK

FORMATS = ('csv', 'parquet')


def main(argv: Sequence[str] | None = None) -> int:
    """Export the bag that the command line names; return the exit code."""
    parser = bag_parser(
        'export', 'Write a recorded run as two tables: a row a state, with the force and the '
        "controller's diagnostics of its tick, its estimate too; and, in FILE_plans, a row a step "
        'of a plan. The columns name their units; angles are in (-pi, pi], 0 upright.')
    parser.add_argument('--output', type=Path, metavar='FILE',
                        help='file to write, .csv or .parquet (default: BAG_states.FORMAT, '
                             'beside the bag)')
    parser.add_argument('--format', choices=FORMATS,
                        help='csv or parquet (default: that of --output, else csv)')
    parser.add_argument('--whole-turns', action='store_true',
                        help='keep the turns of the angles, which then have no jumps')
    return execute(parser, _export, argv)


def _export(arguments: argparse.Namespace) -> int:
    # here: pandas takes half a second, which --help should not wait for
    from dp_swing_ros.bags.tables import plans_of, states_of
    output = _output_for(arguments.bag, arguments.output, arguments.format)
    bag = Bag(arguments.bag, arguments.partial, arguments.namespace, arguments.node)
    tables = {output: states_of(bag, arguments.whole_turns),
              output.with_stem(f'{output.stem}_plans'): plans_of(bag, arguments.whole_turns)}
    output.parent.mkdir(parents=True, exist_ok=True)
    for path, table in tables.items():
        if path.suffix == '.csv':
            table.to_csv(path, index=False)
        else:
            table.to_parquet(path, index=False)
        print(f'{path}: {len(table)} rows')
    if bag.incomplete:
        print(bag.incomplete)
    return OK


def _output_for(bag: Path, output: Path | None, wanted: str | None) -> Path:
    """
    Return the file to write.

    Raises UserError where its name and format do not fit, or the format cannot be written here.
    """
    path = output or Path(f'{beside(bag, "states")}.{wanted or FORMATS[0]}')
    if path.suffix[1:] not in FORMATS or wanted not in (None, path.suffix[1:]):
        names = ' or '.join(f'.{each}' for each in ((wanted,) if wanted else FORMATS))
        raise UserError(f'--output {path} does not end in {names}; name it so, or give another '
                        '--format')
    if path.suffix == '.parquet' and find_spec('pyarrow') is None:
        raise UserError('Parquet needs pyarrow, which is not installed: python3 -m pip install '
                        'pyarrow, or --format csv')
    return path

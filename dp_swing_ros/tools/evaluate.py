# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros evaluate`: campaigns of closed-loop episodes, without ROS."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
import json
from pathlib import Path
import shlex
import sys
from typing import Any

from dp_swing_ros.errors import UserError
from dp_swing_ros.evaluation.baselines import BASELINES
from dp_swing_ros.evaluation.campaign import manifest
from dp_swing_ros.evaluation.campaign.contestants import key, parse_all
from dp_swing_ros.evaluation.campaign.report import (
    compared, compared_in_short, in_short, markdown)
from dp_swing_ros.evaluation.campaign.rows import CampaignError, read, Row, Table
from dp_swing_ros.evaluation.campaign.runner import run
from dp_swing_ros.evaluation.campaign.summary import (
    plain, refuse_strangers, rivals, summarise)
from dp_swing_ros.evaluation.scenarios import Case, PERIOD, RIGS, SCENARIOS
from dp_swing_ros.figures import of_campaign
from dp_swing_ros.parameters import LARGEST, ParameterError
from dp_swing_ros.pendulum.declaration import links_in
from dp_swing_ros.pendulum.state import DEFAULT_LINKS, LINKS
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tools.command_lines import (
    dated, execute, OK, program, SHOWN, within)

SEEDS = 100_000      # of a scenario: a case each is held in memory
MOST = 10_000        # levels of a sweep, processes


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign that the command line asks for; return the exit code."""
    given = sys.argv[1:] if argv is None else argv
    command = shlex.join(['evaluate', *given])
    return execute(command_line(), lambda arguments: _evaluate(arguments, command), given,
                   (CampaignError, OSError))


def _evaluate(arguments: argparse.Namespace, command: str) -> int:
    folder = arguments.output or Path('runs', dated('campaign'))
    if arguments.summary_only and arguments.output is None:
        raise UserError('--summary-only reports on a campaign that is there; expected its folder, '
                        '--output DIR')
    try:
        against = arguments.against
        if against is not None and against.is_dir():
            against /= 'episodes.csv'
        stored = [] if against is None else read(against)
        if not arguments.summary_only:
            _play(arguments, folder, stored, command)
        _report(folder, arguments.figures, stored, arguments.against)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f'call again with --output {folder} to go on') from None
    return OK


def _examples() -> str:
    """Return the end of the help, which names all solvers, baselines and scenarios."""
    call = program('evaluate')
    scenarios = '\n'.join(f'  {name:16}{scenario.about}' for name, scenario in SCENARIOS.items())
    return f"""\
examples:
  {call} --scenarios hanging random --seeds 50
  {call} --contestants ilqr ilqr:config/paper.yaml tvlqr nothing
  {call} --contestants long=ddp:horizon=60+warm_start=forces ddp
  {call} --output runs/night            # again, to go on where it stopped
  {call} --scenarios random --seeds 100 --against results/random.csv.gz
  {call} --links 3 --scenarios hanging

A contestant is a solver ({', '.join(SOLVERS)}) or a baseline ({', '.join(BASELINES)}), after a
colon its parameter files or mpc parameters, before an equals sign its name in tables and pictures.

scenarios:
{scenarios}

With --dask, start the scheduler and workers where this package can be imported, each worker with
one thread: dask worker ADDRESS --nworkers=-1 --nthreads 1

The exit code is 0 when all episodes were run, whatever came of them; 1 when the campaign could not
go on, 2 for what cannot work, 130 after Ctrl-C."""


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the arguments."""
    parser = argparse.ArgumentParser(
        prog=program('evaluate'), epilog=_examples(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description='Run every contestant through the same seeded episodes, and report rates, '
                    'scores and comparisons as Markdown, JSON and pictures.')
    parser.add_argument('--contestants', nargs='+', default=list(SOLVERS), metavar='CONTESTANT',
                        help=f'who takes part (default: {" ".join(SOLVERS)})')
    parser.add_argument('--scenarios', nargs='+', choices=list(SCENARIOS), metavar='SCENARIO',
                        default=[name for name in SCENARIOS if name not in RIGS],
                        help='what they go through (default: all but those of rigs)')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder of table and report; a campaign that is there goes on '
                             '(default: runs/campaign_TIME)')
    parser.add_argument('--links', type=int, choices=LINKS, default=DEFAULT_LINKS,
                        help=f'of the pendulum (default: {DEFAULT_LINKS})')
    parser.add_argument('--seeds', type=seeds, metavar='N | A:B',
                        help='seeds 0 to N - 1, or A to B - 1, of every scenario')
    parser.add_argument('--levels', type=within(int, 1, MOST), metavar='N',
                        help='levels of every sweep')
    parser.add_argument('--duration', type=within(float, PERIOD, 3600), default=10.0,
                        metavar='SECONDS', help='of an episode (default: 10)')
    parser.add_argument('--jobs', type=within(int, 1, MOST), default=-1, metavar='N',
                        help='processes (default: one a core); with one, solve times are those '
                             'of an idle machine')
    parser.add_argument('--dask', default='', metavar='ADDRESS',
                        help='run on the Dask cluster of this scheduler, as tcp://host:8786')
    parser.add_argument('--against', type=Path, metavar='STORED',
                        help='compare with stored rows, episode by episode: the folder of a '
                             'campaign, or a table as results/random.csv.gz')
    parser.add_argument('--figures', action=argparse.BooleanOptionalAction, default=True,
                        help='draw the pictures')
    parser.add_argument('--summary-only', action='store_true',
                        help='run nothing; report on what --output holds')
    return parser


def seeds(text: str) -> range:
    """Read N or A:B."""
    begin, _, end = text.rpartition(':')
    found = range(int(begin or 0), int(end))
    if not found or found.start < 0:
        raise argparse.ArgumentTypeError(f'{text[:SHOWN]} has no seeds')
    if found.stop - found.start > SEEDS or found.stop > LARGEST:
        raise argparse.ArgumentTypeError(f'{text[:SHOWN]} are not up to {SEEDS} seeds of 63 bits')
    return found


def _play(arguments: argparse.Namespace, folder: Path, stored: Sequence[Row],
          command: str) -> None:
    """
    Run what the folder lacks.

    Raises CampaignError where it is to be compared with other episodes, before any is run.
    """
    links = {'links': arguments.links}    # unless parameter files say otherwise
    contestants = [replace(each, plant=links | each.plant, mpc=links | each.mpc)
                   for each in parse_all(arguments.contestants)]
    for each in contestants:
        found = {links_in(each.plant), links_in(each.mpc)}
        if found != {arguments.links}:
            raise ParameterError(
                f'contestant {each.label!r} has plant and mpc with {sorted(found)} links, and the '
                f'campaign {arguments.links}; expected the same: give --links, and the plant of a '
                'parameter file as many as its mpc')
    description = {**manifest.describe(contestants, arguments.scenarios, arguments.seeds,
                                       arguments.levels, arguments.duration, arguments.links),
                   'made': manifest.made(command)}
    cases = _cases(description)
    # case by case, so that contestants stay level
    episodes = [(contestant, case) for case in cases for contestant in contestants]
    if arguments.against is not None:
        refuse_strangers([key(*episode) for episode in episodes], stored)
    folder.mkdir(parents=True, exist_ok=True)
    manifest.keep(folder, description)
    table = Table(folder / 'episodes.csv')
    print(f'{folder}: {len(contestants)} contestants, {len(cases)} cases each; '
          f'{len(table.rows)} episodes are there already', flush=True)
    run(episodes, table, arguments.jobs, arguments.dask)


def _cases(description: dict[str, Any]) -> list[Case]:
    return [case for name, about in description['scenarios'].items()
            for case in SCENARIOS[name].cases(name, range(*about['seeds']), about['levels'],
                                              description['duration'], description['links'])]


def _report(folder: Path, figures: bool, stored: Sequence[Row], against: Path | None) -> None:
    """
    Write summary and pictures of what the folder holds, and how it differs from stored rows.

    What has no room on a terminal is in the files alone.
    Raises CampaignError where no episode is stored.
    """
    description = manifest.load(folder)
    rows = read(folder / 'episodes.csv')
    expected = len(description['contestants']) * len(_cases(description))
    summary = summarise(description, rows, expected)
    (folder / 'summary.json').write_text(json.dumps(plain(summary), indent=1) + '\n',
                                         encoding='utf-8')
    page, lines = markdown(summary), in_short(summary)
    if against is not None:
        pairs = rivals(rows, stored)
        page += f'\n{compared(str(against), pairs)}'
        lines.append(compared_in_short(str(against), pairs))
    (folder / 'summary.md').write_text(page, encoding='utf-8')
    if figures:
        for name, figure in of_campaign(summary, rows):
            figure.savefig(folder / f'{name}.png')
    print(*lines, f'report: {folder / "summary.md"}', f'episodes: {folder / "episodes.csv"}',
          *([f'pictures: {folder / "*.png"}'] if figures else []), sep='\n')

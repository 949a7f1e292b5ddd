# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Run the paper's six experiments anew, draw its Figs. 2 to 10, and measure what it claims.

Each with the defaults and with the paper's own set-up, once through the nodes in lockstep, read
back from the bag, and these and the set-ups between them over many seeds without ROS by the same
classes. Run by `make results`; takes minutes.
"""

import argparse
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
import sys
from typing import NamedTuple

from joblib import delayed, Parallel
import numpy as np
from paper_ensemble import Ensemble, ensemble, trial
from paper_experiments import (
    case, contestant, files_of, Key, keys, PERIOD, PICTURES, SEEDS, SETUPS, STEPS, TOP)
from paper_figures import squared_errors, swing_ups
from paper_page import page
from seeded import sources
from stamp import made
from tqdm import tqdm
import yaml

from dp_swing_ros.bags import read_episode
from dp_swing_ros.errors import UserError
from dp_swing_ros.evaluation.campaign.contestants import measured, simulated
from dp_swing_ros.evaluation.campaign.rows import Row, store, untimed
from dp_swing_ros.figures.style import solver_name
from dp_swing_ros.simulation.episode import Episode
from dp_swing_ros.tools.command_lines import interrupt_on_signals, within
from dp_swing_ros.tools.demo import perform
from dp_swing_ros.tools.processes import isolated

SEED = 0   # of the run that is shown whole


def play(key: Key, seed: int) -> Episode:
    """Run an experiment without ROS."""
    with np.errstate(all='ignore'):  # what a far state overflows is seen in the result
        return simulated(contestant(key), case(key, seed))


def record(key: Key, folder: Path) -> Episode:
    """
    Run an experiment by plant, mpc and logger, and read its bag.

    Raises ProcessError if a process fails.
    """
    folder.mkdir(parents=True)
    start = folder / 'start.yaml'
    start.write_text(yaml.safe_dump({'/**/plant': {'ros__parameters': {
        'initial_state': list(case(key, SEED).plant['initial_state'])}}}), encoding='utf-8')
    return read_episode(perform(folder, {
        'mpc': {'solver': key.solver, 'seed': SEED},
        'plant': {'seed': SEED, 'duration': STEPS[key.solver] * PERIOD, 'lockstep': True},
    }, [*files_of(key), start]))


def check(bag: Episode, simulated: Episode) -> int:
    """Return how many numbers of both are equal; raises UserError where one is not."""
    # the mpc answers the last state as well, though nobody obeys
    pairs = [(bag.X, simulated.X), (bag.U, simulated.U),
             (bag.ticks.cost[:-1], simulated.ticks.cost)]
    if not all(np.array_equal(a, b) for a, b in pairs):
        raise UserError('the run of the nodes and the one without ROS differ; were the nodes '
                        'built from these sources?')
    return sum(a.size for a, _ in pairs)


class Result(NamedTuple):
    """The runs of an experiment together, and a row of each."""

    ensemble: Ensemble
    rows: Sequence[Row]


def main(argv: Sequence[str] | None = None) -> int:
    """Run what the command line asks for, write pictures and tables; return the exit code."""
    arguments = _parser().parse_args(argv)
    try:
        interrupt_on_signals()
        found: dict[Key, Result] = {}
        with isolated(), Parallel(n_jobs=-1, return_as='generator') as parallel:
            for key in keys(arguments.figures):
                found[key] = _measure(key, arguments, parallel)
        ensembles = {key: result.ensemble for key, result in found.items()}
        _draw(ensembles, arguments.docs / 'figures')
        results = arguments.docs / 'results'
        results.mkdir(parents=True, exist_ok=True)
        (results / 'paper.md').write_text(page(ensembles, made('paper', sources('paper'))),
                                          encoding='utf-8')
        store(results / 'paper.csv.gz', [row for one in found.values() for row in one.rows])
    except KeyboardInterrupt:
        print('paper: interrupted', file=sys.stderr)
        return 130
    except (UserError, OSError) as error:
        print(f'paper: error: {error}', file=sys.stderr)
        return 2
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seeds', type=within(int, 1), default=SEEDS, metavar='N',
                        help=f'of each experiment, from 0 on (default: {SEEDS})')
    parser.add_argument('--figures', nargs='+', type=int, metavar='NUMBER', choices=range(2, 11),
                        default=range(2, 11), help="the paper's, with their experiments "
                                                   '(default: 2 to 10)')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        default=Path('runs', f'paper_{datetime.now():%Y%m%d_%H%M%S}'),
                        help='folder for the bags and logs (default: runs/paper_TIME)')
    parser.add_argument('--docs', type=Path, default=TOP / 'results', metavar='DIR',
                        help='folder for figures/ and results/ (default: results)')
    return parser


def _measure(key: Key, arguments: argparse.Namespace, parallel: Parallel) -> Result:
    """Return the runs of an experiment; the one that is drawn went through the nodes."""
    episodes = list(tqdm(parallel(delayed(play)(key, seed) for seed in range(arguments.seeds)),
                         desc=', '.join(key), total=arguments.seeds, disable=None))
    shown = episodes[SEED]
    if SETUPS[key.setup].title:
        shown = record(key, arguments.output / '_'.join(key).replace(' ', '_'))
        print(f'{", ".join(key)}: {check(shown, episodes[SEED])} numbers in the bag of seed '
              f'{SEED}, equal to the bit to the run without ROS', flush=True)
    rows = [untimed(measured(contestant(key), case(key, seed), episode))
            for seed, episode in enumerate(episodes)]
    return Result(ensemble(shown, [trial(episode) for episode in episodes]), rows)


def _draw(experiments: Mapping[Key, Ensemble], folder: Path) -> None:
    """Draw each figure of the experiments that were run."""
    folder.mkdir(parents=True, exist_ok=True)
    for (solver, start), numbers in PICTURES.items():
        ensembles = {SETUPS[key.setup].title: one for key, one in experiments.items()
                     if key[:2] == (solver, start) and SETUPS[key.setup].title}
        # of a swing-up the paper has snapshots and errors, of a start near the goal errors
        for number, draw in zip(reversed(numbers), (squared_errors, swing_ups)):
            if ensembles:
                name = solver_name(solver)
                heading = f'Fig. {number} anew: {name}, {start}, {STEPS[solver]} steps'
                draw(ensembles, heading).savefig(folder / f'paper_fig{number}.png')


if __name__ == '__main__':
    sys.exit(main())

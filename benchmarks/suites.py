# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Play the tasks of others that have our pendulum, and write docs/results/suites.md.

Run by `make results PAGES=suites`, in an environment of its own. Each episode is kept in a file,
so that a second start goes on where the first was stopped. By hand, on a few seeds:

    PYTHONPATH=. .venv-suites/bin/python benchmarks/suites.py --episodes 2 --docs runs
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
import hashlib
import json
from pathlib import Path
from typing import NamedTuple

from campaigns import METHODS
from joblib import delayed, Parallel
from matplotlib.figure import Figure
import numpy as np
import pandas as pd
import stamp
from suites_episodes import Episode, Outcome, play, STEPS, TASKS, TOGETHER
from tqdm import tqdm

from dp_swing_ros import provenance
from dp_swing_ros.evaluation.comparison import CONFIDENCE, RESAMPLES
from dp_swing_ros.figures.style import colours, FAINT, name_lines, solver_name, styled
from dp_swing_ros.tables import compact

PYTHON = stamp.TOP / '.venv-suites' / 'bin' / 'python'
PACKAGES = (*provenance.COMPUTING, 'dm_control', 'gymnasium', 'mujoco')
EPISODES = {'two_poles': {'tuned': 100, 'defaults': 20},    # of each solver
            'three_poles': {'tuned': 50, 'defaults': 20},   # which take ten times as long
            'inverted_double_pendulum': {'defaults': 100}}
SHOWN = ('two_poles', 'three_poles')        # in the picture; the third task only balances
BAND = (0.05, 0.95)                         # of the episodes, in the picture

Outcomes = Mapping[Episode, Outcome]


class Published(NamedTuple):
    """What somebody else's method was paid."""

    method: str
    mean: str
    runs: str
    source: str


CLEANRL = '[CleanRL](https://docs.cleanrl.dev/rl-algorithms/rpo/)'
TD3 = '[Fujimoto et al. 2018](https://arxiv.org/abs/1802.09477), Table 1, environment v1'
PUBLISHED = {
    'two_poles': (Published('PPO', '216.31 ± 4.03', '10 seeds, 8 M steps', CLEANRL),
                  Published('RPO', '218.31 ± 7.30', '10 seeds, 8 M steps', CLEANRL)),
    'three_poles': (Published('PPO', '160.03 ± 2.52', '10 seeds, 8 M steps', CLEANRL),
                    Published('RPO', '159.97 ± 2.28', '10 seeds, 8 M steps', CLEANRL)),
    'inverted_double_pendulum': (
        Published('TD3', '9337.47 ± 14.96', '10 seeds, 1 M steps', TD3),
        Published('SAC', '8487.15', '10 seeds, 1 M steps', TD3))}


def sources() -> str:
    """Return a digest of all that decides the page: code and tuned sets."""
    digest = hashlib.sha256(stamp.sources('suites').encode())
    for task in TASKS.values():
        for file in task.tuned + task.tuned_mppi:
            digest.update((stamp.TOP / 'config' / file).read_bytes())
    return digest.hexdigest()[:16]


def episodes(most: int | None = None) -> list[Episode]:
    """Return the episodes of all lines of the page, so many of each at most."""
    return [Episode(task, setup, solver, seed) for task, counts in EPISODES.items()
            for setup, count in counts.items() for solver in METHODS
            for seed in range(count)[:most]]


def stored(file: Path) -> dict[Episode, Outcome]:
    """Return the episodes that a file holds of these sources; drop a torn last line."""
    if not file.exists():
        return {}
    whole = file.read_text()
    whole = whole[:whole.rfind('\n') + 1]
    file.write_text(whole)
    entries = map(json.loads, whole.splitlines())
    return {Episode(*entry['episode']): outcome_of(entry['outcome'])
            for entry in entries if entry['sources'] == sources()}


def outcome_of(numbers: Sequence) -> Outcome:
    """Return an outcome as it was before it was written as JSON."""
    total, steps, rewards = numbers
    return Outcome(total, steps, tuple(rewards))


def named(episode: Episode) -> tuple[Episode, Outcome]:
    """Play an episode, and return it with its outcome."""
    return episode, play(episode)


def played(wanted: Sequence[Episode], file: Path, jobs: int) -> dict[Episode, Outcome]:
    """Play the episodes that a file lacks, add each to it, and return all in order."""
    file.parent.mkdir(parents=True, exist_ok=True)
    found, of = stored(file), sources()
    missing = [episode for episode in wanted if episode not in found]
    outcomes = Parallel(jobs, return_as='generator_unordered')(map(delayed(named), missing))
    with file.open('a') as output:
        for episode, outcome in tqdm(outcomes, total=len(missing), unit='episode', disable=None):
            print(json.dumps({'sources': of, 'episode': episode, 'outcome': outcome}),
                  file=output, flush=True)
            found[episode] = outcome
    return {episode: found[episode] for episode in wanted}


def table_of(outcomes: Outcomes) -> pd.DataFrame:
    """Return a row for each episode, as the page's CSV has it."""
    return pd.DataFrame([
        {**episode._asdict(), 'return': outcome.total, 'steps': outcome.steps,
         'rewards': ' '.join(f'{reward:.4g}' for reward in outcome.rewards)}
        for episode, outcome in outcomes.items()])


def mean(totals: Sequence[float]) -> str:
    """Return the mean and its 95 % interval by the bootstrap."""
    from scipy.stats import bootstrap
    interval = bootstrap((totals,), np.mean, confidence_level=CONFIDENCE, n_resamples=RESAMPLES,
                         method='percentile', random_state=np.random.default_rng(0)
                         ).confidence_interval
    return f'{np.mean(totals):.1f} ({interval.low:.1f}-{interval.high:.1f})'


def lines(task: str, outcomes: Outcomes) -> Iterable[tuple[str, ...]]:
    """Return the lines of a task: ours, then what others publish."""
    for setup in EPISODES[task]:
        for solver in METHODS:
            of = [outcome for episode, outcome in outcomes.items()
                  if episode[:3] == (task, setup, solver)]
            totals = [outcome.total for outcome in of]
            yield (f'`{task}`', f'`{solver}`, {setup}', str(len(of)), mean(totals),
                   f'{min(totals):.1f}', f'{max(totals):.1f}',
                   str(sum(outcome.steps < STEPS for outcome in of)), 'here')
    for one in PUBLISHED[task]:
        yield (f'`{task}`', one.method, one.runs, one.mean, '-', '-', '-', one.source)


def page(outcomes: Outcomes, made: str) -> str:
    """Return the page."""
    tuned = ', '.join(f'[{file}](../../config/{file})'
                      for task in TASKS.values() for file in task.tuned + task.tuned_mppi)
    return '\n'.join([
        '# External yardsticks\n', made,
        'Tasks that others define, run by their own code: `two_poles` and `three_poles` of '
        "dm_control's domain `cartpole` (swing up poles of 0.1 kg with 10 N on ±1.8 m of track; "
        '1,000 steps of 10 ms, at most 1 a step), and `InvertedDoublePendulum-v5` of Gymnasium '
        '(balance; at most 1,000 steps of 50 ms, 9.36 a step where it stands still). The return '
        'is the sum of the rewards; start, reward and end are theirs.\n',
        '**This is no race on equal terms.** The solvers know the model: masses, lengths, moments '
        "of inertia, frictions and limits are read from the task's own MuJoCo model. The state is "
        "the simulator's own, so there is no estimator, and a solve has no deadline. A method of "
        'reinforcement learning begins without any of this. What is measured is how much of the '
        'return a controller gets that knows the model; the reward it does not know, it minimises '
        'its own cost.\n',
        f'Tuned: weights, horizon, starts and samples of {tuned}, chosen on seeds from 1,000 on, '
        'the weights of `two_poles` by a random search, the rest by hand; there MPPI has a set of '
        'its own, for which its defaults had been tried on seeds 0 and 1. Defaults: the model '
        'alone. Seeds count from 0, one for task and solver; in brackets the 95 % interval of the '
        'mean (bootstrap). Published figures are means over training runs, ± as their sources '
        'give it. The rows: [suites.csv.gz](suites.csv.gz).\n',
        compact([('task', 'method', 'episodes', 'mean return', 'least', 'largest',
                  'ended early', 'source'),
                 *(line for task in TASKS for line in lines(task, outcomes))]) + '\n',
        '![Reward by step of the tasks that swing up](../figures/suites.png)\n',
        f'Lines are means over the tuned episodes, bands hold {100 * (BAND[1] - BAND[0]):.0f} % '
        'of them.\n'])


@styled
def picture(outcomes: Outcomes) -> Figure:
    """Show what each step pays in the tasks that swing up."""
    colour = colours(METHODS)
    figure = Figure((7.2, 2.8), layout='constrained')
    for axes, task in zip(figure.subplots(1, len(SHOWN), sharey=True), SHOWN):
        for solver in METHODS:
            rewards = np.array([outcome.rewards for episode, outcome in outcomes.items()
                                if episode[:3] == (task, 'tuned', solver)])
            steps = TOGETHER * (np.arange(rewards.shape[1]) + 0.5)
            axes.fill_between(steps, *np.quantile(rewards, BAND, axis=0), color=colour[solver],
                              alpha=0.15, linewidth=0)
            axes.plot(steps, rewards.mean(axis=0), color=colour[solver])
        axes.axhline(1, color=FAINT, linestyle='--', linewidth=1)
        axes.set(title=task, xlabel='step', xlim=(0, STEPS), ylim=(0, 1.05))
        axes.grid()
    figure.axes[0].set_ylabel('reward')
    name_lines(figure, {solver_name(solver): {'color': colour[solver]} for solver in METHODS})
    return figure


def main() -> None:
    """Play all episodes and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--episodes', type=int, help='of each line at most, two or more')
    parser.add_argument('--jobs', type=int, default=-1, help='episodes at a time')
    parser.add_argument('--rows', type=Path, default=stamp.TOP / 'runs' / 'suites.jsonl',
                        help='file that keeps the episodes')
    parser.add_argument('--docs', type=Path, default=stamp.TOP / 'docs')
    arguments = parser.parse_args()
    outcomes = played(episodes(arguments.episodes), arguments.rows, arguments.jobs)
    results, figures = arguments.docs / 'results', arguments.docs / 'figures'
    for folder in (results, figures):
        folder.mkdir(parents=True, exist_ok=True)
    stamp.store_table(table_of(outcomes), results / 'suites.csv.gz')
    picture(outcomes).savefig(figures / 'suites.png')
    (results / 'suites.md').write_text(
        page(outcomes, stamp.made('suites', sources(), PACKAGES)), encoding='utf-8')


if __name__ == '__main__':
    main()

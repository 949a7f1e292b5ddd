# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The campaigns of docs/results that are those of `evaluate`: random, robustness, baselines."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from dp_swing_ros.evaluation.campaign import manifest
from dp_swing_ros.evaluation.campaign.contestants import Contestant, parse_all
from dp_swing_ros.evaluation.campaign.report import markdown
from dp_swing_ros.evaluation.campaign.rows import Row
from dp_swing_ros.evaluation.campaign.summary import summarise
from dp_swing_ros.evaluation.scenarios import Case, RIGS, SCENARIOS, STRESS
from dp_swing_ros.figures import of_campaign
from dp_swing_ros.pendulum.state import DEFAULT_LINKS

CONFIG = Path(__file__).parents[1] / 'config'
DURATION = 10.0  # [s]
METHODS = ('ilqr', 'ddp', 'mppi')   # the paper's, which the pages compare
TEXTBOOK = f'mppi_textbook=mppi:{CONFIG / "textbook_mppi.yaml"}'


class Campaign(NamedTuple):
    """
    One campaign: who goes through what, and which pictures stand on its page.

    Timed are so many seeds of some scenarios. Pictures are by their names in `of_campaign`, each a
    name of a file and what is written under it.
    """

    title: str
    contestants: Sequence[str]
    scenarios: Sequence[str]
    seeds: range | None                        # of every scenario, None for its own
    timed: dict[str, int]
    pictures: dict[str, tuple[str, str]]

    def description(self) -> dict[str, Any]:
        """Return it as `evaluate` describes it."""
        return manifest.describe(self.parsed(), self.scenarios, self.seeds, None, DURATION,
                                 DEFAULT_LINKS)

    def parsed(self) -> list[Contestant]:
        """Return the contestants; raises ParameterError."""
        return parse_all(self.contestants)

    def episodes(self) -> list[tuple[Contestant, Case]]:
        """Return all episodes, case by case."""
        contestants = self.parsed()
        return [(contestant, case) for name in self.scenarios
                for case in SCENARIOS[name].cases(name, self.seeds, None, DURATION)
                for contestant in contestants]

    def is_timed(self, case: Case) -> bool:
        """Return whether solve times are those of this case."""
        return case.seed < self.timed.get(case.scenario, 0)


CAMPAIGNS = {
    'random': Campaign(
        'Random starts', METHODS, ('random',), None, {'random': 50},
        {'starts': ('random_starts', 'Random starts'), 'settling': ('settling', 'Settling'),
         'solve_times': ('solve_times', 'Solve times')}),
    'robustness': Campaign(
        'Robustness', (*METHODS, 'tvlqr', 'nothing'),
        tuple(name for name in SCENARIOS
              if name not in ('random', 'transitions', *STRESS, *RIGS)), None,
        {'hanging': 20},
        {'criteria': ('robustness', 'Robustness'), 'sweeps': ('sweeps', 'Sweeps')}),
    'baselines': Campaign(
        'Baselines', (*METHODS, 'tvlqr', 'tvlqr_ekf', 'energy_ekf', 'nothing'),
        ('hanging', 'random', 'near_goal', 'pushes'), range(20), {'hanging': 20},
        {'successes': ('baselines', 'Baselines')}),
    'stress': Campaign(
        'Stress', (*METHODS, 'sampled_ilqr', TEXTBOOK, 'tvlqr', 'tvlqr_ekf', 'energy_ekf'), STRESS,
        None, {}, {'sweeps': ('stress', 'What is held, by level')}),
    # hanging to up_down is beyond 30 steps
    'transitions': Campaign(
        'From each equilibrium to each other',
        tuple(f'{name}={name}:horizon=40' for name in METHODS), ('transitions',), None, {},
        {'settling': ('transitions', 'Settling, all ways')}),
    'fresh': Campaign('Fresh seeds', METHODS[:1], ('random',), range(10_000, 20_000), {}, {})}


def page(name: str, rows: Sequence[Row], made: str, figures: Path) -> str:
    """Return the page of a campaign from its rows, and draw its pictures into a folder."""
    campaign = CAMPAIGNS[name]
    summary = summarise(campaign.description(), rows, len(rows))
    drawn = dict(of_campaign(summary, rows))
    for kind, (file, _) in campaign.pictures.items():
        if kind in drawn:
            drawn[kind].savefig(figures / f'{file}.png')
    shown = [f'![{title}](../figures/{file}.png)\n'
             for kind, (file, title) in campaign.pictures.items() if kind in drawn]
    timed = ', '.join(f'seeds 0 to {count - 1} of `{scenario}`'
                      for scenario, count in campaign.timed.items())
    clock = (f'Solve times and misses are those of {timed}, played by one process alone.' if timed
             else 'Solves are not timed here.')
    named = ''.join(f' `{label}` is `{what.replace(str(CONFIG), "config")}`.' for label, what in (
        text.split('=', 1) for text in campaign.contestants
        if '=' in text.partition(':')[0]))
    return markdown(summary, campaign.title, [
        made, f'{len(rows)} episodes of {DURATION:g} s; their rows: '
        f'[{name}.csv.gz]({name}.csv.gz). {clock}{named}\n', *shown])

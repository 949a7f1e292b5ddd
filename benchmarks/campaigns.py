# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of the page of reliability: the campaigns of `evaluate` that are published."""

from collections.abc import Sequence
from dataclasses import replace
import math
from pathlib import Path
from typing import Any, NamedTuple

from dp_swing_ros.control import controllers
from dp_swing_ros.estimators.unknowns import UnknownsParameters
from dp_swing_ros.evaluation.campaign import manifest, report
from dp_swing_ros.evaluation.campaign.contestants import Contestant, parse_all
from dp_swing_ros.evaluation.campaign.rows import Row
from dp_swing_ros.evaluation.campaign.summary import summarise, Summary
from dp_swing_ros.evaluation.scenarios import Case, LIMITS, RIGS, SCENARIOS
from dp_swing_ros.figures import of_campaign
from dp_swing_ros.parameters import fields_of
from dp_swing_ros.pendulum.state import DEFAULT_LINKS
from dp_swing_ros.simulation.plant import PlantParameters
from dp_swing_ros.tables import compact

CONFIG = Path(__file__).parents[1] / 'config'
DURATION = 10.0  # [s]
METHODS = ('ilqr', 'ddp', 'mppi')   # the paper's, which the pages compare
TEXTBOOK = f'mppi_textbook=mppi:{CONFIG / "textbook_mppi.yaml"}'
# certain of pendulum and drive, the estimator learns nothing but the state
CERTAIN = {f'ekf.{field.name}': 0.0 for field in fields_of(UnknownsParameters, DEFAULT_LINKS)}
STATE_ALONE = '+'.join(f'{name}={value}' for name, value in CERTAIN.items())
TOLD = 'told'   # the contestant that has the truth of each plant
OF_ESTIMATOR = (f'state_alone=ilqr:{STATE_ALONE}', f'{TOLD}=ilqr:{STATE_ALONE}',
                'no_estimator=ilqr:estimator=none')
BASELINE = 'tvlqr_ekf'   # the strongest
STRESS = ('strong_pushes', 'tight', 'position_noise', 'unknown_delay', 'all_at_once', 'uptime')


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
        return [(contestant, informed(case) if contestant.label == TOLD else case)
                for name in self.scenarios
                for case in SCENARIOS[name].cases(name, self.seeds, None, DURATION)
                for contestant in contestants]

    def is_timed(self, case: Case) -> bool:
        """Return whether solve times are those of this case."""
        return case.seed < self.timed.get(case.scenario, 0)


def informed(case: Case) -> Case:
    """
    Return a case whose plant the controller is told, with the limits that it has whatever it is.

    Told so the case stays as it is; for other bodies that a contestant has it would be scaled.
    """
    return replace(case, mpc={**vars(LIMITS), **case.mpc, **truth(case)})


def truth(case: Case) -> dict[str, Any]:
    """
    Return every parameter of a plant that an mpc has, too.

    A response k < 1 in each physics step is a lag of -h / ln(1 - k); one that overshoots is none.
    """
    names = controllers.MPC.fields(DEFAULT_LINKS)
    known = {name: value for name, value in case.plant.items() if name in names}
    k = case.plant.get('actuator_response', 1.0)
    return known | ({'motor_time_constant': -PlantParameters().physics_step / math.log1p(-k)}
                    if k < 1 else {})


CAMPAIGNS = {
    'random': Campaign(
        'From random starts', METHODS, ('random',), None, {'random': 50},
        {'starts': ('random_starts', 'Random starts')}),
    'fresh': Campaign('From fresh random starts', METHODS[:1], ('random',), range(10_000, 11_000),
                      {}, {}),
    'robustness': Campaign(
        'With one thing wrong at a time', (*METHODS, *OF_ESTIMATOR, BASELINE),
        tuple(name for name in SCENARIOS
              if name not in ('random', 'transitions', *STRESS, *RIGS)), None,
        {'hanging': 20}, {'criteria': ('robustness', 'Robustness')}),
    'stress': Campaign(
        'Under stress', (*METHODS, TEXTBOOK, BASELINE), STRESS, None, {},
        {'sweeps': ('stress', 'What is held, by level')}),
    'transitions': Campaign(
        'From each equilibrium to each other', METHODS, ('transitions',), range(100), {}, {})}


def page(name: str, rows: Sequence[Row], made: str, figures: Path) -> str:
    """Return the part of a campaign from its rows, and draw its pictures into a folder."""
    campaign = CAMPAIGNS[name]
    summary = summarise(campaign.description(), rows, len(rows))
    drawn = dict(of_campaign(summary, rows))
    for kind, (file, _) in campaign.pictures.items():
        drawn[kind].savefig(figures / f'{file}.png')
    timed = ', '.join(f'seeds 0 to {count - 1} of `{scenario}`'
                      for scenario, count in campaign.timed.items())
    clock = f' Solve times are those of {timed}, played by one process alone.' if timed else ''
    named = ''.join(f' `{label}` is `{what.replace(str(CONFIG), "config")}`.' for label, what in (
        text.split('=', 1) for text in campaign.contestants
        if '=' in text.partition(':')[0]))
    if f'`{TOLD}`' in named:
        named += f' `{TOLD}` also has what is true of each plant: bodies, drive and delay.'
    tables = [held(summary)] if len(campaign.scenarios) > 1 else [
        report.standings(summary.standings)]
    tables += [report.ways(summary.standings)] if any(
        one.ways for one in summary.standings) else []
    tables += [report.SCORES, report.scores(summary)] if any(
        one.criteria for one in summary.scores) else []
    tables += ['Levels that pass, with more than half of their runs, and those that fail:',
               report.breaks(summary)] if any(one.sweeps for one in summary.standings) else []
    return '\n\n'.join([
        f'# {campaign.title}', made.strip(),
        f'{len(rows)} episodes of {DURATION:g} s.{clock}{named} Rows: `results/{name}.csv.gz`.',
        *(f'![{title}](../figures/{file}.png)' for file, title in campaign.pictures.values()),
        *tables, ''])


def held(summary: Summary) -> str:
    """Return a table of who holds how many of each scenario."""
    names = summary.campaign['contestants']
    found = {(one.scenario, one.contestant): report.share(one.held) for one in summary.standings}
    return compact([('scenario', *(f'`{name}`' for name in names)), *(
        (f'`{scenario}`', *(found[scenario, name] for name in names))
        for scenario in summary.campaign['scenarios'])])

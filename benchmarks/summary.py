# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The solvers in short: what README shows, too, from rows of random starts and of robustness."""

from collections.abc import Sequence
import math
from pathlib import Path

import campaigns
import methods
import numpy as np

from dp_swing_ros.evaluation.campaign.report import number, share, SHOWN
from dp_swing_ros.evaluation.campaign.rows import read, Row, solves
from dp_swing_ros.evaluation.campaign.summary import summarise
from dp_swing_ros.evaluation.comparison import rate, Ratio
from dp_swing_ros.tables import compact

NEEDED = 'random', 'robustness'
BEGIN, END = '<!-- made by make results -->\n', '<!-- as far as here -->\n'   # of what README has
TITLES = {'model': 'bodies 25 % off', 'velocity_noise': 'noisy velocities',
          'force_noise': 'noisy forces', 'response': 'slow or overshooting drive',
          'delay': 'known delay of the states', 'pushes': 'pushes'}   # by the criterion


def write(stored: Path, docs: Path) -> None:
    """Write the part, from a folder of rows into one of documents."""
    text = page(*(read(stored / f'{name}.csv.gz') for name in NEEDED))
    (docs / 'results' / 'summary.md').write_text(text, encoding='utf-8')


def page(starts: Sequence[Row], worse: Sequence[Row]) -> str:
    """Return the part, from rows of random starts and of robustness."""
    return (f'# In short\n\n{BEGIN}\n{solvers(starts)}\n\n{offsets(starts)}\n\n{END}\n'
            f'{costs(starts)}\n\n{robustness(worse)}\n')


def into_readme(readme: Path, page: Path) -> None:
    """Put what stands between the markers on a page between those in README."""
    readme.write_text(replaced(readme.read_text(encoding='utf-8'), between(
        page.read_text(encoding='utf-8'))), encoding='utf-8')


def between(text: str) -> str:
    """Return what stands between the markers."""
    return text.partition(BEGIN)[2].partition(END)[0]


def replaced(text: str, new: str) -> str:
    """Return the text with what stands between the markers replaced."""
    before, _, rest = text.partition(BEGIN)
    return f'{before}{BEGIN}{new}{END}{rest.partition(END)[2]}'


def solvers(starts: Sequence[Row]) -> str:
    """Return the table of the solvers."""
    return compact([
        ('solver', 'random starts held', 'median settling',
         f'cost over that of `{methods.FIRST}`, median (5-95 %)', 'solve, p99 of 50 ms'),
        *((f'`{name}`', *of_solver(starts, name)) for name in campaigns.METHODS)])


def of_solver(starts: Sequence[Row], name: str) -> tuple[str, ...]:
    """Return what a solver did from random starts."""
    rows = methods.of(starts, name)
    settled = [row.metrics.settling_time for row in rows if row.metrics.success]
    return (share(rate([row.metrics.success for row in rows])), f'{np.median(settled):.2f} s',
            methods.typical(starts, name) if name != methods.FIRST else '1',
            f'{1e3 * np.quantile(solves(rows), 0.99):.1f} ms')


def offsets(rows: Sequence[Row]) -> str:
    """Return what settled leaves open."""
    offset = [row.metrics.settling_offset for row in rows if row.metrics.success]
    return ('Held: both angles within 0.1 rad and all speeds below 1 over the last second of 10, '
            'and no track strike; settled\nwhere that last stay begins. The cart may still be off '
            f'the centre then: {np.median(offset):.2f} m in the median, {max(offset):.2f} m at '
            'most.')


def beside(cost: Ratio) -> str:
    """Return a ratio of costs, and whether an equivalence test shows that it is about one."""
    same = ', equivalent' if cost.same < SHOWN else ''
    return f'{cost.value:.2f} ({cost.low:.2f}-{cost.high:.2f}){same}'


def costs(rows: Sequence[Row]) -> str:
    """Return what the median of the costs hides."""
    lines = []
    for name in campaigns.METHODS[1:]:
        less, more, later = methods.tails(rows, name)
        lines.append(f'* `{name}`: below {1 / methods.APART:g} times in {100 * less:.0f} % of the '
                     f'starts, above {methods.APART:g} times in {100 * more:.0f} %; whichever is '
                     f'dearer settles {later:.2f} s later there (median).\n  Geometric mean '
                     f'{beside(methods.cost(rows, name))}.')
    return ('Cost: that of the closed loop, Σℓ by the default weights, over that of '
            f'`{methods.FIRST}` from the same start. They differ in the tails\n(in brackets the '
            '95 % interval; equivalent: within 5 %, by a test):\n\n' + '\n'.join(lines))


def robustness(rows: Sequence[Row]) -> str:
    """Return the table of who is robust to what, and what is no part of the solvers."""
    shown = {**{name: f'`{name}`' for name in campaigns.METHODS},
             'told': '`ilqr`, told the truth, filter of the state alone',
             'state_alone': '`ilqr`, told nothing, filter of the state alone',
             'no_estimator': '`ilqr`, told nothing, no filter',
             campaigns.BASELINE: 'strongest baseline that does not plan anew: TVLQR about '
                                 'one offline swing-up, our filter'}
    found = {one.contestant: one for one in summarise(
        campaigns.CAMPAIGNS['robustness'].description(), rows, len(rows)).scores}
    return ("Robustness is the mean of the leaderboards' six criteria, each the share of levels "
            'at which more than half of the runs\nare held:\n\n' + compact([
                ('', 'robustness', *TITLES.values()),
                *((title, *(number(value, 3) for value in (
                    found[name].robustness,
                    *(found[name].criteria.get(one, math.nan) for one in TITLES))))
                  for name, title in shown.items())]) +
            '\n\nAll know the delay of the states. The truth is that of bodies and drive; of '
            'noise, pushes and a drive that overshoots\nthere is nothing to tell.')

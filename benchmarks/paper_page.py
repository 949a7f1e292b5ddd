# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tables of the paper's experiments, as a page."""

from collections.abc import Callable, Mapping, Sequence
import itertools
import math

from campaigns import METHODS
import numpy as np
from paper_ensemble import band, Ensemble, FIRST, NEAR, Trial
from paper_experiments import Key

from dp_swing_ros.evaluation.campaign.report import probability, share
from dp_swing_ros.evaluation.campaign.summary import DROP
from dp_swing_ros.evaluation.comparison import paired, rate
from dp_swing_ros.evaluation.metrics import REST
from dp_swing_ros.evaluation.scenarios import NEARLY
from dp_swing_ros.figures.style import solver_name
from dp_swing_ros.tables import compact

COMPARED = {'upright first [s]': lambda one: one.reached,
            'settled [s]': lambda one: one.metrics.settling_time,
            'force step, 5 s [N]': lambda one: one.roughness,
            'force step, hold [N]': lambda one: one.metrics.smoothness}


Measured = Mapping[Key, Ensemble]
Column = Callable[[Sequence[Trial]], str]


def page(measured: Measured, made: str) -> str:
    """Return the page as Markdown, with the sentence on where it comes from."""
    seeds = max(one.held.runs for one in measured.values())
    tables = [f'## {start[0].upper()}{start[1:]}\n\n{_table(measured, start)}'
              f'{_pairs(measured, start)}'
              for start in dict.fromkeys(key.start for key in measured)]
    return f"""# The paper's experiments in numbers

{made}
What they mean, claim by claim: [the paper's figures and claims](../paper.md); the rows:
`results/paper.csv.gz`.

Seeds 0 to {seeds - 1} of each, in lockstep, first attempts only. A seed moves each state of the
start by chance (standard deviation {NEARLY:g}), for all solvers and set-ups alike, so that no two
seeds are one run. Set-ups: `defaults`, and `paper`: the parameter files `config/paper.yaml`
and `config/paper_euler.yaml`, for MPPI `config/paper_mppi.yaml` too. With `RK4 plant` and `fine
plant`, `config/paper_euler.yaml` is left out: the model takes an RK4 step of 50 ms, and the plant
the same one, or those of 5 ms as by default; with `Euler model` the model alone stays the paper's.
With `20 N` the force is bounded for plant and mpc;
else it is not, or for MPPI by 75 N. With `S_f = S` the final cost is S instead of 1000 S. With
`our` there are, of the defaults, gains (`mppi.feedback`), sampling (samples, updates, temperature,
noise) and cost (chords, the LQR value, weights, horizon). In figures are the first two. Their runs
of seed 0 went through the nodes plant, mpc and logger; each bag holds the states, forces and costs
of the run without ROS, to the bit.

Upright to the end: both angles within 0.1 rad and all speeds under 1 over the last second, in
brackets Wilson's 95 % interval; settled where that last stay begins, upright first where a state
was so. Near: both angles within {NEAR:g} rad, to the end and for a second at least. Dropped: an
angle beyond {DROP:g} rad. Other cells are the median and, in brackets, the 10 and 90 % quantiles
over the runs that tell: settling times over those that were held. Force steps are the standard
deviation of Δu, over the first {FIRST:g} s, which the runs of all solvers have, and over the last
{REST:g} s (hold).

""" + '\n'.join(tables)


def _table(measured: Measured, start: str) -> str:
    columns = COLUMNS | (NEAR_GOAL if 'goal' in start else {})
    rows = [['solver', 'set-up', *columns]]
    rows += [[solver_name(key.solver), key.setup, *(text(one.trials) for text in columns.values())]
             for key, one in measured.items() if key.start == start]
    return compact(rows) + '\n'


def _pairs(measured: Measured, start: str) -> str:
    """Return who differs from whom, seed by seed, within one set-up."""
    rows = [['set-up', 'less', *COMPARED]]
    names = list(METHODS)
    here = sorted(((key, one) for key, one in measured.items() if key.start == start),
                  key=lambda pair: (pair[0].setup, names.index(pair[0].solver)))
    for (a, first), (b, second) in itertools.combinations(here, 2):
        if a.setup == b.setup:
            rows.append([a.setup, f'{solver_name(a.solver)} less {solver_name(b.solver)}', *(
                _difference(first.trials, second.trials, value) for value in COMPARED.values())])
    if len(rows) == 1:
        return ''
    return ('\nSeed by seed, where both tell: the median difference, its 95 % interval '
            '(bootstrap) and the p of the sign test.\n\n' + compact(rows) + '\n')


def _difference(a: Sequence[Trial], b: Sequence[Trial], value: Callable[[Trial], float]) -> str:
    found = paired(np.array([value(one) for one in a]), np.array([value(one) for one in b]))
    if found.pairs < 2:
        return '-'
    return (f'{found.median:+.3g} ({found.low:+.3g} to {found.high:+.3g}), '
            f'p {probability(found.p)}, {found.pairs} pairs')


def held(runs: Sequence[bool]) -> str:
    """Return a count and the interval of its share."""
    return share(rate(runs), 0)


def middle(values: Sequence[float], digits: int) -> str:
    """Return the median and the 10 and 90 % quantiles of the values that are known."""
    known = np.array([value for value in values if not math.isnan(value)])
    if not len(known):
        return '-'
    low, median, high = (f'{float(part):.{digits}f}' for part in band(known))
    return f'{median} ({low}-{high})'


def _of(name: str, digits: int) -> Column:
    return lambda trials: middle([getattr(one.metrics, name) for one in trials], digits)


COLUMNS: dict[str, Column] = {
    'upright to the end': lambda trials: held([one.metrics.success for one in trials]),
    'near to the end': lambda trials: held([one.neared >= 0 for one in trials]),
    'near from [s]': lambda trials: middle([one.neared for one in trials], 2),
    'upright first [s]': lambda trials: middle([one.reached for one in trials], 2),
    'settled [s]': _of('settling_time', 2),
    'force step, 5 s [N]': lambda trials: middle([one.roughness for one in trials], 1),
    'force step, hold [N]': _of('smoothness', 3),
    'largest force [N]': _of('largest_force', 0),
    'largest position [m]': _of('largest_position', 2),
    'cart from the centre at the end [mm]': lambda trials: middle(
        [1e3 * one.end for one in trials], 1)}
NEAR_GOAL: dict[str, Column] = {
    'dropped': lambda trials: held([one.metrics.largest_angle > DROP for one in trials]),
    'largest angle [rad]': _of('largest_angle', 2)}

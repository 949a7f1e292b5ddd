# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Learned dynamics: how much experience holds a pendulum, who holds it by a log, what is predicted.

Run by `make results`.
"""

from collections.abc import Sequence
import math
import time
from typing import Any

from campaigns import DURATION, METHODS
from joblib import delayed, Parallel
from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np
import pandas as pd
from stamp import asked, made, sources, store_table, verdict
from tqdm import tqdm

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.contestants import Contestant, play
from dp_swing_ros.evaluation.campaign.report import (
    difference, failures, interval, number, probability, ratio, share)
from dp_swing_ros.evaluation.campaign.rows import grouped, Row, solves, store
from dp_swing_ros.evaluation.campaign.summary import common, duel, Failure, why
from dp_swing_ros.evaluation.comparison import median, rate, sign_test
from dp_swing_ros.evaluation.scenarios import PERIOD, SCENARIOS
from dp_swing_ros.figures.style import OWN, solver_name, styled
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.learner import FIRST, Learner
from dp_swing_ros.learning.models import learned, parted
from dp_swing_ros.learning.quality import AHEAD, errors
from dp_swing_ros.learning.recorded import stretches_of
from dp_swing_ros.learning.trials import held_for, OUT, trials
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.tables import compact

SEEDS, PREDICTED = 20, 8
# as in its code: settings_cdp.m and dynamics_cdp.m
BODIES = {'cart_mass': 0.5, 'link1_mass': 0.5, 'link2_mass': 0.5, 'link1_length': 0.6,
          'link2_length': 0.6, 'cart_friction': 0.1}
# of the default bodies, which is what one believes in that is told no others
USUAL = {'force_limit': 20.0, 'track_limit': 2.4, 'physics_step': 0.005}
SET_UP = {**BODIES, **USUAL, 'position_noise': 0.01, 'velocity_noise': 0.01}
# of the state, in trials: by the default ones the cart comes home after their end; chosen with the
# seeds 100 to 123
HOMING = (20.0, 30.0, 30.0, 2.0, 2.0, 0.1)
TRIAL, TOTAL = 5.0, 30.0     # [s]
HOLD = 1.0                   # [s] at the end of a trial
TIP = 0.1                    # [m] from its place above the middle of the track
LONG = 15.0                  # [s] of a run without a break
AIM, STRETCH = 30.0, 15.0    # [s] of experience
LOG = 60.0                   # [s] of random forces
NOISES = {'position_noise': 1e-3, 'velocity_noise': 1e-2}
PLANTS = {"PILCO's": SET_UP, 'our own': NOISES}
# of bodies and frictions, as an estimator with a learned model: what is told is known
CERTAIN = {f'ekf.{name}_error': 0.0
           for name in ('body', 'inertia', 'friction', 'cart_dry_friction', 'joint_dry_friction',
                        'balance')}
HELD = {'hanging': 0.95, 'random': 0.9}
SLOWEST = 0.025              # [s] p99 of the solves


def in_trials(solver: str, seed: int) -> list[dict[str, Any]]:
    """Learn in trials until one ends with the tip in its place, too; return a row a trial."""
    learner = Learner({'solver': solver, 'seed': seed, 'state_weights': HOMING})
    began, rows = time.perf_counter(), []
    for trial in trials(learner, {**SET_UP, 'seed': seed}, TRIAL, TOTAL, math.inf):
        rows.append({'solver': solver, 'seed': seed, 'trial': trial.number,
                     'experience': trial.experience[-1], 'held': trial.held,
                     'tip': tip_for(trial.X), 'seconds': time.perf_counter() - began})
        if all(max(row[measure] for row in rows) >= HOLD for measure in ('held', 'tip')):
            break
    return rows


def tip_for(X: Array) -> float:
    """Return for how long [s] the tip has been in its place at the end of states (K, 2n + 2)."""
    lengths = PendulumParameters(**BODIES).lengths
    off = joint_positions(X, lengths)[:, -1] - (0.0, sum(lengths))
    return held_for(np.linalg.norm(off, axis=1), PERIOD, TIP)


def without_break(bodies: str, solver: str, seed: int) -> dict[str, Any]:
    """Learn without a break; return from which experience on it was held to the end."""
    learner, began = Learner({'solver': solver, 'seed': seed}), time.perf_counter()
    trial, = trials(learner, {**PLANTS[bodies], 'seed': seed}, math.inf, LONG, math.inf)
    return {'bodies': bodies, 'solver': solver, 'seed': seed,
            'since': held_since(trial.deviation, LONG),
            'seconds': time.perf_counter() - began}


def held_since(off: Array, duration: float) -> float:
    """Return from when on [s] deviations (K,) are small to the end; not a number for too late."""
    held = held_for(off, PERIOD)
    return duration - held if held >= HOLD else math.nan


def logged(plant: dict[str, Any], duration: float, seed: int) -> list[Experience]:
    """Return what is measured of a plant under random forces."""
    learner = Learner({'seed': seed}, math.inf)
    simulate(plants.plant({**plant, 'seed': seed}), learner, duration)
    X, _, U, h = map(np.array, zip(*learner.experience))
    t = np.append(0.0, np.cumsum(h[:-1]))
    return stretches_of(t, X, t, U, learner.nominal.parameters.limits.track_limit)


def by_log(seed: int, solvers: Sequence[str] = tuple(METHODS)) -> list[Row]:
    """Learn from a log, and hold by it; and by the equations, which are those of the plant."""
    model = learned(Pendulum.of(PendulumParameters()),
                    parted(logged(NOISES, LOG, seed), seed)).to_text()
    contestants = [
        each for solver in solvers for each in (
            Contestant(solver, solver, NOISES, CERTAIN),
            Contestant(f'{solver}, learned', solver, NOISES,
                       {'dynamics': 'learned', 'model': model}))]
    return [play(contestant, case) for scenario in HELD for contestant in contestants
            for case in SCENARIOS[scenario].cases(scenario, range(seed, seed + 1), None, DURATION)]


def predictions(seed: int) -> list[dict[str, Any]]:
    """Return what each model misses of another log of the same plant, a row a model."""
    plant = {**BODIES, **USUAL, **NOISES}
    of_log, other = logged(plant, LOG, seed), logged(plant, LOG / 2, seed + 1000)
    parts, defaults = parted(of_log, seed), Pendulum.of(PendulumParameters())
    short = parted([of_log[0].chosen(np.arange(round(10.0 / 0.05)))], seed)
    tuned = controllers.controller({'seed': seed})
    simulate(plants.plant({**plant, 'seed': seed}), tuned, 10.0)
    found = {
        'the equations, told': Pendulum.of(PendulumParameters(**BODIES)),
        'the equations with the defaults': defaults,
        'these, after the estimator has seen 10 s': Pendulum.of(tuned.belief.problem.physical),
        'learned, 10 s': learned(defaults, short).dynamics,
        f'learned, {LOG:g} s': learned(defaults, parts).dynamics}
    rows = []
    for name, dynamics in found.items():
        speeds, ahead = errors(dynamics, other)
        rows.append({'model': name, 'seed': seed, 'speed': float(np.sqrt(np.mean(speeds ** 2))),
                     'median': float(np.median(ahead)), 'p95': float(np.quantile(ahead, 0.95))})
    return rows


def in_parallel(what: str, calls: Sequence[Any]) -> list[Any]:
    """Return what calls return, in order, and show how far they are."""
    found = Parallel(-1, return_as='generator', batch_size=1)(calls)
    return list(tqdm(found, desc=what, total=len(calls), leave=False, disable=None))


def by_experience(of_trials: pd.DataFrame, measure: str) -> dict[str, dict[float, list[bool]]]:
    """Return whether some trial so far was held, by solver and experience, a seed each."""
    found: dict[str, dict[float, list[bool]]] = {}
    ends = sorted(set(of_trials.experience.round(6)))
    for solver, of in of_trials.groupby('solver', sort=False):
        firsts = [rows.experience[rows[measure] >= HOLD].min() for _, rows in of.groupby('seed')]
        found[solver] = {end: [first <= end + 1e-6 for first in firsts] for end in ends}
    return found


def draw_since(axes: Axes, breakless: pd.DataFrame, begin: float, end: float) -> None:
    """Draw which share of the seeds is held from then on, between two times [s], by solver."""
    for solver, of in breakless.groupby('solver', sort=False):
        since = np.array([begin, *np.sort(of.since.dropna()), end])
        held = [rate((of.since <= time).tolist()) for time in since]
        axes.step(since, [each.successes / each.runs for each in held], where='post',
                  color=OWN[solver], label=solver_name(solver))
        axes.fill_between(since, [each.low for each in held], [each.high for each in held],
                          step='post', color=OWN[solver], alpha=0.12, linewidth=0)


@styled
def picture(of_trials: pd.DataFrame, breakless: pd.DataFrame) -> Figure:
    """Draw experience against what was held, in trials and without a break."""
    figure = Figure(figsize=(10.2, 6.6), layout='constrained')
    (ours, tip), wholes = panels = figure.subplots(2, 2, sharey=True)
    for axes, measure, title in ((ours, 'held', f'a trial ends within {OUT:g} rad'),
                                 (tip, 'tip', f'a trial ends with the tip within {TIP:g} m')):
        for n, (solver, ends) in enumerate(by_experience(of_trials, measure).items()):
            rates = [rate(held) for held in ends.values()]
            shares = np.array([each.successes / each.runs for each in rates])
            low, high = np.array([(each.low, each.high) for each in rates]).T
            axes.errorbar(np.array(list(ends)) + 0.25 * (n - 1), shares,
                          np.maximum([shares - low, high - shares], 0.0), color=OWN[solver],
                          marker='o', markersize=3.5, capsize=2, label=solver_name(solver))
        axes.set(title=title, xlabel='experience [s]')
    for axes, (bodies, of) in zip(wholes, breakless.groupby('bodies', sort=False)):
        draw_since(axes, of, FIRST, LONG)
        axes.set(title=f'{bodies} bodies, without a break: held from here on',
                 xlabel='experience [s]', xlim=(0, LONG))
    for axes in panels.flat:
        axes.axvspan(0, FIRST, color='#f4f6f8')
        axes.grid(True)
    for axes in panels[:, 0]:
        axes.set(ylabel='share of the seeds', ylim=(-0.02, 1.02))
    for axes in (ours, tip):
        axes.axvline(AIM, color='#9aa5b1', linewidth=1)
    ours.legend(loc='center right', fontsize='small')
    figure.suptitle('From random forces to a pendulum that is held')
    return figure


def page(of_trials: pd.DataFrame, breakless: pd.DataFrame, rows: Sequence[Row],
         predicted: pd.DataFrame, made: str) -> str:
    """Return the page as Markdown."""
    return '\n'.join([
        '# Of a simulated plant\n', made,
        'In brackets intervals of 95 %: of shares Wilson, else by the bootstrap. Rows: '
        '`results/learned*.csv.gz`.\n',
        '## From random forces\n', of_limits(of_trials, breakless),
        '## By a log\n', of_log(rows),
        '## DDP against iLQR\n', of_duels(rows), of_learners(of_trials),
        '## What is predicted\n', of_predictions(predicted)])


def of_limits(of_trials: pd.DataFrame, breakless: pd.DataFrame) -> str:
    """Return what became of experience."""
    lines = []
    for measure, name in (('held', f'all angles within {OUT:g} rad'),
                          ('tip', f'the tip within {TIP:g} m of its place')):
        for solver, ends in by_experience(of_trials, measure).items():
            last = rate(ends[max(ends)])
            lines.append((f'`{solver}`', name, *(str(sum(held)) for held in ends.values()),
                          share(last), verdict(sum(ends[max(ends)]) >= 0.9 * last.runs)))
    long = []
    for (bodies, solver), of in breakless.groupby(['bodies', 'solver'], sort=False):
        long.append((bodies, f'`{solver}`', share(rate(of.since.notna().tolist())),
                     interval(median(of.since.to_numpy()), '.1f'), f'{of.since.max():.1f}',
                     share(rate((of.since <= STRETCH).tolist())), f'{of.seconds.median():.1f}'))
    lasts = of_trials.groupby(['solver', 'seed'], sort=False).last().reset_index()
    pace = {solver: (of.seconds / of.experience).median()
            for solver, of in lasts.groupby('solver', sort=False)}
    return '\n'.join([
        "PILCO's set-up (Deisenroth and Rasmussen, ICML 2011; bodies, friction, noise and trials "
        'as in its published code: three masses of 0.5 kg, links of 0.6 m, friction 0.1, noise '
        f'0.01, trials of {TRIAL:g} s; at second hand it is said to need 60 to 90 s in 20 to 30 '
        'trials): told are the limits, 20 N and 2.4 m of track, and that a cart carries a chain '
        'of two links, of about a kilogram and a metre; not masses, lengths, frictions and '
        'gravity. The noises are first taken for the defaults of the estimator. The first '
        f'{FIRST:g} s are random forces; then every transition counts. A trial is held if at its '
        f'end it has been for {HOLD:g} s; a seed ends when it has held one by both. The weights '
        f'`state_weights` are {list(HOMING)}: by the default ones the cart comes home after the '
        'end of a trial. They were chosen with the seeds 100 to 123, which are not these. Seeds '
        f'that had held a trial, of {of_trials.seed.nunique()}, after so much experience; the aim '
        f'is 90 % within {AIM:g} s.\n',
        '![Experience and what became of it](../figures/learned.png)\n',
        compact([('solver', 'held', *(f'{end:.0f} s' for end in ends), 'in the end', ''), *lines]),
        '', 'Without a break, with the default weights, it is held for good after [s], '
        f'of runs of {LONG:g} s; our own bodies with {named(NOISES)}:\n',
        compact([('bodies', 'solver', 'held', 'median [s]', 'longest [s]', f'within {STRETCH:g} s',
                  'computing [s]'), *long]), '',
        'All computing, planning and learning, per second of experience in trials, median: '
        + ', '.join(f'`{solver}` {each:.2f} s' for solver, each in pace.items()) + '.\n'])


def named(values: dict[str, float]) -> str:
    """Return parameters in words."""
    return ', '.join(f'`{name}` {value:g}' for name, value in values.items())


def of_log(rows: Sequence[Row]) -> str:
    """Return who was held by what a log has told."""
    lines = []
    for (scenario, label), of in grouped(rows, lambda row: (
            row.key.scenario, row.key.contestant)).items():
        held = rate([row.metrics.success for row in of])
        settled = median(np.array([row.metrics.settling_time for row in of
                                   if row.metrics.success]))
        p99 = float(np.quantile(solves(of), 0.99))
        aim = '' if 'learned' not in label else verdict(
            held.successes >= HELD[scenario] * held.runs and p99 <= SLOWEST)
        lines.append((scenario, f'`{label}`', share(held), interval(settled, '.2f'),
                      number(p99, 1, 1e3), aim))
    lost = [Failure(*row.key, why(row)) for row in rows if not row.metrics.success]
    return '\n'.join([
        f'Our own plant, with {named(NOISES)}: '
        f'{LOG:g} s of random forces, a structured model of these, and an mpc with its defaults '
        f'else; each seed has a log and a model of its own. Beside it the mpc that is told the '
        f'equations and as certain of bodies and frictions ({named(CERTAIN)}). '
        f'The aim is {100 * HELD["hanging"]:g} and {100 * HELD["random"]:g} % held, '
        f'and a p99 of the solves of {1e3 * SLOWEST:g} ms at most (here with an episode on each '
        'core).\n',
        compact([('scenario', 'contestant', 'held', 'settling [s]', 'solve p99 [ms]', ''),
                 *lines]), '', failures(lost), ''])


def of_duels(rows: Sequence[Row]) -> str:
    """Return how DDP and iLQR compare on the same seeds, learned and told."""
    lines = []
    for scenario, of in grouped(rows, lambda row: row.key.scenario).items():
        by_label = grouped(of, lambda row: row.key.contestant)
        for dynamics in ('', ', learned'):
            names = [f'{solver}{dynamics}' for solver in ('ddp', 'ilqr')]
            if not set(names) <= set(by_label):
                continue
            one = duel(scenario, *names, common(*(by_label[name] for name in names)))
            lines.append((scenario, dynamics[2:] or 'told', str(one.cases), str(one.first_only),
                          str(one.second_only), probability(one.p),
                          difference(one.differences['settling_time']), ratio(one.cost)))
    return '\n'.join([
        'On the same seeds: what only the one held, settling times of what both held, DDP less '
        'iLQR, and the ratio of the closed-loop costs.\n',
        compact([('scenario', 'dynamics', 'cases', 'only DDP', 'only iLQR', 'p', 'settling [s]',
                  'Σℓ, ratio'), *lines]), ''])


def of_learners(of_trials: pd.DataFrame) -> str:
    """Return how DDP and iLQR compare on the same seeds while they learn in trials."""
    lines = []
    for measure, name in (('held', 'all angles'), ('tip', 'the tip')):
        found = by_experience(of_trials, measure)
        for end in list(found['ddp'])[1:]:   # the first trial is random
            ddp, ilqr = (np.array(found[solver][end]) for solver in ('ddp', 'ilqr'))
            only = int(np.sum(ddp & ~ilqr)), int(np.sum(ilqr & ~ddp))
            lines.append((name, f'{end:.0f} s', *map(str, only), probability(sign_test(*only))))
    return '\n'.join([
        'While they learn, in trials as above: seeds of which by then only the one had held a '
        "trial; p by McNemar's exact test.\n",
        compact([('by', 'experience', 'only DDP', 'only iLQR', 'p'), *lines]), ''])


def of_predictions(predicted: pd.DataFrame) -> str:
    """Return what models miss."""
    lines = []
    for model, of in predicted.groupby('model', sort=False):
        lines.append((model, *(interval(median(of[name].to_numpy()), '.3g')
                               for name in ('speed', 'median', 'p95'))))
    return '\n'.join([
        f"PILCO's bodies, sensors as by a log: what models miss of {LOG / 2:g} s of random forces "
        'that they have not seen, from each measured state on; medians over '
        f'{predicted.seed.nunique()} seeds.\n',
        compact([('model', 'speeds a step ahead, RMS [m/s, rad/s]',
                  f'an angle {AHEAD} steps ahead, median [rad]', '95 % [rad]'), *lines]), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Learn, hold and predict, and write the page."""
    count, results, figures = asked(__doc__, argv, SEEDS)
    seeds = range(count)
    runs = [(solver, seed) for seed in seeds for solver in METHODS]
    of_trials = pd.DataFrame([row for rows in in_parallel(
        'trials', [delayed(in_trials)(*run) for run in runs]) for row in rows])
    breakless = pd.DataFrame(in_parallel(
        'without a break', [delayed(without_break)(bodies, *run)
                            for bodies in PLANTS for run in runs]))
    rows = [row for of in in_parallel('by a log', [delayed(by_log)(seed) for seed in seeds])
            for row in of]
    predicted = pd.DataFrame([row for of in in_parallel(
        'predictions', [delayed(predictions)(seed) for seed in seeds[:PREDICTED]]) for row in of])
    for name, frame in (('trials', of_trials), ('long', breakless), ('predictions', predicted)):
        store_table(frame, results / f'learned_{name}.csv.gz')
    store(results / 'learned.csv.gz', rows)
    picture(of_trials, breakless).savefig(figures / 'learned.png')
    (results / 'learned.md').write_text(page(
        of_trials, breakless, rows, predicted, made('learned', sources('learned'))),
        encoding='utf-8')


if __name__ == '__main__':
    main()

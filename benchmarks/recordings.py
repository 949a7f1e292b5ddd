# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What `identify` finds of a real pendulum, and how far that predicts what it did not see.

The recordings are those of test/recordings: links that swing freely on a clamped cart. Positions
alone are identified, of the first five sixths, with nothing told but that the cart is given; the
last sixth is predicted, beside the parameters that the authors of the recordings published, and
beside what `train` learns. Run by `make results`.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
import time
from typing import Any, NamedTuple

from joblib import delayed, Parallel
from matplotlib.figure import Figure
import numpy as np
import pandas
from stamp import folders, made, sources, store_page, TOP

from dp_swing_ros.dynamics.structured import Structured
from dp_swing_ros.figures.style import FAINT, formulas, legend, LINKS, styled
from dp_swing_ros.identification.base_parameters import base_parameters_of_links
from dp_swing_ros.identification.fit import FINE
from dp_swing_ros.identification.given_cart import HEAVY, on_given_cart
from dp_swing_ros.identification.identify import GIVEN, Identified, identify
from dp_swing_ros.identification.segments import Motion
from dp_swing_ros.learning import regression
from dp_swing_ros.learning.models import learned, parted
from dp_swing_ros.learning.recorded import stretches
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.equations import Pendulum, scale_of
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model, rollout
from dp_swing_ros.pendulum.parameters import ACCELERATION, DIRECT, PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.tables import compact

FILES = TOP / 'test' / 'recordings'
PERIOD, STEP = 0.005, 1e-3       # [s] of the recordings, and of predictions
RATES = {200: 1, 50: 4}          # [Hz] of what is identified: every so many rows
SEEN = 5 / 6                     # of a recording
AHEAD = 0.5, 1.0, 2.0            # [s] of predictions
EVERY = 20                       # rows between the states that they begin with
SHOWN = 5.0                      # [s] of the picture
Dynamics = Pendulum | Structured
AROUND, ORDER = 8, 5             # rows to either side, and order, of what smooths a state
PUBLISHED, FOUND, LEARNED = 'published', 'found', 'learned'
SLOW = 50                        # [Hz] of what is learned; states that come faster are left out


class Link(NamedTuple):
    """A link as it was published."""

    mass: float       # [kg]
    centre: float     # [m] from its joint
    length: float     # [m] to the next joint; of the last one nobody needs it
    inertia: float    # [kg m²] about its centre
    friction: float   # [N m s/rad]


# Kaheman et al., HardwareX 15 (2023) e00465, and their data; see test/recordings/README.md
AUTHORS = {
    'single': (9.81, (Link(0.14775, 0.14758, 0.0, 1.0912e-4, 2.2394e-4),)),
    'double': (9.8086, (Link(0.093844, 0.108565, 0.172719, 4.3753e-4, 2.3714e-4),
                        Link(0.137596, 0.116779, 0.0, 1.26883e-3, 1e-5))),
    'triple': (9.8083, (Link(0.258172, 0.16, 0.1728, 1.0004e-4, 1.4771e-3),
                        Link(0.279428, 0.202939, 0.2287, 3.1416e-4, 2.5958e-4),
                        Link(0.118624, 0.183709, 0.0, 1.6874e-4, 1e-5)))}


class Fitted(NamedTuple):
    """What was found of a recording at a rate [Hz], and in what time [s]."""

    found: Identified
    seconds: float


class Predictor(NamedTuple):
    """Dynamics, and the angles (n,) [rad] at which their links stand balanced."""

    dynamics: Dynamics
    balance: Array | float = 0.0


def main(argv: Sequence[str] | None = None) -> None:
    """Identify all, predict, and write page and picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    docs = parser.parse_args(argv).docs
    _, figures = folders(docs)
    recorded = {name: read(name) for name in AUTHORS}
    which = [(name, rate) for name in AUTHORS for rate in RATES]
    fitted = dict(zip(which, Parallel(n_jobs=-1)(
        delayed(fit)(recorded[name], rate) for name, rate in reversed(which))[::-1]))
    models = dict(zip(AUTHORS, Parallel(n_jobs=-1)(
        delayed(trained)(recorded[name], fitted[name, SLOW].found)
        for name in reversed(AUTHORS))[::-1]))
    rows = pandas.DataFrame([row for name in AUTHORS for row in predicted(recorded[name], {
        PUBLISHED: pendulum(as_rods(name)),
        **{f'{FOUND} at {rate} Hz': as_found(fitted[name, rate].found) for rate in RATES},
        LEARNED: Predictor(models[name])}, name)])
    picture(recorded['double'], {
        PUBLISHED: pendulum(as_rods('double')),
        FOUND: as_found(fitted['double', 200].found)}).savefig(figures / 'recordings.png')
    store_page('recordings', rows, page(rows, fitted), docs)


def read(name: str) -> Array:
    """Return a recording: positions and speeds of its links (K, 2n)."""
    found: Array = pandas.read_csv(FILES / f'{name}.csv.gz').to_numpy()[:, 1:]
    return found


def fit(X: Array, rate: int) -> Fitted:
    """Identify what is seen of a recording (K, 2n) at a rate [Hz]."""
    links = X.shape[1] // 2
    seen = motion_of(X[:round(SEEN * len(X)):RATES[rate], :links], rate)
    began = time.perf_counter()
    found = identify([seen], PendulumParameters(links=links), cart=GIVEN)
    return Fitted(found, time.perf_counter() - began)


def trained(X: Array, found: Identified) -> Structured:
    """
    Return what `train` learns of what is seen of a recording (K, 2n), told what was identified.

    It needs speeds, which are those of `smoothed`, and takes the cart's motion as given.
    """
    links = X.shape[1] // 2
    seen = smoothed(X[:round(SEEN * len(X))])[AROUND:-AROUND:RATES[SLOW]]
    physical = group(PendulumParameters, {**bodies(found), 'drive': ACCELERATION})
    scale, at_rest = scale_of(physical), np.zeros((len(seen), 1))
    parts = parted(stretches(
        on_given_cart(motion_of(seen[:, :links], SLOW), physical.masses[0]),
        np.hstack((at_rest, seen[:, links:])), DIRECT, scale), 0, scale)
    model = learned(Pendulum.of(physical, scale=scale), parts, scale=scale)
    return model.dynamics.sized(scale.inverse).with_creep(regression.FINE.creep).sized(scale)


def motion_of(theta: Array, rate: float) -> Motion:
    """Return the motion of links (K, n) at a rate [Hz] on a cart that stands still."""
    t, none = np.arange(len(theta)) / rate, np.zeros(0)
    return Motion(t, np.column_stack((np.zeros(len(theta)), theta)), none, none, none, np.inf)


def bodies(found: Identified) -> dict[str, Any]:
    """Return what was found as parameters of a pendulum on a cart that stands still."""
    return {**found.values, 'links': len(found.joints), 'cart_mass': HEAVY}


def as_rods(name: str) -> dict[str, Any]:
    """
    Return what was published as parameters of a pendulum that moves as it.

    Of each link with what it carries, first and second moments about its joint are those of a rod
    with an inertia factor, which carries rods.
    """
    g, links = AUTHORS[name]
    values = {'links': len(links), 'cart_mass': HEAVY, 'gravity': g}
    carried = of_rods = 0.0   # [kg] by a link
    for i, link in reversed(list(enumerate(links, 1))):
        first = link.mass * link.centre + carried * link.length
        second = link.inertia + link.mass * link.centre ** 2 + carried * link.length ** 2
        length = link.length or 1.5 * second / first
        mass = 2 * (first / length - of_rods)
        values.update({
            f'link{i}_mass': mass, f'link{i}_length': length, f'joint{i}_friction': link.friction,
            f'link{i}_inertia_factor': 12 * (second / length ** 2 - of_rods) / mass - 3})
        carried, of_rods = carried + link.mass, of_rods + mass
    return values


def as_found(found: Identified) -> Predictor:
    """Return the dynamics that were found of a recording."""
    return pendulum(bodies(found), found.creep)


def pendulum(values: Mapping[str, Any], creep: float = FINE.creep) -> Predictor:
    """Return the dynamics of parameters, with dry friction that begins over a creep, scaled."""
    physical = group(PendulumParameters, values)
    return Predictor(Pendulum.of(physical, creep, scale_of(physical)), np.array(
        [values.get(f'link{i}_balance', 0.0) for i in range(1, physical.links + 1)]))


def predict(predictor: Predictor, X_0: Array, duration: float) -> Array:
    """Return the angles after each STEP (T + 1, n) from positions and speeds X_0 (2n,)."""
    model = Model(predictor.dynamics, INTEGRATORS['rk4'], STEP)
    theta, omega = np.split(X_0, 2)
    X = rollout(model, np.concatenate(([0.0], theta - predictor.balance, [0.0], omega)),
                np.zeros(round(duration / STEP)))
    angles: Array = X[:, 1:len(theta) + 1] + predictor.balance
    return angles


def errors(predictor: Predictor, X: Array, starts: Array, first: Sequence[int]) -> Array:
    """
    Return RMS errors [rad] of predictions AHEAD (3, n).

    They begin with states `starts` (K, 2n), at the rows `first` of a recording X (K, 2n).
    """
    links, steps = X.shape[1] // 2, np.round(np.divide(AHEAD, STEP)).astype(int)
    rows = np.round(np.divide(AHEAD, PERIOD)).astype(int)
    missed = [predict(predictor, starts[row], AHEAD[-1])[steps] - X[row + rows, :links]
              for row in first]
    rms: Array = np.sqrt(np.mean(np.square(missed), axis=0))
    return rms


def smoothed(X: Array) -> Array:
    """Return states (K, 2n) with the speeds of polynomials through the positions around."""
    rows, links = np.arange(-AROUND, AROUND + 1), X.shape[1] // 2
    slope = np.linalg.pinv(np.vander(rows * PERIOD, ORDER + 1))[-2]
    speeds = [np.convolve(angle, slope[::-1], mode='same') for angle in X[:, :links].T]
    return np.column_stack((X[:, :links], *speeds))


def predicted(X: Array, which: Mapping[str, Predictor], name: str) -> list[dict[str, Any]]:
    """Return the errors of predictions [mrad] of what was not seen of a recording, a row each."""
    first = range(round(SEEN * len(X)), len(X) - round(AHEAD[-1] / PERIOD) - AROUND, EVERY)
    return [{'recording': name, 'begin': begin, 'parameters': parameters,
             'predictions': len(first), 'ahead': ahead,
             **{f'theta{i}': 1e3 * rms for i, rms in enumerate(of_joints, 1)}}
            for begin, starts in (('as recorded', X), ('smoothed', smoothed(X)))
            for parameters, predictor in which.items()
            for ahead, of_joints in zip(AHEAD, errors(predictor, X, starts, first))]


def page(rows: pandas.DataFrame, fitted: Mapping[tuple[str, int], Fitted]) -> str:
    """Return the page as Markdown."""
    lines = [
        '# What is found of a real pendulum', '', made('recordings', sources('recordings')),
        'Recordings of the University of Washington of one, two and three links that swing on a '
        'clamped cart ([source](../../test/recordings/README.md)). What `identify --cart given` '
        'makes of the positions in the first five sixths, told nothing else, predicts the last '
        'sixth, beside the parameters that the authors published, and beside what `train` learns '
        f'of the same at {SLOW} Hz, told what `identify` found. Errors are RMS [mrad] of each '
        f'angle, from a state every {EVERY * PERIOD:g} s: with the speeds as they were recorded '
        '(filtered, and off by 20 to 60 mrad/s), or with those of a polynomial of order '
        f'{ORDER} through the positions of {2 * AROUND * PERIOD:g} s around, which are also those '
        'that is learned from.', '']
    best, table = better(rows), [['recording', 'from a state', 'parameters', *(
        f'after {ahead:g} s' for ahead in AHEAD)]]
    for (name, begin, parameters), of in rows.groupby(
            ['recording', 'begin', 'parameters'], sort=False):
        table.append([name, begin, parameters, *(
            ', '.join(f'**{row[angle]:.2f}**' if best[name, begin, ahead, angle] == parameters
                      else f'{row[angle]:.2f}' for angle in angles_of(row))
            for ahead, row in of.set_index('ahead').iterrows())])
    lines += [compact(table), '', said(best), '',
              '![recorded and predicted angles of the double pendulum](../figures/recordings.png)',
              '', f'The double pendulum over {SHOWN:g} s of that which was not seen.', '',
              '## What was found', '',
              'What motion tells of links on a given cart, whatever the masses are as a whole, '
              'with intervals of 95 % as `identify` prints them. '
              'Moments are those of a link with all that it carries at its tip.', '']
    table = [['recording', 'what', PUBLISHED, *(f'{rate} Hz' for rate in RATES), 'unit']]
    for name in AUTHORS:
        published = base_parameters_of_links(group(PendulumParameters, as_rods(name)))
        for what, (value, unit) in published.items():
            ours = [fitted[name, rate].found.base[what] for rate in RATES]
            table.append([name, what, f'{value:.4g}', *(
                f'{of.value:.4g} ({of.low:.4g} to {of.high:.4g})' for of in ours), unit])
    lines += [compact(table), '',
              'Error within the segments that were fitted, RMS, and the time that it took:', '']
    table = [['recording', 'rate [Hz]', 'error [mrad]', 'time [s]', 'ended at a bound',
              'not told by these motions']]
    for (name, rate), (found, seconds) in fitted.items():
        rms = ', '.join(f'{1e3 * each:.2f}' for each in found.rms('after')[found.joints])
        table.append([name, str(rate), rms, f'{seconds:.0f}', ', '.join(found.at_bound) or '-',
                      ', '.join(found.unidentified) or '-'])
    return '\n'.join([*lines, compact(table)]) + '\n'


def said(best: Mapping[tuple[str, str, float, str], str]) -> str:
    """Return in words where the published parameters predict best."""
    theirs = [f'{name} {begin}, θ{angle[-1]} after {ahead:g} s'
              for (name, begin, ahead, angle), by in best.items() if by == PUBLISHED]
    return (f'The best of each is bold. Of {len(best)} the published parameters have '
            f'{len(theirs)}{": " * bool(theirs)}{"; ".join(theirs)}. What is learned has '
            f'{list(best.values()).count(LEARNED)}.')


def angles_of(row: Any) -> list[str]:
    """Return the columns of the angles that a row has."""
    return [name for name in row.index if name.startswith('theta') and np.isfinite(row[name])]


def better(rows: pandas.DataFrame) -> dict[tuple[str, str, float, str], str]:
    """Return which parameters predict best, by recording, state to begin with, time and angle."""
    found = {}
    for (name, begin, ahead), of in rows.groupby(['recording', 'begin', 'ahead'], sort=False):
        of = of.set_index('parameters')
        for angle in angles_of(of.iloc[0]):
            found[name, begin, ahead, angle] = of[angle].idxmin()
    return found


@styled
def picture(X: Array, which: Mapping[str, Dynamics]) -> Figure:
    """Draw recorded and predicted angles of what was not seen, from one state."""
    links, start = X.shape[1] // 2, round(SEEN * len(X))
    X_0, rows = smoothed(X)[start], start + np.arange(round(SHOWN / PERIOD))
    figure = Figure(figsize=(9.6, 1.0 + 2.2 * links), layout='constrained')
    panels = figure.subplots(links, 1, sharex=True, squeeze=False)[:, 0]
    for i, axes in enumerate(panels):
        axes.plot((rows - start) * PERIOD, X[rows, i], color=FAINT, linewidth=4.0,
                  label='recorded')
        for (label, predictor), dashes in zip(which.items(), (':', '-')):
            theta = predict(predictor, X_0, SHOWN)[:, i]
            axes.plot(np.arange(len(theta)) * STEP, theta, dashes, color=LINKS[i], label=label)
        axes.set_ylabel(f'{formulas(links)[1 + i]} [rad]')
        axes.grid(True)
        legend(axes)
    panels[-1].set_xlabel('time [s]')
    figure.suptitle(f'A real double pendulum: {SHOWN:g} s that were not seen, from one state')
    return figure


if __name__ == '__main__':
    main()

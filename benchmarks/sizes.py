# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pendulums of any size, at any rate: the defaults, told nothing but bodies and limits."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from ablation import Ablated, ONE_A_STEP
from campaigns import CONFIG, METHODS
import numpy as np

from dp_swing_ros.control.controllers import MPC
from dp_swing_ros.evaluation.campaign.contestants import Contestant, key, parse
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.campaign.rows import Row
from dp_swing_ros.evaluation.comparison import rate as held_of
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.equations import own_units
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import DEFAULT_LINKS, LINKS
from dp_swing_ros.tables import compact

LENGTHS = (0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0)   # [m] of each of two links
RATES = (20.0, 50.0, 100.0, 200.0, 500.0)   # [Hz]
FAST = RATES[1:]
TRACK = 2.4              # lengths of a link, either way: that of the default bodies
SEEDS = range(8)
DURATION = {1: 10.0, 2: 10.0, 3: 20.0}   # [s] by links, of the default bodies; of others likewise
SHORT = 6.0   # [s] of the sizes, of which none takes a second swing
DRAWN, COUNT = 40, 100   # bodies at random: a seed of its own, and how many
SURE, LIKELY = 0.5, 0.7   # λT up to which all are to be held, and nearly all
ALIKE, SLOWER = 0.15, 0.1   # of a settling time that others are to be within, and not above


# masses [kg] and lengths [m] of the multi-arm pendulum on a cart of the University of Washington,
# as uniform rods: Kaheman et al., "The experimental multi-arm pendulum on a cart", HardwareX 15,
# 2023; a last link is twice as long as to its centre of mass
PUBLISHED = {1: ((0.148, 0.295),), 2: ((0.0938, 0.173), (0.138, 0.234)),
             3: ((0.258, 0.173), (0.279, 0.229), (0.119, 0.367))}
LAB = {'cart_mass': 0.5, 'track_limit': 0.5}   # told beside them


class Pendulum(NamedTuple):
    """Some bodies by parameters of plant and mpc alike, and the rates of their states [Hz]."""

    name: str
    values: Mapping[str, Any]
    rates: Sequence[float]
    plant: Mapping[str, Any] = {}   # of which the mpc is told nothing
    scenario: str = 'hanging'
    seeds: range = SEEDS
    duration: float = 0.0           # [s] of the default bodies; 0: by links

    @property
    def time(self) -> float:
        """Return its own unit of time [s], 1/λ."""
        return own_units(group(PendulumParameters, self.values)).time

    def contestant(self, rate: float, solver: str) -> Contestant:
        """Return a solver with it."""
        return Contestant(f'{solver}, {self.name}, {rate:g} Hz', solver,
                          {**self.values, **self.plant, 'rate': rate}, dict(self.values))


def two(first: float, second: float, **others: float) -> dict[str, Any]:
    """Return the parameters of two links of lengths [m]."""
    return {'link1_length': first, 'link2_length': second, **others}


SIZES = [Pendulum(f'{length:g} m', two(length, length), RATES, duration=SHORT)
         for length in LENGTHS]
OTHERS = [
    Pendulum('0.15 and 0.25 m', two(0.15, 0.25), FAST),
    Pendulum('0.35 and 0.2 m', two(0.35, 0.2), FAST),
    *(Pendulum(f'0.3 m, 1 kg, cart of {mass:g} kg', two(0.3, 0.3, cart_mass=mass,
                                                        track_limit=0.3 * TRACK), FAST)
      for mass in (0.1, 1.0, 10.0)),
    *(Pendulum(f'published, links {n}', {
        'links': n, **LAB, **{f'link{i}_{name}': value for i, link in enumerate(links, 1)
                              for name, value in zip(('mass', 'length'), link)}}, FAST)
      for n, links in PUBLISHED.items()),
    Pendulum('0.32, 0.42 and 0.48 m', {'links': 3, 'link3_length': 0.48, **two(0.32, 0.42)}, FAST)]


def drawn(number: int) -> Pendulum:
    """Return a pendulum as nobody chose it: links, lengths, masses and rate at random."""
    rng = np.random.default_rng((DRAWN, number))
    links = int(rng.integers(1, 4))
    lengths = np.exp(rng.uniform(*np.log((0.1, 2.0))) + rng.uniform(-0.5, 0.5, links))
    masses = np.exp(rng.uniform(*np.log((0.05, 2.0))) + rng.uniform(-0.7, 0.7, links))
    values = {'links': links, 'cart_mass': masses.sum() * 10 ** rng.uniform(-1, 1), **{
        f'link{i}_{name}': value for i, each in enumerate(zip(masses, lengths), 1)
        for name, value in zip(('mass', 'length'), each)}}
    values = {name: float(f'{value:.3g}') if name != 'links' else value
              for name, value in values.items()}
    period = rng.uniform(0.05, SURE) * Pendulum('', values, ()).time
    return Pendulum(f'drawn {number}', values, (float(f'{1 / period:.4g}'),),
                    seeds=range(number, number + 1))


LAB_RIG = parse(f'ilqr:{CONFIG / "lab_rig.yaml"}')
RIGS = [
    Pendulum('`config/lab_rig.yaml`', dict(sorted(LAB_RIG.mpc.items())), (50.0, 100.0, 200.0),
             dict(sorted(LAB_RIG.plant.items()))),
    Pendulum('`rig_all`, 0.2 m', two(0.2, 0.2), (50.0, 100.0, 200.0), scenario='rig_all',
             seeds=range(100))]
WAYS_AT = 50.0, 200.0, 500.0   # [Hz]
KEPT, EACH, FINE = (   # ways to answer states that come faster than steps
    'a solve a step, feedback in between',
    'a solve for each state, plans shifted by parts of a step',
    'a step for each period, as many as last as long')
RANDOM = [drawn(number) for number in range(COUNT)]
ALL = (*SIZES, *OTHERS, *RIGS, *RANDOM)


def of_pendulum(one: Pendulum, rate: float, solver: str) -> Iterator[tuple[Contestant, Case]]:
    """Yield the episodes of a solver with a pendulum at a rate [Hz]."""
    contestant = one.contestant(rate, solver)
    links = one.values.get('links', DEFAULT_LINKS)
    for case in SCENARIOS[one.scenario].cases(
            one.scenario, one.seeds, None, one.duration or DURATION[links], links):
        yield contestant, case


def of_way(way: str, rate: float) -> Iterator[tuple[Contestant, Case]]:
    """Yield the episodes of iLQR with links of 0.2 m that answers states in a way."""
    small = SIZES[2]
    for contestant, case in of_pendulum(small, rate, 'ilqr'):
        label = contestant.label if way == KEPT else f'{contestant.label}, {way}'
        mpc = dict(contestant.mpc)
        if way == FINE:
            usual = MPC.complete(mpc)
            mpc |= {'step': 1 / rate, 'horizon': round(usual['horizon'] * usual['step'] * rate)}
        yield (Ablated(label, contestant.name, contestant.plant, mpc, ONE_A_STEP) if way == EACH
               else replace(contestant, label=label, mpc=mpc)), case


def episodes() -> list[tuple[Contestant, Case]]:
    """Return the episodes of all cells."""
    return [episode for one in ALL for rate in one.rates for solver in METHODS
            for episode in of_pendulum(one, rate, solver)] + [
                episode for way in (EACH, FINE) for rate in WAYS_AT
                for episode in of_way(way, rate)]


def cell(one: Pendulum, rate: float, found: Mapping[Any, Row]) -> str:
    """Return how many each solver held at a rate [Hz], and λT."""
    held = [sum(found[key(*each)].metrics.success for each in of_pendulum(one, rate, solver))
            for solver in METHODS]
    return f'{" / ".join(map(str, held))} ({1 / (rate * one.time):.3f})'


def settles(one: Pendulum, runs: Iterable[tuple[Contestant, Case]],
            found: Mapping[Any, Row]) -> float:
    """Return the median settling time of runs in the pendulum's own units; NaN of none."""
    metrics = [found[key(*each)].metrics for each in runs]
    return float(np.median(
        [of.settling_time for of in metrics if of.success] or [np.nan])) / one.time


def settling(one: Pendulum, rate: float, found: Mapping[Any, Row]) -> str:
    """Return the median settling times of each solver in the pendulum's own units."""
    times = [settles(one, of_pendulum(one, rate, solver), found) for solver in METHODS]
    return ' / '.join('-' if np.isnan(each) else f'{each:.1f}' for each in times)


def of_ways(found: Mapping[Any, Row]) -> str:
    """Return a table of the ways to answer states that come faster than steps."""
    lines = []
    for way in (KEPT, EACH, FINE):
        runs = [list(of_way(way, rate)) for rate in WAYS_AT]
        held = [sum(found[key(*each)].metrics.success for each in of) for of in runs]
        times = [settles(SIZES[2], of, found) for of in runs]
        lines.append((way, *(f'{count} ({time:.1f})' for count, time in zip(held, times))))
    return compact([('way', *(f'{rate:g} Hz' for rate in WAYS_AT)), *lines])


def verdict(found: Mapping[Any, Row]) -> str:
    """Return in words how settling goes with size and rate."""
    sizes = {(one.name, rate, solver): settles(one, of_pendulum(one, rate, solver), found)
             for one in SIZES for rate in FAST for solver in METHODS}
    middle = float(np.median(list(sizes.values())))
    low, high = (100 * (each(sizes.values()) / middle - 1) for each in (min, max))
    slower = []
    for one in (*SIZES, *OTHERS, *RIGS):
        rates = [rate for rate in one.rates if 1 / (rate * one.time) <= SURE]
        for solver in METHODS:
            times = [settles(one, of_pendulum(one, rate, solver), found) for rate in rates]
            worst = max((100 * (later / earlier - 1), rate, before)
                        for n, (later, rate) in enumerate(zip(times, rates))
                        for earlier, before in zip(times[:n], rates))
            if worst[0] > 100 * SLOWER:
                slower.append(f'{one.name}, `{solver}`, {worst[0]:+.0f} % ({worst[2]:g} to '
                              f'{worst[1]:g} Hz)')
    met = 'met' if max(-low, high) <= 100 * ALIKE else '**missed**'
    return (f'From {FAST[0]:g} Hz on, the medians of all sizes and solvers are within {low:+.0f} '
            f'and {high:+.0f} % of their median (aim: ±{100 * ALIKE:g} %, {met}). Of the '
            f'{len(METHODS) * len((*SIZES, *OTHERS, *RIGS))} bodies by solvers of the tables here '
            f'and below, {len(slower)} settle more than {100 * SLOWER:g} % later at some rate '
            f'than at a lower one (aim: none{", met" if not slower else ", **missed**"})'
            f'{": " * bool(slower)}{"; ".join(slower)}.')


Cell = Callable[[Pendulum, float, Mapping[Any, Row]], str]


def table(pendulums: Sequence[Pendulum], what: Cell, found: Mapping[Any, Row]) -> str:
    """Return a table of pendulums by rates."""
    rates = pendulums[0].rates
    return compact([('bodies', '1/λ [ms]', *(f'{rate:g} Hz' for rate in rates)), *(
        (one.name, f'{1e3 * one.time:.0f}', *(what(one, rate, found) for rate in rates))
        for one in pendulums)])


def in_short(found: Mapping[Any, Row]) -> str:
    """Return what is held up to SURE, up to LIKELY, and beyond, over all pendulums."""
    lines = []
    for words, low, high in (
            (f'λT ≤ {SURE:g}', 0.0, SURE), (f'{SURE:g} < λT ≤ {LIKELY:g}', SURE, LIKELY),
            (f'λT > {LIKELY:g}', LIKELY, np.inf)):
        runs = [found[key(*each)].metrics.success for one in (*SIZES, *OTHERS)
                for rate in one.rates if low < 1 / (rate * one.time) <= high
                for solver in METHODS for each in of_pendulum(one, rate, solver)]
        lines.append((words, share(held_of(runs))))
    return compact([('period', 'held'), *lines])


def of_random(found: Mapping[Any, Row]) -> str:
    """Return a table of what is held of the bodies that were drawn, by links."""
    lines = []
    for links in LINKS:
        alike = [one for one in RANDOM if one.values['links'] == links]
        lines.append((str(links), str(len(alike)), *(share(held_of(
            [found[key(*each)].metrics.success for one in alike for rate in one.rates
             for each in of_pendulum(one, rate, solver)])) for solver in METHODS)))
    return compact([('links', 'bodies', *(f'`{name}`' for name in METHODS)), *lines])


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from the rows of all runs."""
    found = {row.key: row for row in rows}
    return '\n\n'.join([
        '# Sizes and rates', made.strip(),
        f'From nearly hanging, in lockstep without ROS, seeds 0 to {SEEDS.stop - 1}, for as long '
        f'as {DURATION[2]:g} s are with links of 1 m, {SHORT:g} s in the first tables and '
        f'{DURATION[3]:g} s with three links; told are bodies and, of some of the others below, '
        f'the track. Held of {len(SEEDS)}: {" / ".join(f"`{name}`" for name in METHODS)}, and in '
        "brackets λT, the period of the states in the pendulum's own unit of time, 1/λ. In square "
        'brackets 95 % intervals (Wilson). Rows: `results/sizes.csv.gz`.',
        'All of these and of the other bodies together:', in_short(found),
        'Two links of the same length each, 0.5 kg, a cart of 1 kg:',
        table(SIZES, cell, found), 'Median settling in units of 1/λ:',
        table(SIZES, settling, found), verdict(found),
        '## Other bodies', table(OTHERS, cell, found),
        'Median settling in units of 1/λ:', table(OTHERS, settling, found),
        'Published are masses and lengths, as uniform rods, of Kaheman et al., "The experimental '
        'multi-arm pendulum on a cart", HardwareX 15, 2023, with a cart of '
        f'{LAB["cart_mass"]:g} kg and ±{LAB["track_limit"]:g} m of track; three links of 0.32, '
        '0.42 and 0.48 m are about '
        'as long as those of Glück, Eder and Kugi, "Swing-up control of a triple pendulum on a '
        'cart with experimental validation", Automatica 49, 2013.',
        '## States faster than steps',
        'Three ways to answer them, by `ilqr` with links of 0.2 m: held of '
        f'{len(SEEDS)}, and in brackets the median settling in units of 1/λ. The first is what '
        'the mpc does; the last takes as many times longer as its steps are more.',
        of_ways(found),
        '## Bodies at random',
        f'{len(RANDOM)} pendulums that nobody chose: one to three links around a length from 0.1 '
        'to 2 m and a mass from 0.05 to 2 kg, which differ by a factor of up to 2.7 and 4 among '
        'each other, a cart of a tenth to ten times their mass, and a rate with λT from 0.05 to '
        f'{SURE:g}; each from one start.', of_random(found),
        '## Small rigs',
        'A rig of laboratory size, of which the mpc is told bodies, limits and the back EMF of '
        'its motor, but not that its encoders are coarse and give no velocities; and '
        f'[`rig_all`](../evaluation.md#scenarios) for links of 0.2 m, {len(RIGS[1].seeds)} seeds, '
        'of which it is told only the nominal bodies.',
        table(RIGS, cell, found), 'Median settling in units of 1/λ:',
        table(RIGS, settling, found), ''])

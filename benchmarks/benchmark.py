# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure this package and its peers on the same problems, in turn, and write the page about it.

Run by `make results`, on a machine that must do nothing else: benchmark.md, .json and
a picture. What is not installed is left out, and the page says so.
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import ctypes
import json
import os
from pathlib import Path
import sys
from typing import Any

import benchmark_figures
import benchmark_page
from campaigns import METHODS
from stamp import made, sources, TOP
from timing import has, median, Missing, race, ratio, Work

from dp_swing_ros import provenance
from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.state import Array

PEERS = ('libcrocoddyl', 'libmim-solvers', 'casadi', 'comma-deps-acados', 'libaligator', 'torch',
         'pytorch_mppi', 'hydrax')   # by what pip calls them
SAMPLES = (256, 1024, 8192, 65536)
KINDS = 'compiled', 'closed'


def compared(works: dict[str, Work], rounds: int) -> dict[str, Any]:
    """Race works whose first name is ours: the times [s] of all, and how many of ours each is."""
    times = race(works, rounds)
    return {'rounds': rounds, 'seconds': {name: median(t)._asdict() for name, t in times.items()},
            'ratios': {name: ratios_of(name, times) for name in works}}


def ratios_of(name: str, times: dict[str, Array]) -> dict[str, dict[str, float]]:
    """Return how many times slower a contender is than each of ours."""
    ours = [other for other in times if other.split(', ')[0] in METHODS]
    return {other: ratio(times[name], times[other])._asdict() for other in ours}


def gradient(rounds: int) -> dict[str, Any]:
    """Compare iterations with crocoddyl, mim-solvers, acados and aligator."""
    import peers_gradient
    return {contest: compared(works, rounds)
            for contest, works in peers_gradient.contests().items()}


def growth(rounds: int) -> dict[str, Any]:
    """Compare iterations over longer horizons, and with more links."""
    import peers_gradient
    found: dict[str, Any] = {}
    for by, count, works in peers_gradient.growing():
        found.setdefault(by, {})[str(count)] = compared(works, max(rounds // 2, 3))
    return found


def whole_solves(rounds: int) -> dict[str, Any]:
    """Compare solves to the same cost."""
    from peers_solvers import solves
    return solves(controllers.problem({}), max(rounds // 8, 3))


def sampling(rounds: int) -> dict[str, Any]:
    """Compare updates with pytorch_mppi."""
    from peers_sampling import our_ticks, torch_tick

    problem, found = controllers.problem({}), {}
    for samples in SAMPLES:
        few = min(rounds, max(12, rounds * 1024 // samples))
        works = our_ticks(problem, samples)
        for kind in KINDS:
            for threads in (1, 2):
                works[f'pytorch_mppi {kind}, {threads} threads'] = torch_tick(
                    problem, samples, kind, threads)
        found[str(samples)] = compared(works, few)
    return found


def hydrax(rounds: int) -> dict[str, Any]:
    """Compare updates with the methods of hydrax."""
    import peers_hydrax
    from peers_sampling import our_ticks

    problem, samples = controllers.problem({}), peers_hydrax.SAMPLES
    return compared({**our_ticks(problem, samples), **{
        f'hydrax {name}': peers_hydrax.tick(problem, name, samples)
        for name in peers_hydrax.METHODS}}, rounds)


def gpu(rounds: int) -> dict[str, Any]:
    """Measure updates on a GPU."""
    from peers_sampling import gpu_ticks
    device, works = gpu_ticks()
    return {'device': device, **compared(works, rounds)}


def limits(rounds: int) -> dict[str, Any]:
    """Measure how near the processor's limit ours come."""
    import limit
    return limit.measure(rounds)


def starting(rounds: int) -> dict[str, Any]:
    """Measure the start of the node."""
    from startup import start_ups
    return {name: start_ups(max(rounds // 8, 3), name) for name in METHODS}


FAMILIES: dict[str, Callable[[int], dict[str, Any]]] = {
    'gradient': gradient, 'growth': growth, 'solves': whole_solves, 'sampling': sampling,
    'hydrax': hydrax, 'gpu': gpu, 'limit': limits, 'startup': starting}


@contextmanager
def quiet() -> Iterator[None]:
    """Drop what C prints: acados has a line for every solve that ends at its last iteration."""
    flush, shown = ctypes.CDLL(None).fflush, os.dup(1)
    with open(os.devnull, 'wb') as nowhere:
        os.dup2(nowhere.fileno(), 1)
    try:
        yield
    finally:
        flush(None)   # what is still in its buffer
        os.dup2(shown, 1)
        os.close(shown)


def main() -> None:
    """Measure, and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rounds', type=int, default=24, help='of each comparison')
    parser.add_argument('--only', nargs='+', choices=FAMILIES, default=list(FAMILIES))
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    arguments = parser.parse_args()
    sys.path.append(str(TOP / 'examples' / 'acados_rti'))   # which need not be installed
    results: dict[str, Any] = {
        'made': made('benchmark', sources('benchmark'),
                     [*provenance.COMPUTING, *filter(has, PEERS)]),
        'rounds': arguments.rounds,
        'missing': {name: 'it is not installed' for name in PEERS if not has(name)}}
    for name in arguments.only:
        print(name, flush=True)
        try:
            with quiet():
                results[name] = FAMILIES[name](arguments.rounds)
        except ImportError as error:
            results['missing'][name] = f'{error.name} is not installed'
        except Missing as error:
            results['missing'][name] = str(error)
    for folder in ('results', 'figures'):
        (arguments.docs / folder).mkdir(parents=True, exist_ok=True)
    path = arguments.docs / 'results' / 'benchmark'
    path.with_suffix('.json').write_text(json.dumps(results, indent=1) + '\n')
    path.with_suffix('.md').write_text(benchmark_page.page(results))
    for name in benchmark_figures.DRAWN.keys() & results.keys():
        draw = benchmark_figures.DRAWN[name]
        draw(results[name]).savefig(
            arguments.docs / 'figures' / f'benchmark_{draw.__name__}.png')


if __name__ == '__main__':
    main()

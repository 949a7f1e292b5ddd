# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the kernels do is counted right, and the page about the processor's limit says it."""

import dis
import gc
import json

import benchmark_page
import limit
from numba import typeof
import numpy as np
import operations
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.kernels import trigonometry, unrolling
from dp_swing_ros.kernels.compilation import mapped
from dp_swing_ros.pendulum.model import accelerated
from dp_swing_ros.solvers import riccati

LATENCIES = {'fma': 4.0, 'add': 2.0, 'multiply': 3.0, 'divide': 13.0, 'sincos': 50.0}


@pytest.fixture
def tally():
    return operations.Tally(LATENCIES)


def test_a_sum_takes_one_product_in(tally):
    a, b, c, d = tally.numbers([2.0, 3.0, 4.0, 5.0])
    assert a * b + c * d == 26.0
    assert tally.counts == {'fma': 1, 'multiply': 1, 'add': 0}
    assert operations_of(tally) == 3
    assert tally.chain == 3 + 2    # sooner than 3 + 4, the one product after the other
    assert (a * b + c) + d == 15.0 and tally.chain == 4 + 2


def test_what_is_done_twice_counts_once(tally):
    a, b = tally.numbers([2.0, 3.0])
    assert a * b == b * a == 6.0 and a - b == -(b - a)
    assert tally.counts == {'multiply': 1, 'add': 2}
    assert operations.counted_sincos(a) == operations.counted_sincos(a)
    assert tally.counts['sincos'] == 1


def test_numbers_of_the_model_are_constants(tally):
    x, = tally.numbers([2.0])
    assert [np.float64(3.0) * x, np.float32(4.0) * x, 5 + x, 1.0 / x] == [6.0, 8.0, 7.0, 0.5]
    assert tally.counts == {'multiply': 2, 'add': 1, 'divide': 1}


def test_a_column_of_a_riccati_step_is_counted_as_algebra_has_it(tally, rng):
    n = 4   # numbers of the state of one link
    V_x, V_xx, F, W = (tally.numbers(rng.normal(size=shape)) for shape in (
        n, (n, n), (n, n + 1), (n + 1, 1)))
    given = tuple(V_x), tuple(map(tuple, V_xx)), tuple(map(tuple, F.T))
    Q_z, Q_zz, BF = (operations.cells(shape) for shape in ((1,), (n + 1, 1), (1,)))
    riccati.propagate_lane(given, F[:, :1], W, Q_z, Q_zz, BF, 0)
    dots, column = 2 + n, 2 * n - 1    # Fᵀ V_x, Bᵀ F and V_xx F; a dot product of n numbers
    # and with that the dot products of all columns of F, each a part of W
    assert operations_of(tally) == dots * column + (n + 1) * (column + 1)


def test_counted_is_what_the_straight_line_has(tally, monkeypatch):
    monkeypatch.setattr(trigonometry, 'sincos', operations.counted_sincos)
    pendulum = controllers.problem({}).model.pendulum
    # so slow that friction is not at its bound
    x, u = tuple(np.linspace(0.01, 0.06, 6).tolist()), 1.0
    run = unrolling.written_out(accelerated.__wrapped__, tuple(map(typeof, (pendulum, x, u))))
    run(mapped(lambda number: tally.numbers([number])[0], pendulum), tuple(tally.numbers(x)),
        tally.numbers([u])[0])
    signs = [each.argrepr for each in dis.get_instructions(run) if each.opname == 'BINARY_OP']
    assert operations_of(tally) == len([sign for sign in signs if sign in '+-*'])
    assert tally.counts['divide'] == signs.count('/')
    assert tally.counts['sincos'] == 2


def test_the_parts_of_the_solvers_are_counted():
    of = limit.counted(LATENCIES, '1')['1']
    steps, stages = 30, 4
    for name in ('rollout', 'derivatives'):
        assert of[name]['sincos'] == of[name]['divide'] == steps * stages
    # the cost shares the angles of the states, but for the last one's
    assert of['line_search']['sincos'] == steps * stages + 1
    assert of['sample']['divide'] == stages
    assert limit.flops(of['ddp backward']) > limit.flops(of['ilqr backward'])
    # states wait for each other, in a line search for the forces too; derivatives do not
    assert of['line_search']['chain'] > of['rollout']['chain'] > 10 * of['derivatives']['chain']


@pytest.mark.parametrize('precision', limit.TYPES)
def test_a_spinner_does_what_its_chains_say(precision):
    for lanes in limit.widths(precision).values():
        kinds = limit.mix({'fma': 2, 'add': 1, 'multiply': 1})
        assert kinds.count('fma') == 2 * kinds.count('add') == 2 * kinds.count('multiply')
        spinner = limit.Spinner(precision, lanes, kinds)
        assert spinner.run() == limit.ROUNDS * lanes * len(kinds)


def test_a_tick_of_a_running_mpc_has_all_its_parts(monkeypatch):
    monkeypatch.setattr(limit, 'FIRST', 1)
    found = limit.running(3, 0.01)
    gc.unfreeze()   # what the mpc has frozen
    assert len(found) == 8 and all(len(times) == 3 for times in found.values())
    assert np.all(np.array(list(found.values())) > 0)


def test_the_page_has_every_part_and_what_a_tick_consists_of():
    seconds = {'value': 4e-6, 'low': 3e-6, 'high': 5e-6}
    row = {'flops': 12345, 'divide': 60, 'sincos': 62, 'vector': 1e-6, 'scalar': 2e-6,
           'chain': 3e-6, 'seconds': seconds}
    names = ['ilqr, iteration', 'ilqr, derivatives', 'ilqr, backward', 'ilqr, line_search',
             'ddp, backward', limit.ROLLOUT, limit.SAMPLE]
    tick = {limit.KERNELS: seconds, 'rclpy': {**seconds, 'value': 12e-6},
            limit.ITERATIONS_OF: {'value': 2}}
    best = {f'{precision} {width} fma': 1e-11 for precision in limit.TYPES
            for width in limit.widths(precision)}

    def section(row):
        return benchmark_page.limit(json.loads(json.dumps({
            'rows': {name: dict.fromkeys('123', row) for name in names}, 'best': best,
            'tick': dict.fromkeys(limit.PAUSES, tick), 'single': 1000, 'lanes': [9, 16]})))
    text = section(row)
    for name in names:
        assert f'| {name} | 12,345 | 60 | 62 | 1 | 2 | 3 | 4 (3-5) | 25 % | 25 % | 25 % |' in text
    assert f'| {limit.KERNELS} | 4 | 3-5 | 25.0 % | 4 |' in text
    assert '| together | 16 |  | 100 % | 16 |' in text
    assert '9 columns take 16 lanes' in text
    # which they take already where they are faster than single numbers can be
    assert 'take vectors' in text and 'take vectors' not in section({**row, 'scalar': 5e-6})


def operations_of(tally):
    """Return how many additions and multiplications were counted."""
    return limit.flops(tally.counts)

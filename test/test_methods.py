# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page that answers which method, when, from rows that are made up."""

from campaigns import STRESS
import methods
import numpy as np
import pytest
from results import row


@pytest.fixture
def rows():
    """Return rows of two methods: MPPI costs half of iLQR, and holds every second case."""
    def of(method, scenario, seed):
        mppi = method == 'mppi'
        return row(method, scenario, seed, held=not mppi or seed % 2 == 0,
                   closed_loop_cost=(0.5 if mppi else 1.0) * (100.0 + seed))
    both = ('ilqr', 'mppi')
    return {'random': [of(method, 'random', seed) for method in both for seed in range(8)],
            'stress': [of(method, name, seed) for method in both for name in STRESS
                       for seed in range(4)]}


def test_costs_are_compared_where_both_held(rows):
    found = methods.cost(rows['random'], 'mppi')
    assert (found.pairs, found.value) == (4, pytest.approx(0.5))
    assert methods.cost(rows['stress'], 'mppi', 'tight').pairs == 2
    assert methods.typical(rows['random'], 'mppi') == '0.50 (0.50-0.50)'
    assert methods.typical(rows['random'], 'ddp') == '-'
    less, more, later = methods.tails(rows['random'], 'mppi')
    assert (less, more, later) == (1.0, 0.0, pytest.approx(0.0))
    assert np.isnan(methods.cost(rows['random'], 'ddp').value)


def test_the_page_says_who_holds_what(rows):
    text = methods.page(rows)
    assert ('| `ilqr` | 8 of 8 (67.6-100.0 %) | 1.00 (1.00-1.00) | 1.000 (1.000 to 1.000) | - |'
            in text)
    assert '| `mppi` | 4 of 8 ' in text
    assert '| `mppi` | 2 of 4 | 2 of 4 | 2 of 4 | 2 of 4 | 2 of 4 | 2 of 4 |' in text
    success, beside = methods.picture(rows).axes
    assert len(success.get_yticks()) == len(STRESS) + 1
    assert 0.5 in [line.get_xdata()[0] for line in beside.lines if len(line.get_xdata()) == 1]

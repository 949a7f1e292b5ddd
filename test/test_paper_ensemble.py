# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math

import numpy as np
from paper_ensemble import band, ensemble, FIRST, NEAR, trial
import pytest
from synthetic import first, PERIOD, swing_up

from dp_swing_ros.pendulum.state import is_upright


def leaning(angle, begins):
    """Return a run that leans by an angle [rad] from a time [s] on for half a second."""
    episode = swing_up(duration=6.0)
    X = episode.X.copy()
    X[(episode.t >= begins) & (episode.t < begins + 0.5), 1] = angle
    return dataclasses.replace(episode, X=X)


def test_a_trial_has_when_it_was_up_and_where_the_cart_ended():
    episode = swing_up()
    one = trial(episode)
    assert one.reached == episode.t[np.argmax(is_upright(episode.X))]
    assert PERIOD < one.neared < one.reached < one.metrics.settling_time + 1e-9
    assert one.end == abs(episode.X[-1, 0])
    assert np.all(one.error[-1] < 1e-9)   # on whichever turn


def test_who_leaves_is_near_only_from_when_it_is_back():
    assert trial(leaning(NEAR - 0.01, 4.0)).neared == trial(swing_up(duration=6.0)).neared
    assert trial(leaning(NEAR + 0.01, 4.0)).neared == pytest.approx(4.5)
    assert math.isnan(trial(leaning(NEAR + 0.01, 5.0)).neared)   # back for less than a second


def test_who_never_comes_up_has_no_time():
    one = trial(first(swing_up(), 15))
    assert math.isnan(one.reached) and math.isnan(one.neared)


def test_the_forces_of_runs_of_any_length_are_compared_over_the_same_time():
    short, long = trial(swing_up(FIRST)), trial(swing_up(FIRST + 2.5))
    assert short.roughness == long.roughness > 0
    assert short.metrics.roughness > long.metrics.roughness


def test_a_band_holds_the_tenth_the_median_and_the_ninetieth_of_a_hundred(rng):
    low, median, high = band(rng.permutation(np.arange(101.0))[:, None])
    assert (low[0], median[0], high[0]) == (10, 50, 90)


def test_what_is_not_known_lies_beyond_all():
    assert band(np.array([math.nan, 1.0, 2.0])) == (1.0, 2.0, math.inf)


@pytest.mark.parametrize('links', [1, 2, 3])
def test_an_ensemble_counts_and_bounds_its_runs(links):
    episodes = [swing_up(rise=rise, links=links) for rise in (1.0, 1.5, 2.0, 6.0)]
    one = ensemble(episodes[0], [trial(episode) for episode in episodes])
    assert one.held[:2] == (3, 4)
    assert one.error.low.shape == (len(episodes[0].t), 2 * links + 2)
    assert np.all(one.angle.low <= one.angle.median)
    assert np.all(one.angle.median <= one.angle.high)
    assert one.angle.high[0] == pytest.approx(math.pi)

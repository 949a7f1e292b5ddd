# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import math

import numpy as np
from paper_ensemble import ensemble, trial
from paper_figures import moments, squared_errors, swing_ups
from PIL import Image
import pytest
from synthetic import swing_up

from dp_swing_ros.evaluation.metrics import settling_time
from dp_swing_ros.figures import ERROR_FLOOR


def of(*rises, duration=4.0, links=2):
    episodes = [swing_up(duration, rise, links=links) for rise in rises]
    return ensemble(episodes[0], [trial(episode) for episode in episodes])


def diverged():
    episode = swing_up()
    X = episode.X.copy()
    X[20:] = math.nan
    return dataclasses.replace(of(1.0, 2.0), trials=[trial(dataclasses.replace(episode, X=X))])


BOTH = {'ours': of(1.0, 1.5, 2.0), 'theirs': of(3.0, 2.0, 8.0)}


def texts(figure):
    return ' '.join(text.get_text() for part in (figure, *figure.subfigs) for text in part.texts)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('draw', [swing_ups, squared_errors])
@pytest.mark.parametrize('ensembles', [BOTH, {'one': of(2.0)}, {'a': diverged(), 'b': of(1.0)},
                                       {'a': of(1.0, links=1)}, {'a': of(1.0, 2.0, links=3)}],
                         ids=['two', 'one', 'diverged', 'one link', 'three links'])
def test_picture_is_written_and_not_blank(draw, ensembles, tmp_path):
    draw(ensembles, 'Fig. 0').savefig(tmp_path / 'picture.png', dpi=60)
    with Image.open(tmp_path / 'picture.png') as image:
        assert min(image.size) > 200
        assert np.asarray(image.convert('L')).std() > 5


def test_snapshots_stand_above_the_angles_of_all_runs():
    figure = swing_ups(BOTH, 'Fig. 0')
    assert 'Fig. 0' in texts(figure)
    assert 'ours\n3 of 3 upright to the end (44-100 %), force up to 20 N' in texts(figure)
    assert 'theirs\n2 of 3 upright to the end' in texts(figure)
    for half, one in zip(figure.subfigs, BOTH.values()):
        film, below = half.subfigs
        shown = [axes.get_title() for axes in film.axes if axes.axison]
        assert len(shown) == len(set(shown)) <= 12
        assert (shown[0], shown[-1]) == ('0.0 s', '4.0 s')
        assert '1 m' in [text.get_text() for text in film.axes[0].texts]
        median, run, _ = below.axes[0].lines
        np.testing.assert_array_equal(median.get_ydata(), one.angle.median)
        np.testing.assert_allclose(run.get_ydata(), np.sqrt(one.trials[0].error[:, 1:3].max(1)))


def test_errors_of_both_lie_in_six_panels():
    figure = squared_errors(BOTH, 'Fig. 0')
    assert len(figure.axes) == 6
    for i, axes in enumerate(figure.axes):
        assert axes.get_yscale() == 'log'
        for one, median, run in zip(BOTH.values(), axes.lines[::2], axes.lines[1::2]):
            np.testing.assert_allclose(median.get_ydata(),
                                       np.maximum(one.error.median[:, i], ERROR_FLOOR))
            np.testing.assert_allclose(run.get_ydata(),
                                       np.maximum(one.trials[0].error[:, i], ERROR_FLOOR))


@pytest.mark.parametrize('duration, rise', [(4.0, 1.5), (10.0, 2.0), (7.5, 1.0), (5.0, 20.0)])
def test_moments_are_of_the_way_up_and_of_the_end(duration, rise):
    episode = swing_up(duration, rise)
    times = moments(episode)
    assert 5 <= len(times) <= 12
    assert (times[0], times[-1]) == (0.0, pytest.approx(duration))
    settled = settling_time(episode.t, episode.errors)
    # no more than one picture but the last is of what is held
    assert math.isnan(settled) or np.count_nonzero(times > settled + 0.5) <= 1

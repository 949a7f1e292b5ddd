# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import dataclasses
import math

from matplotlib.collections import LineCollection
import numpy as np
from PIL import Image
import pytest
from synthetic import first, swing_up, without_ticks

from dp_swing_ros import figures
from dp_swing_ros.dynamics.pendulum import joints
from dp_swing_ros.parameters import LimitParameters

STILLS = [figures.snapshots, figures.squared_error, figures.timeline, figures.hero]


def gap(episode):
    X, U = episode.X.copy(), episode.U.copy()
    X[20:40] = U[20:40] = math.nan
    return dataclasses.replace(episode, X=X, U=U)


def unlimited(episode):
    limits = LimitParameters(force_limit=math.inf, track_limit=math.inf)
    return dataclasses.replace(episode, limits=limits)


def late(episode):
    episode.ticks.late[3] = True
    return episode


ODD = {
    'no state': first(swing_up(), 0), 'one state': first(swing_up(), 1),
    'two states': first(swing_up(), 2), 'no controller': without_ticks(swing_up()),
    'gap': gap(swing_up()), 'unlimited': unlimited(swing_up()), 'late': late(swing_up()),
    'long': swing_up(duration=100.0), 'unknown solver': swing_up(solver='mine')}


@pytest.mark.parametrize('draw', STILLS)
def test_picture_is_written_and_not_blank(draw, tmp_path):
    path = tmp_path / 'picture.png'
    draw(swing_up()).savefig(path)
    with Image.open(path) as image:
        assert min(image.size) > 300
        assert np.asarray(image.convert('L')).std() > 5


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('draw', STILLS)
@pytest.mark.parametrize('name', ODD)
def test_odd_runs_are_drawn_without_a_warning(draw, name, tmp_path):
    draw(ODD[name]).savefig(tmp_path / 'picture.png', dpi=30)
    assert (tmp_path / 'picture.png').stat().st_size > 1000


@pytest.mark.parametrize('draw', STILLS)
def test_title_names_the_solver(draw):
    figure = draw(swing_up(solver='mppi'))
    assert any('MPPI' in text.get_text() for text in figure.texts)


def test_snapshots_show_the_pendulum_every_half_second():
    episode = swing_up(duration=10.0)
    panels = [axes for axes in figures.snapshots(episode).axes if axes.axison]
    assert [axes.get_title() for axes in panels] == [f'{0.5 * n:.1f} s' for n in range(21)]
    for n, axes in enumerate(panels):
        places = joints(episode.X[10 * n], episode.bodies)
        track, link1, link2, _ = axes.lines
        np.testing.assert_allclose(link1.get_xydata(), places[:2], atol=1e-9)
        np.testing.assert_allclose(link2.get_xydata(), places[1:], atol=1e-9)


def test_snapshots_label_both_axes():
    figure = figures.snapshots(swing_up())
    assert (figure.get_supxlabel(), figure.get_supylabel()) == ('x [m]', 'z [m]')


def test_squared_error_shows_the_six_states_to_the_nearest_turn():
    episode = swing_up()
    panels = figures.squared_error(episode).axes
    assert len(panels) == 6
    for i, axes in enumerate(panels):
        x = episode.X[:, i] - (2 * np.pi * np.round(episode.X[:, i] / (2 * np.pi))
                               if i in (1, 2) else 0)
        shown = axes.lines[0].get_ydata()
        np.testing.assert_allclose(shown, np.maximum(x ** 2, figures.ERROR_FLOOR))
        assert axes.get_yscale() == 'log'
        assert '[' in axes.get_ylabel()


def test_timeline_shows_force_limits_and_the_period():
    episode = swing_up()
    angles, position, force, times = figures.timeline(episode).axes
    np.testing.assert_array_equal(force.patches[0].get_data().values, episode.U)
    assert [line.get_ydata()[0] for line in force.lines] == [20.0, -20.0]
    assert [line.get_ydata()[0] for line in position.lines[1:]] == [2.4, -2.4]
    assert [line.get_label() for line in times.lines] == [
        'solve time', 'latency, state to force', 'period']
    assert times.lines[-1].get_ydata()[0] == pytest.approx(50.0)
    assert times.get_yscale() == 'log'
    assert times.get_xlabel() == 'time [s]'


def test_timeline_ends_at_zero_whatever_the_turn():
    angles = figures.timeline(swing_up()).axes[0]
    for line in angles.lines:
        assert line.get_ydata()[-1] == pytest.approx(0.0)


def test_timeline_marks_late_ticks():
    times = figures.timeline(late(swing_up())).axes[3]
    marks = [line for line in times.lines if line.get_label() == 'late (1)']
    assert len(marks[0].get_xdata()) == 1


def test_hero_stands_every_cart_above_its_moment():
    speed = 3.4
    film, force = figures.hero(swing_up(), seconds=2.0, speed=speed).axes
    assert film.get_xlim() == pytest.approx(speed * np.array(force.get_xlim()))
    assert sum(isinstance(artist, LineCollection) for artist in film.collections) == 2
    carts = [patch.get_x() + patch.get_width() / 2 for patch in film.patches]
    np.testing.assert_allclose(carts, speed * 0.25 * np.arange(9), atol=1e-9)


def test_states_between_the_recorded_follow_the_speeds():
    t = np.linspace(0.0, 3.0, 31)
    X = np.stack([np.sin(t), np.cos(t), 0.1 * t ** 3, np.cos(t), -np.sin(t), 0.3 * t ** 2], axis=1)
    episode = dataclasses.replace(swing_up(), t=t, X=X)
    between = np.linspace(0.0, 3.0, 217)
    shown = figures.states_at(episode, between)
    np.testing.assert_allclose(shown[:, 0], np.sin(between), atol=1e-6)
    np.testing.assert_allclose(shown[:, 2], 0.1 * between ** 3, atol=1e-12)
    np.testing.assert_array_equal(figures.states_at(episode, t[[0, 7, 30]]), X[[0, 7, 30]])


def test_animation_plays_in_real_time_and_is_small(tmp_path):
    path = tmp_path / 'animation.gif'
    seen = []
    figures.animation(swing_up(duration=2.0), path, lambda times: seen.extend(times) or times)
    with Image.open(path) as image:
        durations = []
        for frame in range(image.n_frames):
            image.seek(frame)
            durations.append(image.info['duration'])
    assert len(seen) == 41
    # equal pictures in a row are one that lasts longer
    assert sum(durations) == 41 * 50
    assert path.stat().st_size < 400_000


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('name', ['one state', 'two states', 'no controller', 'gap', 'unlimited'])
def test_odd_runs_are_animated_without_a_warning(name, tmp_path):
    figures.animation(ODD[name], tmp_path / 'animation.gif')
    assert (tmp_path / 'animation.gif').stat().st_size > 1000


def test_run_without_states_cannot_be_animated(tmp_path):
    with pytest.raises(ValueError, match='without states'):
        figures.animation(ODD['no state'], tmp_path / 'animation.gif')

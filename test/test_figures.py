# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import dataclasses
import math
from pathlib import Path
import runpy
import sys

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.text import Text
import numpy as np
from PIL import Image
import pytest
from sketch import sketch
from synthetic import first, PERIOD, resized, swing_up, without_ticks

from dp_swing_ros import figures
from dp_swing_ros.figures.curves import unwrapped
from dp_swing_ros.figures.film import by_motion, SPEED
from dp_swing_ros.figures.pendulum import draw_pendulum, states_at
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import is_upright

TOP = Path(__file__).parents[1]
README, FIGURES = TOP / 'README.md', TOP / 'docs' / 'figures'
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


SHORT = swing_up(0.4, 0.2)   # a few pictures of snapshots, of which each takes its time
ODD = {   # several oddities that do not meet are drawn in one
    'one state': first(swing_up(), 1), 'two states': first(swing_up(), 2),
    'no controller': without_ticks(SHORT),
    'one link, unlimited, late, unknown solver': late(unlimited(
        swing_up(0.4, 0.2, links=1, solver='mine'))),
    'three links, long, with a gap': gap(swing_up(duration=100.0, links=3))}


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
    figure = draw(dataclasses.replace(SHORT, solver='mppi'))
    assert any('MPPI' in text.get_text() for text in figure.texts)


@pytest.mark.parametrize('links', [1, 2, 3])
def test_snapshots_show_the_motion_and_the_end(links):
    episode = swing_up(duration=10.0, links=links)
    panels = [axes for axes in figures.snapshots(episode).axes if axes.axison]
    times = [float(axes.get_title().removesuffix(' s')) for axes in panels]
    assert times[0] == 0.0 and times[-1] == 10.0
    assert len([t for t in times if t < 2.0]) > 15   # while it swings up
    for t, axes in zip(times, panels):
        n = round(t / PERIOD)
        assert (axes.title.get_weight() == 'bold') == is_upright(episode.errors[n])
        places = joint_positions(episode.X[n], episode.physical.lengths)
        shown = axes.lines[-links - 1:-1]
        for link, line in enumerate(shown):
            np.testing.assert_allclose(line.get_xydata(), places[link:link + 2], atol=1e-9)
        assert len({line.get_color() for line in shown}) == links


def test_snapshots_are_equal_ways_apart():
    t = np.linspace(0.0, 1.0, 2001)
    places = np.stack([[t ** 3, t ** 3], [0 * t, 0 * t]], axis=-1).transpose(1, 0, 2)
    shown = by_motion(places, 11)
    np.testing.assert_allclose(t[shown] ** 3, np.linspace(0.0, 1.0, 11), atol=2e-3)
    places[500:600] = np.nan   # from there on as if it had not moved
    assert len(by_motion(places, 11)) == 11
    assert by_motion(np.zeros((5, 3, 2)), 11).tolist() == [0, 4]


def test_snapshots_label_both_axes():
    figure = figures.snapshots(SHORT)
    assert (figure.get_supxlabel(), figure.get_supylabel()) == ('x [m]', 'z [m]')


@pytest.mark.parametrize('links', [1, 2, 3])
def test_squared_error_shows_all_states_to_the_nearest_turn(links):
    episode = swing_up(links=links)
    panels = figures.squared_error(episode).axes
    assert len(panels) == 2 * links + 2
    for i, axes in enumerate(panels):
        x = episode.X[:, i] - (2 * np.pi * np.round(episode.X[:, i] / (2 * np.pi))
                               if 1 <= i <= links else 0)
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


@pytest.mark.parametrize('drive, name, limits', [
    ('force', 'force', [20.0, -20.0]), ('voltage', 'force', []),   # [V] of it, and [N] is drawn
    ('velocity', 'acceleration', [7.0, -7.0])])
def test_pictures_show_the_limit_of_what_acts_by_its_name(drive, name, limits):
    episode = swing_up()
    episode = dataclasses.replace(
        episode, physical=dataclasses.replace(episode.physical, drive=drive),
        limits=LimitParameters(acceleration_limit=7.0))
    for axes in (figures.timeline(episode).axes[2], figures.hero(episode).axes[1],
                 figures.overlay({'one': episode, 'two': episode}).axes[3]):
        assert axes.get_ylabel().startswith(f'{name} ')
        assert [line.get_ydata()[0] for line in axes.lines] == limits


@pytest.mark.parametrize('drive, unit', [('voltage', 'N'), ('velocity', 'm/s²')])
def test_an_animation_names_the_unit_of_what_acts(drive, unit, tmp_path, monkeypatch):
    written, text = [], Figure.text
    monkeypatch.setattr(Figure, 'text', lambda self, x, y, words, **look: (
        written.append(words), text(self, x, y, words, **look))[1])
    episode = swing_up(duration=0.1)
    figures.animation(dataclasses.replace(episode, physical=dataclasses.replace(
        episode.physical, drive=drive)), tmp_path / 'animation.gif')
    shown = [words.split(' ', 1)[1] for words in written if words[0] in '+−']
    assert len(shown) > 1 and set(shown) == {unit}
    written.clear()   # of a log without any
    figures.animation(dataclasses.replace(episode, U=np.full_like(episode.U, np.nan)),
                      tmp_path / 'animation.gif')
    assert '' in written and not any('nan' in words for words in written)


@pytest.mark.parametrize('turn', [0, -2 * math.pi, 4 * math.pi])
def test_hanging_is_pi_on_whatever_turn_and_side_it_was_measured(turn):
    episode = swing_up()
    X = episode.X.copy()
    X[:, 1] += turn - 0.01
    X[:, 2] += turn + 0.01
    for line in figures.timeline(dataclasses.replace(episode, X=X)).axes[0].lines:
        assert line.get_ydata()[0] == pytest.approx(math.pi, abs=0.02)
        assert round(line.get_ydata()[-1] / math.pi, 1) in (0.0, 2.0)


def test_angles_that_a_sensor_wraps_are_drawn_as_they_turned():
    episode = swing_up()
    X = episode.X.copy()
    X[:, 1:3] = np.angle(np.exp(1j * X[:, 1:3]))
    wrapped, whole = (np.array([line.get_ydata() for line in figures.timeline(one).axes[0].lines])
                      for one in (dataclasses.replace(episode, X=X), episode))
    np.testing.assert_allclose(wrapped, whole, atol=1e-9)


def test_a_start_next_to_upright_is_drawn_there():
    X = swing_up().X
    X[:, 1:3] = np.array([0.2, -0.3]) + 2 * np.pi
    np.testing.assert_allclose(unwrapped(X)[0], [0.2, -0.3])


@pytest.mark.parametrize('links', [1, 3])
def test_timeline_shows_every_angle_in_its_own_colour(links):
    lines = figures.timeline(swing_up(links=links)).axes[0].lines
    assert [line.get_label() for line in lines] == [
        rf'$\theta_{i}$' for i in range(1, links + 1)]
    assert len({line.get_color() for line in lines}) == links


def test_timeline_marks_late_ticks():
    times = figures.timeline(late(swing_up())).axes[3]
    marks = [line for line in times.lines if line.get_label() == 'late (1)']
    assert len(marks[0].get_xdata()) == 1


def test_hero_stands_every_cart_above_its_moment():
    film, force = figures.hero(swing_up(duration=6.0)).axes
    assert film.get_xlim() == pytest.approx(SPEED * np.array(force.get_xlim()))
    assert sum(isinstance(artist, LineCollection) for artist in film.collections) == 2
    carts = [patch.get_x() + patch.get_width() / 2 for patch in film.patches]
    np.testing.assert_allclose(carts, SPEED * np.array([*0.25 * np.arange(17), 4.5]), atol=1e-9)


def test_hero_goes_on_to_the_end_of_the_run():
    episode = swing_up(duration=6.0)
    figure = figures.hero(episode)
    film, force = figure.axes
    assert [label.get_text() for label in force.get_xticklabels()][-2:] == ['4.0', '6.0']
    assert 'upright from 1.70 to 6.0 s' in figure.texts[-1].get_text()
    last = joint_positions(episode.X[-1], episode.physical.lengths)
    np.testing.assert_allclose(film.lines[-2].get_ydata(), last[1:, 1], atol=1e-9)
    fallen = figures.hero(first(episode, 31))
    assert 'not upright at the end, 1.5 s' in fallen.texts[-1].get_text()


@pytest.mark.parametrize('links', [1, 2, 3])
@pytest.mark.parametrize('rise', [2.0, 6.0, 30.0])
def test_hero_has_room_for_all_links_however_late_they_stand(links, rise):
    episode = swing_up(duration=20.0, rise=rise, links=links)
    film, _ = figures.hero(episode).axes
    assert film.get_ylim() == pytest.approx((-links - 0.25, links + 0.25))
    left, right = film.get_xlim()
    for line in film.lines[1:]:
        x, z = line.get_xydata().T
        assert left < x.min() and x.max() < right
        assert np.abs(z).max() <= links + 1e-9


def test_hero_draws_no_cart_where_the_state_is_not_known():
    film, _ = figures.hero(gap(swing_up())).axes
    assert [math.isnan(patch.get_x()) for patch in film.patches].count(True) == 4


@pytest.mark.parametrize('rise, shown', [(2.0, 4.0), (6.0, 6.5), (14.0, 10.0)])
def test_hero_shows_the_swing_up_until_the_pendulum_is_up(rise, shown):
    _, force = figures.hero(swing_up(duration=20.0, rise=rise)).axes
    labels = [label.get_text() for label in force.get_xticklabels()]
    assert labels[-2:] == [f'{shown:.1f}', '20.0']


def test_states_between_the_recorded_follow_the_speeds():
    t = np.linspace(0.0, 3.0, 31)
    X = np.stack([np.sin(t), np.cos(t), 0.1 * t ** 3, np.cos(t), -np.sin(t), 0.3 * t ** 2], axis=1)
    episode = dataclasses.replace(swing_up(), t=t, X=X)
    between = np.linspace(0.0, 3.0, 217)
    shown = states_at(episode, between)
    np.testing.assert_allclose(shown[:, 0], np.sin(between), atol=1e-6)
    np.testing.assert_allclose(shown[:, 2], 0.1 * between ** 3, atol=1e-12)
    np.testing.assert_array_equal(states_at(episode, t[[0, 7, 30]]), X[[0, 7, 30]])


def test_a_centre_of_mass_is_drawn_where_it_is_not_in_the_middle():
    def dots(**centres):
        axes = Figure().subplots()
        x = np.array([0.5, math.pi / 2, 0.0, 0.0, 0.0, 0.0])
        draw_pendulum(axes, PendulumParameters(**centres), x)
        return [line.get_xydata().tolist() for line in axes.lines if line.get_zorder() > 5]
    assert dots() == dots(link1_centre=0.5 + 1e-9) == []   # a description is rounded
    assert dots(link1_centre=0.2) == [[[pytest.approx(0.7), pytest.approx(0.0)]]]
    assert dots(link2_centre=1.2) == [[[pytest.approx(1.5), pytest.approx(1.2)]]]   # beyond


def test_animation_plays_in_real_time_and_is_small(tmp_path):
    path = tmp_path / 'animation.gif'
    seen = []
    figures.animation(swing_up(duration=1.0), path, lambda times: seen.extend(times) or times)
    with Image.open(path) as image:
        durations = []
        for frame in range(image.n_frames):
            image.seek(frame)
            durations.append(image.info['duration'])
    assert len(seen) == 21
    # equal pictures in a row are one that lasts longer
    assert sum(durations) == 21 * 50
    assert path.stat().st_size < 200_000


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('episode', [
    ODD['one state'], ODD['no controller'], gap(unlimited(swing_up(2.5, links=3)))],
    ids=['one state', 'no controller', 'three links, unlimited, with a gap'])
def test_odd_runs_are_animated_without_a_warning(episode, tmp_path):
    figures.animation(episode, tmp_path / 'animation.gif')
    assert (tmp_path / 'animation.gif').stat().st_size > 1000


@pytest.mark.parametrize('links', [1, 2, 3])
def test_sketch_names_every_coordinate_length_and_sign(links):
    figure = sketch(PendulumParameters(links=links))
    texts = ' '.join(text.get_text() for text in figure.axes[0].texts)
    for symbol in ('$x$', '$u$', '$m_0$', 'hanging', 'upright', 'clockwise positive', '−2.4 m'):
        assert symbol in texts, symbol
    for i in (1, 2, 3):
        for symbol in (rf'$\theta_{i}$', f'$l_{i}$, $m_{i}$', f'$m_{i}$ = 0.5 kg'):
            assert (symbol in texts) == (i <= links), symbol


def test_the_sketch_is_made_by_a_command_and_shown_near_the_top(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, 'argv', ['sketch.py', str(tmp_path)])
    runpy.run_path(str(TOP / 'scripts' / 'sketch.py'), run_name='__main__')
    sizes = []
    for folder in (tmp_path, FIGURES):
        with Image.open(folder / 'pendulum.png') as picture:
            sizes.append(picture.size)
    assert sizes[0] == sizes[1]
    assert 'docs/figures/pendulum.png' in README.read_text().split('## ')[1]


def drawn(figure):
    """Return the pixels of a picture without its words."""
    for text in figure.findobj(Text):
        text.set_alpha(0.0)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].astype(int)


@pytest.mark.parametrize('links', [1, 2, 3])
def test_a_small_pendulum_looks_as_a_large_one_on_film(links):
    episode = swing_up(duration=6.0, links=links)
    small = resized(episode, 0.25, 0.1)
    pictures = [drawn(figures.hero(one)) for one in (episode, small)]
    assert np.mean(np.abs(np.subtract(*pictures)) > 2) < 1e-3
    film, force = figures.hero(small).axes
    np.testing.assert_allclose(force.get_xticks(), [*0.25 * np.arange(9), 2.25])
    assert [label.get_text() for label in force.get_xticklabels()][-2:] == ['2.00', '3.00']
    panels = [figures.snapshots(first(one, 9)).axes[0] for one in (episode, small)]
    assert panels[1].get_xlim() == pytest.approx(np.multiply(panels[0].get_xlim(), 0.25))
    assert panels[1].get_xticks().tolist() == (0.25 * panels[0].get_xticks()).tolist()


def test_a_small_pendulum_looks_as_a_large_one_in_an_animation(tmp_path):
    episode = swing_up(duration=1.0)
    pictures = []
    for name, one in (('large', episode), ('small', resized(episode, 0.25, 0.1))):
        figures.animation(one, tmp_path / f'{name}.gif')
        with Image.open(tmp_path / f'{name}.gif') as image:
            durations = []
            for frame in range(image.n_frames):
                image.seek(frame)
                durations.append(image.info['duration'])
            pictures.append(np.asarray(image.convert('RGB'))[50:].astype(int))
            assert sum(durations) == pytest.approx(1050 if name == 'large' else 525, abs=25)
    assert np.mean(np.abs(np.subtract(*pictures)) > 2) < 1e-3


def test_what_counts_as_upright_is_marked_in_own_units():
    episode = swing_up()
    large, small = (figures.squared_error(one).axes for one in (episode, resized(episode, 0.25)))
    for axes, other, unit in zip(large, small, (0.25, 1, 1, 0.5, 2, 2)):
        assert other.get_ylim()[0] == pytest.approx(axes.get_ylim()[0] * unit ** 2)
        for line, its in zip(axes.lines, other.lines):
            np.testing.assert_allclose(its.get_ydata(), np.multiply(line.get_ydata(), unit ** 2))


@pytest.mark.parametrize('length', [0.05, 0.15, 0.4, 3.0])
def test_any_size_has_ticks_that_can_be_read(length):
    figure = figures.snapshots(resized(SHORT, length))
    panel = figure.axes[0]
    inside = [tick for tick in panel.get_xticks() if abs(tick) <= panel.get_xlim()[1]]
    assert 2 < len(inside) < 8

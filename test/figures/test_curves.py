# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import numpy as np
import pytest
from synthetic import first, swing_up, without_ticks

from dp_swing_ros.figures import overlay


def test_every_run_is_in_every_panel_in_its_own_colour():
    runs = {'one': swing_up(), 'two': swing_up(rise=1.0, solver='ddp')}
    figure = overlay(runs)
    th_1, th_2, position, force, times = figure.axes
    for n, run in enumerate(runs.values()):
        np.testing.assert_array_equal(position.lines[n].get_ydata(), run.X[:, 0])
        np.testing.assert_array_equal(force.patches[n].get_data().values, run.U)
        np.testing.assert_allclose(times.lines[n].get_ydata(), 1e3 * run.ticks.solve_time)
        for axes in (th_1, th_2):
            assert axes.lines[n].get_ydata()[0] == pytest.approx(np.pi)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ['one', 'two']
    colours = [line.get_color() for line in legend.get_lines()]
    assert len(set(colours)) == 2
    for axes in (th_1, th_2, position, times):
        assert [line.get_color() for line in axes.lines[:2]] == colours


@pytest.mark.parametrize('links', [(1, 1), (3, 3), (1, 2, 3)])
def test_every_angle_of_the_longest_pendulum_has_a_panel(links):
    panels = overlay({str(n): swing_up(links=each) for n, each in enumerate(links)}).axes
    assert len(panels) == max(links) + 3
    for i, axes in enumerate(panels[:max(links)]):
        assert len(axes.lines) == sum(each > i for each in links)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('runs', [
    {'alone': without_ticks(swing_up())}, {'$x': swing_up(), '\\bar$': first(swing_up(), 2)},
    {f'a run with a long name, number {n}': swing_up() for n in range(9)}],
    ids=['no controller', 'odd names', 'many'])
def test_odd_runs_are_drawn_without_a_warning(runs, tmp_path):
    overlay(runs).savefig(tmp_path / 'overlay.png', dpi=30)
    assert (tmp_path / 'overlay.png').stat().st_size > 1000

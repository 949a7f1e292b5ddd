# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
from matplotlib.text import Text
import numpy as np
from PIL import Image
import pytest
from results import campaign, error_row, row

from dp_swing_ros.evaluation.campaign.summary import summarise
from dp_swing_ros.figures.campaign import (
    criteria, of_campaign, settling, SHARES, solve_times, starts, successes, sweeps)
from dp_swing_ros.figures.style import looks

NAMES = ('ilqr', 'mppi', 'ilqr:paper')
SCENARIOS = ('random', 'model', 'delay', 'pushes')
ROWS = [
    *(row(name, 'random', seed, held=seed > n, settling_time=1.0 + seed if seed > n else np.nan)
      for n, name in enumerate(NAMES) for seed in range(6)),
    *(row(name, 'model', 0, held=level < 1.2, parameter='link1_mass', level=level)
      for name in NAMES for level in np.linspace(0.75, 1.25, 5)),
    *(row(name, 'delay', seed, held=level < 0.1, parameter='delay', level=level)
      for name in NAMES for level in (0.0, 0.075, 0.15) for seed in range(2)),
    *(row(name, 'pushes', seed, parameter='profile', level=float(seed))
      for name in NAMES for seed in range(3))]


def summary_of(rows, contestants=NAMES, scenarios=SCENARIOS, **about):
    return summarise(campaign(contestants, scenarios, **about), rows, 100)


def drawn(rows, contestants=NAMES, scenarios=SCENARIOS):
    return dict(of_campaign(summary_of(rows, contestants, scenarios), rows))


@pytest.mark.filterwarnings('error')
def test_a_campaign_has_six_pictures(tmp_path):
    figures = drawn(ROWS)
    assert list(figures) == [
        'successes', 'criteria', 'sweeps', 'settling', 'solve_times', 'starts']
    for name, figure in figures.items():
        figure.savefig(tmp_path / f'{name}.png', dpi=60)
        with Image.open(tmp_path / f'{name}.png') as image:
            assert min(image.size) > 100
            assert np.asarray(image.convert('L')).std() > 5


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('rows, names', [
    ([error_row()], {'successes', 'settling'}),
    ([row(held=False, settling_time=np.nan)], {'successes', 'settling', 'solve_times'}),
    ([row(scenario='delay', parameter='delay', level=0.1)],
     {'successes', 'criteria', 'sweeps', 'solve_times'})])
def test_only_what_there_is_to_see_is_drawn(rows, names, tmp_path):
    figures = drawn(rows, ['ilqr'], [rows[0].key.scenario])
    assert set(figures) == names
    for figure in figures.values():
        figure.savefig(tmp_path / 'picture.png', dpi=30)


def test_a_solver_has_one_colour_and_its_variants_other_lines():
    first, _, variant = looks(campaign(NAMES)).values()
    assert first.line['color'] == first.mark['color'] == variant.line['color'] \
        == variant.mark['color'] == first.mark['markerfacecolor']
    assert first.line['linestyle'] != variant.line['linestyle']
    assert first.mark['marker'] != variant.mark['marker']
    assert variant.mark['markerfacecolor'] == 'white'


def test_successes_are_at_their_shares():
    axes = successes(summary_of(ROWS)).axes[0]
    for line in axes.lines:
        assert line.get_markevery() == [1]
        assert np.ptp(line.get_ydata()) == 0
    points = [line.get_xdata()[1] for line in axes.lines]
    assert points[:3] == [5 / 6, 4 / 6, 3 / 6]
    assert {'5 of 6', '6 of 6', '4 of 5', '3 of 3'} >= {
        text.get_text() for text in axes.texts} - {'4 of 6', '3 of 6'}


def test_settling_ends_at_the_success_rate():
    axes = settling(summary_of(ROWS), ROWS).axes[0]
    assert [line.get_ydata()[-1] for line in axes.lines] == [5 / 6, 4 / 6, 3 / 6]
    assert axes.get_xlabel() == 'settling time [s]'


def test_settling_is_shown_for_as_long_as_the_episodes_were():
    rows = [row('ilqr', 'uptime', settling_time=40.0, duration=60.0)]
    axes = settling(summary_of(rows, ['ilqr'], ['uptime']), rows).axes[0]
    line = axes.lines[0].get_xdata()
    assert axes.get_xlim() == (0.0, 60.0)
    assert (np.diff(line) >= 0).all() and line[-1] == 60.0


def test_random_starts_are_those_of_the_bodies_that_started():
    rows = [row('short', 'random', seed) for seed in range(40)]
    summary = summary_of(rows, ['short'], ['random'], links=1)
    default = starts(summary, rows).axes[0].get_ylim()[1]
    summary.campaign['contestants']['short']['mpc']['link1_length'] = 0.25
    assert starts(summary, rows).axes[0].get_ylim()[1] > 1.3 * max(default, 3.0)


def test_solve_times_are_shares_of_solves():
    rows = [row('ilqr', solve_times=(0.0, 0.001, 0.004, 0.002))]
    line = solve_times(summary_of(rows, ['ilqr'], ['hanging']), rows).axes[0].lines[0]
    np.testing.assert_allclose(line.get_xdata(), [1.0, 2.0, 4.0])
    np.testing.assert_allclose(line.get_ydata(), [1.0, 2 / 3, 1 / 3])


def test_a_strip_has_a_cell_a_level_and_its_shade_is_the_share():
    panel = sweeps(summary_of(ROWS)).axes[0]
    assert panel.get_title(loc='left') == 'model: link1 mass [of the nominal]'
    assert len(panel.patches) == 3 * 5
    shades = [patch.get_facecolor() for patch in panel.patches[:5]]
    assert shades == [SHARES(1.0)] * 4 + [SHARES(0.0)]


def test_every_sweep_has_a_unit_and_every_text_can_be_read():
    figure = sweeps(summary_of(ROWS))
    assert all('[' in axes.get_title(loc='left') for axes in figure.axes if axes.get_title('left'))
    assert min(text.get_fontsize() for text in figure.findobj(Text) if text.get_text()) >= 9


def test_robustness_is_shown_with_intervals():
    figure = criteria(summary_of(ROWS))
    axes, = figure.axes
    bars = [line for line in axes.lines if line.get_markevery() == [1]]
    assert all(np.ptp(line.get_xdata()) == 0 and line.get_linestyle() == '-' for line in bars)
    intervals = {tuple(np.round(line.get_ydata(), 6)) for line in bars}
    expected = {tuple(np.round((one.held.low, one.held.successes / one.held.runs, one.held.high),
                               6)) for one in summary_of(ROWS).standings
                if one.scenario != 'random'}
    assert expected <= intervals
    assert [label.get_text() for label in axes.get_xticklabels()] == [
        'model\n0.75 to 1.25', 'delay\n0 to 0.15 s', 'pushes']


def test_the_legend_of_intervals_has_their_lines():
    figure = successes(summary_of(ROWS))
    legend, = figure.legends
    drawn = {(line.get_color(), line.get_linestyle()) for line in figure.axes[0].lines}
    assert {(line.get_color(), line.get_linestyle()) for line in legend.get_lines()} <= drawn


def test_starts_are_at_the_angles_of_their_seeds():
    panel = starts(summary_of(ROWS), ROWS).axes[0]
    assert len(panel.lines[0].get_xdata()) == 1
    assert np.all(np.abs(panel.lines[0].get_xydata()) <= np.pi)
    assert panel.get_title() == 'ilqr\n5 of 6 held, median 4.00 s'


def test_starts_that_are_all_held_differ_in_their_colours():
    rows = [row('ilqr', 'random', seed, settling_time=1.5 + 0.001 * seed) for seed in range(700)]
    image, = starts(summary_of(rows, ['ilqr'], ['random']), rows).axes[0].images
    shades = image.norm(image.get_array())
    assert np.ptp(shades) > 0.5

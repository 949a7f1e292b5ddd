# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import pytest
from results import campaign, error_row, row

from dp_swing_ros.evaluation.campaign.report import failing, in_short, markdown, spans, which
from dp_swing_ros.evaluation.campaign.summary import Failure, Level, summarise

ROWS = [row('ilqr', seed=0), row('mppi', seed=0, held=False), error_row('mppi', seed=1),
        *(row(name, 'delay', parameter='delay', level=level, held=level < 0.1)
          for name in ('ilqr', 'mppi') for level in (0.0, 0.05, 0.1))]


def cells(page):
    """Return the cells of all lines of tables, which must be as wide as their heads."""
    tables, width = [], 0
    for line in page.splitlines():
        if not line.startswith('| '):
            width = 0
            continue
        found = [cell.strip() for cell in line.replace(r'\|', '').split('|')[1:-1]]
        width = width or len(found)
        assert len(found) == width, line
        tables.append(found)
    return tables


def test_a_page_has_a_line_for_each_contestant_in_each_scenario():
    page = markdown(summarise(campaign(scenarios=('hanging', 'delay')), ROWS, 12))
    lines = cells(page)
    assert any(line[:2] == ['`ilqr`', '1 of 1 (20.7-100.0 %)'] for line in lines)
    assert any(line[:2] == ['`mppi`', '0 of 2 (0.0-65.8 %)'] for line in lines)
    assert ['delay', 'delay', '2 of 3; fails at 0.1', '2 of 3; fails at 0.1'] in lines
    assert ['hanging', '`mppi`', 'never upright', '1', 'seed 0'] in lines
    assert ['hanging', '`mppi`', 'ValueError: no, "never"', '1', 'seed 1'] in lines
    assert '9 episodes of 4 s, 3 not run yet' in page


def test_heads_name_the_units_of_what_acts():
    about = campaign()
    for contestant, drive in zip(about['contestants'].values(), ('acceleration', 'velocity')):
        contestant['mpc']['drive'] = drive
    page = markdown(summarise(about, ROWS[:2], 2))
    found = next(line for line in cells(page) if line[:2] == ['contestant', 'held'])
    assert found[5:7] == ['acceleration step: hold, run [m/s²]',
                          'largest u [m/s²], x [m], θ [rad]']
    assert found[10:13] == ['Σabs(Δx u)', '∫abs(u) [m/s]', '∫u² [m²/s³]']
    assert 'acceleration step at hold [m/s²]' in page
    force = markdown(summarise(campaign(), ROWS[:2], 2))
    assert 'force step: hold, run [N]' in force and 'Σabs(Δx u) [J]' in force


def test_scenarios_that_take_longer_are_told_so():
    about = campaign(scenarios=('hanging', 'uptime'))
    rows = [row('ilqr', 'hanging'), row('ilqr', 'uptime')]
    assert in_short(summarise(about, rows, 2))[0] == '2 episodes of 4 s, of uptime of 24 s.'


def test_a_terminal_is_shown_a_line_for_each_contestant():
    rows = [row('ilqr', seed=1, settling_time=1.5), *ROWS]
    about = campaign(('ilqr', 'mppi', 'ddp'), ('hanging', 'delay'))
    assert in_short(summarise(about, rows, 20)) == [
        '10 episodes of 4 s, 10 not run yet.',
        'ilqr: held 4 of 5 (least in delay, 2 of 3), median settling 1.60 to 1.70 s, '
        'solves p99 2.0 ms',
        'mppi: held 2 of 5 (least in hanging, 0 of 2), median settling 1.70 s, solves p99 2.0 ms',
        'ddp: not run yet']


def test_each_way_has_a_line():
    ways = ('down_down to up_up', 'up_up to down_down')
    rows = [row(name, 'transitions', seed, parameter=way, held=way == ways[0] or name == 'ilqr',
                settling_time=1.0 + seed)
            for name in ('ilqr', 'mppi') for way in ways for seed in range(3)]
    found = cells(markdown(summarise(campaign(scenarios=('transitions',)), rows, 12)))
    assert [ways[0], *['3 of 3 (43.9-100.0 %), 2.00'] * 2] in found
    assert [ways[1], '3 of 3 (43.9-100.0 %), 2.00', '0 of 3 (0.0-56.1 %), -'] in found


def test_a_campaign_without_a_failure_is_reported():
    assert 'Everything was held.' in markdown(summarise(campaign(), [row()], 1))


@pytest.mark.parametrize('rows', [[], [error_row()], [row(held=False)]])
def test_campaigns_with_nothing_to_show_have_a_page(rows):
    assert markdown(summarise(campaign(), rows, 20)).startswith('# Campaign')


@pytest.mark.parametrize('passed, text', [
    ([1, 1, 1], ''), ([0, 1, 1], '; fails at 0.1'), ([0, 0, 1, 0], '; fails at 0.1 to 0.2, 0.4')])
def test_levels_that_fail_are_ranges(passed, text):
    assert failing([Level(0.1 * (n + 1), held, 1) for n, held in enumerate(passed)]) == text


def test_seeds_are_ranges():
    assert spans([5, 0, 1, 2, 9]) == '0-2, 5, 9'


def test_failures_of_a_sweep_are_listed_level_by_level():
    failures = [Failure('ilqr', 'delay', 'delay', level, seed, 'fell')
                for level, seed in ((0.1, 0), (0.1, 1), (0.15, 4))]
    assert which(failures) == 'delay 0.1: seeds 0-1; delay 0.15: seed 4'

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import math

import numpy as np
from PIL import Image
import pytest
from synthetic import swing_up

from dp_swing_ros.figures import counterfactual, regret
from dp_swing_ros.pendulum.parameters import LimitParameters
from dp_swing_ros.rerun.counterfactual import Counterfactual, ScoredTrajectory


def trajectory(solver, begin, end, cost, settled=2.0, scale=1.0, links=2):
    """Return a part of a run that is made up."""
    run = swing_up(links=links)
    part = slice(begin, end)
    return ScoredTrajectory(solver, run.t[part], scale * run.X[part], run.U[begin:end - 1], cost,
                            settled)


def made_up(at=10, costs=(120.0, 100.0, 100.5, 1000.0), settled=2.0, scale=1.0, links=2):
    others = [trajectory(solver, at, 80, cost, settled, scale, links)
              for solver, cost in zip(('ilqr', 'ddp', 'mppi'), costs[1:])]
    return Counterfactual(0.05 * at, trajectory('ilqr', 0, at + 1, 0.0, links=links),
                          trajectory('ilqr', at, 80, costs[0], links=links), others)


ODD = {   # several oddities that do not meet are drawn in one
    'whole': made_up(), 'one link, from the start, no regret': made_up(
        at=0, costs=(5.0, 5.0, 5.0, 5.0), links=1),
    'three links, many turns, nobody held': made_up(settled=math.nan, scale=9.0, links=3),
    'one solver, unknown cost': made_up(costs=(math.nan, 4.0))}


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('name', ODD)
def test_pictures_are_not_blank_and_drawn_without_a_warning(name, tmp_path):
    limits = LimitParameters(force_limit=math.inf if 'many turns' in name else 20.0)
    times = (0.5,) if 'one solver' in name else (0.5, 3.0)
    for figure in (counterfactual(ODD[name], limits),
                   regret([ODD[name]._replace(at=at) for at in times])):
        figure.savefig(tmp_path / 'picture.png', dpi=50)
        with Image.open(tmp_path / 'picture.png') as image:
            assert np.asarray(image.convert('L')).std() > 5


@pytest.mark.parametrize('count', [1, 12])
def test_every_solver_is_drawn_however_many_there_are(count):
    names = ['ilqr', 'ddp', 'mppi', *(f'mine{n}' for n in range(9))][:count]
    one = made_up()._replace(others=[trajectory(name, 10, 80, 100.0) for name in names])
    figure = counterfactual(one, LimitParameters())
    th_1, *_ = figure.axes
    assert len([line for line in th_1.lines if len(line.get_xdata()) > 2]) == count + 1
    forces = [axes for axes in figure.axes if axes.get_ylabel() == '$u$ [N]']
    assert len(forces) == count + 1
    colours = [line.get_color() for line in th_1.lines[:count + 1]]
    assert len(set(colours)) == count + 1
    assert {line.get_linewidth() for line in th_1.lines[:count + 1]} == {
        th_1.lines[0].get_linewidth()}
    assert len(regret([one]).axes[1].get_legend().get_texts()) == count + 1


def test_accelerations_are_drawn_with_their_own_limit():
    figure = counterfactual(made_up(), LimitParameters(acceleration_limit=7.0), drive='velocity')
    of_input = [axes for axes in figure.axes if axes.get_ylabel() == '$u$ [m/s²]']
    assert of_input and all(7.0 in [line.get_ydata()[0] for line in axes.lines]
                            for axes in of_input)
    assert any('limits of track and acceleration' in words.get_text()
               for axes in figure.axes for words in axes.texts)


@pytest.mark.parametrize('links', [1, 3])
def test_every_angle_has_a_panel(links):
    figure = counterfactual(made_up(links=links), LimitParameters())
    labels = [axes.get_ylabel().split(' [')[0] for axes in figure.axes
              if axes.get_ylabel()][:links + 1]
    assert labels == [*(rf'$\theta_{i}$' for i in range(1, links + 1)), '$x$']


def test_the_cost_is_drawn_once_and_the_regret_is_in_words():
    figure = counterfactual(made_up(), LimitParameters())
    bars, = [axes for axes in figure.axes if axes.get_xlabel() == 'cost to go, without unit']
    assert [bar.get_width() for bar in bars.patches] == [120.0, 100.0, 100.5, 1000.0]
    assert [text.get_text().split('\n')[0] for text in bars.texts] == [
        'recorded (iLQR): 120, regret 20', 'iLQR: 100, the least', 'DDP: 100, regret 0.5',
        'MPPI: 1,000, regret 900']
    assert not [axes for axes in figure.axes if axes.get_xlabel() == 'regret']


def test_angles_begin_at_hanging_whatever_turn_was_recorded():
    one = made_up()
    for part in (one.past, one.recorded, *one.others):
        part.X[:, 1] -= 2 * np.pi
    th_1, *_ = counterfactual(one, LimitParameters()).axes
    assert th_1.lines[0].get_ydata()[0] == pytest.approx(np.pi)

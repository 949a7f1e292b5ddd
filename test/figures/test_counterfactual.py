# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import math

import numpy as np
from PIL import Image
import pytest
from synthetic import swing_up

from dp_swing_ros.figures import counterfactual, regret
from dp_swing_ros.pendulum.parameters import LimitParameters
from dp_swing_ros.rerun.counterfactual import Fork
from dp_swing_ros.rerun.runs import Course


def course(solver, begin, end, cost, settled=2.0, scale=1.0):
    """Return a part of a run that is made up."""
    run = swing_up()
    part = slice(begin, end)
    return Course(solver, run.t[part], scale * run.X[part], run.U[begin:end - 1], cost, settled)


def made_up(at=10, costs=(120.0, 100.0, 100.5, 1000.0), settled=2.0, scale=1.0):
    others = [course(solver, at, 80, cost, settled, scale)
              for solver, cost in zip(('ilqr', 'ddp', 'mppi'), costs[1:])]
    return Fork(0.05 * at, course('ilqr', 0, at + 1, 0.0), course('ilqr', at, 80, costs[0]),
                others)


ODD = {'whole': made_up(), 'from the start': made_up(at=0), 'nobody held': made_up(
    settled=math.nan), 'no regret': made_up(costs=(5.0, 5.0, 5.0, 5.0)),
    'many turns': made_up(scale=9.0), 'one solver': made_up(costs=(5.0, 4.0)),
    'unknown cost': made_up(costs=(math.nan, 4.0, 5.0, 6.0))}


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('name', ODD)
@pytest.mark.parametrize('draw', [
    lambda fork: counterfactual(fork, LimitParameters()),
    lambda fork: counterfactual(fork, LimitParameters(force_limit=math.inf)),
    lambda fork: regret([fork]), lambda fork: regret([fork, fork._replace(at=3.0)])])
def test_pictures_are_not_blank_and_drawn_without_a_warning(draw, name, tmp_path):
    draw(ODD[name]).savefig(tmp_path / 'picture.png', dpi=50)
    with Image.open(tmp_path / 'picture.png') as image:
        assert np.asarray(image.convert('L')).std() > 5


def test_every_solver_is_drawn_however_many_there_are():
    others = [course(name, 10, 80, 100.0) for name in ('ilqr', 'ddp', 'mppi', 'mine', 'yours')]
    figure = counterfactual(made_up()._replace(others=others), LimitParameters())
    th_1, *_ = figure.axes
    assert len([line for line in th_1.lines if len(line.get_xdata()) > 2]) == 6
    forces = [axes for axes in figure.axes if axes.get_ylabel() == '$u$ [N]']
    assert len(forces) == 6
    colours = [line.get_color() for line in th_1.lines[:6]]
    assert len(set(colours)) == 6
    assert {line.get_linewidth() for line in th_1.lines[:6]} == {th_1.lines[0].get_linewidth()}


def test_the_cost_is_drawn_once_and_the_regret_is_in_words():
    figure = counterfactual(made_up(), LimitParameters())
    bars, = [axes for axes in figure.axes if axes.get_xlabel() == 'cost to go, without unit']
    assert [bar.get_width() for bar in bars.patches] == [120.0, 100.0, 100.5, 1000.0]
    assert [text.get_text().split('\n')[0] for text in bars.texts] == [
        'recorded (iLQR): 120, regret 20', 'iLQR: 100, the least', 'DDP: 100, regret 0.5',
        'MPPI: 1,000, regret 900']
    assert not [axes for axes in figure.axes if axes.get_xlabel() == 'regret']


def test_angles_begin_at_hanging_whatever_turn_was_recorded():
    fork = made_up()
    for part in (fork.past, fork.recorded, *fork.others):
        part.X[:, 1] -= 2 * np.pi
    th_1, *_ = counterfactual(fork, LimitParameters()).axes
    assert th_1.lines[0].get_ydata()[0] == pytest.approx(np.pi)

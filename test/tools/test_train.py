# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command, from bags that real nodes recorded to an mpc that plans with what it left."""

import subprocess

import numpy as np
from one_process import record
from PIL import Image
import pytest
from real_bags import rewritten

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.control import controllers
from dp_swing_ros.dynamics.files import load
from dp_swing_ros.learning import regression
from dp_swing_ros.learning.quality import Errors
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import deviation
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.tools.train import by_commands, main, remarks
from dp_swing_ros.topics import FORCE_COMMAND, JOINT_STATES

BODIES = {'cart_mass': 0.8, 'link2_mass': 0.6, 'link1_length': 0.7, 'cart_dry_friction': 1.0,
          'force_limit': 20.0, 'track_limit': 2.4}   # as the mpc has them


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return a swing-up of bodies that the mpc takes for others, and filters its way to."""
    lines = ''.join(f'    {name}: {value}\n' for name, value in BODIES.items())
    return record(tmp_path_factory.mktemp('bag'), '--lockstep', '--duration', '15',
                  plant=f'{lines}    position_noise: 0.001\n    velocity_noise: 0.01\n')


@pytest.fixture
def briefly(monkeypatch):
    """Let a model be of few rounds, where it is not tested how good it is."""
    monkeypatch.setattr(regression, 'ROUNDS', 3)


def test_the_process_leaves_a_model_that_holds_what_moved(bag, tmp_path):
    output = tmp_path / 'new' / 'model.json'
    run = subprocess.run(['ros2', 'run', 'dp_swing_ros', 'train', str(bag), '-o', str(output)],
                         capture_output=True, text=True, timeout=280)
    assert run.returncode == 0, run.stderr
    assert ' s to learn from, ' in run.stdout and 'warning' not in run.stdout
    with Image.open(output.with_suffix('.png')) as picture:
        assert min(picture.size) > 400
    found = load(str(output), 2)
    assert found.about['bags'] == ['bag'] and len(found.about['experience']) == 16
    own, equations = (np.array(found.about[name]['speeds'])
                      for name in ('errors', 'errors of the equations'))
    assert np.all(own < 0.9 * equations)   # it stands still for most of it
    plant = plants.plant(BODIES)
    learned = controllers.controller({'dynamics': 'learned', 'model': str(output)})
    episode = simulate(plant, learned, 10.0)
    assert np.all(deviation(episode.X[-40:], learned.nominal.x_r) < 0.1)


def test_a_model_lies_beside_the_bag_where_nothing_else_is_said(bag, briefly, capsys):
    assert main([str(bag), '--seed', '3']) == 0
    assert str(bag.with_name('bag_structured.json')) in capsys.readouterr().out.splitlines()


def test_what_a_killed_logger_left_is_learned_from_and_what_is_missing_is_said(
        bag, briefly, tmp_path, capsys):
    cut, whole = tmp_path / 'cut.mcap', (bag / 'bag_0.mcap').read_bytes()
    cut.write_bytes(whole[:len(whole) * 2 // 3])
    assert main([str(cut), '--partial', '-o', str(tmp_path / 'model.json')]) == 0
    assert Bag(cut, True).incomplete in capsys.readouterr().out


def test_positions_alone_are_no_experience_unless_an_estimate_has_the_speeds(
        bag, briefly, tmp_path, capsys):
    def still(message):
        message.velocity = []
        return message
    # the mpc of the bag has estimated them, and they are in its diagnostics
    assert main([str(rewritten(bag, tmp_path / 'a', JOINT_STATES, still)), '-o',
                 str(tmp_path / 'model.json')]) == 0
    capsys.readouterr()


@pytest.mark.parametrize(('change', 'words'), [
    (lambda message: None, 'no commands on'), (None, 'links; 3 were asked for')])
def test_what_cannot_be_learned_from_is_refused(bag, tmp_path, capsys, change, words):
    if change is None:
        arguments = [str(bag), '--links', '3']
    else:
        arguments = [str(rewritten(bag, tmp_path / 'a', FORCE_COMMAND, change))]
    assert main([*arguments, '-o', str(tmp_path / 'model.json')]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / 'model.json').exists()


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--links', '9'], 'invalid choice'), (['--seed', '-1'], 'at least 0')])
def test_misuse_is_refused(arguments, words, capsys):
    with pytest.raises(SystemExit, match='2'):
        main(['bag', *arguments])
    assert words in capsys.readouterr().err


def test_springs_that_nothing_learns_are_told():
    ours = Errors(np.ones(3), np.ones(5))
    worse = Errors(2 * np.ones(3), np.ones(5))
    assert remarks(ours, worse, False) == []
    assert remarks(ours, worse, True) == [
        'warning: the joints have springs, of which what is learned knows nothing']


def test_commands_move_a_pendulum_as_their_forces_do():
    p = Pendulum.of(PendulumParameters(cart_friction=0.3, joint1_dry_friction=0.1,
                                       joint2_stiffness=0.4, joint1_preload=0.2))
    x = [0.1, 2.0, -1.0, 0.5, 1.5, -2.0]
    np.testing.assert_allclose(by_commands(p, 2.5).accelerations(x, 3.0),
                               p.accelerations(x, 7.5), rtol=1e-12)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command, from its words to the model and the picture that it leaves."""

from contextlib import closing
from itertools import islice
import threading

from conftest import PATIENCE, wait_until
import numpy as np
from peer import Peer
from PIL import Image
import pytest

from dp_swing_ros.bags.episodes import revisions_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.dynamics.files import load
from dp_swing_ros.learning.trials import trials
from dp_swing_ros.nodes.connections import publish
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.tools import learn, live_learning, verify
from dp_swing_ros.tools.learn import main
from dp_swing_ros.topics import FORCE_COMMAND, JOINT_STATES

# the limits are those of an mpc that is told no bodies
PLANT = ('/**:\n  ros__parameters: {cart_mass: 0.5, link1_length: 0.6, link2_length: 0.6,\n'
         '    force_limit: 20.0, track_limit: 2.4}\n'
         'plant:\n  ros__parameters: {position_noise: 0.01, velocity_noise: 0.01}\n')


def test_a_model_a_picture_and_a_line_a_trial(tmp_path, capsys):
    file = tmp_path / 'plant.yaml'
    file.write_text(PLANT)
    assert main(['--params', str(file), '--solver', 'mppi', '--trial', '5', '--total', '25',
                 '-o', str(tmp_path / 'learned')]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith('trial 1: 5.0 s of experience, ')
    assert lines[-1].startswith('held after ')
    assert load(str(tmp_path / 'learned' / 'model.json'), 2).about['seconds'] > 5.0
    with Image.open(tmp_path / 'learned' / 'learning.png') as picture:
        assert min(picture.size) > 300


def test_an_option_that_is_not_given_leaves_what_a_file_says(here, monkeypatch, capsys):
    (here / 'file.yaml').write_text('/**:\n  ros__parameters: {seed: 5}\n'
                                    'mpc:\n  ros__parameters: {solver: ddp}\n')
    asked = []

    def nothing(arguments, mpc, plant, *rest):
        asked.append((mpc['solver'], mpc['seed'], plant['seed']))
        return None, []
    monkeypatch.setattr(learn, '_simulated', nothing)
    assert main(['--params', 'file.yaml']) == main([
        '--params', 'file.yaml', '--solver', 'ilqr', '--seed', '0', '-o', 'other']) == 1
    assert asked == [('ddp', 5, 5), ('ilqr', 0, 0)]
    assert 'ddp: 5 s of random forces first -> runs/learn_ddp_' in capsys.readouterr().out


def test_what_is_not_held_is_said_and_what_was_learned_is_left(tmp_path, capsys):
    assert main(['--first', '2', '--total', '3', '-o', str(tmp_path / 'learned')]) == 1
    assert capsys.readouterr().out.splitlines()[-1].startswith('not held after ')
    assert (tmp_path / 'learned' / 'model.json').exists()


def test_what_was_learned_until_an_interrupt_is_kept(tmp_path, capsys, monkeypatch):
    def interrupted(learner, *rest):
        yield from islice(trials(learner, *rest), 1)
        raise KeyboardInterrupt
    monkeypatch.setattr(learn, 'trials', interrupted)
    output = tmp_path / 'learned'
    assert main(['--first', '2', '--trial', '3', '--total', '9', '-o', str(output)]) == 130
    assert f'what was learned until then is in {output / "model.json"}' in capsys.readouterr().err
    assert load(str(output / 'model.json'), 2).about['seconds'] > 0


def test_time_for_more_than_the_random_forces_is_needed(here, capsys):
    assert main(['--total', '4']) == 2
    assert '--total is 4 s, and --first, of random forces alone, 5 s' in capsys.readouterr().err
    assert not (here / 'runs').exists()


def test_a_plant_that_runs_is_held_by_an_mpc_whose_model_is_learned(
        start_node, tmp_path, monkeypatch, capsys):
    """In lockstep, so that a busy machine is fast enough; it only learns more rarely."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(live_learning, 'SILENCE', PATIENCE)   # of a busy machine
    file, bag = tmp_path / 'plant.yaml', tmp_path / 'bag'
    file.write_text(PLANT)
    logger = start_node('logger', {'output': str(bag)})
    logger.wait_for('recording to')
    plant = start_node('plant', {'lockstep': True, 'pace': 2.0}, ['--params-file', str(file)])
    plant.wait_for('waiting for a controller')

    def publish_to_both(node, topic):
        forces = publish(node, topic)
        assert wait_until(lambda: forces.get_subscription_count() == 2)   # the logger hears all
        return forces
    monkeypatch.setattr(live_learning, 'publish', publish_to_both)
    assert main(['--live', '--total', '200', '-o', 'learned']) == 0
    out = capsys.readouterr().out
    assert 'held after ' in out and 'not held' not in out
    assert (plant.stop(), logger.stop()) == (0, 0)
    model = load(str(tmp_path / 'learned' / 'model.json'), 2)
    assert 5.0 < model.about['seconds'] < 200.0
    # it was learned again, and the mpc planned with that too
    models = {each.parameters['model'] for each in revisions_of(Bag(bag))['mpc'].values()}
    assert len(models) > 1
    forces = [message.data for message in Bag(bag).of(FORCE_COMMAND)]
    # those of each master end with zero, and none is beyond the limit
    assert forces[-1] == 0.0 and 0.0 in forces[:-1] and max(map(abs, forces)) <= 20.0
    assert verify.main([str(bag)]) == 1   # the random forces are of no tick; all ticks repeat
    out = capsys.readouterr().out
    assert 'forces on force_command are of no tick' in out and 'ticks of ilqr in' not in out
    assert 'not checked: states and efforts, which began under forces that no tick sent' in out
    log = (tmp_path / 'learned' / 'mpc.log').read_text()
    assert 'model is {"format"' in log and max(map(len, log.splitlines())) < 1000


@pytest.mark.real_time
def test_a_plant_in_real_time_is_held_too(start_node, tmp_path, capsys):
    start_node('plant', {'link2_mass': 0.7}).wait_for('states a second')
    assert main(['--live', '--total', '60', '-o', str(tmp_path / 'learned')]) == 0
    assert 'held after ' in capsys.readouterr().out


def test_where_nothing_runs_it_says_so(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(live_learning, 'SILENCE', 1.0)
    assert main(['--live', '-o', str(tmp_path / 'learned')]) == 2
    assert 'no state on joint_states for 1 s; start a plant' in capsys.readouterr().err


def test_there_is_one_master(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(live_learning, 'DISCOVERY', 10.0)   # of a busy machine
    with closing(Peer()) as peer:
        publish(peer.node, FORCE_COMMAND)
        assert main(['--live', '-o', str(tmp_path / 'learned')]) == 2
    assert '/peer on force_command, too; end it' in capsys.readouterr().err


def test_live_a_plant_of_more_links_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(live_learning, 'SILENCE', PATIENCE)   # of a busy machine
    done = threading.Event()
    message = to_joint_state(to_stamp(0), np.zeros(8), 0.0)
    with closing(Peer()) as peer:
        states = publish(peer.node, JOINT_STATES)

        def send():
            while not done.wait(0.05):
                states.publish(message)
        sender = threading.Thread(target=send)
        sender.start()
        try:
            assert main(['--live', '-o', str(tmp_path / 'learned')]) == 2
        finally:
            done.set()
            sender.join()
    assert 'give the number of links' in capsys.readouterr().err


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--live', '--trial', '5'], 'not allowed with'),
    (['--solver', 'none'], 'invalid choice'), (['--first', '0'], 'at least 0.5')])
def test_misuse_is_refused(arguments, words, capsys):
    with pytest.raises(SystemExit, match='2'):
        main(arguments)
    assert words in capsys.readouterr().err


def test_live_a_file_for_another_node_is_refused(here, capsys):
    (here / 'file.yaml').write_text('mcp:\n  ros__parameters: {horizon: 9}\n')
    assert main(['--live', '--params', 'file.yaml']) == 2
    assert "did you mean 'mpc'?" in capsys.readouterr().err
    assert not (here / 'runs').exists()


def test_a_file_that_is_missing_leaves_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(['--params', 'none.yaml']) == 2
    assert 'none.yaml' in capsys.readouterr().err
    assert not list(tmp_path.iterdir())

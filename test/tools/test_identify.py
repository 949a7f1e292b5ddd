# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import subprocess

import numpy as np
from one_process import Crew, record
import pytest
import real_bags
from real_bags import rewritten
import virtual

from dp_swing_ros import declarations
from dp_swing_ros.bags.episodes import configurations_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.control import controllers
from dp_swing_ros.identification import fit, identify, recorded as times
from dp_swing_ros.identification.fit import ROUGH
from dp_swing_ros.identification.recorded import recorded
from dp_swing_ros.nodes.mpc import MpcNode
from dp_swing_ros.nodes.plant import PlantNode
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.simulation import plants
from dp_swing_ros.tools.identify import main
from dp_swing_ros.topics import (
    CONFIGURATION, DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES, ROBOT_DESCRIPTION)

RIG = {'cart_mass': 1.1, 'link2_mass': 0.55, 'link1_length': 1.05, 'joint1_dry_friction': 0.02,
       'actuation_delay': 0.01, 'motor_time_constant': 0.015}
NOISE = {'position_noise': 1e-4}   # which every rig has; to be exact takes a fit ten times as long
PLANT = ''.join(f'    {name}: {value}\n' for name, value in {**RIG, **NOISE}.items())
HOUR = 3600   # [s]


@pytest.fixture(scope='module')
def lockstep(tmp_path_factory):
    # with seed 1 the forces change often enough to tell the delay of the drive from its lag
    return record(tmp_path_factory.mktemp('lockstep'), '--lockstep', '--duration', '5',
                  '--seed', '1', plant=PLANT)


@pytest.fixture(scope='module')
def real_time(tmp_path_factory):
    return virtual.record(tmp_path_factory.mktemp('real_time') / 'bag', 5.0,
                          np.random.default_rng(20), **RIG, **NOISE)


@pytest.fixture
def roughly(monkeypatch):
    """Let the fit be rough to the end, where the work is tested and not how exact it is."""
    for module in fit, identify:
        monkeypatch.setattr(module, 'FINE', ROUGH)


def stamped(change):
    """Return what changes the stamps of states [s]."""
    def of_message(message):
        message.header.stamp.sec, message.header.stamp.nanosec = change(message.header.stamp)
        return message
    return of_message


@pytest.fixture(scope='module')
def identified(lockstep, tmp_path_factory):
    """Return what the process printed, and the file that it wrote."""
    output = tmp_path_factory.mktemp('identified') / 'new' / 'rig.yaml'
    run = subprocess.run(['ros2', 'run', 'dp_swing_ros', 'identify', str(lockstep), '-o',
                          str(output)], capture_output=True, text=True, timeout=280)
    assert run.returncode == 0, run.stderr
    return run.stdout, output


def test_the_process_finds_what_moved_the_plant(identified):
    shown, output = identified
    assert 'force_gain held at 1.0' in shown
    assert times.LOCKSTEP in shown
    assert output.with_suffix('.png').stat().st_size > 10_000
    values = declarations.read([output])
    assert values['plant'] == values['mpc']
    for name, value in RIG.items():
        assert values['mpc'][name] == pytest.approx(value, rel=0.02, abs=2e-3), name


def test_plant_and_mpc_take_the_file(identified, lockstep, tmp_path):
    _, output = identified
    values = declarations.read([output])
    told = configurations_of(Bag(lockstep))['mpc'].parameters
    for name in ('drive', 'force_limit', 'track_limit'):   # of which motion tells nothing
        assert values['mpc'][name] == values['plant'][name] == told[name]
    assert 'cart_speed_limit' not in values['mpc']         # there is none
    found = plants.plant(values['plant']).physical
    assert found.cart_mass == values['plant']['cart_mass']
    assert controllers.controller(values['mpc']).belief.drive.gain == pytest.approx(1, abs=0.02)
    with Crew(tmp_path / 'nodes.yaml', {'plant': {'duration': 0.2}},
              ['--params-file', str(output)]) as crew:
        mpc, plant = map(crew.start, (MpcNode, PlantNode))
        assert crew.until(lambda: plant.done)
        for node in (mpc.core.live, plant):
            assert node.values['cart_mass'] == values['plant']['cart_mass']
        for node in (mpc, plant):
            crew.end(node)


def assert_is_found_in(bag, file):
    """Check that the rig is found from what was sent in real time."""
    found = recorded(Bag(bag))
    assert found.times == times.SAME
    ages = found.motion.sent[20:] - found.motion.t[np.searchsorted(
        found.motion.t, found.motion.sent[20:]) - 1]
    assert np.median(ages) > 0
    assert main([str(bag), '-o', str(file)]) == 0
    values = declarations.read([file])['mpc']
    assert values['cart_mass'] == pytest.approx(RIG['cart_mass'], rel=0.03)
    assert values['link1_length'] == pytest.approx(RIG['link1_length'], rel=0.03)


def test_in_real_time_a_command_counts_from_when_it_was_sent(real_time, roughly, tmp_path):
    assert_is_found_in(real_time, tmp_path / 'rig.yaml')


@pytest.mark.real_time
def test_what_processes_did_in_real_time_is_identified(tmp_path):
    assert_is_found_in(real_bags.record(tmp_path / 'run', '--duration', '4', plant=PLANT),
                       tmp_path / 'rig.yaml')


def test_stamps_of_another_clock_are_fitted(real_time, tmp_path):
    bag = rewritten(real_time, tmp_path / 'bag', JOINT_STATES,
                    stamped(lambda stamp: (stamp.sec - HOUR, stamp.nanosec)))
    found, usual = recorded(Bag(bag)), recorded(Bag(real_time))
    assert found.times == times.OTHER
    np.testing.assert_allclose(found.motion.t, usual.motion.t)
    np.testing.assert_allclose(found.motion.sent, usual.motion.sent, atol=times.LOOSE)


def test_where_stamps_are_zero_the_log_counts(real_time, tmp_path):
    bag = rewritten(real_time, tmp_path / 'bag', JOINT_STATES, stamped(lambda stamp: (0, 0)))
    found, usual = recorded(Bag(bag)), recorded(Bag(real_time))
    assert found.times == times.LOGGED
    np.testing.assert_allclose(found.motion.t, usual.motion.t, atol=times.LOOSE)


def test_states_and_commands_are_all_that_a_bag_needs(real_time, tmp_path):
    bag = real_time
    for n, topic in enumerate((CONFIGURATION, DIAGNOSTICS, ROBOT_DESCRIPTION)):
        bag = rewritten(bag, tmp_path / f'bag{n}', topic, lambda message: None)
    found, usual = recorded(Bag(bag)), recorded(Bag(real_time))
    assert found.times == times.SAME
    np.testing.assert_array_equal(found.motion.Q, usual.motion.Q)
    assert found.physical == PendulumParameters()


def test_several_bags_are_of_one_rig(lockstep, real_time, roughly, tmp_path, capsys):
    output = tmp_path / 'rig.yaml'
    assert main([str(lockstep), str(real_time), '--known', 'cart_mass=1.1', '-o',
                 str(output)]) == 0
    shown = capsys.readouterr().out
    assert times.LOCKSTEP in shown and times.SAME in shown
    assert declarations.read([output])['mpc']['cart_mass'] == 1.1


def test_a_bag_without_commands_is_one_line(lockstep, roughly, tmp_path, capsys):
    bag = rewritten(lockstep, tmp_path / 'bag', FORCE_COMMAND, lambda message: None)
    assert main([str(bag)]) == 2
    assert 'no commands on force_command' in capsys.readouterr().err
    assert main([str(bag), '-o', str(tmp_path / 'rig.yaml'), '--cart', 'given']) == 0
    lengths = declarations.read([tmp_path / 'rig.yaml'])['mpc']
    assert lengths['link1_length'] == pytest.approx(RIG['link1_length'], rel=0.05)
    assert 'cart_mass' not in lengths


def test_a_rig_that_hangs_still_is_one_line(lockstep, tmp_path, capsys):
    def hang(message):
        message.position = [0.0, np.pi, np.pi]
        return message
    assert main([str(rewritten(lockstep, tmp_path / 'bag', JOINT_STATES, hang))]) == 2
    assert 'moves too little' in capsys.readouterr().err


@pytest.mark.parametrize('arguments, text', [
    (['--links', '1'], 'is of 2 links'),
    (['--known', 'cart_mas=1.1'], "did you mean 'cart_mass'"),
    (['--known', 'cart_mass=-1'], 'at least 0.001'),
    (['--known', 'force_limit=20'], 'unknown parameter'),
    (['--known', 'horizon=30'], 'unknown parameter'),
    (['--cart', 'given', '--known', 'cart_mass=1.1'], 'nothing depends on it')])
def test_what_cannot_be_is_one_line(lockstep, arguments, text, capsys):
    assert main([str(lockstep), *arguments]) == 2
    assert text in capsys.readouterr().err


def test_a_bag_that_is_not_there_is_one_line(tmp_path, capsys):
    assert main([str(tmp_path / 'none')]) == 2
    assert 'there is no bag' in capsys.readouterr().err


def test_what_is_known_has_a_name_and_a_number(lockstep, capsys):
    with pytest.raises(SystemExit) as end:
        main([str(lockstep), '--known', 'cart_mass'])
    assert end.value.code == 2
    assert 'is not NAME=VALUE' in capsys.readouterr().err

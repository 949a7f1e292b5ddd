# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is made to hang or to fill the memory ends soon, in one line; each in its own process."""

import os
from types import SimpleNamespace

from limited import called
from made_bags import encoded, FLOAT
from mcap.writer import Writer
import pytest
from rclpy.serialization import serialize_message
from recorded_bags import record
from recorded_runs import told, write_bag
from std_msgs.msg import String
from synthetic import first, swing_up
import yaml

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.messages.definitions import schema

TOOLS = ('analyse', 'verify', 'compare', 'recover', 'export', 'replay')
ALIASES = 'a0: &a0 [x, x, x, x, x, x, x, x, x]\n' + ''.join(
    f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 9)}]\n' for n in range(1, 40))
DEEP, LONG = '[' * 100_000, 'a: ' + 'x' * (2 << 20)


def run(tool, bag, *arguments):
    """Call a tool on a bag within the limits; return the exit code and what it printed."""
    place, given = 'tools', [str(bag), *arguments]
    if tool == 'replay':
        place, given = 'nodes', ['--ros-args', '-p', f'bag:={bag}', '-p', 'rate:=1000.0', '-p',
                                 'wait:=0.0']
    return called(f'{place}.{tool}', given if place == 'tools' else [tool, *given], bag.parent)


@pytest.fixture
def bag(tmp_path):
    return record(tmp_path / 'bag', duration=1.0).parent


UNFOLDING = ALIASES + (
    'rosbag2_bagfile_information: {relative_file_paths: *a39, message_count: 1}')


@pytest.mark.parametrize('tool, text', [
    *((tool, UNFOLDING) for tool in TOOLS), ('analyse', DEEP), ('recover', LONG)])
def test_metadata_does_not_unfold(bag, tool, text):
    (bag / 'metadata.yaml').write_text(text)
    code, shown = run(tool, bag)
    assert (code == 2) == (tool in ('analyse', 'verify', 'compare')), shown


@pytest.mark.parametrize('text', [
    ALIASES, DEEP, LONG, yaml.safe_dump(told('mpc', {'seed': 10 ** 400})._asdict()),
    'node: 0x' + 'f' * 50_000, 'node: 1' + ':59' * 20_000],
    ids=['aliases', 'deep', 'long', 'seed', 'hexadecimal', 'base 60'])
def test_configuration_does_not_unfold(tmp_path, text):
    raw = SimpleNamespace(to_text=lambda: text)
    bag = write_bag(first(swing_up(), 20), tmp_path / 'bag', [raw])
    code, shown = run('verify', bag)
    # a number of base 60, which would take the square of its length, is a text
    wrong = 'expected YAML with node' if ':59' in text else 'a configuration is not YAML'
    assert code == 2 and wrong in shown, shown


@pytest.mark.parametrize('text', [ALIASES, DEEP[:50_000]], ids=['aliases', 'deep'])
def test_profiles_do_not_unfold(tmp_path, text):
    with (tmp_path / 'bag.mcap').open('wb') as file:
        writer = Writer(file)
        writer.start(profile='ros2')
        number = writer.register_schema(FLOAT, 'ros2msg', schema(FLOAT).encode())
        channel = writer.register_channel('/force_command', 'cdr', number,
                                          {'offered_qos_profiles': text})
        for time in range(3):
            writer.add_message(channel, time, encoded(time), time)
        writer.finish()
    code, shown = run('replay', tmp_path / 'bag.mcap')
    assert code == 2 and 'its quality of service is' in shown, shown
    assert run('recover', tmp_path / 'bag.mcap')[0] == 0


@pytest.mark.parametrize('text', [
    f'/**/mpc:\n  ros__parameters:\n    seed: {"9" * 400}', ALIASES, DEEP, LONG],
    ids=['seed', 'aliases', 'deep', 'long'])
def test_parameter_files_do_not_unfold(tmp_path, text):
    (tmp_path / 'file.yaml').write_text(text)
    code, shown = called('tools.evaluate', ['--contestants', f'ilqr:{tmp_path / "file.yaml"}',
                                            '--seeds', '1'], tmp_path)
    # what is beyond any number is a text, as ROS has it
    assert code == 2 and ("'seed'" if 'seed' in text else 'is not YAML') in shown, shown


@pytest.mark.parametrize('arguments, text', [
    (['--seeds', '0:99999999999'], 'are not up to 100000 seeds'),
    (['--seeds', '9' * 400], 'are not up to 100000 seeds'),
    (['--seeds', f'{"9" * 400}:1{"0" * 400}'], 'are not up to 100000 seeds'),
    (['--levels', '99999999999'], 'is not a whole number of at least 1 and at most 10000'),
    (['--contestants', f'ilqr:seed={"9" * 400}'], 'expected a whole number')])
def test_numbers_of_a_campaign_are_bounded(tmp_path, arguments, text):
    code, shown = called('tools.evaluate', arguments, tmp_path)
    assert code == 2 and text in shown, shown


@pytest.mark.parametrize('tool', [*TOOLS, 'identify'])
def test_named_pipes_are_no_bags(bag, tool):
    pipe = bag.with_name('pipe.mcap')
    os.mkfifo(pipe)
    code, shown = run(tool, pipe)
    assert code == 2 and 'neither a folder nor a regular file' in shown, shown


def test_named_pipes_are_no_files_of_a_bag(bag):
    (bag / 'metadata.yaml').unlink()
    os.mkfifo(bag / 'metadata.yaml')
    assert run('analyse', bag, '--no-animation')[0] == 0
    (bag / 'bag_0.mcap').unlink()
    os.mkfifo(bag / 'bag_0.mcap')
    code, shown = run('analyse', bag)
    assert code == 2 and 'it is not a regular file' in shown, shown


@pytest.mark.parametrize('definition', [
    ''.join(f'float64 f{n}\n' for n in range(20_000)), 'float64 ' + 'f' * 10_000_000],
    ids=['fields', 'long'])
def test_definitions_are_bounded(tmp_path, definition):
    writer = BagWriter(tmp_path / 'bag')
    writer.add(Recorded('/joint_states', 'sensor_msgs/msg/JointState', definition, '', []))
    writer.write('/joint_states', serialize_message(String(data='x')), 1, 1, 1)
    writer.close()
    code, shown = run('analyse', tmp_path / 'bag')
    assert code == 2 and 'its definition is longer than' in shown, shown

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""scripts/ros2, which stands in for ros2cli, on a prefix that holds one package."""

import os
import re
import signal
import subprocess
import sys
import threading

from conftest import PATIENCE
from peer import Peer
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from standin import ROS2, ros2
from std_srvs.srv import SetBool, Trigger


@pytest.fixture
def prefix(tmp_path):
    """Return a prefix with the package 'swing': two executables and a text."""
    marker = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages' / 'swing'
    marker.parent.mkdir(parents=True)
    marker.touch()
    folder = tmp_path / 'lib' / 'swing'
    folder.mkdir(parents=True)
    (folder / 'echo').write_text(
        '#!/bin/sh\ntrap "exit 7" INT\nprintf "%s\\n" $$ "$@" end\nread forever\n')
    (folder / 'notes').write_text('no executable')
    (folder / 'other').touch()
    for name in ('echo', 'other'):
        (folder / name).chmod(0o755)
    return tmp_path


def start(prefix, *arguments):
    return subprocess.Popen(
        [sys.executable, ROS2, *arguments], text=True,
        env={**os.environ, 'AMENT_PREFIX_PATH': str(prefix)},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


@pytest.fixture
def call(prefix, monkeypatch):
    """Return a function that calls it where 'swing' is the only package."""
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    return ros2


def test_run_becomes_the_executable_with_its_arguments_and_exit_code(prefix):
    words = ('--ros-args', '-p', 'a:=[1.0, 2.0]', '--help', '')
    with start(prefix, 'run', 'swing', 'echo', *words) as process:
        shown = [process.stdout.readline() for _ in range(len(words) + 2)]
        assert shown == [f'{word}\n' for word in (process.pid, *words, 'end')]
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 7
        assert process.communicate() == ('', '')


@pytest.mark.parametrize('arguments', [(), ('swing',)])
def test_pkg_executables(call, arguments):
    assert call('pkg', 'executables', *arguments) == (0, 'swing echo\nswing other\n', '')


@pytest.mark.parametrize('arguments, says', [
    (['run', 'wing', 'echo'], "no package 'wing' in AMENT_PREFIX_PATH; available: swing"),
    (['run', '../wing', 'echo'], "no package '../wing' in AMENT_PREFIX_PATH; available: swing"),
    (['pkg', 'executables', 'wing'], "no package 'wing' in AMENT_PREFIX_PATH; available: swing"),
    (['run', 'swing', 'notes'], "no executable 'notes' in package 'swing'; "
                                'available: echo, other'),
    (['topic', 'delay', '/x'], "cannot do 'topic delay /x'; this stand-in knows"),
    (['run', 'swing'], "cannot do 'run swing'; this stand-in knows"),
])
def test_what_it_cannot_do_is_one_line(call, arguments, says):
    code, output, error = call(*arguments)
    assert (code, output) == (2, '')
    assert error.startswith(f'ros2: {says}')
    assert error.count('\n') == 1


def test_without_a_sourced_workspace_it_says_what_to_source():
    with start('', 'run', 'swing', 'echo') as process:
        assert process.communicate(timeout=PATIENCE) == (
            '', 'ros2: AMENT_PREFIX_PATH is not set; source install/setup.bash first\n')
        assert process.returncode == 2


@pytest.mark.parametrize('arguments', [[], ['--help']])
def test_help(call, arguments):
    code, output, _ = call(*arguments)
    assert code == 0
    assert output.startswith('usage: ros2 run PACKAGE EXECUTABLE')


TOP = ROS2.parents[1]
ELSEWHERE = {'bag'}   # of rosbag2, beside which this package's own are described


def test_it_knows_what_the_documents_prescribe():
    usage = ros2('--help')[1]
    pages = [TOP / 'README.md', TOP / 'CONTRIBUTING.md', *(TOP / 'docs').rglob('*.md')]
    prescribed = {' '.join(words) for page in pages for words in re.findall(
        r'(?m)(?:^ *|`|; )ros2 ([a-z]+) ([a-z]+)', page.read_text()) if words[0] not in ELSEWHERE}
    assert {'run dp', 'topic echo', 'service call', 'param set'} <= prescribed
    for words in prescribed:
        assert f'ros2 {re.sub("^run .*", "run ", words)}' in usage


@pytest.fixture
def swing():
    """Have a node /swing with a latched topic, two services and a parameter."""
    peer = Peer('swing')
    publisher = peer.node.create_publisher(JointState, 'kept', QoSProfile(
        depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    state = JointState(name=['cart'], position=[0.5])
    state.header.stamp.sec = 7
    publisher.publish(state)
    peer.node.declare_parameter('gain', 3.0)

    def trigger(_, response):
        response.message = 'triggered'
        return response

    def switch(request, response):
        response.success = request.data
        return response

    peer.node.create_service(Trigger, 'swing/reset', trigger)
    peer.node.create_service(SetBool, 'swing/enable', switch)
    over = threading.Event()
    thread = threading.Thread(target=peer.until, args=(over.is_set, 600.0))
    thread.start()
    yield peer
    over.set()
    thread.join()
    peer.close()


def asked(*arguments, code=0):
    """Return what it prints where the packages are those of the test."""
    found, output, errors = ros2(*arguments)
    assert found == code, errors
    return output if code == 0 else errors


def test_nodes_topics_services_and_parameters_are_listed(swing):
    assert asked('node', 'list') == '/swing\n'
    assert '/kept' in asked('topic', 'list').splitlines()
    pipe = f'{sys.executable} {ROS2} service list | head -n 1'   # which ends in no traceback
    assert subprocess.run(pipe, shell=True, capture_output=True,
                          timeout=PATIENCE).stderr == b''
    assert {'/swing/reset', '/swing/enable'} <= set(asked('service', 'list').splitlines())
    listed = asked('param', 'list').splitlines()
    assert listed[0] == '/swing:' and '  gain' in listed
    assert asked('param', 'get', '/swing', 'gian', code=1) == (
        "Parameter not set; did you mean 'gain'?\n")


def test_a_topic_is_read_and_described(swing):
    assert asked('topic', 'echo', '--once', 'kept') == """\
header:
  stamp:
    sec: 7
    nanosec: 0
  frame_id: ''
name:
- cart
position:
- 0.5
velocity: []
effort: []
---
"""
    assert asked('topic', 'info', '/kept') == (
        'Type: sensor_msgs/msg/JointState\nPublisher count: 1\nSubscription count: 0\n')
    assert 'Node name: swing\n' in asked('topic', 'info', '-v', 'kept')
    assert asked('topic', 'echo', '/kpet', code=2).endswith(
        'nobody has /kpet; of a near name: /kept\n')


def test_a_service_is_called(swing):
    answer = asked('service', 'call', '/swing/enable', 'std_srvs/srv/SetBool', '{data: true}')
    assert answer.endswith(
        "response:\nstd_srvs.srv.SetBool_Response(success=True, message='')\n\n")
    assert "message='triggered'" in asked('service', 'call', 'swing/reset', 'std_srvs/srv/Trigger')
    assert 'no request of std_srvs/srv/SetBool: ' in asked(
        'service', 'call', '/swing/enable', 'std_srvs/srv/SetBool', '{date: true}', code=2)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags of made-up episodes, written as the logger would."""

from contextlib import closing, contextmanager

import rclpy  # noqa: F401  the wheels start Python anew here, before anything else is read
from rclpy.serialization import serialize_message
from rosbags.serde import SerdeError
from rosbags.typesys import get_typestore, Stores
from std_msgs.msg import String

from dp_swing_ros import topics
from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.messages.cdr import to_diagnostics
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.pendulum.urdf import urdf

START = 1_000_000_000_000  # [ns]
TYPES = get_typestore(Stores.ROS2_JAZZY)


def told(node, parameters, **others):
    """Return what a node says that it ran with."""
    about = {'version': '0.1', 'commit': 'abc', 'sources': '123', 'machine': 'a machine',
             'packages': {'numpy': '2.0'}}
    return Configuration(f'/{node}', parameters, **{**about, **others})


def serialised(message):
    """Return the bytes of a message, which it may be already; the same ones in every process."""
    if isinstance(message, bytes):
        return message
    package, _, _ = type(message).__module__.partition('.')
    name = f'{package}/msg/{type(message).__name__}'
    data = serialize_message(message)
    try:   # between fields rclpy leaves what was in the memory, rosbags zeros
        fields = TYPES.deserialize_cdr(data, name)
    except SerdeError:   # which does not read what rclpy writes of one without a list
        return data
    return bytes(TYPES.serialize_cdr(fields, name))


@contextmanager
def written(folder, recorded):
    """Write a bag with these topics; yield what writes a message of one at a time [ns]."""
    with closing(BagWriter(folder)) as writer:
        for topic in recorded:
            writer.add(Recorded(topic.name, topic.type, schema(topic.type), '', []))
        yield lambda topic, time, message, sequence=0: writer.write(
            topic.name, serialised(message), time, time, sequence)


def write_bag(episode, folder, configurations=()):
    """Write an episode, and what nodes tell; return the folder."""
    recorded = [topics.ROBOT_DESCRIPTION, topics.JOINT_STATES, topics.DIAGNOSTICS,
                *([topics.CONFIGURATION] if configurations else [])]
    stamps = [START + round(1e9 * t) for t in episode.t]
    with written(folder, recorded) as write:
        write(topics.ROBOT_DESCRIPTION, START, String(data=urdf(episode.physical, episode.limits)))
        for configuration in configurations:
            write(topics.CONFIGURATION, START, String(data=configuration.to_text()))
        for stamp, x, u in zip(stamps, episode.X, [0.0, *episode.U]):
            write(topics.JOINT_STATES, stamp, to_joint_state(to_stamp(stamp), x, u))
        columns = zip(stamps, *episode.ticks[1:])
        for stamp, cost, iterations, solve_time, latency, late, status in columns:
            write(topics.DIAGNOSTICS, stamp, to_diagnostics(to_stamp(stamp), 'mpc', 0, '', {
                'solver': episode.solver, 'cost': cost, 'iterations': int(iterations),
                'solve_time': solve_time, 'latency': latency, 'late': int(late),
                'status': status}))
    return folder

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded run without the time it takes to record one: chunks as a logger flushes them."""

from pathlib import Path

from recorded_runs import serialised
from std_msgs.msg import Float64, String
from synthetic import swing_up

from dp_swing_ros import topics
from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.messages.cdr import to_diagnostics
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.pendulum.urdf import urdf

START = 1_795_225_249_000_000_000  # [ns]
ENDLESS = {'sec': 9223372036, 'nsec': 854775807}
QOS = [{'history': 'keep_last', 'depth': 1000, 'reliability': 'reliable',
        'durability': 'transient_local', 'deadline': ENDLESS, 'lifespan': ENDLESS,
        'liveliness': 'automatic', 'liveliness_lease_duration': ENDLESS,
        'avoid_ros_namespace_conventions': False}]
HASHES = {topics.ROBOT_DESCRIPTION.type:
          'RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18'}
USED = (topics.ROBOT_DESCRIPTION, topics.JOINT_STATES, topics.FORCE_COMMAND, topics.DIAGNOSTICS)


def record(folder: Path, flush: int = 10, **run) -> Path:
    """Write a made-up run, flushed after so many states; return the file."""
    episode = swing_up(**run)
    writer = BagWriter(folder)
    for topic in USED:
        writer.add(Recorded('/' + topic.name.lstrip('/'), topic.type, schema(topic.type),
                            HASHES.get(topic.type, ''), QOS))

    def write(topic, time, message, number):
        writer.write('/' + topic.name.lstrip('/'), serialised(message), time + 1000, time,
                     number)

    write(topics.ROBOT_DESCRIPTION, START, String(data=urdf(episode.physical, episode.limits)), 1)
    for n, (t, x) in enumerate(zip(episode.t, episode.X)):
        time = START + round(1e9 * t)
        write(topics.JOINT_STATES, time, to_joint_state(
            to_stamp(time), x, episode.U[n - 1] if n else 0.0), n + 1)
        if n < len(episode.U):
            write(topics.FORCE_COMMAND, time, Float64(data=float(episode.U[n])), n + 1)
            write(topics.DIAGNOSTICS, time, to_diagnostics(to_stamp(time), 'mpc', 0, '', {
                'solver': episode.solver, 'cost': 5.0, 'iterations': 3, 'solve_time': 0.002,
                'latency': 0.003, 'late': 0, 'status': 'CONVERGED'}), n + 1)
        if n % flush == flush - 1:
            writer.flush()
    writer.close()
    return next(folder.glob('*.mcap'))

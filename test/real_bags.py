# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags that real nodes record, and copies of them that are not as they were."""

import os
import struct
import subprocess

from rclpy.serialization import deserialize_message, serialize_message
from rosbags.convert import convert
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from sensor_msgs.msg import JointState

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.messages.configuration import from_text
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.nodes.connections import message_class
from dp_swing_ros.topics import TOPICS

LIMIT = 280  # [s] for one run; the first start on a machine compiles


def record(folder, *arguments, plant='', mpc=''):
    """Let the demo record a run, with these lines of parameters, and return its bag."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / 'parameters.yaml'
    file.write_text(''.join(f'/**/{node}:\n  ros__parameters:\n    use_sim_time: false\n{lines}'
                            for node, lines in (('plant', plant), ('mpc', mpc))))
    run = subprocess.run(
        ['ros2', 'run', 'dp_swing_ros', 'demo', '--no-figures', '--params', str(file), '--output',
         str(folder / 'run'), *arguments], env={**os.environ, 'ROS_DOMAIN_ID': ''},
        capture_output=True, text=True, timeout=LIMIT)
    # whether it ended upright does not matter
    assert run.returncode in (0, 1) and 'settling time' in run.stdout, run.stdout + run.stderr
    return folder / 'run' / 'bag'


def rewritten(bag, folder, topic, change, more=None):
    """
    Write a bag again; change is given the messages of a topic and returns them or None.

    more is a message for each topic that the bag lacks.
    """
    more = {f'/{extra.name}': serialize_message(message)
            for extra, message in (more or {}).items()}
    last = Bag(bag).entries[-1]

    def changed(entry):
        if entry.topic != f'/{topic.name.lstrip("/")}':
            return [entry]
        message = change(deserialize_message(entry.data, message_class(topic.type)))
        return [] if message is None else [entry._replace(stored=serialize_message(message))]
    return again(bag, folder, changed, [(name, data, last.received, last.sent)
                                        for name, data in more.items()])


def repeated(bag, folder, topic, number):
    """Write a bag again, one message of a topic twice with all that it says of itself."""
    return again(bag, folder, lambda entry: [entry] * (
        1 + (entry.topic == f'/{topic.name}' and entry.sequence == number)))


def stalled(bag, folder, span):
    """Write a bag again as a logger does that has a turn every span [ns]: topic by topic."""
    order = sorted({entry.topic for entry in Bag(bag).entries})
    return again(bag, folder, lambda entry: [entry._replace(
        received=(entry.received // span + 1) * span + order.index(entry.topic))])


def again(bag, folder, change, more=()):
    """Write a bag again, of each message what change returns, and more with other topics."""
    types = {f'/{one.name.lstrip("/")}': one.type for one in TOPICS}
    writer, entries = BagWriter(folder), Bag(bag).entries
    for name in sorted({entry.topic for entry in entries} | {each[0] for each in more}):
        writer.add(Recorded(name, types[name], schema(types[name]), '', []))
    for each in more:
        writer.write(*each)
    for entry in entries:
        for one in change(entry):
            writer.write(one.topic, one.data, one.received, one.sent, one.sequence)
    writer.close()
    return folder


def converted(bag, folder, storage, change):
    """
    Convert a bag by rosbags, which numbers no message, the forces changed; back to MCAP at last.

    change is given the forces in their order and returns others.
    """
    made = folder.with_name('converted') if storage == 'sqlite3' else folder
    with AnyReader([bag]) as reader, Writer(
            made, version=9, storage_plugin=StoragePlugin[storage.upper()]) as writer:
        connections = {each.id: writer.add_connection(
            each.topic, each.msgtype, msgdef=each.msgdef.data, rihs01=each.digest)
            for each in reader.connections}
        forces = []
        for connection, time, data in reader.messages():
            if connection.topic == '/force_command':
                topic = connections[connection.id]
                forces.append((time, *struct.unpack_from('<d', data, 4)))
            else:
                writer.write(connections[connection.id], time, data)
        times, numbers = map(list, zip(*forces))
        for n, number in enumerate(change(numbers)):
            writer.write(topic, times[min(n, len(times) - 1)],
                         struct.pack('<4sd', b'\x00\x01\x00\x00', number))
    if storage == 'sqlite3':
        convert([made], folder, 'mcap', 9, None, 'none', None, None, [], [], [], [])
    return folder


def value_of(message, key):
    """Return the text of a value that the mpc tells of a tick; None if it tells nothing."""
    return next((pair.value for status in message.status if status.name == 'mpc'
                 for pair in status.values if pair.key == key), None)


def tick(number, change):
    """Return what changes the diagnostics of one tick."""
    return lambda message: (change(message) if value_of(message, 'number') == str(number)
                            else message)


def with_value(key, value):
    """Return what changes one value of diagnostics."""
    def change(message):
        for pair in message.status[0].values:
            if pair.key == key:
                pair.value = value
        return message
    return change


def renamed(bag, folder, names):
    """Write a bag again as if its nodes had other names, given by those that they have."""
    types = {'/configuration': 'std_msgs/msg/String',
             '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray'}

    def changed(entry):
        if entry.topic not in types:
            return [entry]
        message = deserialize_message(entry.data, message_class(types[entry.topic]))
        if entry.topic == '/configuration':
            found = from_text(message.data)
            name = names.get(found.node.strip('/'), found.node.strip('/'))
            message.data = found._replace(node=f'/{name}').to_text()
        else:
            for status in message.status:
                status.name = names.get(status.name, status.name)
        return [entry._replace(stored=serialize_message(message))]
    return again(bag, folder, changed)


def shared(bag, folder, message, count=1, stamped=True):
    """Write a bag again with states of another publisher, so many after each of ours."""
    numbers = iter(range(1, 1_000_000))

    def changed(entry):
        if entry.topic != '/joint_states':
            return [entry]
        if stamped:
            message.header.stamp = deserialize_message(entry.data, JointState).header.stamp
            message.header.stamp.nanosec += 1
        return [entry, *(entry._replace(stored=serialize_message(message), sequence=next(numbers))
                         for _ in range(count))]
    return again(bag, folder, changed)

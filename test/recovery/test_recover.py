# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import io

from made_bags import encoded, FLOAT, START
from mcap.writer import CompressionType, Writer
import pytest

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.recovery.recover import recover


def begin(folder):
    writer = BagWriter(folder)
    writer.add(Recorded('/a', FLOAT, schema(FLOAT), '', []))
    return writer


def recovered(writer, output):
    """Return what comes of a bag without its metadata."""
    writer.close()
    (writer.folder / 'metadata.yaml').unlink()
    return recover(writer.folder, output)


@pytest.mark.parametrize('numbers, missing', [
    ([1, 2, 3], 0), ([7, 8, 9], 0), ([1, 2, 5, 7], 3),
    ([1, 1, 2, 2], None), ([1, 2, 1, 2], None), ([5, 6, 1, 7], None)])
def test_numbers_are_missing_only_where_one_publisher_counts(numbers, missing, tmp_path):
    writer = begin(tmp_path / 'bag')
    for place, number in enumerate(numbers):
        writer.write('/a', encoded(place), START + place, START, number)
    account = recovered(writer, tmp_path / 'new').accounts()['/a']
    assert (account.saved, account.missing) == (len(numbers), missing)
    assert (account.first, account.last) == (START, START + len(numbers) - 1)


@pytest.mark.parametrize('received, sent, faults', [
    (2 ** 63 - 1, 2 ** 63 - 1, {}), (2 ** 63, START, {'on /a at a time that cannot be': 1}),
    (START, 2 ** 63, {'on /a at a time that cannot be': 1})])
def test_times_that_rosbag2_cannot_hold_are_left_out(received, sent, faults, tmp_path):
    writer = begin(tmp_path / 'bag')
    writer.write('/a', encoded(1), START, START, 1)
    writer.write('/a', encoded(2), received, sent, 2)
    found = recovered(writer, tmp_path / 'new')
    assert (len(found.entries), found.faults) == (2 - len(faults), faults)


def file_of(topics):
    """Return a file of many chunks with the channels of topics in their order; /a is all 1."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=200, compression=CompressionType.NONE)
    writer.start('ros2')
    kind = writer.register_schema(FLOAT, 'ros2msg', schema(FLOAT).encode())
    channels = {topic: writer.register_channel(topic, 'cdr', kind) for topic in topics}
    for n in range(50):
        for topic, channel in channels.items():
            writer.add_message(channel, START + n, encoded(1.0 if topic == '/a' else 2.0), START)
    writer.finish()
    return stream.getvalue()


@pytest.mark.parametrize('share', [0.1, 0.3, 0.5])
def test_of_a_file_that_another_continues_no_message_gets_another_topic(share, tmp_path):
    one, other = file_of(['/a', '/b']), file_of(['/b', '/a'])
    path = tmp_path / 'bag.mcap'
    path.write_bytes(one[:len(one) // 2] + other[round(share * len(other)):])
    found = recover(path, tmp_path / 'new')
    assert {entry.data for entry in found.entries if entry.topic == '/a'} == {encoded(1.0)}
    assert {entry.data for entry in found.entries if entry.topic == '/b'} == {encoded(2.0)}
    assert found.faults['of a channel that nothing whole describes'] > 10

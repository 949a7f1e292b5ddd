# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import gc
import io
import re
import shlex
import struct
import subprocess
import warnings

from mcap.writer import Writer
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from recorded_bags import record
from rosbags.convert.commands import command as convert
from std_msgs.msg import String

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.episodes import configurations_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.topics import CONFIGURATION, JOINT_STATES, ROBOT_DESCRIPTION

STRING, STATE = 'std_msgs/msg/String', JOINT_STATES.type


def save(path, items, kind=STRING, definition=None, encoding='ros2msg', topic='/configuration',
         time=0):
    """Write a file whose checksums all fit, with messages of such a topic."""
    out = io.BytesIO()
    writer = Writer(out)
    writer.start(profile='ros2')
    number = writer.register_schema(kind, encoding, (
        schema(kind) if definition is None else definition).encode('latin-1'))
    channel = writer.register_channel(topic, 'cdr', number)
    for data in items:
        writer.add_message(channel, time, data, time)
    writer.finish()
    path.write_bytes(out.getvalue())
    return path


def text(content):
    return serialize_message(String(data=content))


@pytest.fixture
def path(tmp_path):
    return tmp_path / 'bag_0.mcap'


@pytest.fixture
def file(tmp_path):
    return record(tmp_path / 'bag')


@pytest.mark.parametrize(('definition', 'kind', 'encoding', 'match'), [
    ('', STRING, 'ros2msg', 'not one of this pendulum'),
    ('string[ data', STRING, 'ros2msg', 'is no std_msgs/msg/String'),
    ('string data\xff', STRING, 'ros2msg', 'is no std_msgs/msg/String|not one of this'),
    ('wstring data', STRING, 'ros2msg', 'is no std_msgs/msg/String'),
    ('other/Thing data', STRING, 'ros2msg', 'is no std_msgs/msg/String'),
    ('string text', STRING, 'ros2msg', 'not one of this pendulum'),
    ('float64[1000000000] data', STRING, 'ros2msg', 'is no std_msgs/msg/String'),
    ('string[] data', STRING, 'ros2msg', 'is no std_msgs/msg/String'),
    ('string data', 'a/msg/B', 'ros2msg', r"has /configuration as 'a/msg/B'; expected std_msgs"),
    ('string data', STRING, 'ros2idl', 'in another encoding')])
def test_definition_that_is_another_is_told(path, definition, kind, encoding, match):
    save(path, [text('x')], kind, definition, encoding)
    with pytest.raises(BagError, match=match):
        configurations_of(Bag(path))


@pytest.mark.parametrize('data', [
    b'', b'\0\1', text('x')[:-3], text('x')[:4] + struct.pack('<I', 2 ** 32 - 1) + b'x',
    text('x')[:4] + struct.pack('<I', 9) + b'\xff' * 9])
def test_body_that_is_another_is_told_with_topic_and_time(path, data):
    save(path, [data], time=77)
    bag = Bag(path)
    with pytest.raises(BagError, match=r'on /configuration, received at 77 ns.*recover'):
        bag.of(CONFIGURATION)


@pytest.mark.parametrize('content', [
    '', '\0', '!!int ""', '!!timestamp x', '[' * 50_000, '{[]: 1}', 'node: 5',
    'node: 5\nparameters: {}\nversion: a\ncommit: b\nsources: c\nmachine: d\npackages: {}'])
def test_configuration_that_is_none_is_told(path, content):
    save(path, [text(content)])
    with pytest.raises(BagError, match='is not one of this pendulum: a configuration is'):
        configurations_of(Bag(path))


@pytest.mark.parametrize('content', [
    '', '<', '<robot/>', '\0', '<robot><link name="link1"/></robot>',
    '<!DOCTYPE a [<!ENTITY b "c'])
def test_description_that_is_none_is_told(tmp_path, content):
    file = record(tmp_path / 'bag')
    save(file.with_name('bag_1.mcap'), [text(content)], topic='/' + ROBOT_DESCRIPTION.name,
         time=2 ** 62)   # the last one counts
    with pytest.raises(BagError, match='is not one of this pendulum: the robot description'):
        read_episode(file.parent)


def test_messages_are_in_the_order_in_which_they_were_received(path):
    """Not in that of the file, which may have been put together otherwise."""
    later, sooner = (save(path.with_name(f'x_{n}.mcap'), [text(content)], time=time)
                     for n, (content, time) in enumerate((('b', 20), ('a', 10))))
    assert later.name < sooner.name
    bag = Bag(path.parent)
    assert [entry.received for entry in bag.entries] == [10, 20]
    assert [message.data for message in bag.of(CONFIGURATION)] == ['a', 'b']


def test_time_that_cannot_be_is_read_as_it_is(path):
    save(path, [text('x')], time=2 ** 63 + 5)
    assert Bag(path).entries[0].received == 2 ** 63 + 5


def test_every_changed_byte_is_told_or_does_not_matter(file, rng):
    content = file.read_bytes()
    whole = read_episode(file)
    refused = 0
    for place in rng.integers(len(content), size=150):
        damaged = bytearray(content)
        damaged[place] ^= 1 << int(rng.integers(8))
        file.write_bytes(damaged)
        try:
            episode = read_episode(file)
        except BagError as error:
            refused += 1
            assert 'recover' in str(error)
            continue
        assert np.array_equal(episode.X, whole.X)
        assert np.array_equal(episode.ticks.t, whole.ticks.t)
    assert refused > 50


def test_unknown_channel_is_told(path):
    body = struct.pack('<HIQQ', 9, 0, 0, 0) + text('x')
    content = save(path, [text('x')]).read_bytes()
    place = content.index(b'\x0f' + struct.pack('<Q', 4))
    path.write_bytes(content[:place] + struct.pack('<BQ', 5, len(body)) + body + content[place:])
    with pytest.raises(BagError, match='after 1 messages, then has a message of the unknown ch'):
        Bag(path)


def test_sqlite3_names_the_command_that_converts_it(file):
    other = file.parent.with_name('other')
    assert not convert([file.parent], other, 'sqlite3')
    for path in (other, other / 'other.db3'):
        with pytest.raises(BagError, match='rosbags-convert') as error:
            Bag(path)
        command = re.search('`(rosbags-convert .*?)`', str(error.value))[1]
    subprocess.run(shlex.split(command), check=True)
    assert len(read_episode(other.with_name('other_mcap')).t) == len(read_episode(file).t)


def test_a_file_that_is_refused_is_closed(tmp_path, recwarn):
    gc.collect()   # what other tests have left open
    recwarn.clear()
    warnings.simplefilter('always', ResourceWarning)
    (tmp_path / 'other.db3').write_bytes(b'SQLite format 3\0')
    with pytest.raises(BagError, match='sqlite3'):
        Bag(tmp_path / 'other.db3')
    gc.collect()
    assert not list(recwarn)


def test_places_that_are_no_bag(tmp_path):
    (tmp_path / 'empty.mcap').write_bytes(b'')
    with pytest.raises(BagError, match='is no MCAP file'):
        Bag(tmp_path / 'empty.mcap')
    (tmp_path / 'x.mcap').mkdir()
    with pytest.raises(BagError, match='it holds nothing'):
        Bag(tmp_path / 'x.mcap')
    (tmp_path / 'bag' / 'x.mcap').mkdir(parents=True)
    with pytest.raises(BagError, match='cannot read .*x.mcap.*Is a directory'):
        Bag(tmp_path / 'bag')
    with pytest.raises(BagError, match='cannot read|is no bag|is no MCAP'):
        Bag('/dev/null')


@pytest.mark.parametrize('content', [b'', b'{', b'\xff', b'a: 1', b'- 1', None])
def test_metadata_that_is_damaged_does_not_matter(file, content):
    about = file.with_name('metadata.yaml')
    about.unlink() if content is None else about.write_bytes(content)
    assert len(read_episode(file.parent).t) == 81


def test_file_that_metadata_names_must_be_there(file):
    about = file.with_name('metadata.yaml')
    about.write_text(about.read_text().replace(
        'relative_file_paths:', 'relative_file_paths:\n  - bag_1.mcap'))
    with pytest.raises(BagError, match='lacks bag_1.mcap, which its metadata.yaml names'):
        read_episode(file.parent)
    assert len(read_episode(file.parent, partial=True).t) == 81


def test_file_under_another_name_is_read(file):
    file.rename(file.with_name('renamed.mcap'))
    assert len(read_episode(file.parent).t) == 81

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags that are split, cut by a full disk, or written to a folder that goes away."""

from contextlib import contextmanager
import ctypes
import os
import resource
import shutil
import subprocess

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import pytest
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from std_msgs.msg import Float64
import yaml

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.bags.writer import BagWriter, McapFile, METADATA_ROOM, Storage
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.definitions import schema

TYPE = 'std_msgs/msg/Float64'
START = 1_795_225_249_000_000_000
PERIOD = 50_000_000
TOPICS = ('/even', '/odd')


def begin(folder, **storage):
    """Begin a bag of two topics."""
    writer = BagWriter(folder, Storage(**storage))
    for name in TOPICS:
        writer.add(Recorded(name, TYPE, schema(TYPE), '', []))
    return writer


def write(writer, numbers):
    """Write numbers, one a period."""
    for n in numbers:
        time = START + n * PERIOD
        writer.write(TOPICS[n % 2], serialize_message(Float64(data=float(n))), time, time, n)


def fill(writer):
    """Write and flush until that fails; return the error and how many were flushed."""
    flushed = 0
    with pytest.raises(BagError) as error:
        while flushed < 10 ** 6:
            write(writer, range(flushed, flushed + 5))
            writer.flush()
            flushed += 5
    writer.close()
    assert not (writer.folder / '.reserve').exists()
    return str(error.value), flushed


def information(folder):
    return yaml.safe_load((folder / 'metadata.yaml').read_text())['rosbag2_bagfile_information']


def check(folder, count):
    """Check that all readers find the first so many numbers in the one file of a bag."""
    file = folder / f'{folder.name}_0.mcap'
    assert [entry.sequence for entry in Bag(folder).entries] == [*range(count)]
    with AnyReader([folder]) as reader:
        assert reader.message_count == count
        assert [reader.deserialize(data, connection.msgtype).data
                for connection, _, data in reader.messages()] == [*range(count)]
    with file.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert [message.decoded_message.data
                for message in reader.iter_decoded_messages()] == [*range(count)]
        return reader.get_summary()


def check_with_rerun(file, *options):
    if shutil.which('rerun') is not None:
        run = subprocess.run(['rerun', 'mcap', 'check', *options, file], capture_output=True,
                             text=True)
        assert run.returncode == 0, run.stderr


@contextmanager
def file_limit(size):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.fixture
def disk(tmp_path):
    """Return a function that makes a small disk of a size."""
    place, libc = tmp_path / 'disk', ctypes.CDLL(None, use_errno=True)

    def make(size):
        place.mkdir()
        if libc.mount(b'tmpfs', bytes(place), b'tmpfs', ctypes.c_ulong(0),
                      f'size={size}'.encode()):
            pytest.skip(f'no disk can be mounted here: {os.strerror(ctypes.get_errno())}')
        return place

    yield make
    libc.umount(bytes(place))


@pytest.mark.parametrize('size', ['1m', '5m'])
def test_full_disk_leaves_a_whole_bag(disk, size):
    folder = disk(size) / 'bag'
    message, flushed = fill(begin(folder))
    assert message == (
        f"cannot write the bag '{folder}': No space left on device; what it holds so far can be "
        f'read, and `ros2 run dp_swing_ros recover {folder}` makes a whole bag of it')
    assert flushed > 1000
    # the reserve has room for the flush that failed, too
    count = information(folder)['message_count']
    assert count == flushed + 5
    assert check(folder, count).statistics.message_count == count
    assert sorted(os.listdir(folder)) == ['bag_0.mcap', 'metadata.yaml']
    check_with_rerun(folder / 'bag_0.mcap')


def test_disk_without_room_for_a_reserve_leaves_a_file_with_an_end(disk):
    folder = disk(METADATA_ROOM) / 'bag'
    _, flushed = fill(begin(folder))
    assert flushed > 1000
    with AnyReader([folder / 'bag_0.mcap']) as reader:
        assert reader.message_count == flushed
    assert len(Bag(folder).entries) == flushed  # not as partial: it has an end
    check_with_rerun(folder / 'bag_0.mcap', '--recover')


@pytest.mark.parametrize('limit', range(20_000, 20_200, 10))
def test_full_file_gets_an_end_wherever_it_is_cut(tmp_path, limit):
    with file_limit(limit):
        message, flushed = fill(begin(tmp_path / 'bag'))
    assert 'File too large; what it holds so far can be read' in message
    count = information(tmp_path / 'bag')['message_count']
    assert count in (flushed, flushed - 5)  # at most one flush made room for the end
    check(tmp_path / 'bag', count)


def test_finished_summary_is_not_longer_than_it_was_said_to_be(tmp_path):
    file = McapFile(tmp_path / 'file', [Recorded(name, TYPE, schema(TYPE), 'RIHS01_0', [])
                                        for name in TOPICS], Storage())
    for n in range(300):
        file.write(TOPICS[n % 2], b'', n, n, n)
        file.flush()
    before, limit = file.size, file.end_size
    file.finish()
    assert 0.5 * limit < file.size - before <= limit


def test_failing_at_the_very_end_costs_the_summary_only(tmp_path):
    writer = begin(tmp_path / 'bag')
    for n in range(300):
        write(writer, [n])
        writer.flush()
    size = (tmp_path / 'bag' / 'bag_0.mcap').stat().st_size
    with file_limit(size + 1000), pytest.raises(BagError, match='File too large'):
        writer.close()
    assert check(tmp_path / 'bag', 300) is None


def test_flush_without_messages_writes_nothing(tmp_path):
    writer = begin(tmp_path / 'bag')
    file = tmp_path / 'bag' / 'bag_0.mcap'
    write(writer, range(10))
    writer.flush()
    size = file.stat().st_size
    writer.flush()
    assert file.stat().st_size == size
    assert len(Bag(file, partial=True).entries) == 10
    writer.close()


def test_full_chunk_is_written_at_once(tmp_path):
    writer = begin(tmp_path / 'bag', chunk_size=5000, fsync=True)
    write(writer, range(500))
    assert len(Bag(tmp_path / 'bag', partial=True).entries) > 300
    writer.close()
    check(tmp_path / 'bag', 500)


def test_folder_that_vanishes_is_told(tmp_path):
    writer = begin(tmp_path / 'bag')
    write(writer, range(10))
    shutil.rmtree(tmp_path / 'bag')
    with pytest.raises(BagError, match='it was removed$'):
        writer.flush()
    writer.close()
    assert not (tmp_path / 'bag').exists()


def test_folder_that_is_moved_is_told_at_the_end(tmp_path):
    writer = begin(tmp_path / 'bag')
    write(writer, range(10))
    (tmp_path / 'bag').rename(tmp_path / 'bag_2')
    writer.flush()
    with pytest.raises(BagError, match='No such file or directory$'):
        writer.close()
    assert len(Bag(tmp_path / 'bag_2').entries) == 10


@pytest.mark.parametrize('storage', [
    {'max_duration': 10 * PERIOD}, {'max_size': 1200}])
def test_split_bag(tmp_path, storage):
    folder = tmp_path / 'bag'
    writer = begin(folder, **storage)
    for n in range(0, 120, 2):
        write(writer, [n, n + 1])
        writer.flush()
    writer.custom['lost:/odd'] = '3'
    writer.close()
    about = information(folder)
    paths = about['relative_file_paths']
    assert len(paths) > 10
    assert paths == [f'bag_{n}.mcap' for n in range(len(paths))]
    assert sorted(os.listdir(folder)) == sorted([*paths, 'metadata.yaml'])
    assert [entry.sequence for entry in Bag(folder).entries] == [*range(120)]
    assert (about['message_count'], about['duration']['nanoseconds']) == (120, 119 * PERIOD)
    assert about['custom_data']['lost:/odd'] == '3'
    assert [topic['message_count'] for topic in about['topics_with_message_count']] == [60, 60]
    with AnyReader([folder]) as reader:
        assert reader.message_count == 120
        assert len([*reader.messages()]) == 120
    for file in about['files']:
        with (folder / file['path']).open('rb') as stream:
            summary = make_reader(stream).get_summary()
        assert {channel.topic for channel in summary.channels.values()} == set(TOPICS)
        statistics = summary.statistics
        assert file['message_count'] == statistics.message_count > 0
        assert file['starting_time']['nanoseconds_since_epoch'] == statistics.message_start_time
        assert file['duration']['nanoseconds'] == (
            statistics.message_end_time - statistics.message_start_time)
    if 'max_duration' in storage:
        assert [file['message_count'] for file in about['files']] == [10] * 12


def test_topic_that_comes_later_is_in_the_files_after(tmp_path):
    writer = begin(tmp_path / 'bag', max_duration=2 * PERIOD)
    write(writer, range(4))
    writer.add(Recorded('/late', TYPE, schema(TYPE), '', []))
    write(writer, range(4, 6))
    writer.close()
    assert writer.counts == {'/even': 3, '/odd': 3, '/late': 0}
    channels = []
    for n in range(3):
        with (tmp_path / 'bag' / f'bag_{n}.mcap').open('rb') as stream:
            channels.append(len(make_reader(stream).get_summary().channels))
    assert channels == [2, 3, 3]


def test_next_file_that_cannot_be_made(tmp_path):
    writer = begin(tmp_path / 'bag', max_duration=100 * PERIOD)
    write(writer, range(100))
    (tmp_path / 'bag' / 'bag_1.mcap').touch()
    with pytest.raises(BagError, match='bag_1.mcap.* exists and is not overwritten'):
        write(writer, [100])
    writer.close()
    with AnyReader([tmp_path / 'bag']) as reader:
        assert reader.message_count == 100


def test_file_without_room_for_any_end_keeps_what_was_flushed(tmp_path):
    writer = begin(tmp_path / 'bag', max_duration=100 * PERIOD)
    for n in range(150):
        write(writer, [n])
        writer.flush()
    with file_limit(100), pytest.raises(BagError, match='File too large; what it holds so far'):
        write(writer, range(150, 250))
    writer.close()
    entries = Bag(tmp_path / 'bag', partial=True).entries
    assert [entry.sequence for entry in entries] == [*range(150)]
    assert not (tmp_path / 'bag' / 'metadata.yaml').exists()


def test_file_that_somebody_emptied_is_no_traceback(tmp_path):
    writer = begin(tmp_path / 'bag')
    write(writer, range(10))
    writer.flush()
    os.truncate(tmp_path / 'bag' / 'bag_0.mcap', 0)
    with file_limit(100), pytest.raises(BagError, match='File too large'):
        write(writer, range(10, 20))
        writer.flush()
    writer.close()

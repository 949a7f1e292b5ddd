# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Files and chunks that memory has no room for: read as a stream, or refused in one line."""

import os

from limited import called
from made_bags import encoded, FLOAT, START
from mcap.writer import CompressionType, Writer
import pytest
from recorded_bags import record

from dp_swing_ros.bags import mcap_reader
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.topics import FORCE_COMMAND

SPARSE = 8 << 30   # [bytes] of a file that takes hardly any on the disk
IMAGE = 1 << 20    # [bytes] of a message of somebody else
ROOM = 200 << 20   # [bytes] that a process may take beside what it has when it begins


def run(tool, path):
    """Call a tool on a file with little memory; return code and what it printed."""
    return called(f'tools.{tool}', [str(path)], path.parent, ROOM)


def one_line(shown, tool):
    return shown.startswith(f'{tool}: error: ') and shown.count('\n') == 1


def write(path, images, chunk_size=1 << 20, count=20, image=IMAGE):
    """Write a file of forces between images that are as large as memory is not."""
    with path.open('wb') as stream:
        writer = Writer(stream, chunk_size=chunk_size, compression=CompressionType.ZSTD)
        writer.start('ros2')
        force = writer.register_channel('/force_command', 'cdr', writer.register_schema(
            FLOAT, 'ros2msg', schema(FLOAT).encode()))
        camera = writer.register_channel('/camera', 'cdr', writer.register_schema(
            'p/msg/Image', 'ros2msg', b'uint8[] data\n'))
        body = b'\0\1\0\0' + image.to_bytes(4, 'little') + bytes(image)
        for n in range(images):
            writer.add_message(camera, START + n, body, START + n)
            if n < count:
                writer.add_message(force, START + n, encoded(n), START + n)
        writer.finish()
    return path


@pytest.mark.parametrize('data', [b'', b'\x89MCAP0\r\n'], ids=['holes', 'a beginning'])
@pytest.mark.parametrize('tool', ['export', 'recover'])
def test_a_file_of_holes_is_one_line(tool, data, tmp_path):
    path = tmp_path / 'bag.mcap'
    path.write_bytes(data)
    os.truncate(path, SPARSE)
    code, shown = run(tool, path)
    assert code == 2 and one_line(shown, tool), shown


def test_of_a_bag_with_holes_behind_it_all_is_saved(tmp_path):
    path = record(tmp_path / 'bag', duration=1.0)
    count = len(Bag(path).entries)
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    os.truncate(path, SPARSE)
    code, shown = run('recover', path)
    assert code == 0 and f'saved {count} messages' in shown, shown


def test_a_record_as_large_as_the_file_is_not_read(tmp_path):
    path = write(tmp_path / 'bag.mcap', 2)
    with path.open('r+b') as stream:   # of its header, the length
        stream.seek(9)
        stream.write((SPARSE - 100).to_bytes(8, 'little'))
        stream.truncate(SPARSE)
    for tool in ('export', 'recover'):
        code, shown = run(tool, path)
        assert code in (0, 2) and 'Traceback' not in shown, shown


@pytest.mark.parametrize('chunk_size', [1 << 20, 1 << 29], ids=['small chunks', 'one chunk'])
def test_messages_of_others_take_no_memory(tmp_path, chunk_size):
    path = write(tmp_path / 'bag.mcap', 400, chunk_size)
    code, shown = run('export', path)
    assert code == 2 and one_line(shown, 'export'), shown
    assert 'nothing on joint_states: it holds messages of /camera, /force_command' in shown
    assert [message.data for message in Bag(path).of(FORCE_COMMAND)] == [*range(20)]


def test_many_large_messages_are_saved_one_by_one(tmp_path):
    path = write(tmp_path / 'bag.mcap', 400)
    path.write_bytes(path.read_bytes()[:-100])
    code, shown = run('recover', path)
    assert code == 0 and 'saved 420 messages' in shown, shown


def test_a_chunk_that_has_no_room_is_one_line(tmp_path):
    path = write(tmp_path / 'bag.mcap', 400, 1 << 29)
    path.write_bytes(path.read_bytes()[:-100])
    code, shown = run('recover', path)
    assert code == 2 and one_line(shown, 'recover') and 'fits into the memory' in shown, shown


def test_messages_that_have_no_room_are_one_line(tmp_path, monkeypatch):
    path = write(tmp_path / 'bag.mcap', 20)
    monkeypatch.setattr(mcap_reader, 'memory_left', lambda: 1 << 12)
    with pytest.raises(BagError, match='holds more than fits into the memory, of which'):
        Bag(path)
    with pytest.raises(BagError, match='give a shorter recording, or one of fewer topics'):
        Bag(path, topics=[''])

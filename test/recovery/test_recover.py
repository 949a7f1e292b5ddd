# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import io

from made_bags import encoded, FLOAT, START
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
import pytest

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.reader import Bag
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
    account = recovered(writer, tmp_path / 'new').accounts['/a']
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
    assert (found.saved, found.faults) == (2 - len(faults), faults)


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
    entries = list(found.entries(path))
    assert len(entries) == found.saved == len(Bag(tmp_path / 'new').entries)
    assert {entry.data for entry in entries if entry.topic == '/a'} == {encoded(1.0)}
    assert {entry.data for entry in entries if entry.topic == '/b'} == {encoded(2.0)}
    assert found.faults['of a channel that nothing whole describes'] > 10


KINDS = {   # as rosbag2 and others write them: encoding, type, definition and its encoding, body
    'service event': ('cdr', 'example_interfaces/srv/AddTwoInts_Event', 'ros2msg',
                      b'int64 a\nint64 b\n---\nint64 sum\n', b'\0\1\0\0' + bytes(60)),
    'service of nothing': ('cdr', 'std_srvs/srv/Empty_Event', 'ros2msg', b'---\n',
                           b'\0\1\0\0' + bytes(40)),
    'action feedback': ('cdr', 'example_interfaces/action/Fibonacci_FeedbackMessage', 'ros2msg',
                        b'int32 order\n---\nint32[] sequence\n---\nint32[] sequence\n',
                        b'\0\1\0\0' + bytes(20)),
    'idl': ('cdr', 'p/msg/T', 'ros2idl', b'module p { module msg { struct T { long a; }; }; };',
            b'\0\1\0\0' + bytes(4)),
    'json': ('json', 'T', 'jsonschema', b'{"type": "object"}', b'{"a": 1}'),
    'protobuf': ('protobuf', 'p.T', 'protobuf', b'\n\xff\xfe\x80', b'\x08\x96\x01'),
    'unknown definition': ('cdr', 'p/msg/T', 'ros2msg', b'', b'\0\1\0\0' + bytes(40)),
    'no definition': ('cdr', 'p/msg/T', '', b'', b'\0\1\0\0' + bytes(40)),
    'part that is not defined': ('cdr', 'p/msg/T', 'ros2msg', b'p/Part part\n',
                                 b'\0\1\0\0' + bytes(8)),
    'wide text': ('cdr', 'p/msg/T', 'ros2msg', b'wstring a\n', b'\0\1\0\0\1\0\0\0a\0\0\0'),
    'other CDR': ('cdr', 'p/msg/T', 'ros2msg', b'int64 a\n', b'\0\7\0\0' + bytes(8)),
    'unknown encoding': ('wrong_format', FLOAT, 'ros2msg', b'float64 data', b'any'),
    'no schema': ('json', None, None, None, b'{}')}
SEVERAL = 30   # messages of each


def file_of_others(kinds, chunked=True, checksums=True):
    """Return a file with messages of these kinds, the same ones again and again, and floats."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=500, compression=CompressionType.NONE,
                    use_chunking=chunked, enable_crcs=checksums)
    writer.start('ros2')
    known = writer.register_schema(FLOAT, 'ros2msg', schema(FLOAT).encode())
    channels = [(writer.register_channel('/known', 'cdr', known), encoded(1.0))]
    for name in kinds:
        encoding, kind, of_definition, definition, body = KINDS[name]
        number = writer.register_schema(kind, of_definition, definition) if kind else 0
        channels.append((writer.register_channel(f'/{name}', encoding, number), body))
    for n in range(SEVERAL):
        for channel, body in channels:
            writer.add_message(channel, START + n // 2, body, START + n // 2)
    writer.finish()
    return stream.getvalue()


def stored(path):
    """Return all that a file says of its messages, by topic."""
    found = {}
    with path.open('rb') as stream:
        for kind, channel, message in make_reader(stream).iter_messages():
            found.setdefault(channel.topic, []).append((
                channel.message_encoding, *((kind.name, kind.encoding, kind.data) if kind else ()),
                message.log_time, message.publish_time, message.sequence, message.data))
    return found


@pytest.mark.parametrize('chunked, checksums', [(True, True), (True, False), (False, False)])
@pytest.mark.parametrize('kind', KINDS)
def test_sound_bags_of_others_are_whole(kind, chunked, checksums, tmp_path):
    path = tmp_path / 'bag.mcap'
    path.write_bytes(file_of_others([kind], chunked, checksums))
    found = recover(path, tmp_path / 'new')
    assert found.whole and found.saved == 2 * SEVERAL
    assert found.accounts[f'/{kind}'].saved == SEVERAL
    assert not (tmp_path / 'new').exists()


def test_of_a_cut_bag_of_others_all_that_is_there_is_kept_as_it_is(tmp_path):
    whole, cut = tmp_path / 'whole.mcap', tmp_path / 'cut.mcap'
    data = file_of_others(KINDS)
    whole.write_bytes(data)
    cut.write_bytes(data[:len(data) * 2 // 3])
    found = recover(cut, tmp_path / 'new')
    assert not found.faults and found.saved > SEVERAL * len(KINDS) / 3
    kept = stored(tmp_path / 'new' / 'new_0.mcap')
    for name, messages in stored(whole).items():
        assert messages[:len(kept[name])] == kept[name]


@pytest.mark.parametrize('checksums', [True, False])
def test_after_damage_only_a_checksum_keeps_what_no_type_verifies(checksums, tmp_path):
    path, data = tmp_path / 'bag.mcap', bytearray(file_of_others(['json'], True, checksums))
    data[len(data) // 3:len(data) // 3 + 200] = bytes(200)
    path.write_bytes(data)
    found = recover(path, tmp_path / 'new')
    assert found.accounts['/known'].saved > SEVERAL / 2
    kept = found.accounts['/json'].saved if checksums else \
        sum(count for text, count in found.faults.items() if 'neither a checksum' in text)
    assert kept > SEVERAL / 2 and checksums == ('/json' in found.accounts)


def test_what_is_not_what_its_type_says_is_left_out(tmp_path):
    writer = begin(tmp_path / 'bag')
    bodies = [encoded(1.0), encoded(1.0)[:-1], b'', b'\1' * 12]
    for place, body in enumerate(bodies):
        writer.write('/a', body, START + place, START)
    found = recovered(writer, tmp_path / 'new')
    assert (found.saved, found.faults.total()) == (1, 3)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags that `ros2 bag record` has compressed, message by message or as whole files."""

import subprocess
import sys

from made_bags import encoded, FLOAT, START
import pytest
from recorded_bags import record
import yaml
import zstandard

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.tools import analyse, export, recover
from dp_swing_ros.topics import FORCE_COMMAND

COUNT = 40


def described(folder, mode, form='zstd'):
    """Say in the metadata of a bag how it is compressed; return it."""
    file = folder / 'metadata.yaml'
    about = yaml.safe_load(file.read_text())
    about['rosbag2_bagfile_information'].update(compression_mode=mode, compression_format=form)
    file.write_text(yaml.safe_dump(about))
    return folder


def compressed(folder, bodies, form='zstd'):
    """Write forces as rosbag2 does with `compression_mode: MESSAGE`; return the bag."""
    writer = BagWriter(folder)
    writer.add(Recorded('/force_command', FLOAT, schema(FLOAT), '', []))
    for n, body in enumerate(bodies):
        writer.write('/force_command', body, START + n, START + n, n + 1)
    writer.close()
    return described(folder, 'MESSAGE', form)


def forces(count=COUNT):
    return [zstandard.compress(encoded(n)) for n in range(count)]


def numbers(bag):
    return [message.data for message in Bag(bag).of(FORCE_COMMAND)]


@pytest.mark.parametrize('killed', [False, True])
def test_messages_are_read_with_and_without_metadata(tmp_path, killed):
    bag = compressed(tmp_path / 'bag', forces())
    if killed:   # which leaves no metadata
        (bag / 'metadata.yaml').unlink()
    assert numbers(bag) == [*range(COUNT)]
    assert [entry.data for entry in Bag(bag).entries] == [*map(encoded, range(COUNT))]


def test_every_tool_reads_a_run_as_if_it_were_not_compressed(
        tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(analyse, 'PICTURES', {})
    plain = record(tmp_path / 'plain', duration=2.0).parent
    packed, original = BagWriter(tmp_path / 'packed'), Bag(plain)
    for name, channel in original.channels.items():
        packed.add(Recorded(name, channel.type, channel.definition.decode(), '', []))
    for entry in original.entries:
        packed.write(entry.topic, zstandard.compress(entry.data), *entry[1:4])
    packed.close()
    shown = []
    for bag in plain, described(tmp_path / 'packed', 'MESSAGE'):
        assert export.main([str(bag), '--output', str(bag) + '.csv']) == 0
        capsys.readouterr()
        assert analyse.main([str(bag), '--no-animation']) == 0
        shown.append(capsys.readouterr().out.split('\n\n')[0])
        assert recover.main([str(bag)]) == 0
        assert f'is whole: {len(original.entries)} messages' in capsys.readouterr().out
    assert shown[0] == shown[1]
    assert (tmp_path / 'plain.csv').read_bytes() == (tmp_path / 'packed.csv').read_bytes()


@pytest.mark.parametrize('tool', [export, recover])
def test_another_compression_is_refused(tmp_path, tool, capsys):
    assert tool.main([str(compressed(tmp_path / 'bag', forces(), 'lz4'))]) == 2
    error = capsys.readouterr().err
    assert "are compressed with 'lz4'; expected zstd" in error and error.count('\n') == 1


@pytest.mark.parametrize('body', [
    encoded(1.0), zstandard.compress(encoded(1.0))[:-3], b'', b'\x28\xb5\x2f\xfd' + bytes(20),
    zstandard.compress(encoded(1.0)) + b'more',
    zstandard.ZstdCompressor(write_content_size=False).compress(encoded(1.0))],
    ids=['plain', 'cut', 'empty', 'garbage', 'longer', 'without size'])
def test_what_does_not_decompress_is_told_and_never_saved(tmp_path, body, capsys):
    bag = compressed(tmp_path / 'bag', [*forces(), body])
    with pytest.raises(BagError, match=f'received at {START + COUNT} ns, .*it is compressed'):
        numbers(bag)
    assert recover.main([str(bag)]) == 0
    assert '1 messages on /force_command that are compressed' in capsys.readouterr().out
    assert numbers(tmp_path / 'bag_recovered') == [*range(COUNT)]


def test_a_compressed_message_is_never_taken_for_cdr(tmp_path):
    """Nothing says that these are, and only zstd is known by how it begins."""
    bag = compressed(tmp_path / 'bag', [encoded(0.0), b'\x04"M\x18' + encoded(1.0)])
    (bag / 'metadata.yaml').unlink()
    with pytest.raises(BagError, match='does not begin as CDR does'):
        numbers(bag)
    assert recover.main([str(bag)]) == 0
    assert numbers(tmp_path / 'bag_recovered') == [0.0]


def test_a_cut_bag_is_saved_decompressed(tmp_path):
    bag = compressed(tmp_path / 'bag', forces(400))
    file = bag / 'bag_0.mcap'
    file.write_bytes(file.read_bytes()[:-200])
    assert recover.main([str(bag)]) == 0
    found = numbers(tmp_path / 'bag_recovered')
    assert len(found) > 100 and found == [*range(len(found))]
    about = yaml.safe_load((tmp_path / 'bag_recovered' / 'metadata.yaml').read_text())
    assert about['rosbag2_bagfile_information']['compression_mode'] == ''


def test_a_message_that_unpacks_to_gib_costs_no_memory_until_it_is_asked_for(tmp_path):
    frame = zstandard.compress(bytes(1 << 28))
    bag = compressed(tmp_path / 'bag', [*forces(), *[frame] * 100])
    code = ('import resource, sys\nfrom dp_swing_ros.bags.reader import Bag\n'
            'before = resource.getrusage(0).ru_maxrss\n'
            f'assert len(Bag({str(bag)!r}).entries) == {COUNT + 100}\n'
            'sys.exit(resource.getrusage(0).ru_maxrss - before > 1 << 17)')
    assert subprocess.run([sys.executable, '-c', code]).returncode == 0


@pytest.mark.parametrize('given', ['', 'bag_0.mcap.zstd'])
@pytest.mark.parametrize('tool', [export, recover])
def test_a_compressed_file_names_the_command_that_unpacks_it(tmp_path, given, tool, capsys):
    bag = described(record(tmp_path / 'bag', duration=1.0).parent, 'FILE')
    file, text = bag / 'bag_0.mcap', (bag / 'metadata.yaml').read_text()
    (bag / 'metadata.yaml').write_text(text.replace('bag_0.mcap', 'bag_0.mcap.zstd'))
    data = file.read_bytes()
    file.unlink()
    packed = file.with_name('bag_0.mcap.zstd')
    packed.write_bytes(zstandard.compress(data))
    assert tool.main([str(bag / given)]) == 2
    error = capsys.readouterr().err
    assert f'`zstd -d {packed}` makes' in error and error.count('\n') == 1
    file.write_bytes(data)   # as that command does
    assert tool.main([str(bag)]) == 0

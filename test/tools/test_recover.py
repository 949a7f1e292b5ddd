# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import re
import shutil

from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mutations import records
import pytest
from recorded_bags import HASHES, QOS, record
from rosbags.highlevel import AnyReader
import yaml

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.tools.recover import main


@pytest.fixture(scope='module')
def original(tmp_path_factory):
    """Return the folder of a whole bag; tests damage a copy of it."""
    return record(tmp_path_factory.mktemp('recover') / 'bag').parent


@pytest.fixture
def bag(original, tmp_path):
    shutil.copytree(original, tmp_path / 'bag')
    return tmp_path / 'bag'


def entries(bag):
    return {(entry.topic, *entry[1:]) for entry in Bag(bag).entries}


def damage(bag, begin=0.5, size=300):
    """Overwrite a part of the file; return its path."""
    file = next(bag.glob('*.mcap'))
    content = bytearray(file.read_bytes())
    place = int(begin * len(content))
    content[place:place + size] = bytes(size)
    file.write_bytes(content)
    return file


def test_whole_bag_is_told_and_nothing_is_written(bag, capsys):
    assert main([str(bag)]) == 0
    assert f'is whole: {len(entries(bag))} messages' in capsys.readouterr().out
    assert [path.name for path in bag.parent.iterdir()] == ['bag']


def test_damaged_bag_becomes_a_whole_one(bag, original, capsys):
    damage(bag)
    before = next(bag.glob('*.mcap')).read_bytes()
    assert main([str(bag)]) == 0
    new = bag.with_name('bag_recovered')
    assert next(bag.glob('*.mcap')).read_bytes() == before
    found = entries(new)
    assert len(entries(original)) * 0.5 < len(found) < len(entries(original))
    assert found < entries(original)
    told = capsys.readouterr().out
    assert f'saved {len(found)} messages of the {len(entries(original))} that' in told
    assert re.search(r'bag_0.mcap, bytes \d+ to \d+ \(\d+\): ', told)
    lost = re.findall(r'^\| /(?:joint_states|diagnostics|force_command) .* (\d+) \|$', told, re.M)
    assert len(lost) == 3
    assert sum(map(int, lost)) == len(entries(original)) - len(found)
    assert main([str(new)]) == 0
    assert 'has nothing to repair' in capsys.readouterr().out


def test_other_readers_take_it(bag, original):
    damage(bag)
    main([str(bag)])
    new = bag.with_name('bag_recovered')
    found = entries(new)
    with AnyReader([new]) as reader:
        assert reader.message_count == len(found)
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
    with next(new.glob('*.mcap')).open('rb') as file:
        reader = make_reader(file, True, [DecoderFactory()])
        assert len(list(reader.iter_decoded_messages())) == len(found)
        summary = reader.get_summary()
        for channel in summary.channels.values():
            assert yaml.safe_load(channel.metadata['offered_qos_profiles']) == QOS
            assert channel.metadata['topic_type_hash'] == HASHES.get(
                summary.schemas[channel.schema_id].name, '')
    about = yaml.safe_load((new / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert about['message_count'] == len(found)


def test_killed_logger_loses_what_was_not_flushed(bag, original):
    file = next(bag.glob('*.mcap'))
    content = file.read_bytes()
    file.write_bytes(content[:len(content) // 2])
    (bag / 'metadata.yaml').unlink()
    assert main([str(bag)]) == 0
    partial = read_episode(file, partial=True)
    saved = read_episode(bag.with_name('bag_recovered'))
    assert len(saved.t) == len(partial.t) > 10
    assert entries(bag.with_name('bag_recovered')) < entries(original)


def test_file_alone_and_another_output(bag, tmp_path):
    file = damage(bag)
    assert main([str(file), '--output', str(tmp_path / 'new' / 'bag')]) == 0
    assert main([str(file)]) == 0
    assert entries(tmp_path / 'new' / 'bag') == entries(bag / 'bag_0_recovered')


def test_metadata_that_is_gone_is_made_anew(bag, original, capsys):
    (bag / 'metadata.yaml').unlink()
    assert main([str(bag)]) == 0
    assert 'metadata.yaml is missing' in capsys.readouterr().out
    assert entries(bag.with_name('bag_recovered')) == entries(original)


@pytest.mark.parametrize('flipped, described, topics', [
    (False, False, {'/joint_states', '/force_command', '/diagnostics'}),
    (True, True, {'/force_command', '/diagnostics'}), (True, False, set())])
def test_a_damaged_summary_gives_no_message_another_topic(flipped, described, topics, bag,
                                                          original):
    """The chunk that declared all channels is gone, and the summary declares them again."""
    file = next(bag.glob('*.mcap'))
    content = bytearray(file.read_bytes())
    begin, end = next(place for place in records(content) if content[place[0]] == Opcode.CHUNK)
    content[(begin + end) // 2] ^= 1
    content[content.rindex(b'/joint_states') + 1] ^= 4 * flipped   # /noint_states
    file.write_bytes(content)
    if not described:
        (bag / 'metadata.yaml').unlink()
    assert main([str(bag)]) == (0 if topics else 2)
    found = entries(bag.with_name('bag_recovered')) if topics else set()
    assert found <= entries(original)
    assert {topic for topic, *_ in found} == topics


def test_what_is_there_twice_is_saved_once(bag, original, capsys):
    file = next(bag.glob('*.mcap'))
    content = file.read_bytes()
    half = len(content) // 2
    file.write_bytes(content[:half] + content[half // 2:])
    assert main([str(bag)]) == 0
    found = Bag(bag.with_name('bag_recovered')).entries
    assert len(found) == len(entries(original))
    assert entries(bag.with_name('bag_recovered')) == entries(original)
    assert 'the same chunk is there before' in capsys.readouterr().out


def test_several_files_become_one(bag, original, capsys):
    shutil.copy(bag / 'bag_0.mcap', bag / 'bag_1.mcap')
    damage(bag, 0.0, 8)
    assert main([str(bag)]) == 0
    told = capsys.readouterr().out
    assert 'bag_0.mcap, bytes 0 to 8' in told
    assert entries(bag.with_name('bag_recovered')) == entries(original)


def test_nothing_is_overwritten(bag, capsys):
    damage(bag)
    (bag.with_name('bag_recovered')).mkdir()
    assert main([str(bag)]) == 2
    assert 'exists and is not overwritten' in capsys.readouterr().err
    assert list(bag.with_name('bag_recovered').iterdir()) == []


@pytest.mark.parametrize('content', [b'', b'text', bytes(10_000)])
def test_nothing_to_save_is_one_line(bag, content, capsys):
    next(bag.glob('*.mcap')).write_bytes(content)
    assert main([str(bag)]) == 2
    error = capsys.readouterr().err
    assert error.startswith('recover: error: ')
    assert 'nothing to save' in error
    assert error.count('\n') == 1
    assert not bag.with_name('bag_recovered').exists()


def test_missing_bag_is_one_line(tmp_path, capsys):
    assert main([str(tmp_path / 'none')]) == 2
    assert 'there is no bag' in capsys.readouterr().err

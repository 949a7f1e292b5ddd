# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""metadata.yaml, decoded as strictly as rosbag2 does, and more so."""

import pytest
import yaml

from dp_swing_ros.bags.metadata import Contents, described, metadata, Recorded

FOREVER = {'sec': 9223372036, 'nsec': 854775807}
QOS = {'history': 'keep_last', 'depth': 100, 'reliability': 'reliable',
       'durability': 'transient_local', 'deadline': FOREVER, 'lifespan': FOREVER,
       'liveliness': 'automatic', 'liveliness_lease_duration': FOREVER,
       'avoid_ros_namespace_conventions': False}
START = 1_795_225_249_000_000_000
TOPICS = [Recorded('/a', 'std_msgs/msg/Float64', '', 'RIHS01_0', [QOS, QOS]),
          Recorded('/b', 'std_msgs/msg/String', '', 'RIHS01_1', [])]
FILES = [Contents('bag_0.mcap', {'/a': 3}, START, START + 20),
         Contents('bag_1.mcap', {'/a': 4, '/b': 1}, START + 10, START + 50)]


def unsigned(value):
    assert type(value) is int and 0 <= value < 2 ** 64
    return value


def text(value):
    assert type(value) is str
    return value


def flag(value):
    assert type(value) is bool
    return value


def each(kind):
    def decode(value):
        assert type(value) is list
        return [decoded(kind, element) for element in value]
    return decode


def texts(value):
    assert all(type(key) is type(word) is str for key, word in value.items())
    return value


TIME = {'sec': unsigned, 'nsec': unsigned}
EXTENT = {'duration': {'nanoseconds': unsigned},
          'starting_time': {'nanoseconds_since_epoch': unsigned}, 'message_count': unsigned}
PROFILE = {'history': text, 'depth': unsigned, 'reliability': text, 'durability': text,
           'deadline': TIME, 'lifespan': TIME, 'liveliness': text,
           'liveliness_lease_duration': TIME, 'avoid_ros_namespace_conventions': flag}
BAG = {'rosbag2_bagfile_information': {
    'version': unsigned, 'storage_identifier': text, **EXTENT,
    'topics_with_message_count': each({
        'topic_metadata': {'name': text, 'type': text, 'serialization_format': text,
                           'offered_qos_profiles': each(PROFILE), 'type_description_hash': text},
        'message_count': unsigned}),
    'compression_format': text, 'compression_mode': text, 'relative_file_paths': each(text),
    'files': each({'path': text, **EXTENT}), 'custom_data': texts, 'ros_distro': text}}


def decoded(kind, value):
    """Decode a value of a kind: a function, or the fields of a map, all there and no others."""
    if callable(kind):
        return kind(value)
    assert value.keys() == kind.keys()
    return {key: decoded(kind[key], value[key]) for key in kind}


def test_a_strict_decoder_takes_it():
    about = decoded(BAG, yaml.safe_load(metadata(TOPICS, FILES, {'lost:/a': '0'})))
    about = about['rosbag2_bagfile_information']
    assert (about['version'], about['storage_identifier'], about['ros_distro']) == (
        9, 'mcap', 'jazzy')
    assert about['starting_time']['nanoseconds_since_epoch'] == START
    assert (about['duration']['nanoseconds'], about['message_count']) == (50, 8)
    assert [topic['message_count'] for topic in about['topics_with_message_count']] == [7, 1]
    assert about['topics_with_message_count'][0]['topic_metadata'] == {
        'name': '/a', 'type': 'std_msgs/msg/Float64', 'serialization_format': 'cdr',
        'offered_qos_profiles': [QOS, QOS], 'type_description_hash': 'RIHS01_0'}
    assert about['relative_file_paths'] == ['bag_0.mcap', 'bag_1.mcap']
    assert [(file['path'], file['starting_time']['nanoseconds_since_epoch'] - START,
             file['duration']['nanoseconds'], file['message_count'])
            for file in about['files']] == [('bag_0.mcap', 0, 20, 3), ('bag_1.mcap', 10, 40, 5)]
    assert about['custom_data'] == {'lost:/a': '0'}


@pytest.mark.parametrize('topics', [[], TOPICS])
def test_a_bag_without_messages(topics):
    empty = Contents('bag_0.mcap', {topic.name: 0 for topic in topics}, 0, 0)
    about = decoded(BAG, yaml.safe_load(metadata(topics, [empty], {})))
    assert about['rosbag2_bagfile_information']['message_count'] == 0


def test_a_file_without_messages_has_no_time():
    empty = Contents('bag_2.mcap', {'/a': 0}, 0, 0)
    about = yaml.safe_load(metadata(TOPICS, [*FILES, empty], {}))['rosbag2_bagfile_information']
    assert about['starting_time']['nanoseconds_since_epoch'] == START
    assert about['duration']['nanoseconds'] == 50


def test_of_a_file_its_own_messages_are_told(tmp_path):
    (tmp_path / 'metadata.yaml').write_text(metadata(TOPICS, FILES, {}))
    assert [described(path).messages for path in (
        tmp_path, *(tmp_path / f'bag_{n}.mcap' for n in range(3)))] == [8, 3, 5, None]


def test_people_can_read_it():
    assert '&' not in metadata(TOPICS, FILES, {}) and '*' not in metadata(TOPICS, FILES, {})

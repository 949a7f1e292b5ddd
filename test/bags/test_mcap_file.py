# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from mcap.reader import make_reader
import pytest

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import McapFile, Storage

TOPICS = [Recorded('/a', 'std_msgs/msg/Float64', 'float64 data', '', []),
          Recorded('/b', 'std_msgs/msg/Float64', 'float64 data', '', []),
          Recorded('/c', 'std_msgs/msg/String', 'string data', '', [])]


@pytest.fixture
def begun(tmp_path):
    """Return a function that begins a file with messages, in flushes of three."""
    def begin(name):
        file = McapFile(tmp_path / name, TOPICS, Storage())
        for n in range(90):
            topic = TOPICS[0 if n < 45 else n % 2]
            file.write(topic.name, bytes([n]), 100 + (n ^ 64), n, n)
            if n % 3 == 2:
                file.flush()
        return file
    return begin


def summary_of(path):
    with path.open('rb') as stream:
        return make_reader(stream).get_summary()


def test_end_of_a_rescued_file_is_that_of_a_finished_one(begun, tmp_path):
    finished, rescued = begun('finished'), begun('rescued')
    finished.finish()
    with (tmp_path / 'rescued').open('ab') as stream:
        stream.write(b'half of a flush' * 10)
    rescued.rescue()
    assert rescued.contents._replace(path='') == finished.contents._replace(path='')
    assert (tmp_path / 'rescued').read_bytes() == (tmp_path / 'finished').read_bytes()
    assert summary_of(tmp_path / 'rescued').statistics.message_count == 90


def test_file_without_a_message_gets_an_end(tmp_path):
    file = McapFile(tmp_path / 'empty', TOPICS, Storage())
    file.rescue()
    assert summary_of(tmp_path / 'empty').statistics.message_count == file.contents.messages == 0

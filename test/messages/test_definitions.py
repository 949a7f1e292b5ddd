# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import pytest

from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.definitions import RULE, schema
from dp_swing_ros.topics import TOPICS


@pytest.mark.parametrize('topic', TOPICS, ids=lambda topic: topic.name)
def test_every_topic_has_a_definition(topic):
    assert schema(topic.type)


def test_dependencies_follow_once_each():
    text = schema('diagnostic_msgs/msg/DiagnosticArray')
    assert [part.splitlines()[1] for part in text.split(RULE)[1:]] == [
        'MSG: std_msgs/Header', 'MSG: diagnostic_msgs/DiagnosticStatus',
        'MSG: builtin_interfaces/Time', 'MSG: diagnostic_msgs/KeyValue']


def test_place_of_an_installation_comes_first(tmp_path, monkeypatch):
    (tmp_path / 'share/std_msgs/msg').mkdir(parents=True)
    (tmp_path / 'share/std_msgs/msg/Float64.msg').write_text('float64 data  # mine\n')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path}')
    assert 'mine' in schema('std_msgs/msg/Float64')


def test_missing_package_is_named():
    with pytest.raises(BagError, match=r"'no_such_msgs/msg/Thing'.*install"):
        schema('no_such_msgs/msg/Thing')

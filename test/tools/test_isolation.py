# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import contextlib
import os
from pathlib import Path
import socket
from xml.etree import ElementTree

import pytest

from dp_swing_ros.errors import UserError
from dp_swing_ros.tools import isolation
from dp_swing_ros.tools.isolation import isolated


@pytest.fixture(autouse=True)
def environment(monkeypatch):
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    monkeypatch.setenv('ROS_DOMAIN_ID', '')
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', 'mine.xml')


def test_domain_of_the_user_is_kept(monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', '42')
    with isolated() as domain:
        assert domain == '42'
        assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    assert os.environ['ROS_DOMAIN_ID'] == '42'


def test_two_at_once_get_different_domains(monkeypatch):
    with isolated() as domain:
        assert os.environ['ROS_DOMAIN_ID'] == domain
        monkeypatch.setenv('ROS_DOMAIN_ID', '')
        with isolated() as other:
            assert other != domain


def test_domain_with_a_participant_is_passed_over(monkeypatch):
    with isolated() as domain:
        pass
    monkeypatch.setattr(isolation, 'DOMAINS', [int(domain)])
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as participant:
        participant.bind(('', 7400 + 250 * int(domain) + 12))
        with pytest.raises(UserError, match='set ROS_DOMAIN_ID'), isolated():
            pass
    with isolated() as again:
        assert again == domain


def test_profile_of_the_user_is_kept():
    with isolated():
        assert os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] == 'mine.xml'


def test_profile_of_the_package_is_one_of_fast_dds(monkeypatch, tmp_path):
    monkeypatch.delenv('FASTRTPS_DEFAULT_PROFILES_FILE')
    config = Path(__file__).parents[2] / 'config'
    share = tmp_path / 'share'
    (share / 'dp_swing_ros').mkdir(parents=True)
    (share / 'dp_swing_ros' / 'config').symlink_to(config)
    index = share / 'ament_index' / 'resource_index' / 'packages'
    index.mkdir(parents=True)
    (index / 'dp_swing_ros').touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    with isolated():
        profile = Path(os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'])
    root = ElementTree.parse(profile).getroot()
    participant = root.find('.//{*}participant')
    assert participant.get('is_default_profile') == 'true'
    assert participant.find('.//{*}leaseAnnouncement') is not None


def test_missing_package_is_said(monkeypatch, tmp_path):
    monkeypatch.delenv('FASTRTPS_DEFAULT_PROFILES_FILE')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    with pytest.raises(UserError, match='not in the ament index'), isolated():
        pass

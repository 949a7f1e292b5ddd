# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters that change between two ticks, without anything else of a node."""

import math
import os

import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.messages.fields import Report
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.runtime.live_parameters import check_file, LiveParameters
from dp_swing_ros.runtime.sent import Announcement, Log, PutBack, Said


class Live:
    """Live parameters that have begun, and what they sent."""

    def __init__(self, **given):
        self.sent = []
        self.values = controllers.MPC.complete(given)
        self.controller = controllers.controller(self.values)
        self.controller.warm_up()
        self.live = LiveParameters(self.values, self.sent.append,
                                   Log(self.sent.append, lambda: 0.0))
        self.live.begin(self.controller)

    def load(self, **changes):
        """Load others as in lockstep, where time waits."""
        values = {**self.values, **changes}
        self.live.load(controllers.controller(values), values, waits=True)

    def of(self, kind):
        return [each for each in self.sent if isinstance(each, kind)]


@pytest.fixture(scope='module')
def started():
    return Live()


def test_others_count_from_the_next_tick_on_and_are_announced():
    one = Live()
    one.load(horizon=20)
    assert one.controller.nominal.horizon == 30
    one.live.take_over(7)
    assert one.controller.nominal.horizon == 20
    assert one.live.values['horizon'] == 20 and one.live.revision == 1
    announcement, = one.of(Announcement)
    assert (announcement.revision, announcement.parameters['horizon']) == (1, 20)
    one.live.take_over(8)   # once
    assert one.live.revision == 1


def test_what_cannot_be_used_is_put_back(monkeypatch):
    monkeypatch.setattr(os, 'nice', lambda by: by)   # what is compiled aside is waited for
    one = Live()
    impossible = {**one.values, 'solver': 'ddp'}
    other = controllers.controller(impossible)

    def warm_up(most):
        raise RuntimeError('no compiler')
    other.warm_up = warm_up
    with pytest.raises(ParameterError, match='no compiler'):
        one.live.load(other, impossible, waits=True)
    one.live.take_over(7)
    report, = one.of(Report)
    assert (report.stamp, report.part) == (7, 'parameters')
    assert 'no compiler; going on with the last' in report.message
    assert one.of(PutBack) == [PutBack(one.values)]
    assert one.live.revision == 0 and one.live.values == one.values


def test_what_was_found_is_announced_with_what_was_given():
    one = Live()
    one.live.find(joint_offsets=[0.1, 0.2, 0.3])
    one.load(horizon=25)
    one.live.take_over(1)
    found = one.of(Announcement)
    assert found[0] == Announcement({'joint_offsets': [0.1, 0.2, 0.3]}, 0)
    assert found[1].parameters['joint_offsets'] == [0.1, 0.2, 0.3]
    assert found[1].parameters['horizon'] == 25


@pytest.mark.parametrize(('of_plant', 'says'), [
    ({'force_limit': 10.0}, 'force_limit is 20, and that of the plant 10'),
    ({'track_limit': 1.0}, 'track_limit is 2.4, and that of the plant 1'),
    ({'drive': 'voltage'}, "the drive of the plant is 'voltage', and commands are for 'force'"),
    ({'force_limit': 30.0, 'track_limit': math.inf}, None)])
def test_a_plant_that_can_less_is_warned_of(started, of_plant, says):
    started.sent.clear()
    started.live.log.reset()
    started.live.compare(of_plant)
    said = [each.text for each in started.of(Said)]
    assert [says in text for text in said] == ([] if says is None else [True])


def test_a_file_that_nothing_will_be_written_to_is_refused_or_warned_of(tmp_path):
    for given in (str(tmp_path), str(tmp_path / 'nowhere' / 'model.yaml')):
        with pytest.raises(ParameterError, match='expected a file in a folder'):
            check_file(given)
    check_file('')
    one = Live(learned_file=str(tmp_path / 'model.yaml'))
    assert 'nothing is learned' in one.of(Said)[-1].text

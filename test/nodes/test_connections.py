# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from dp_swing_ros.nodes import connections


def test_however_often_others_announce_themselves_it_is_heard_once_in_a_while(monkeypatch):
    class Subscription:
        """Something that a group can refer to."""

    now, heard = 100.0, []
    monkeypatch.setattr(connections.time, 'monotonic', lambda: now)
    group, subscription = connections.Sparing(), Subscription()
    group.add_entity(subscription)
    for _ in range(10_000):   # 5000 a second, of virtual time
        if group.can_execute(subscription):
            assert group.beginning_execution(subscription)
            group.ending_execution(subscription)
            heard.append(now)
        now += 2e-4
    assert heard[9] < 100.01   # those of a start, at once
    assert 29 <= len(heard) <= 30
    now += 60.0   # what was not needed is not saved up
    assert sum(group.can_execute(subscription) and group.beginning_execution(subscription)
               and group.ending_execution(subscription) is None for _ in range(50)) == 10

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a driver and its user can rely on: the switch, and signs of life."""

import itertools
import signal

from controllers import plant
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import LivelinessPolicy, QoSProfile
from std_msgs.msg import Float64
from std_srvs.srv import SetBool
from test_drivers import Driver, LEANING, recorded, Rig

from dp_swing_ros.nodes.connections import DEADLINE, LEASE
from dp_swing_ros.tools import verify


def switch(peer, enabled):
    """Enable or disable the mpc; return its answer."""
    answer = peer.call(SetBool, 'mpc/enable', data=enabled)
    assert answer.success
    return answer.message


def test_disabled_it_sends_zero_at_once_and_for_each_state(tmp_path, capsys):
    with recorded(tmp_path / 'bag', {}) as (peer, _):
        driver = Driver(peer)
        driver.meet()
        driver.stream(20, lambda now: now)
        assert peer.until(lambda: driver.stream(1, lambda now: now)
                          or driver.forces and driver.forces[-1].data != 0.0)
        before = len(driver.forces)
        assert 'zero force' in switch(peer, False)
        # without a state that it would answer
        assert peer.until(lambda: len(driver.forces) > before and driver.forces[-1].data == 0.0)
        zeros = len(driver.forces)
        assert peer.until(lambda: driver.stream(1, lambda now: now)
                          or len(driver.forces) >= zeros + 18)
        assert not any(force.data for force in driver.forces[zeros - 1:])

        def is_estimated():   # which after a gap the filter may refuse at first
            last = driver.ticks()[-1]
            sent = LEANING[0] * (1 + 1e-3 * driver.n)
            return last.level != DiagnosticStatus.ERROR[0] and abs(
                last.values['estimate_cart_position'] - sent) < 1e-3
        assert peer.until(lambda: driver.stream(1, lambda now: now) or is_estimated())
        last = driver.ticks()[-1]
        assert (last.level, last.values['status']) == (DiagnosticStatus.WARN[0], 'DISABLED')
        assert 'disabled: the force is zero; call mpc/enable' in last.message
        switch(peer, False)                  # which changes nothing
        switch(peer, True)
        driver.stream(20, lambda now: now)
        assert peer.until(lambda: driver.stream(1, lambda now: now) or (
            driver.ticks()[-1].values['status'] != 'DISABLED' and driver.forces[-1].data != 0.0))
    assert verify.main([str(tmp_path / 'bag')]) == 0, capsys.readouterr().out
    assert 'every force is the recorded one' in capsys.readouterr().out


def test_it_brakes_the_cart_before_it_ends(tmp_path, capsys):
    parameters = {'controlled_stop': 0.5, 'clock': 'lockstep', **Rig.PARAMETERS}
    with recorded(tmp_path / 'bag', parameters) as (peer, mpc):
        rig, pendulum, times = Rig(peer), plant(), itertools.count(0, 50_000_000)
        rig.meet(lockstep=True)
        swung = rig.swing(pendulum, 12, lambda: next(times), paced=False)
        assert not mpc.may_end()   # which is asked from a signal on
        braked = rig.swing(pendulum, 12, lambda: next(times), paced=False)
        assert peer.until(mpc.may_end)
    assert rig.forces[-1].data == 0.0
    stops = [tick for tick in rig.ticks() if tick.values['status'] == 'STOP']
    assert len(stops) == 10 and 'the process ends' in stops[0].message
    assert stops[0].level == DiagnosticStatus.ERROR[0]
    assert abs(swung[-1, 3]) > 0.5 and np.abs(braked[7:11, 3]).max() < 0.1
    assert verify.main([str(tmp_path / 'bag')]) == 0, capsys.readouterr().out
    assert 'every force is the recorded one' in capsys.readouterr().out


def test_a_driver_that_asks_hears_of_the_death_of_the_mpc(peer, start_node):
    heard, forces = set(), []   # what is wrong; liveliness as long as it is
    profile = QoSProfile(depth=1000, deadline=Duration(seconds=DEADLINE),
                         liveliness=LivelinessPolicy.AUTOMATIC,
                         liveliness_lease_duration=Duration(seconds=LEASE))
    peer.node.create_subscription(
        Float64, 'force_command', forces.append, profile,
        event_callbacks=SubscriptionEventCallbacks(
            deadline=lambda event: heard.add('deadline'),
            liveliness=lambda event: (heard.discard if event.alive_count else heard.add)(
                'liveliness'),
            use_default_callbacks=False))
    node = start_node('mpc')
    node.wait_for('ready')
    driver = Driver(peer, forces=1000)   # whose own subscriptions ask for nothing
    driver.meet()
    driver.stream(20, lambda now: now)
    assert peer.until(lambda: driver.stream(1, lambda now: now) or (
        len(forces) >= 18 and len(driver.forces) == len(forces)))
    # not one before the first state, or of a busy machine
    assert peer.until(lambda: heard.discard('deadline') or driver.stream(1, lambda now: now)
                      or not heard)
    node.signal(signal.SIGKILL)
    assert peer.until(lambda: heard == {'deadline', 'liveliness'})


def test_states_that_stop_are_a_missed_deadline_too(peer, start_here):
    """The stream is: a force a state, then zero, then silence."""
    missed = []
    peer.node.create_subscription(
        Float64, 'force_command', lambda message: None,
        QoSProfile(depth=10, deadline=Duration(seconds=DEADLINE)),
        event_callbacks=SubscriptionEventCallbacks(
            deadline=missed.append, use_default_callbacks=False))
    start_here('mpc').wait_for('ready')
    driver = Driver(peer)
    driver.meet()
    driver.stream(20, lambda now: now)
    assert peer.until(lambda: driver.forces and driver.forces[-1].data == 0.0)
    missed.clear()
    assert peer.until(lambda: missed)
    assert driver.forces[-1].data == 0.0

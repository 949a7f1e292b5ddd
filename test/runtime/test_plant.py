# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a plant does with what comes and when, in virtual time."""

import itertools
import math

from controllers import plant
import numpy as np
import pytest

from dp_swing_ros.messages.configuration import BEFORE
from dp_swing_ros.messages.fields import BILLION, Report
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.runtime.plant import (
    Announcement, Description, ERROR, OK, PlantCore, State, Trouble, WARN, Warned)

PERIOD = 0.05
DAY = 1_700_000_000 * BILLION   # [ns] when it begins
LEANING = (0.5, 1.0, 0.0, 0.0, 0.0, 0.0)


class Running:
    """A core from its first state on, a clock that is set by hand, and all that was sent."""

    def __init__(self, begun=True, **parameters):
        self.core, self.now, self.sent = PlantCore(plant(**parameters)), 1000 * BILLION, []
        if begun:
            self.begin()

    def begin(self):
        self.take(self.core.begin(self.now, DAY))

    def take(self, sent):
        """Remember what was sent, and return it."""
        self.sent += sent
        return sent

    def of(self, kind):
        return [each for each in self.sent if isinstance(each, kind)]

    @property
    def states(self):
        return self.of(State)

    @property
    def report(self):
        """Return the last report."""
        return self.of(Report)[-1]

    def warnings(self, trouble):
        return [each.text for each in self.of(Warned) if each.of is trouble]

    def times(self):
        """Return the times [s] of the states from the beginning on."""
        begin = 0 if self.core.lockstep else DAY
        return [(state.stamp - begin) / BILLION for state in self.states]

    def passes(self, seconds):
        self.now += round(seconds * BILLION)

    def force(self, force):
        return self.take(self.core.on_force(force, self.now))

    def push(self, push):
        return self.take(self.core.on_push(push))

    def reset(self):
        return self.take(self.core.reset(self.now, DAY + self.now - 1000 * BILLION))

    def change(self, **parameters):
        return self.take(self.core.change(plant(**parameters), self.now))

    def tick(self, count=1, after=PERIOD):
        """Tick after a time [s], so many times; return what was sent at the last."""
        for _ in range(count):
            self.passes(after)
            sent = self.take(self.core.tick(self.now))
        return sent

    def listeners(self, *names):
        return self.take(self.core.on_listeners(set(names), self.now))

    def pause(self, paused):
        answer, sent = self.core.pause(paused, self.now)
        self.take(sent)
        return answer

    def step(self):
        answer, sent = self.core.step(self.now)
        self.take(sent)
        return answer

    def due(self):
        """Tick as soon as a tick is due, as long as it is at once; return what comes then."""
        while (wait := self.core.wait(self.now)) == 0:
            self.take(self.core.tick(self.now))
        return wait


def lockstep(**parameters):
    return Running(lockstep=True, **parameters)


def test_in_real_time_states_come_with_the_ticks_and_the_time_of_day():
    run = Running(initial_state=LEANING)
    run.tick(30)
    np.testing.assert_allclose(run.times(), np.arange(31) * PERIOD, atol=1e-9)
    p = plant(initial_state=LEANING)
    for state in run.states:
        np.testing.assert_allclose(state.x, p.x, atol=1e-9)
        p.advance(PERIOD)
    assert [report.values['time'] for report in run.of(Report)] == pytest.approx([0.0, 1.0])
    assert run.core.wait(run.now) is None
    assert (run.report.level, run.report.message) == (OK, 'obeys the force')


def test_late_ticks_are_counted_and_not_made_up_for():
    run = Running(initial_state=LEANING)
    for after in (0.05, 0.07, 0.1, 0.85, 0.051, 0.049):
        run.tick(after=after)
    assert run.core.counts.skipped_ticks == 0 + 0 + 1 + 16
    assert len(run.states) == 7
    p = plant(initial_state=LEANING)
    p.advance(run.times()[-1])
    np.testing.assert_allclose(run.states[-1].x, p.x, atol=1e-6)
    assert run.report.values['skipped_ticks'] == 17


@pytest.mark.parametrize('jump', [-1e9, -0.5, 3.0, 1e6, 1.7e9])
def test_a_clock_that_is_set_is_told_of_and_nothing_else(jump):
    run = Running(initial_state=LEANING)
    run.tick(10)
    run.tick(after=jump)
    run.tick(10)
    assert run.warnings(Trouble.JUMP) == [
        f'the clock jumped by {jump:+.6g} s; the pendulum goes on from where it was']
    p = plant(initial_state=LEANING)
    p.advance(20 * PERIOD)
    np.testing.assert_allclose(run.states[-1].x, p.x, atol=1e-9)
    # where nothing passed, the state is measured anew
    np.testing.assert_array_equal(run.states[10].x, run.states[11].x)
    assert run.times()[11:] == pytest.approx(jump + np.arange(10, 21) * PERIOD)
    assert run.core.counts.skipped_ticks == 0


def test_a_force_acts_from_when_it_comes():
    run = Running()
    run.passes(0.02)
    assert run.force(10.0) == []
    run.tick(after=0.03)
    assert run.states[-1].force == pytest.approx(10.0 * 0.03 / PERIOD)
    run.tick()
    assert run.states[-1].force == pytest.approx(10.0)
    assert run.states[-1].x[0] > 0


def test_a_force_before_the_first_state_is_counted_and_not_obeyed():
    run = Running(begun=False)
    assert run.force(10.0) == []
    run.begin()
    run.tick()
    assert (run.core.counts.commands, run.states[-1].force) == (1, 0.0)


def test_without_commands_the_force_becomes_zero_and_it_says_so_once():
    run = Running(command_timeout=0.32)
    run.force(1.0)
    run.tick(30)
    assert run.report.message == 'no force arrives; it is zero' and run.report.level == WARN
    assert sum(state.force for state in run.states) * PERIOD == pytest.approx(0.32)
    assert run.warnings(Trouble.SILENCE) == [
        'no force for 0.32 s; the force is zero until the next']
    run.force(1.0)
    run.tick()
    assert run.states[-1].force == pytest.approx(1.0)
    run.tick(20)
    assert len(run.warnings(Trouble.SILENCE)) == 2
    run.reset()
    assert run.report.level == OK


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf])
def test_a_force_that_is_not_finite_is_refused(bad):
    for run in (Running(), lockstep()):
        run.force(bad)
        assert run.warnings(Trouble.FORCE) == [
            f'refused a force of {bad}; expected a finite number [N]']
        assert len(run.states) == 1
        assert run.core.counts.refused == 1 and run.core.counts.commands == 0
    run = Running()
    run.force(bad)
    run.tick(21)
    assert (run.report.level, run.report.message) == (WARN, 'refused a force or a disturbance')
    assert run.report.values['refused'] == 1 and run.states[-1].force == 0.0
    run.tick(20)
    assert run.report.level == OK


def test_a_push_lasts_the_next_period():
    """In both modes; it is reported where it begins."""
    for run in (Running(), lockstep()):
        run.push(4.0)
        run.push(6.0)
        for _ in range(3):
            run.force(0.0)
            run.tick()
        p = plant()
        for state, push in zip(run.states, (0.0, 10.0, 0.0)):
            np.testing.assert_allclose(state.x, p.x, atol=1e-12)
            p.begin_period(push)
            p.advance(PERIOD)
        assert all(state.force == 0.0 for state in run.states)
        assert [(report.values['time'], report.values['push']) for report in run.of(Report)] == [
            (0.0, 0.0), (pytest.approx(PERIOD), 10.0)]


@pytest.mark.parametrize('pushes', [[1e6], [-1e6], [math.nan], [60.0, 60.0, 60.0]], ids=str)
def test_a_push_beyond_all_bounds_is_refused(pushes):
    run, accepted = lockstep(), 60.0 if len(pushes) > 1 else 0.0
    for push in pushes:
        run.push(push)
    for _ in range(44):
        run.force(0.0)
    p = plant()
    p.begin_period(0.0)
    p.advance(PERIOD)
    p.begin_period(accepted)
    p.advance(PERIOD)
    np.testing.assert_array_equal(run.states[2].x, p.x)
    refused = max(len(pushes) - 1, 1)
    assert len(run.warnings(Trouble.PUSH)) == refused
    assert f'refused a disturbance of {pushes[-1]:g} N' in run.warnings(Trouble.PUSH)[-1]
    assert 'expected 100 N at most (disturbance_limit)' in run.warnings(Trouble.PUSH)[-1]
    then, *_, later = [each for each in run.of(Report) if each.values['refused_disturbances']]
    assert (then.level, later.level) == (WARN, OK)
    assert then.values['refused_disturbances'] == later.values['refused_disturbances'] == refused
    assert {each.stamp: each.values['push'] for each in run.of(Report) if each.values['push']} == (
        {50_000_000: accepted} if accepted else {})


def test_a_reset_goes_back_to_the_start_and_says_so_before_the_state():
    run = Running(initial_state=LEANING)
    run.push(1.0)
    run.tick(7)
    run.passes(0.01)
    announced, state, report = run.reset()
    assert announced == Announcement(resets=1)
    np.testing.assert_array_equal(state.x, LEANING)
    assert state.stamp == DAY + round((7 * PERIOD + 0.01) * BILLION)
    assert (report.values['time'], report.values['push']) == (0.0, 0.0)
    run.tick()
    assert run.core.plant.t == pytest.approx(PERIOD) and run.core.counts.skipped_ticks == 0
    assert run.reset()[0].resets == 2
    assert Running(begun=False).reset() == [Announcement(resets=1)]


def test_faults_in_real_time_are_counted():
    run = Running(state_loss=0.4, command_loss=0.4, command_jitter=0.08, actuator_response=0.02)
    for _ in range(40):
        run.force(4.0)
        run.tick()
    assert max(state.force for state in run.states) == pytest.approx(4.0, abs=0.1)
    assert any(0.1 < state.force < 3.5 for state in run.states)   # it got there by and by
    counts = run.core.counts
    assert counts.commands == 40 and 8 < counts.lost_commands < 24
    assert counts.lost_states == 41 - len(run.states) and 8 < counts.lost_states < 24
    run.tick(20)
    assert run.report.values['lost_commands'] == counts.lost_commands


def test_what_has_not_arrived_yet_is_not_lost():
    for run in (Running(delay=0.6), lockstep(delay=0.6)):
        run.tick(12)
        run.due()
        assert run.core.counts.lost_states == 0
        assert len(run.states) == 1
        np.testing.assert_allclose(run.states[0].x, [0, math.pi, math.pi, 0, 0, 0], atol=1e-9)
        assert run.times() == [pytest.approx(0.0)]


def test_a_state_that_is_not_finite_is_an_error():
    core = PlantCore(plant(limits=LimitParameters(force_limit=math.inf)))
    core.begin(0, DAY)
    core.on_force(1e300, 0)
    sent = [each for n in range(1, 22) for each in core.tick(n * 50_000_000)]
    report = [each for each in sent if isinstance(each, Report)][-1]
    assert (report.level, report.message) == (ERROR, 'the state is not finite; call plant/reset')


def test_it_is_done_after_its_duration():
    run = Running(duration=1.0)
    run.tick(19)
    assert not run.core.done
    run.tick()
    assert run.core.done
    run = lockstep(duration=1.0)
    for n in range(20):
        assert not run.core.done
        run.force(float(n))
    assert run.core.done and run.times()[-1] == 1.0
    assert run.force(1.0) == [] and len(run.states) == 21


def test_lockstep_waits_for_every_force():
    run = lockstep(rate=50.0)
    for n in range(1, 30):
        run.passes(100.0)
        assert run.core.wait(run.now) is None and run.core.tick(run.now) == []
        run.force(float(n % 5))
        assert len(run.states) == n + 1
        assert run.states[n].force == n % 5
    assert run.times() == pytest.approx(np.arange(30) * 0.02)
    assert run.of(Warned) == []


FAULTS = {'state_loss': 0.4, 'command_loss': 0.4, 'command_jitter': 0.08,
          'actuator_response': 0.3}
SEED = next(seed for seed in itertools.count() if plant(seed, state_loss=0.4).measure() is None)


@pytest.mark.parametrize('names', [['state_loss'], ['command_loss'], list(FAULTS)], ids=str)
def test_lockstep_goes_on_through_losses(names):
    """To the bit as a plant by hand whose n-th state is answered with n."""
    faults = {name: FAULTS[name] for name in names}
    run, p, n, heard = lockstep(seed=SEED, **faults), plant(SEED, **faults), 0, 0
    while n < 30:
        measured, force = p.measure(), p.mean_force
        p.begin_period(0.0)
        if measured is not None:
            assert run.due() is None
            state = run.states[n]
            assert state.stamp == round(measured.t * BILLION) and state.force == force
            np.testing.assert_array_equal(state.x, measured.x)
            n += 1
            heard += p.obey(float(n))
            run.force(float(n))
        p.advance(PERIOD)
    assert run.core.counts.lost_commands == 30 - heard
    assert (run.core.counts.lost_states > 5) is ('state_loss' in names)


def test_lockstep_without_any_state_goes_on_a_period_a_tick():
    run = lockstep(state_loss=1.0, duration=5.0)
    for n in range(100):   # each a call of its own, so that a signal can end it
        assert run.core.wait(run.now) == 0 and not run.core.done
        assert run.report.values['lost_states'] == pytest.approx(
            run.report.values['time'] / PERIOD + 1)
        run.tick(after=0.0)
    assert run.core.done and run.core.wait(run.now) is None
    assert not run.states


def test_a_force_that_answers_no_state_is_not_obeyed():
    run = lockstep(delay=0.1)
    assert not run.states   # none can be here yet
    run.force(5.0)
    run.due()
    assert run.states[-1].stamp == 0 and run.states[-1].force == 0.0
    run.force(2.0)
    assert run.states[-1].force == 2.0


@pytest.mark.parametrize('parameters', [{}, {'lockstep': True}])
def test_a_push_from_before_a_reset_does_not_act_after_it(parameters):
    run, alone = (Running(initial_state=LEANING, **parameters) for _ in range(2))
    run.take(run.core.on_push(5.0))
    for each in (run, alone):
        each.reset()
        each.force(0.0)
        each.tick()
    np.testing.assert_array_equal(run.states[-1].x, alone.states[-1].x)


def test_a_force_from_before_a_reset_is_not_obeyed():
    run = lockstep()
    run.force(1.0)
    run.reset()   # while the answer to the second state is underway
    assert run.states[-1].stamp == 0
    assert run.force(7.0) == []
    run.force(2.0)
    assert run.states[-1].stamp == 50_000_000 and run.states[-1].force == 2.0


def test_after_a_reset_between_force_and_period_the_next_force_is_obeyed():
    run = lockstep()
    run.pause(True)
    run.force(7.0)   # it is here already, so nothing is underway
    run.reset()
    run.pause(False)
    assert len(run.states) == 2
    run.force(2.0)
    assert run.states[-1].force == 2.0


def test_a_state_whose_answer_was_overlooked_is_sent_again():
    run = lockstep()
    run.listeners(b'mpc')
    run.passes(1.0)
    run.reset()   # and the first state is never answered
    run.passes(0.1)
    run.force(3.0)
    run.passes(0.2)
    assert run.listeners(b'mpc') == []
    run.passes(0.2)
    assert run.listeners(b'mpc') == [run.states[-2]]
    run.passes(1.0)
    assert run.listeners(b'mpc') == []   # once
    run.force(4.0)
    assert run.states[-1].force == 4.0


def test_a_controller_that_joins_late_gets_the_unanswered_state():
    run = lockstep()
    run.listeners(b'first')
    run.force(3.0)
    run.passes(1.0)
    assert run.listeners(b'first', b'second') == []   # it may not hear yet
    run.passes(0.2)
    assert run.listeners(b'first', b'second') == []
    run.passes(0.2)
    assert run.listeners(b'first', b'second') == [run.states[-2]]
    run.passes(1.0)
    assert run.listeners(b'first', b'second') == []
    run.listeners(b'first')
    run.listeners(b'first', b'second')   # it leaves and comes back
    run.passes(0.4)
    assert len(run.listeners(b'first', b'second')) == 1


def test_no_state_is_sent_again_that_is_answered_or_where_there_is_none():
    run = lockstep(pace=0.01)
    run.force(1.0)   # of a period that lasts
    assert run.listeners(b'mpc') == []
    run = lockstep(state_loss=1.0)
    run.listeners(b'mpc')
    run.passes(1.0)
    assert run.listeners(b'mpc') == []


def test_it_stops_between_two_periods_and_goes_on_as_if_nothing_had_been():
    run = lockstep()
    for n in range(3):
        run.force(float(n + 1))
    assert run.pause(True) == (True, 'paused')
    assert (run.report.values['paused'], run.report.message) == (True, 'paused')
    run.force(4.0)
    assert len(run.states) == 4 and run.core.wait(run.now) is None
    assert run.pause(False) == (True, 'going on')
    assert not run.report.values['paused']
    for n in range(4, 20):
        run.force(float(n + 1))
    assert [state.force for state in run.states] == [float(n) for n in range(21)]
    assert run.times() == pytest.approx(np.arange(21) * PERIOD)


def test_it_can_be_paused_before_it_begins():
    run = Running(begun=False, lockstep=True)
    assert run.pause(True) == (True, 'paused') and run.sent == []
    run.begin()
    assert run.report.message == 'paused'
    run.force(1.0)
    assert len(run.states) == 1


def test_a_step_lets_one_period_pass():
    run = lockstep()
    assert run.step() == (False, 'not paused; call plant/pause first')
    run.pause(True)
    for n in range(1, 4):
        run.force(float(n))
        assert run.step() == (True, 'a period has passed')
        assert len(run.states) == n + 1
    # before its force is there
    assert run.step() == (True, 'a period passes with the next force')
    assert len(run.states) == 4
    run.force(4.0)
    assert len(run.states) == 5
    run.force(5.0)
    assert len(run.states) == 5
    run = lockstep(pace=0.01)   # nor does it wait for its time
    run.pause(True)
    for n in range(1, 4):
        run.force(1.0)
        assert run.step().success and len(run.states) == n + 1


def test_a_pace_is_kept_and_can_change():
    run = lockstep(pace=0.5)
    run.force(1.0)   # the first need not wait
    for n in range(1, 6):
        run.force(1.0)
        assert run.core.wait(run.now) == 100_000_000
        run.tick(after=0.06)
        assert len(run.states) == n + 1
        run.tick(after=0.04)
        assert len(run.states) == n + 2
    # a tick that came late, and a period that makes up for it
    run.passes(0.15)
    run.force(1.0)
    assert len(run.states) == 8
    run.force(1.0)
    assert run.core.wait(run.now) == 50_000_000
    run.change(lockstep=True, pace=0.01)   # 5 s a period, but not that one
    run.tick(after=0.05)
    run.force(1.0)
    assert run.core.wait(run.now) == 5 * BILLION
    run.change(lockstep=True)
    assert run.due() is None
    before = len(run.states)
    for _ in range(40):
        run.force(1.0)
    assert len(run.states) == before + 40


def test_no_more_than_one_period_makes_up_for_a_long_one():
    run = lockstep(pace=0.5)
    run.passes(10.0)
    run.force(1.0)
    run.force(1.0)
    assert len(run.states) == 3
    run.force(1.0)
    assert run.core.wait(run.now) == 100_000_000


def test_a_reset_while_it_is_paused_brings_the_first_state_and_stays_paused():
    run = lockstep()
    run.force(1.0)
    run.pause(True)
    run.force(2.0)
    run.reset()
    assert len(run.states) == 3 and run.states[-1].stamp == 0
    run.force(3.0)
    assert len(run.states) == 3
    assert run.step().success
    assert run.states[-1].force == 3.0 and len(run.states) == 4


def test_real_time_cannot_be_stopped_and_says_so():
    run = Running()
    for answer in (run.pause(True), run.step()):
        assert not answer.success
        assert 'lockstep:=true, or all by `make play LOCKSTEP=1`' in answer.message
    run.tick(21)
    assert len(run.states) == 22 and not run.report.values['paused']


def test_a_change_counts_from_now_on_and_is_announced():
    run = Running(initial_state=LEANING)
    run.tick(5)
    run.passes(0.02)
    announced, = run.change(initial_state=LEANING, rate=100.0, command_timeout=0.5)
    assert announced == Announcement(revision=1, since=round((5 * PERIOD + 0.02) * BILLION))
    assert run.core.stepper.period == 0.01
    run.tick(50, after=0.01)
    assert run.core.counts.skipped_ticks == 2    # the first came 0.03 s after a state
    p = plant(initial_state=LEANING)
    p.advance(run.times()[-1])
    np.testing.assert_allclose(run.states[-1].x, p.x, atol=1e-6)
    run.reset()
    assert run.of(Announcement)[-1] == announced._replace(resets=1)


def test_a_change_in_lockstep_counts_from_the_period_on_that_has_begun():
    run = lockstep()
    run.force(1.0)
    run.passes(1.0)
    assert run.change(lockstep=True, rate=40.0) == [Announcement(revision=1, since=50_000_000)]
    run.force(1.0)
    assert run.times()[-1] == pytest.approx(0.075)
    run = lockstep(pace=0.01)   # also where it lets that period pass at once
    run.force(1.0)
    run.force(1.0)
    assert run.change(lockstep=True) == [Announcement(revision=1, since=50_000_000)]
    assert run.due() is None and run.times()[-1] == pytest.approx(0.1)


def test_a_change_before_the_first_state_is_as_if_it_had_begun_so():
    run = Running(begun=False)
    assert run.change(initial_state=LEANING) == [Announcement(revision=1, since=BEFORE)]
    run.begin()
    np.testing.assert_array_equal(run.states[0].x, LEANING)


def test_another_pendulum_is_described_anew():
    run = Running()
    described, announced = run.change(physical=PendulumParameters(
        link2_mass=0.7))
    assert isinstance(described, Description) and 'value="0.7"' in described.text
    assert described == run.core.description()
    assert announced.revision == 1

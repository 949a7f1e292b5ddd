# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What real nodes did is repeated to the bit, and what was changed afterwards is found."""

from itertools import pairwise
import re

from learned_dynamics import model_of, of_chain
from one_process import record, recorded_until, recording
import pytest
from rclpy.parameter import Parameter
from real_bags import converted, repeated, rewritten, tick, value_of, with_value
from std_msgs.msg import String

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.dynamics.files import load
from dp_swing_ros.messages.configuration import from_text
from dp_swing_ros.messages.fields import nanoseconds
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.rerun.ticks import record_of
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tools.verify import main
from dp_swing_ros.topics import (
    CONFIGURATION, DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES, PLAN, ROBOT_DESCRIPTION)

FAULTS = ('    position_noise: 0.002\n    velocity_noise: 0.05\n    force_noise: 1.0\n'
          '    state_loss: 0.4\n')


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Return a short run in lockstep of each solver."""
    return {solver: record(tmp_path_factory.mktemp(solver), '--solver', solver, '--duration', '1',
                           '--lockstep', '--seed', '5') for solver in sorted(SOLVERS)}


def verified(bag, capsys):
    """Return the exit code, the lines that were printed, and the error."""
    code = main([str(bag)])
    shown = capsys.readouterr()
    return code, shown.out.splitlines(), shown.err.split('\r')[-1].strip()


def drop(_):
    return None


def whole(count, solver):
    """Return what is said of a lockstep run that comes out again."""
    return [f'{count} ticks of {solver} in lockstep: every force is the recorded one to the bit',
            f'{count} plans: all states and forces are the recorded ones to the bit',
            f'{count} states: the plant simulated again gives them and the forces applied to '
            'the bit',
            'so the whole run, simulated again from its parameters alone, is the recorded one']


def test_with_springs_on_another_turn_it_comes_out_again(tmp_path, capsys):
    springs = '    joint1_stiffness: 0.3\n    joint1_preload: 0.9\n'
    bag = record(tmp_path, '--duration', '1.5', '--lockstep', mpc=springs, plant=springs + (
        '    initial_state: [0.0, 6.5, 6.3, 0.0, 0.0, 0.0]\n'))
    assert verified(bag, capsys)[:2] == (0, whole(31, 'ilqr'))


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_lockstep_comes_out_again(bags, solver, capsys):
    assert verified(bags[solver], capsys)[:2] == (0, whole(21, solver))


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_noise_lost_states_and_what_the_estimator_makes_of_them(solver, tmp_path, capsys):
    bag = record(tmp_path, '--solver', solver, '--duration', '2', '--lockstep', plant=FAULTS)
    ticks = record_of(Bag(bag)).ticks
    assert len(ticks) < 35
    code, lines, _ = verified(bag, capsys)
    # noise and losses come from seeds, so the plant comes out again too
    assert (code, lines[0].split()[0]) == (0, str(len(ticks)))
    assert lines[-1] == whole(0, solver)[-1]


def test_real_time_comes_out_again(tmp_path, capsys):
    def last_is_answered(bag):
        *_, last = Bag(bag).of(JOINT_STATES)
        return nanoseconds(last.header.stamp) in [
            nanoseconds(plan.header.stamp) for plan in Bag(bag).of(PLAN)]
    bag = recorded_until(last_is_answered, tmp_path, '--duration', '1')
    ticks = record_of(Bag(bag)).ticks
    assert all(one.real_time and one.delay > 0 for one in ticks)
    # the plant ends first: the mpc carries on, then lets go
    assert ticks[-1].status == 'ZERO'
    silent = sum(tick.x is None for tick in ticks)
    # a state may come late to a busy machine: then one answers none in between, too
    until = max(tick.stamp for tick in ticks if tick.x is not None)
    assert silent > 0
    assert len(read_episode(bag).ticks.t) == sum(tick.stamp <= until for tick in ticks)
    assert verified(bag, capsys)[:2] == (0, [
        f'{len(ticks)} ticks of ilqr in real time (no state came for {silent}): every force is '
        'the recorded one to the bit',
        f'{len(ticks)} plans: all states and forces are the recorded ones to the bit',
        'not checked: states and efforts, which in real time depend on when each force arrived'])


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_solves_that_a_deadline_cut_come_out_again(solver, tmp_path, capsys):
    def some_were_cut(bag):
        return sum(one.status == 'DEADLINE' for one in record_of(Bag(bag)).ticks) > 3
    bag = recorded_until(some_were_cut, tmp_path, '--solver', solver, '--duration', '1',
                         mpc='    time_limit: 0.0005\n')
    assert verified(bag, capsys)[0] == 0


def test_states_that_did_not_come_in_real_time(tmp_path, capsys):
    def some_did_not_come(bag):
        pairs = list(pairwise(record_of(Bag(bag)).ticks))
        return (any(one.x is None and following.x is not None for one, following in pairs)
                and any(one.status == 'ZERO' and following.x is not None
                        for one, following in pairs))
    bag = recorded_until(some_did_not_come, tmp_path, '--duration', '2', plant=FAULTS,
                         mpc='    carry_over: 0.04\n')
    assert verified(bag, capsys)[0] == 0


def test_a_changed_force_is_named(bags, tmp_path, capsys):
    count = iter(range(100))

    def change(message):
        if next(count) == 6:
            message.data += 1e-9
        return message

    code, lines, _ = verified(rewritten(bags['ilqr'], tmp_path / 'bag', FORCE_COMMAND, change),
                              capsys)
    assert code == 1
    assert re.match(r'tick 7 at 300000000 ns \(0\.300 s\), CONVERGED, differs: '
                    r'command on force_command .* recorded, .* now: 1\.\d+e-09 N apart', lines[0])
    assert lines[1].startswith('1 of 21 ticks of ilqr in lockstep differ')
    assert lines[-1].startswith('code, packages and machine are the same')


@pytest.mark.parametrize('key, value, text', [
    ('force', '0.125', r'force 0\.125 N recorded, \S+ N now: \S+ N apart'),
    ('cost', '1.5', r'cost 1\.5 recorded, \S+ now: \S+ apart'),
    ('solves', '1 2', r'iterations \(1, 2\) recorded, \(\d+, \d+, \d+\) now')])
def test_a_changed_report_is_named(bags, key, value, text, tmp_path, capsys):
    bag = rewritten(bags['ilqr'], tmp_path / 'bag', DIAGNOSTICS, tick(4, with_value(key, value)))
    code, lines, _ = verified(bag, capsys)
    assert code == 1
    assert re.match(rf'tick 4 at 150000000 ns .*differs: {text}', lines[0])
    assert lines[1].startswith('1 of 21 ticks')


def configured(node, old, new):
    """Return what changes the configuration of a node."""
    def change(message):
        if f'node: /{node}' in message.data:
            assert old in message.data
            message.data = message.data.replace(old, new)
        return message
    return change


def test_another_seed_is_another_run(bags, tmp_path, capsys):
    bag = rewritten(bags['mppi'], tmp_path / 'bag', CONFIGURATION,
                    configured('mpc', 'seed: 5', 'seed: 6'))
    code, lines, _ = verified(bag, capsys)
    assert code == 1
    assert lines[0].startswith('tick 1 at 0 ns')


def test_of_a_plant_that_had_been_changed_before_the_last_change_is_known(
        bags, tmp_path, capsys):
    bag = rewritten(bags['ilqr'], tmp_path / 'bag', CONFIGURATION,
                    configured('plant', 'revision: 0', 'revision: 2'))
    assert verified(bag, capsys)[0] == 0


def test_other_code_is_the_likely_cause_only_of_a_difference(bags, tmp_path, capsys):
    other = rewritten(bags['ddp'], tmp_path / 'other', CONFIGURATION,
                      configured('mpc', 'sources: ', 'sources: old'))
    code, lines, _ = verified(other, capsys)
    assert (code, lines[:4]) == (0, whole(21, 'ddp'))
    assert re.match(r'note: recorded elsewhere \(code old\w+ there, \w+ here\)', lines[4])
    changed = rewritten(other, tmp_path / 'changed', DIAGNOSTICS,
                        tick(4, with_value('force', '1')))
    code, lines, _ = verified(changed, capsys)
    assert code == 1
    assert lines[-1].startswith('likely cause: code old')


@pytest.mark.parametrize('missing', [1, 8])
def test_nothing_is_said_of_ticks_after_a_gap(bags, missing, tmp_path, capsys):
    bag = rewritten(bags['ilqr'], tmp_path / 'bag', DIAGNOSTICS, tick(missing, lambda _: None))
    code, lines, error = verified(bag, capsys)
    assert code == 2
    # the plant is known up to the state that no known force answers
    assert [line.split()[0] for line in lines] == {1: ['1'], 8: ['7', '7', '8']}[missing]
    assert f'error: tick {missing} is missing (the next is {missing + 1})' in error


def test_a_bag_that_begins_in_mid_run_is_verified_from_a_reset_on(bags, tmp_path, capsys):
    """As one of the console's: ticks before the reset are there, and those before them are not."""
    def change(message):
        number = int(value_of(message, 'number') or 0)
        return message if number == 0 else None if number < 5 else with_value(
            'resets', str(int(number >= 8)))(message)

    bag = rewritten(bags['ilqr'], tmp_path / 'bag', DIAGNOSTICS, change)
    found = record_of(Bag(bag))
    assert (found.ticks[0].number, found.ticks[0].reset, found.gap) == (8, True, '')
    assert found.begins_later
    assert record_of(Bag(bag), anywhere=True).ticks[0].number == 5
    # the force was not one after a reset, which is noticed
    code, lines, _ = verified(bag, capsys)
    assert code == 1
    assert lines[0].startswith('tick 8 at ')
    assert any('14 ticks' in line for line in lines), lines


def test_a_missing_state_is_a_gap(bags, tmp_path, capsys):
    bag = rewritten(bags['ilqr'], tmp_path / 'bag', JOINT_STATES, lambda message: (
        None if message.header.stamp.nanosec == 250_000_000 else message))
    code, lines, error = verified(bag, capsys)
    assert (code, [line.split()[0] for line in lines]) == (2, ['5', '5', '5'])
    assert 'the state of tick 6 is missing (250000000 ns)' in error


def test_states_that_the_logger_heard_too_late_are_said_to_be_that(bags, tmp_path, capsys):
    """As when two plants start at once on a busy machine, and discovery takes seconds."""
    dropped = []
    bag = rewritten(bags['ilqr'], tmp_path / 'bag', JOINT_STATES, lambda message: (
        dropped.append(message) if message.header.stamp.nanosec < 250_000_000 else message))
    code, _, error = verified(bag, capsys)
    assert code == 2
    # five, and the first again, if the mpc was found later
    before = [message.header.stamp.nanosec for message in dropped if not message.header.stamp.sec]
    assert len(set(before)) == 5
    assert (f'the state of tick 1 is missing (0 ns): {len(before)} were sent on /joint_states '
            'before') in error
    assert 'qos_overrides./joint_states.publisher.durability:=transient_local' in error


def changed_once(number, change):
    """Return what changes one message of a topic."""
    count = iter(range(1, 1000))
    return lambda message: change(message) if next(count) == number else message


@pytest.mark.parametrize('topic', [FORCE_COMMAND, PLAN])
def test_what_the_bag_lacks_is_not_passed_over(bags, topic, tmp_path, capsys):
    bag = rewritten(bags['ilqr'], tmp_path / 'bag', topic, changed_once(4, drop))
    code, lines, error = verified(bag, capsys)
    assert (code, lines[0]) == (2, whole(21, 'ilqr')[0])
    assert error == f'verify: error: the bag has nothing on {topic.name} of tick 4'
    assert not any(line.startswith('so the whole run') for line in lines)


def test_a_bag_without_forces_is_not_passed_over(bags, tmp_path, capsys):
    bag = rewritten(bags['ilqr'], tmp_path / 'bag', FORCE_COMMAND, drop)
    code, _, error = verified(bag, capsys)
    assert code == 2
    assert 'nothing on force_command of tick 1, 2, 3, 4, 5 and 16 more' in error


def test_a_bag_without_plans_says_so(bags, tmp_path, capsys):
    code, lines, _ = verified(rewritten(bags['ilqr'], tmp_path / 'bag', PLAN, drop), capsys)
    assert code == 0
    assert 'not checked: the plans, for the bag has no mpc/plan' in lines


def move(field, place, by):
    """Return what changes a number of a JointState, or of the third point of a plan."""
    def change(message):
        numbers = getattr(message.points[2] if hasattr(message, 'points') else message, field)
        numbers[place] += by
        return message
    return change


def changed_at(stamp, change):
    """Return what changes the message of that stamp; the number of a state says less."""
    # in lockstep one that a controller was found after is sent again
    return lambda message: (change(message) if nanoseconds(message.header.stamp) == stamp
                            else message)


@pytest.mark.parametrize('topic, change, text', [
    (JOINT_STATES, move('effort', 0, 1e-9), r'the state at 150000000 ns \(0\.150 s\), differs: '
     r'effort \S+ N recorded, \S+ N now: 1\.\d+e-09 N apart'),
    (PLAN, move('effort', 0, 1e-9), r'tick 4 at 150000000 ns .*: forces of the plan: \S+ apart'),
    (PLAN, move('positions', 1, 1e-9), r'tick 4 at .*: states of the plan: \S+ apart')])
def test_a_changed_effort_or_plan_is_named(bags, topic, change, text, tmp_path, capsys):
    bag = rewritten(bags['ddp'], tmp_path / 'bag', topic, changed_at(150_000_000, change))
    code, lines, _ = verified(bag, capsys)
    assert code == 1
    assert re.match(text, lines[0])
    assert lines[1].startswith('1 of 21 ')


@pytest.mark.parametrize('topic, change, text', [
    (CONFIGURATION, configured('plant', 'cart_mass: 1.0', 'cart_mass: 1.1'),
     'the robot description, diff'),
    (CONFIGURATION, configured('plant', 'physics_step: 0.005', 'physics_step: 0.01'),
     'the state at '),
    (CONFIGURATION, configured('plant', '  rate: 20.0', '  rate: 40.0'), 'the state at '),
    (ROBOT_DESCRIPTION, lambda message: String(data=message.data.replace(
        'value="9.81"', 'value="9.8"')), 'the robot description, differs: its physical parameters '
     'and limits')])
def test_changed_parameters_of_the_plant_are_named(bags, topic, change, text, tmp_path, capsys):
    code, lines, _ = verified(rewritten(bags['ddp'], tmp_path / 'bag', topic, change), capsys)
    assert code == 1
    assert lines[0].startswith(text)


def doubled(forces):
    return forces[:7] + forces[6:]


def swapped(forces):
    return [*forces[:6], forces[7], forces[6], *forces[8:]]


def altered(forces):
    return [*forces[:6], forces[6] * (1 + 1e-15), *forces[7:]]


CONVERTED = [
    (lambda forces: forces, 0, 'every force is the recorded one to the bit'),
    (lambda forces: forces[:6] + forces[7:], 2, 'nothing on force_command of tick 7'),
    (doubled, 1, '1 forces on force_command are of no tick'),
    (swapped, 1, '2 of 21 ticks of ddp in lockstep differ'),
    (altered, 1, '1 of 21 ticks of ddp in lockstep differ'),
    (lambda forces: forces[1:], 2, 'nothing on force_command of tick '),
    (lambda forces: forces[:-3], 2, 'nothing on force_command of tick 20, 21'),
    (lambda forces: [0.5, *forces], 1, '1 forces on force_command are of no tick'),
    (lambda forces: [*forces, 0.5], 1, '1 forces on force_command are of no tick'),
    (lambda forces: [], 2, 'nothing on force_command of tick 1, 2, 3, 4, 5 and 16 more')]


# a bag that was in sqlite3 is one of MCAP like any other, so a few changes show that
@pytest.mark.parametrize('storage, change, code, text', [
    *(('mcap', *each) for each in CONVERTED), *(('sqlite3', *each) for each in CONVERTED[:3])])
def test_converted_bags_have_no_numbers_and_are_checked_all_the_same(
        bags, storage, change, code, text, tmp_path, capsys):
    bag = converted(bags['ddp'], tmp_path / 'bag', storage, change)
    assert {entry.sequence for entry in Bag(bag).entries} == {0}
    found, lines, error = verified(bag, capsys)
    assert (found, text in '\n'.join([*lines, error])) == (code, True)


@pytest.mark.parametrize('number', [1, 7, 21])
def test_doubled_forces_with_their_numbers_are_named(bags, number, tmp_path, capsys):
    bag = repeated(bags['ddp'], tmp_path / 'bag', FORCE_COMMAND, number)
    code, lines, _ = verified(bag, capsys)
    assert code == 1
    assert re.match(r'a force at \d+ ns, differs: \S+ N on force_command, which no tick sent',
                    lines[0])


def test_a_bag_whose_metadata_counts_more_is_not_passed_over(bags, tmp_path, capsys):
    bag = rewritten(bags['ddp'], tmp_path / 'bag', FORCE_COMMAND, lambda message: message)
    about = bag / 'metadata.yaml'
    count = len(Bag(bag).entries)
    about.write_text(about.read_text().replace(
        f'message_count: {count}\n', f'message_count: {count + 9}\n'))
    code, lines, error = verified(bag, capsys)
    assert code == 2
    assert f'Incomplete: {count} of {count + 9} messages' in lines
    assert f'Incomplete: {count} of {count + 9} messages; ask for what is there' in error
    assert main([str(bag), '--partial']) == 0


def again(message):
    """Give all ticks one number, as if the mpc was started again at each."""
    return with_value('number', '1')(message) if value_of(message, 'number') else message


@pytest.mark.parametrize('topic, change, complaint', [
    (CONFIGURATION, drop, 'has no parameters of the mpc, but those of no node'),
    (CONFIGURATION, configured('mpc', 'horizon: 30', 'horizont: 30'),
     "unknown parameter 'horizont' of the node 'mpc'; did you mean 'horizon'?"),
    (CONFIGURATION, configured('mpc', 'horizon: 30', 'horizon: 0'), "parameter 'horizon' is 0"),
    (DIAGNOSTICS, drop, 'has no ticks of an mpc'),
    (DIAGNOSTICS, tick(2, with_value('carried', '?')), 'invalid literal'),
    (DIAGNOSTICS, again, 'has two ticks number 1: the mpc was started again, or two ran'),
    (JOINT_STATES, drop, 'has nothing on joint_states')])
def test_what_cannot_be_verified_is_one_line(bags, topic, change, complaint, tmp_path, capsys):
    bag = rewritten(bags['ilqr'], tmp_path / 'bag', topic, change)
    code, lines, error = verified(bag, capsys)
    assert (code, lines) == (2, [])
    assert error.startswith('verify: error: ') and '\n' not in error
    assert complaint in error


def test_a_bag_holds_the_learned_model_that_it_was_planned_with(tmp_path, capsys):
    """So it is verified where the file is no more, and differs where the model does."""
    file = tmp_path / 'model.json'
    file.write_text(model_of(of_chain(PendulumParameters())).to_text())
    bag = record(tmp_path, '--solver', 'ddp', '--duration', '1', '--lockstep',
                 mpc=f'    dynamics: learned\n    model: {file}\n')
    file.unlink()
    assert verified(bag, capsys)[:2] == (0, whole(21, 'ddp'))

    def heavier(message):
        found = from_text(message.data)
        if 'model' in found.parameters:
            text = model_of(of_chain(PendulumParameters(link2_mass=0.51))).to_text()
            found = found._replace(parameters={**found.parameters, 'model': text})
        return String(data=found.to_text())
    assert verified(rewritten(bag, tmp_path / 'other', CONFIGURATION, heavier), capsys)[0] == 1


def test_a_bag_in_which_what_was_learned_beside_the_equations_drives_is_verified(
        tmp_path, capsys):
    told = ('dynamics: adaptive\nestimator: none\nlink2_length: 1.3\n'
            f'learned_file: {tmp_path}/model.json\n')
    bag = record(tmp_path, '--duration', '4', '--lockstep', mpc=told)
    drove = {value_of(message, 'dynamics') for message in Bag(bag).of(DIAGNOSTICS)}
    assert {'analytic', 'learned'} <= drove
    assert load(f'{tmp_path}/model.json', 2).about['seconds'] == pytest.approx(4.0, abs=0.2)
    assert verified(bag, capsys)[:2] == (0, whole(81, 'ilqr'))


def test_a_bag_in_which_it_is_learned_anew_is_verified(tmp_path, capsys):
    """After other dynamics, and after a reset; another goal leaves what was learned."""
    told = {'estimator': 'none', 'link2_length': 1.3}
    with recording(tmp_path / 'bag', {
            'mpc': told, 'plant': {'duration': 6.0, 'lockstep': True, 'pace': 4.0}}) as (
                crew, mpc, plant):
        for forces, change in (
                (10, ('dynamics', 'adaptive')), (50, ('goal', 'down_up')), (60, None),
                (95, ('dynamics', 'analytic')), (105, ('dynamics', 'adaptive'))):
            assert crew.until(lambda: mpc.core.forces >= forces)
            if change is None:
                mpc.core.reset()
            else:
                mpc.set_parameters([Parameter(change[0], value=change[1])])
        assert crew.until(lambda: plant.done)
    assert 'learned' in {value_of(message, 'dynamics')
                         for message in Bag(tmp_path / 'bag').of(DIAGNOSTICS)}
    assert verified(tmp_path / 'bag', capsys)[:2] == (0, whole(121, 'ilqr'))


def test_a_bag_from_before_is_told(bags, tmp_path, capsys):
    def change(message):
        message.status[0].values = [pair for pair in message.status[0].values
                                    if pair.key not in ('number', 'solves')]
        return message

    bag = rewritten(bags['ilqr'], tmp_path / 'bag', DIAGNOSTICS, change)
    code, lines, error = verified(bag, capsys)
    assert (code, lines) == (2, [])
    assert 'is of an mpc without solves, number at every tick' in error


def test_missing_and_damaged_bags_are_one_line(bags, tmp_path, capsys):
    assert verified(tmp_path / 'none', capsys)[2].startswith('verify: error: there is no bag')
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(next(bags['ilqr'].glob('*.mcap')).read_bytes()[:-200])
    assert verified(cut, capsys)[0] == 2
    assert main([str(cut), '--partial']) == 0
    count = len(Bag(cut, partial=True).entries)
    assert f'Incomplete: {count} of unknown messages' in capsys.readouterr().out

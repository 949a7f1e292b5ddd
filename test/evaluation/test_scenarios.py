# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
import math

import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.contestants import parse, play
from dp_swing_ros.evaluation.campaign.summary import CRITERIA
from dp_swing_ros.evaluation.scenarios import (
    APART, FIRST_PUSH, LAST_PUSH, PERIOD, PHYSICAL, push_profile, SCENARIOS, sized)
from dp_swing_ros.pendulum.parameters import DriveParameters, PendulumParameters
from dp_swing_ros.pendulum.state import angles, equilibria, hanging, is_upright, LINKS
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.simulation.plant import PlantParameters
from dp_swing_ros.solvers import SOLVERS


def cases(name, seeds=None, levels=0, duration=10.0, links=2):
    return list(SCENARIOS[name].cases(name, seeds, levels, duration, links))


@pytest.mark.parametrize('links', LINKS)
@pytest.mark.parametrize('name', SCENARIOS)
def test_every_case_is_one_of_a_plant_that_there_is(name, links):
    for case in cases(name, range(2), 3, links=links):
        plants.plant({'links': links, **case.plant})
        assert case.scenario == name
        assert len(case.pushes) in (0, 200)


@pytest.mark.parametrize('name', SCENARIOS)
def test_cases_are_all_different_and_always_the_same(name):
    found = cases(name, range(3), 4)
    assert len({(case.parameter, case.level, case.seed) for case in found}) == len(found)
    assert found == cases(name, range(3), 4)


@pytest.mark.parametrize('name, count', [
    ('hanging', 20), ('random', 1000), ('near_goal', 100), ('model', 9 * 21),
    ('velocity_noise', 210), ('force_noise', 210), ('response', 21), ('delay', 21),
    ('pushes', 50), ('loss', 2 * 21 * 5), ('jitter', 21 * 5)])
def test_defaults_are_those_of_the_leaderboards(name, count):
    assert len(cases(name)) == count


def test_six_criteria_make_the_robustness():
    assert CRITERIA == ['model', 'velocity_noise', 'force_noise', 'response', 'delay', 'pushes']


@pytest.mark.parametrize('links, count', [(1, 2), (2, 12), (3, 56)])
def test_there_is_a_way_from_each_equilibrium_to_each_other(links, count):
    found = cases('transitions', range(2), links=links)
    assert len(found) == 2 * count
    for case in found:
        start, goal = case.parameter.split(' to ')
        assert goal == case.mpc['goal'] != start
        off = case.plant['initial_state'] - equilibria(links)[start]
        assert 0 < np.abs(off).max() < 5e-3


def starts(name, seeds, links=2):
    return np.array([case.plant['initial_state'] for case in cases(name, seeds, links=links)])


@pytest.mark.parametrize('links', LINKS)
@pytest.mark.parametrize('name', sorted(
    set(SCENARIOS) - {'random', 'near_goal', 'transitions'}))
def test_what_gives_no_start_starts_nearly_hanging_with_each_seed_elsewhere(name, links):
    found = cases(name, range(3), 2, links=links)
    off = np.array([case.plant['initial_state'] for case in found]) - hanging(links)
    assert np.abs(off).max() < 5e-3
    assert len({tuple(each) for each in off.tolist()}) == 3


@pytest.mark.parametrize('solver', ['ilqr', 'ddp'])
def test_no_two_seeds_from_hanging_are_one_run(solver):
    runs = [play(parse(solver), case) for case in cases('hanging', range(4), duration=1.0)]
    assert len({run.metrics.closed_loop_cost for run in runs}) == 4


@pytest.mark.parametrize('links', LINKS)
def test_random_starts_fill_their_box(links):
    largest = np.abs(starts('random', range(500), links)).max(axis=0)
    box = np.array([1.0, *[np.pi] * links, 1.0, *[3.0] * links])
    assert np.all(largest <= box)
    assert np.all(largest > 0.97 * box)


@pytest.mark.parametrize('links', LINKS)
def test_starts_near_the_goal_are_at_rest_in_the_middle(links):
    X = starts('near_goal', range(200), links)
    np.testing.assert_array_equal(np.delete(X, angles(X), axis=1), 0.0)
    assert 0.29 < np.abs(X[:, angles(X)]).max() <= 0.3


def test_a_start_is_not_made_of_the_numbers_of_the_first_plan():
    # both are drawn from the seed, and must have nothing to do with each other
    first = controllers.controller({'seed': 3}).planner.random.uniform(-1, 1, 2)
    start = starts('near_goal', range(3, 4))[0, 1:3] / 0.3
    assert not np.allclose(first, start)


def swept(name, parameter, levels):
    return [(case.level, without_start(case)) for case in cases(name, range(1), levels)
            if case.parameter == parameter]


def without_start(case):
    return {name: value for name, value in case.plant.items() if name != 'initial_state'}


@pytest.mark.parametrize('name, parameter, expected', [
    ('model', 'link1_mass', [(0.75, {'link1_mass': 0.375}), (1.25, {'link1_mass': 0.625})]),
    ('model', 'joint2_friction', [(0.0, {'joint2_friction': 0.0}),
                                  (0.1, {'joint2_friction': 0.1})]),
    ('response', 'actuator_response', [(0.1, {'actuator_response': 0.1}),
                                       (2.0, {'actuator_response': 2.0})]),
    ('delay', 'delay', [(0.0, {'delay': 0.0}), (0.15, {'delay': 0.15})])])
def test_a_sweep_goes_from_end_to_end(name, parameter, expected):
    assert swept(name, parameter, 2) == expected


def test_force_noise_goes_to_18_percent_of_the_limit():
    assert swept('force_noise', 'force_noise', 3)[-1][0] == pytest.approx(3.6)


def test_the_middle_of_the_model_sweep_is_the_nominal_plant():
    nominal = plants.plant({}).physical
    for case in cases('model', range(1), 3):
        if case.level == 1.0:
            assert plants.plant(case.plant).physical == nominal


def test_pushes_are_strong_and_apart():
    for seed in range(20):
        forces = push_profile(seed, 200)
        t = 0.05 * (np.arange(200) + 0.5)
        pushed = np.abs(forces) > 0.05
        assert np.abs(forces).max() <= 10.0
        assert t[pushed].min() >= FIRST_PUSH - 0.4
        assert t[pushed].max() <= LAST_PUSH + 0.4
        # a pulse is over well before the next comes
        middles = t[np.flatnonzero(np.diff(np.sign(np.diff(np.abs(forces)))) < 0) + 1]
        strong = middles[np.abs(np.interp(middles, t, forces)) > 0.5]
        assert np.all(np.diff(strong) >= APART - 0.1)


def test_every_profile_is_a_level():
    found = cases('pushes', range(3))
    assert [(case.parameter, case.level) for case in found] == [
        ('profile', 0.0), ('profile', 1.0), ('profile', 2.0)]
    assert found[0].pushes != found[1].pushes


def test_strong_pushes_are_the_same_profiles_but_stronger():
    weak, strong = cases('strong_pushes', range(3, 4), 2)
    assert (weak.level, strong.level) == (10.0, 40.0)
    np.testing.assert_allclose(weak.pushes, push_profile(3, 200))
    np.testing.assert_allclose(strong.pushes, 4 * np.array(weak.pushes))
    assert not without_start(weak)


def test_a_tight_track_is_known_to_plant_and_controller():
    weakest, *_ = cases('tight', range(1))
    assert weakest.told == {'force_limit': 6.0, 'track_limit': 1.5}
    assert not without_start(weakest)


def test_all_at_once_grows_with_its_level():
    half, twice = cases('all_at_once', range(7, 8), 2)
    plants.plant(twice.plant)
    assert twice.plant['engine'] == half.plant['engine'] == 'own'
    assert (half.plant['encoder_counts'], twice.plant['encoder_counts']) == (8192, 2048)
    for name, nominal in (('actuation_delay', 0.0), ('force_gain', 1.0), ('link1_mass', 0.5),
                          ('force_bias', 0.0), ('joint1_dry_friction', 0.0)):
        assert twice.plant[name] - nominal == pytest.approx(4 * (half.plant[name] - nominal))


def test_resets_come_at_random_times_a_second_apart_at_least():
    for case in cases('uptime', range(5)):
        periods = [n for n, _ in case.resets]
        assert case.duration == 60.0
        assert len(periods) == 15
        assert min(np.diff([0, *periods, 1200])) >= 19
        assert len({len(x) for _, x in case.resets}) == 1
    one, other = cases('uptime', range(2))
    assert one.resets != other.resets
    assert not cases('uptime', range(1), duration=0.1)[0].resets


RIGS = [name for name in SCENARIOS if name.startswith('rig_')]
NOMINAL = vars(PendulumParameters()) | vars(DriveParameters()) | vars(PlantParameters())
RANGES = {
    'rig_delay': {'actuation_delay': (0.0, 0.05)}, 'rig_gain': {'force_gain': (0.7, 1.3)},
    'rig_all': {
        'actuation_delay': (0.0, 0.03), 'motor_time_constant': (0.0, 0.025),
        'cart_dry_friction': (0.0, 3.0), 'joint1_dry_friction': (0.0, 0.03),
        'joint2_dry_friction': (0.0, 0.03), 'force_gain': (0.85, 1.15), 'force_bias': (-2.0, 2.0),
        'cart_mass': (0.85, 1.15), 'link1_mass': (0.425, 0.575), 'link2_mass': (0.425, 0.575),
        'link1_length': (0.85, 1.15), 'link2_length': (0.85, 1.15)}}
RANGES['rig_all_fast'] = RANGES['rig_all']


@pytest.mark.parametrize('name', RIGS)
def test_a_rig_is_of_other_make_and_nobody_is_told(name):
    for case in cases(name, range(3)):
        made = plants.plant(case.plant)
        assert made.parameters.engine == 'mujoco'
        start = np.array(case.plant['initial_state']) - hanging()
        assert 0 < np.abs(start).max() < 5e-3
        wrong = {name for name, value in case.plant.items() if value != NOMINAL[name]}
        assert wrong - {'engine', 'initial_state'} or name == 'rig_clean'
        # what the contestants solve for is what they are told: nothing
        assert controllers.controller({}).nominal.physical == PendulumParameters()


@pytest.mark.parametrize('links', LINKS)
@pytest.mark.parametrize('name', RIGS)
def test_a_rig_is_the_same_for_every_contestant_and_another_for_other_seeds(name, links):
    first, again = (cases(name, range(4), links=links) for _ in range(2))
    assert first == again
    for level in {case.level for case in first}:
        plants = [case.plant for case in first if case.level == level]
        assert len({str(each) for each in plants}) == 4
        assert len({each['initial_state'] for each in plants}) == 4


@pytest.mark.parametrize('name', sorted(RANGES))
def test_a_rig_s_ranges_are_kept_and_filled(name):
    plants = [case.plant for case in cases(name, range(300))]
    for parameter, (low, high) in RANGES[name].items():
        values = np.array([each[parameter] for each in plants])
        assert low <= values.min() < low + 0.03 * (high - low), parameter
        assert high - 0.03 * (high - low) < values.max() <= high, parameter
    # one number tells nothing of another
    values = np.array([[each[parameter] for parameter in RANGES[name]] for each in plants])
    correlations = np.atleast_2d(np.corrcoef(values.T)) - np.eye(values.shape[1])
    assert np.abs(correlations).max() < 0.25


@pytest.mark.parametrize('name, expected', [
    ('rig_lag', {'motor_time_constant': (0.025, 0.05)}),
    ('rig_cart', {'cart_dry_friction': (2.0, 4.0)}),
    ('rig_joints', {'joint1_dry_friction': (0.025, 0.05), 'joint2_dry_friction': (0.025, 0.05)}),
    ('rig_noise', {'position_noise': (0.0025, 0.005)}), ('rig_bias', {'force_bias': (2.5, 5.0)}),
    ('rig_backlash', {'joint_backlash': (math.radians(0.5), math.radians(1.0))})])
def test_a_rig_s_sweep_has_the_half_and_the_whole(name, expected):
    found = cases(name, range(2))
    assert len(found) == 4
    for parameter, levels in expected.items():
        assert [case.plant[parameter] for case in found] == pytest.approx(
            [levels[0]] * 2 + [levels[1]] * 2)
    assert sorted({case.level for case in found}) == pytest.approx(next(iter(expected.values())))


@pytest.mark.parametrize('links', LINKS)
def test_the_joints_of_a_rig_are_all_its_joints(links):
    joints = {f'joint{i}_dry_friction' for i in range(1, links + 1)}
    for name in ('rig_joints', 'rig_all'):
        for case in cases(name, range(2), links=links):
            assert {each for each in case.plant if each.startswith('joint')} == joints
            assert min(case.plant[each] for each in joints) > 0


@pytest.mark.parametrize('name', RIGS)
def test_what_a_rig_s_sensors_are(name):
    plant = plants.plant(cases(name, range(1))[0].plant).parameters
    counts = {'rig_encoders': 2048, 'rig_backlash': 4096, 'rig_all': 4096,
              'rig_all_fast': 4096}.get(name, 0)
    assert (plant.encoder_counts, plant.velocities) == (counts, 'none' if counts else 'exact')
    assert plant.rate == (100.0 if name == 'rig_all_fast' else 20.0)


@pytest.mark.parametrize('solver', sorted(SOLVERS))
@pytest.mark.parametrize('name, seed, furthest', [
    ('rig_all', 2, 0.025), ('rig_delay', 0, 0.02), ('rig_bias', 0, 0.02)])
def test_a_rig_is_swung_up_and_held(name, seed, furthest, solver):
    """A quick version of a campaign: one rig, its worst level; that of seed 2 slides easily."""
    case = cases(name, range(seed, seed + 1))[-1]
    c = controllers.controller({'solver': solver, 'seed': case.seed})
    episode = simulate(plants.plant({**case.plant, 'seed': case.seed}), c, 10.5)
    held = episode.t >= 8.5
    assert np.abs(episode.X[held, 0]).max() < furthest
    assert all(is_upright(x) for x in episode.X[held])


def test_for_the_default_bodies_a_case_is_what_it_is():
    for case in (case for name in SCENARIOS for case in cases(name, range(1), 2)):
        assert sized(case, PHYSICAL, PERIOD) is case


def test_a_case_of_other_bodies_is_the_same_in_their_own_units():
    """Links of a quarter of the length, masses of a tenth: half the time, a tenth of the force."""
    small = PendulumParameters(cart_mass=0.1, link1_mass=0.05, link2_mass=0.05,
                               link1_length=0.25, link2_length=0.25)
    case, = cases('rig_all', range(1))
    found = sized(case, small, 0.01)
    assert found.duration == 5.0
    for name, factor in (('cart_mass', 0.1), ('link1_length', 0.25), ('actuation_delay', 0.5),
                         ('cart_dry_friction', 0.1), ('joint1_dry_friction', 0.025),
                         ('force_bias', 0.1), ('force_gain', 1.0), ('encoder_counts', 1)):
        assert found.plant[name] == pytest.approx(factor * case.plant[name], rel=1e-5), name
    np.testing.assert_allclose(found.plant['initial_state'], np.array(
        case.plant['initial_state']) * [0.25, 1, 1, 0.5, 2, 2], rtol=1e-5)
    assert found.plant['velocities'] == case.plant['velocities']
    pushes = cases('pushes', range(1))[0].pushes
    shorter = sized(cases('pushes', range(1))[0], small, 0.0125).pushes   # two periods are one
    assert len(shorter) == 2 * len(pushes)
    assert sum(shorter) / 2 == pytest.approx(0.1 * sum(pushes), rel=1e-2)
    (n, x), *_ = cases('uptime', range(1))[0].resets
    (m, y), *_ = sized(cases('uptime', range(1))[0], small, 0.0125).resets
    assert m == 2 * n and y[0] == pytest.approx(0.25 * x[0], rel=1e-5)


@pytest.mark.parametrize('rate', [20.0, 100.0])
def test_a_rate_of_the_contestant_s_own_meets_the_same_pushes(rate):
    case, = cases('pushes', range(1), duration=8.0)
    contestant = replace(parse('ilqr'), plant={'rate': rate})
    assert play(contestant, case).metrics.success

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import dataclasses
from dataclasses import replace
from functools import cache
import re

import numpy as np
import plausible_rig
import pytest
from scipy.stats import t

from dp_swing_ros.errors import UserError
from dp_swing_ros.identification.base_parameters import (
    base_parameters, base_parameters_of_links)
from dp_swing_ros.identification.fit import CREEPS, FINE, Fit
from dp_swing_ros.identification.guess import guessed, resized
from dp_swing_ros.identification.identify import identify
from dp_swing_ros.identification.recorded import Recorded
from dp_swing_ros.identification.segments import Motion, resolution, segments_of
from dp_swing_ros.identification.unknowns import OF_CART, Parametrisation
from dp_swing_ros.parameters import fields_of, group, ParameterError
from dp_swing_ros.pendulum.drive import follow_commands, HISTORY
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model
from dp_swing_ros.pendulum.parameters import DIRECT, Drive, PendulumParameters
from dp_swing_ros.pendulum.sensors import default_sensors, SensorParameters
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.pendulum.units import POSITIONS, SAME, Units
from dp_swing_ros.tools.identify import parameter_file, report, table

PERIOD = 0.05  # [s]
DRIVE = Drive(0.012, 0.02, 1.0, 0.3)
BALANCE = np.array([0.0, 0.03, -0.05, 0.02])   # [m, rad] of cart and links, as they are measured


def rig(links, **others):
    """Return a pendulum that differs from the nominal one in everything that motion tells."""
    values = {'cart_mass': 1.15, 'cart_friction': 0.1, 'cart_dry_friction': 0.6}
    for i in range(1, links + 1):
        values |= {f'link{i}_mass': 0.4 + 0.1 * i, f'link{i}_length': 0.9 + 0.1 * i,
                   f'joint{i}_friction': 0.01, f'joint{i}_dry_friction': 0.02}
    return PendulumParameters(links=links, **{**values, **others})


def of_size(physical, scale):
    """Return a pendulum so many times larger, and a drive that is as late in its own time."""
    values = {field.name: scale.sized(getattr(physical, field.name), field.metadata['unit'])
              for field in fields_of(PendulumParameters, physical.links) if field.name != 'links'}
    drive = map(scale.sized, DRIVE, ('s', 's', '1', 'N'))
    return dataclasses.replace(physical, **values), Drive(*drive)


def swung(physical, seed=0, duration=10.0, noise=0.0, drive=DRIVE, amplitude=12.0,
          period=PERIOD, scale=SAME, creep=FINE.creep):
    """Return a motion under random commands, which a spring keeps from the ends of the track."""
    random = np.random.default_rng(seed)
    model = Model(Pendulum.of(physical, creep), INTEGRATORS['rk4'], scale.sized(FINE.step, 's'))
    amplitude, spring, damping = (scale.sized(value, unit) for value, unit in (
        (amplitude, 'N'), (6.0, 'N/m'), (2.0, 'N s/m')))
    x = hanging(physical.links)
    x[1:physical.links + 1] += random.uniform(-1.0, 1.0, physical.links)
    t, X, commands = period * np.arange(round(duration / period)), [], []
    for now in t:
        X.append(x.copy())
        commands.append(random.uniform(-amplitude, amplitude) - spring * x[0]
                        - damping * x[len(x) // 2])
        last = max(len(commands) - 1 - round(HISTORY / period), 0)
        ends = np.append(t[last + 1:len(commands)] - now, np.inf)
        sent = np.array([0.0, *commands[last:]]) if last == 0 else np.array(commands[last:])
        follow_commands(model, drive, np.append(t[last] - now, ends) if last == 0 else ends, sent,
                        x, period)
    Q = np.hsplit(np.array(X), 2)[0]
    deviations = scale.each_joint(noise, POSITIONS, physical.links)
    return Motion(t, Q + deviations * random.normal(size=Q.shape), t, np.array(commands),
                  np.array([]), scale.sized(2.4, 'm'))


def true(physical, drive, name):
    """Return the value of a parameter of pendulum or drive."""
    of_drive = dict(zip(('actuation_delay', 'motor_time_constant', 'force_gain', 'force_bias'),
                        drive))
    if name.endswith('_balance'):
        return 0.0
    return of_drive.get(name, getattr(physical, name, None))


@pytest.fixture(scope='module')
def exact():
    """Return a function from numbers of links to what is found of a motion without noise."""
    @cache
    def found(links):
        # of three, half the time tells as much
        motion = swung(rig(links), duration=5.0 if links == 3 else 10.0, creep=CREEPS[-links])
        return identify([motion._replace(Q=motion.Q + BALANCE[:links + 1])],
                        PendulumParameters(links=links))
    return found


def springs(links):
    return {f'joint{i}_{each}' for i in range(1, links + 1) for each in ('stiffness', 'preload')}


@pytest.mark.parametrize('links', [1, 2, 3])
def test_what_moved_it_is_found_exactly(links, exact):
    physical, found = rig(links), exact(links)
    assert not (found.unidentified or found.at_bound) and found.creep == CREEPS[-links]
    assert {'force_gain', 'gravity', f'link{links}_inertia_factor', *springs(links)} == set(
        found.held)
    for name in found.intervals:
        value = BALANCE[int(name[4])] if name.endswith('_balance') else true(
            physical, DRIVE, name)
        assert found.values[name] == pytest.approx(value, rel=2e-3, abs=2e-4), name
    assert np.all(found.rms('after') < 1e-4)
    assert np.all(found.rms('before') > 20 * found.rms('after'))


def test_bodies_of_which_nothing_is_known_are_told_by_what_they_share():
    """Another inertia of the last link, and forces in another unit: other masses move alike."""
    physical = rig(2, link2_inertia_factor=1.3)
    found = identify([swung(physical, noise=1e-4, drive=DRIVE._replace(gain=0.8))],
                     PendulumParameters())
    assert abs(found.values['link2_length'] / physical.link2_length - 1) > 0.02
    for name, (value, unit) in base_parameters(physical, 0.8).items():
        assert found.base[name].value == pytest.approx(value, rel=0.01), name
        assert found.base[name].unit == unit


def test_an_inertia_that_is_told_stays_so():
    """Its field of a factor says nothing then, and the search begins with what it says itself."""
    told = PendulumParameters(link2_inertia=0.09)
    factor = told.inertia_factors[1]
    assert factor > 2.0
    found = Parametrisation(told, DIRECT, {}, resized(told, 1, -1, {}))
    i = found.names.index('link2_inertia_factor')
    assert found.nominal[i] == pytest.approx(factor) and found.first[i] == pytest.approx(
        np.log(resized(told, 1, -1, {}).inertia_factors[1] / factor))
    known = Parametrisation(told, DIRECT, {'link2_inertia_factor': 1.5}, told)
    assert known.nominal[i] == 1.5 and known.first[i] == 0.0


def test_what_is_known_finds_the_rest():
    physical = rig(2, link1_inertia_factor=0.8, link2_inertia_factor=1.3)
    drive = DRIVE._replace(gain=0.8)
    known = {'cart_mass': physical.cart_mass, 'link2_length': physical.link2_length}
    found = identify([swung(physical, drive=drive)], PendulumParameters(), known=known)
    for name in ('force_gain', 'link1_inertia_factor', 'link2_inertia_factor', 'link1_mass'):
        assert found.values[name] == pytest.approx(true(physical, drive, name), rel=3e-3), name
    assert all(found.values[name] == value for name, value in known.items())


@pytest.mark.parametrize('links', [1, 3])
def test_where_the_motion_of_the_cart_is_given_no_force_is_needed(links):
    """
    Nobody knows what moved it, nor what it weighs.

    Its forces jump from sample to sample, which no path through its positions does: that costs
    the frictions a tenth.
    """
    physical = rig(links, cart_mass=0.4)
    motion = swung(physical, duration=5.0, period=0.01)._replace(
        sent=np.zeros(0), commands=np.zeros(0))
    found = identify([motion], PendulumParameters(links=links), cart='given',
                     known={'link1_mass': physical.link1_mass})
    assert set(found.held) == {'gravity', 'link1_mass', f'link{links}_inertia_factor',
                               *springs(links)}
    assert not set(found.values) & set(OF_CART)
    for name in found.intervals:
        assert found.values[name] == pytest.approx(
            true(physical, DRIVE, name), rel=5e-3,
            abs=3e-3 if name.endswith(('friction', 'balance')) else 0.0), name
    assert np.all(found.rms('after')[1:] < 1e-3)


def test_a_clamped_cart_tells_the_links_from_positions_alone():
    physical = rig(2)
    motion = swung(replace(physical, cart_mass=1e6), period=0.01, noise=5e-5)
    clamped = motion._replace(Q=motion.Q * [0.0, 1.0, 1.0], sent=np.zeros(0),
                              commands=np.zeros(0), track_limit=0.0)
    found = identify([clamped], PendulumParameters(), cart='given')
    assert found.held['link1_mass'].startswith('motion tells masses and frictions beside')
    share = physical.link1_mass / found.values['link1_mass']   # of all masses and frictions
    for name, (low, high) in found.intervals.items():
        times = share if name.endswith(('mass', 'friction')) else 1.0
        assert times * found.values[name] == pytest.approx(
            true(physical, DRIVE, name), rel=0.03,
            abs=1e-3 if name.endswith(('friction', 'balance')) else 0.0), name
        assert high - low < (0.6 if name.endswith('friction') else 0.2) * max(high, 0.01), name
    for name, (value, _) in base_parameters_of_links(physical).items():
        assert found.base[name].value == pytest.approx(
            value, rel=0.01, abs=1e-3 if 'friction' in name else 0.0), name


def test_two_motions_tell_more_than_one():
    motions = [swung(rig(2), seed, duration=6.0, noise=1e-3) for seed in (1, 2)]
    one, two = (identify(motions[:count], PendulumParameters()) for count in (1, 2))
    assert len(two.predictions) == 2
    widths = [[np.diff(each.intervals[name]) for name in one.intervals] for each in (one, two)]
    assert np.median(np.divide(*widths)) > 1.1


def test_intervals_cover_the_truth_as_often_as_they_say():
    physical, names = rig(2), ('cart_mass', 'link1_mass', 'link2_length', 'cart_dry_friction',
                               'joint1_friction', 'actuation_delay', 'force_bias')
    covered = []
    for seed in range(5):
        found = identify([swung(physical, seed, duration=4.0, noise=5e-4)], PendulumParameters())
        covered += [found.intervals[name][0] <= true(physical, DRIVE, name)
                    <= found.intervals[name][1] for name in names if name in found.intervals]
        covered += [found.base[name].low <= value <= found.base[name].high
                    for name, (value, _) in base_parameters(physical).items()]
    assert len(covered) > 60
    assert np.mean(covered) > 0.88


def test_the_plausible_rig_is_found_within_the_figures():
    found = identify([plausible_rig.record()], PendulumParameters())
    for name in found.intervals:
        value = plausible_rig.truth()[name]
        if not name.startswith('joint'):   # of which the median over seeds is within
            assert abs(found.values[name] - value) <= plausible_rig.allowed(name, value), name


def recorded(motion):
    return Recorded(motion, motion.Q, 'by one clock', rig(2), DRIVE, (rig(2), DRIVE))


def test_a_motion_is_explained_to_within_its_encoders_or_something_else_moves():
    steps = np.array([2.5e-4, *[2 * np.pi / 4096] * 2])
    physical = rig(2)
    motion = swung(physical, duration=5.0)
    motion = motion._replace(Q=steps * np.rint(motion.Q / steps))
    assert [resolution(q) for q in motion.Q.T] == pytest.approx(steps)
    found = identify([motion], PendulumParameters())
    assert ('explains the motion to within the encoders, whose steps are: cart 0.25 mm, joint1 '
            '1.53 mrad, joint2 1.53 mrad') in report(found, [recorded(motion)])
    # with the rest known, nothing is sought for long that could make up for a wrong length
    known = {name: getattr(physical, name) for name in (
        'cart_mass', 'cart_friction', 'link1_mass', 'link1_length', 'link2_mass',
        'joint1_friction', 'joint2_friction')}
    found = identify([motion], PendulumParameters(), known={**known, 'link2_length': 0.7})
    assert re.search(r'something else moves here.*joint2 is off by [\d.]+ times',
                     report(found, [recorded(motion)]))


def test_positions_on_no_grid_have_no_resolution(rng):
    assert np.isnan(resolution(rng.normal(size=1000)))
    assert np.isnan(resolution(np.zeros(1000)))


@pytest.mark.parametrize('relative', [False, True])
def test_angles_at_which_links_stand_balanced_are_zeros_of_the_sensors(relative, exact):
    """To the sensors that the file tells, the motion is one whose links balance upright."""
    found = exact(2)
    told = group(SensorParameters, default_sensors(2) | {
        'relative_angles': relative, 'joint_signs': (1.0, -1.0, 1.0),
        'joint_offsets': (0.1, 3.0, -1000.0)})
    file = parameter_file(found, told, [], {})
    offsets = tuple(map(float, re.search(r'joint_offsets: \[(.*)\]', file).group(1).split(', ')))
    measured = np.array([0.3, 1.0, 2.0, 0.0, 0.0, 0.0])
    seen, as_found = (sensors.state_of(measured)
                      for sensors in (told, replace(told, joint_offsets=offsets)))
    assert (seen - as_found)[:3] == pytest.approx(BALANCE[:3], abs=2e-4)
    assert 'joint_offsets' not in parameter_file(
        found, replace(told, zero='hanging'), [], {})


def test_an_angle_of_balance_at_either_bound_is_told():
    about = Parametrisation(PendulumParameters(), DIRECT, {}, PendulumParameters())
    i, none = about.names.index('link1_balance'), np.zeros(len(about.names))
    for bound in (about.lowest[i], about.highest[i]):
        p = about.first.copy()
        p[i] = bound
        assert [name for name, met in zip(about.names, about.at_bounds(p, none)) if met] == [
            'link1_balance']


def test_what_motions_do_not_tell_stays_nominal():
    physical = rig(2, cart_friction=0.0)
    motion = swung(physical, duration=2.0, noise=5e-3, amplitude=3.0)
    found = identify([motion], PendulumParameters())
    assert found.unidentified
    for name in found.unidentified:
        assert found.values[name] == pytest.approx(found.before[name])
        assert name not in found.intervals


def test_a_push_that_nobody_knows_of_is_left_out():
    motion = swung(rig(2), duration=5.0)
    Q = motion.Q.copy()
    Q[45:50] += np.linspace(0.0, 0.5, 5)[:, None]
    found = identify([motion._replace(Q=Q)], PendulumParameters())
    assert found.left_out == 1
    assert found.values['link1_mass'] == pytest.approx(0.5, rel=5e-3)


def test_a_motion_of_which_nothing_fits_the_others_is_refused():
    other = swung(rig(2), seed=1, duration=2.0)
    with pytest.raises(UserError, match='motion 2 of 2 fits no parameters'):
        identify([swung(rig(2)), other._replace(Q=np.cumsum(other.Q, axis=0))],
                 PendulumParameters())


def changed(**fields):
    """Return what changes a motion."""
    return lambda motion: motion._replace(**{
        name: change(getattr(motion, name)) for name, change in fields.items()})


def size(length, mass):
    """Return how many times larger is what has so many times the lengths and masses."""
    return Units(length, length ** 0.5, mass, mass)


@pytest.mark.parametrize('links', [1, 2])
def test_a_rig_of_15_cm_is_found_from_the_defaults(links):
    scale = size(0.15, 0.2)
    physical, drive = of_size(rig(links), scale)
    motion = swung(physical, duration=5.0, noise=4e-4, drive=drive, period=0.02, scale=scale)
    found = identify([motion], PendulumParameters(links=links),
                     known={'cart_mass': physical.cart_mass})
    assert not found.at_bound and not found.left_out
    covered = [low <= true(physical, drive, name) <= high
               for name, (low, high) in found.intervals.items()]
    assert len(covered) > 3 * links + 4 and np.mean(covered) > 0.88
    for i in range(1, links + 1):
        for name in (f'link{i}_mass', f'link{i}_length'):
            assert found.values[name] == pytest.approx(getattr(physical, name), rel=0.02), name


@pytest.mark.parametrize('length, mass', [(0.1, 0.05), (0.3, 1.0), (3.0, 10.0)])
def test_a_guess_is_about_as_large_as_what_moved(length, mass):
    scale = size(length, mass)
    physical, drive = of_size(rig(2), scale)
    motion = swung(physical, noise=1e-3, drive=drive, period=0.05 * scale.time, scale=scale)
    found = guessed([motion], PendulumParameters(), DIRECT, {}, lambda: None)
    assert 0.5 < found.link1_length / physical.link1_length < 2
    assert 0.25 < found.cart_mass / physical.cart_mass < 4


def test_what_is_about_as_large_as_nominal_bodies_is_guessed_to_be_like_them():
    nominal = PendulumParameters(joint1_friction=0.1)
    assert guessed([swung(rig(2))], nominal, DIRECT, {}, lambda: None) == nominal
    found = guessed([swung(rig(2))], nominal, DIRECT, {'link1_mass': 0.6}, lambda: None)
    assert found == dataclasses.replace(nominal, link1_mass=0.6)


def test_what_meets_a_bound_is_no_estimate():
    physical = rig(1)
    motion = swung(physical, duration=5.0)
    found = identify([motion], PendulumParameters(links=1),
                     known={'cart_mass': 40 * physical.cart_mass})   # so the gain is 40
    assert found.at_bound == ['force_gain']
    assert found.values['force_gain'] == pytest.approx(30, rel=0.1)
    assert 'force_gain' not in found.intervals
    shown, file = table(found), parameter_file(
        found, group(SensorParameters, default_sensors(1)), [], {})
    assert re.search(r'force_gain *\| +[\d.]+ \| +at the bound of the search \|', shown)
    assert re.search(r'force_gain: [\d.]+  # at the bound of the search', file)
    assert 'force_gain: at the bound of the search' in report(found, [recorded(motion)])


def test_a_bound_beyond_which_nothing_changes_is_told_as_one():
    """Rods that move as these links have no inertia; near none, its logarithm does nothing."""
    physical = rig(2, link1_mass=0.1, link1_length=1.0, link1_centre=0.4, link1_inertia_factor=0.8,
                   link2_mass=0.16, link2_length=1.8, link2_centre=1.03, link2_inertia_factor=0.84)
    found = identify([swung(physical, duration=5.0, noise=5e-4)], PendulumParameters(),
                     known={'cart_mass': physical.cart_mass})
    assert 'link1_inertia_factor' in found.at_bound
    assert 'link1_inertia_factor' not in {**found.unidentified, **found.intervals}


@cache
def two_links_that_swing():
    """Return a fit of a motion of two links, some of it odd, and what is found without each."""
    physical = rig(2, cart_dry_friction=0.0, joint1_dry_friction=0.0, joint2_dry_friction=0.0)
    about = Parametrisation(physical, DRIVE, {}, physical)
    motion = swung(physical, duration=5.0, noise=1e-3)
    motion.Q[20:24] += 4e-3   # beyond what the loss takes for a square
    segments = segments_of(motion, about.scale)

    def solved(which, whitening=None):
        fit = Fit([segments.chosen(which)], about)
        fit.use(FINE)
        fit.free = np.array([about.names.index(name) for name in (
            'link1_mass', 'link1_length', 'link2_mass', 'actuation_delay')])
        fit.restart()
        if whitening is None:
            fit.whiten()
        else:
            fit.whitening = whitening
        fit.solve()
        return fit
    whole = np.arange(len(segments.t))
    fit = solved(whole)
    return fit, np.array([solved(np.delete(whole, s), fit.whitening).p - fit.p for s in whole])


def test_intervals_are_by_how_far_all_moves_without_a_segment():
    fit, moved = two_links_that_swing()
    S, moved = len(moved), moved[:, fit.free]
    covariance = fit.covariance()
    expected = (S - 1) / S * moved.T @ moved
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), np.sqrt(np.diag(expected)), rtol=0.03)
    assert fit.halves(covariance) == pytest.approx(
        t.ppf(0.975, S - 1) * np.sqrt(np.diag(covariance)))


def test_one_segment_tells_what_its_residuals_do():
    fit, _ = two_links_that_swing()
    one = Fit([fit.motions[0].chosen(np.arange(1))], fit.about)
    one.use(FINE)
    one.whitening, one.free = fit.whitening, fit.free[:1]
    one.take(fit.p[fit.free[:1]])
    H, _ = one.normal_equations()
    variance = fit.about.scales[fit.free[0]] ** 2 / H[0, 0]
    assert one.covariance() == pytest.approx(variance)
    assert one.halves(one.covariance()) == pytest.approx(1.959964 * np.sqrt(variance))


def test_what_makes_up_for_what_is_not_told_is_as_uncertain():
    """A lag makes up for a delay: where that is held, a scale off, all else is off by as much."""
    physical, off = rig(1, cart_dry_friction=0.0, joint1_dry_friction=0.0), 5e-4
    about = Parametrisation(physical, DRIVE, {}, physical)
    fit = Fit([segments_of(swung(physical), about.scale)], about)
    fit.use(FINE)
    held = about.names.index('actuation_delay')
    fit.free = np.array([i for i, name in enumerate(about.names)
                         if name not in about.held and 'dry' not in name and i != held])
    fit.restart()
    alone, p = fit.covariance(), fit.p.copy()
    fit.p[held] += off
    fit.solve()
    expected = np.abs(fit.p - p)[fit.free] * about.scales[held] / off
    fit.p = p.copy()
    fit.take(p[fit.free])
    fit.untold = np.array([held])
    wider = np.sqrt(np.diag(fit.covariance())[:-1] - np.diag(alone))
    np.testing.assert_allclose(wider / about.scales[fit.free],
                               expected / about.scales[fit.free], atol=0.02)
    lag = about.names.index('motor_time_constant')
    assert expected[fit.free == lag] > 0.5 * about.scales[held]


@pytest.mark.parametrize('change, text', [
    (changed(Q=lambda Q: 0.01 * Q), 'moves too little'),
    (changed(Q=lambda Q: np.where(Q == Q, np.nan, Q)), 'nothing can be used'),
    (changed(Q=lambda Q: Q + [2.3, 0, 0], track_limit=lambda limit: 0.5), 'nothing can be used'),
    (changed(commands=lambda u: u[:3], sent=lambda t: t[:3]), 'nothing can be used'),
    (changed(t=lambda t: t[:5], Q=lambda Q: Q[:5]), 'nothing can be used')])
def test_motions_that_say_too_little_are_refused(change, text):
    with pytest.raises(UserError, match=text):
        identify([change(swung(rig(2), duration=2.0))], PendulumParameters())


def test_what_cannot_be_known_is_refused():
    with pytest.raises(ParameterError, match='link1_mass'):
        identify([swung(rig(2), duration=2.0)], PendulumParameters(), known={'link1_mas': 1.0})


def test_segments_are_whole_and_share_no_sample():
    motion = swung(rig(2), duration=4.0)
    segments = segments_of(motion._replace(pushes=np.array([2.0])), SAME)
    assert segments.t.shape == (7, 10)   # of eight, but for the one with the push
    assert len(set(segments.t.ravel())) == segments.t.size
    assert not np.any((segments.t[:, 0] < 2.2) & (segments.t[:, -1] > 2.0))


def test_results_are_frozen(exact):
    with pytest.raises(dataclasses.FrozenInstanceError):
        exact(1).values = {}

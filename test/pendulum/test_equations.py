# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The equations of motion against an outside engine, the paper, and the energy they must keep."""

import mujoco
import numpy as np
import pytest

from dp_swing_ros.pendulum.equations import (
    derivative, energy, friction, inverse_inertia, mass_matrix, Pendulum, solve)
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.integrators import INTEGRATORS, rk4
from dp_swing_ros.pendulum.model import Model, rollout
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import angles, LINKS, SIZES, upright

UNEVEN = {'cart_mass': 1.3, 'link1_mass': 0.4, 'link2_mass': 0.7, 'link3_mass': 0.3,
          'link1_length': 0.8, 'link2_length': 1.1, 'link3_length': 0.6,
          'link1_inertia_factor': 1.25, 'link2_inertia': 0.04, 'link3_inertia_factor': 0.9,
          'link1_centre': 0.5, 'link2_centre': 0.3, 'link3_centre': 0.7,
          'cart_friction': 0.3, 'joint1_friction': 0.1, 'joint2_friction': 0.05,
          'joint3_friction': 0.02}
SPRINGS = {'joint1_stiffness': 0.8, 'joint2_stiffness': 0.3, 'joint3_stiffness': 0.5,
           'joint1_preload': 2.0, 'joint2_preload': -0.4, 'joint3_preload': 0.1}

of_links = pytest.mark.parametrize('links', LINKS)


def mujoco_model(physical):
    """Build the same pendulum in MuJoCo, whose hinges measure θi - θi-1."""
    inside = ''
    for i in reversed(range(physical.links)):
        mass, length = physical.masses[i + 1], physical.lengths[i]
        centre, about_centre, factor = (getattr(physical, f'link{i + 1}_{name}') for name in (
            'centre', 'inertia', 'inertia_factor'))
        about_centre = about_centre or factor * mass * length ** 2 / 12
        stiffness, preload = physical.stiffnesses[i], physical.preloads[i]
        base = physical.lengths[i - 1] if i > 0 else 0
        inside = f"""
            <body pos="0 0 {base}">
              <joint type="hinge" axis="0 1 0" damping="{physical.frictions[i + 1]}"
                     frictionloss="{physical.dry_frictions[i + 1]}"
                     stiffness="{stiffness}" springref="{preload / (stiffness or 1.0)}"/>
              <inertial pos="0 0 {centre or length / 2}" mass="{mass}"
                        diaginertia="{about_centre} {about_centre} {about_centre}"/>{inside}
            </body>"""
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <compiler angle="radian"/>
          <option gravity="0 0 {-physical.gravity}"/>
          <worldbody><body>
            <joint type="slide" axis="1 0 0" damping="{physical.cart_friction}"
                   frictionloss="{physical.cart_dry_friction}"/>
            <inertial pos="0 0 0" mass="{physical.cart_mass}" diaginertia="1 1 1"/>{inside}
          </body></worldbody>
        </mujoco>""")


def to_relative(q):
    """Return the cart's coordinate, and each link's relative to the link before."""
    return [q[0], *np.diff(q[1:], prepend=0.0)]


def random_state(rng, links):
    return rng.normal(size=SIZES[links]) * (1, *[3] * links, 2, *[5] * links)


def mass_matrix_at(p, x):
    th = x[angles(x)]
    return np.array(mass_matrix(p, np.sin(th), np.cos(th)))


@pytest.mark.parametrize('values', [{}, UNEVEN, {**UNEVEN, **SPRINGS}],
                         ids=['default', 'uneven', 'springs'])
@of_links
def test_accelerations_agree_with_mujoco(links, values, rng):
    physical = PendulumParameters(links=links, **values)
    model, p = mujoco_model(physical), Pendulum.of(physical)
    data = mujoco.MjData(model)
    for _ in range(200):
        x, u = random_state(rng, links), rng.normal() * 20
        data.qpos[:], data.qvel[:] = map(to_relative, np.split(x, 2))
        data.qfrc_applied[0] = u
        mujoco.mj_forward(model, data)
        theirs = [data.qacc[0], *np.cumsum(data.qacc[1:])]
        ours = derivative(p, x, u)
        np.testing.assert_array_equal(ours[:links + 1], x[links + 1:])
        np.testing.assert_allclose(ours[links + 1:], theirs, rtol=1e-11,
                                   atol=1e-12 * np.abs(theirs).max())


DRY = {'cart_dry_friction': 2.0, 'joint1_dry_friction': 0.1, 'joint2_dry_friction': 0.05,
       'joint3_dry_friction': 0.03}


@of_links
def test_dry_friction_agrees_with_mujoco_where_all_move(links, rng):
    """Faster than the creep at each joint, it has all of its size, and so it has in MuJoCo."""
    physical = PendulumParameters(links=links, **UNEVEN, **DRY)
    model, p = mujoco_model(physical), Pendulum.of(physical)
    data, compared = mujoco.MjData(model), 0
    without = Pendulum.of(PendulumParameters(links=links, **UNEVEN))
    for _ in range(200):
        x, u = random_state(rng, links), rng.normal() * 20
        data.qpos[:], data.qvel[:] = map(to_relative, np.split(x, 2))
        data.qfrc_applied[0] = u
        mujoco.mj_forward(model, data)
        # its constraint is soft: less than all where it would bring a joint to rest right now
        acts = -np.sign(data.qvel) * physical.dry_frictions
        if np.any(np.abs(data.qvel) * p.sharpness < 1) or not np.allclose(
                data.qfrc_constraint, acts):
            continue
        theirs = [data.qacc[0], *np.cumsum(data.qacc[1:])]
        ours = derivative(p, x, u)[links + 1:]
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-6 * np.abs(theirs).max())
        assert np.abs(np.subtract(ours, derivative(without, x, u)[links + 1:])).max() > 0.1
        compared += 1
    assert compared > 50


@pytest.mark.parametrize('share, expected', [
    (-3.0, -1.0), (-1.0, -1.0), (0.0, 0.0), (0.5, 203 / 256), (1.0, 1.0), (50.0, 1.0)])
def test_dry_friction_grows_over_its_creep(share, expected):
    """s(y) = y (15 - 10 y² + 3 y⁴) / 8; at half the creep 203 / 256."""
    p = Pendulum.of(PendulumParameters(links=1, cart_dry_friction=4.0, joint1_dry_friction=0.5),
                    creep=0.05)
    assert friction(p, 0, share * 0.05) == pytest.approx(4.0 * expected, abs=1e-14)
    assert friction(p, 1, share * 0.05) == pytest.approx(0.5 * expected, abs=1e-14)


def test_a_cart_slides_to_rest_as_the_formula_says():
    """Viscous and dry: M v̇ = -c v - F, so v = (v_0 + F / c) exp(-c t / M) - F / c."""
    m, c, dry, v_0 = 10.0, 2.0, 8.0, 1.5
    physical = PendulumParameters(links=1, cart_mass=m, link1_mass=1e-3, cart_friction=c,
                                  cart_dry_friction=dry)
    x = np.array([0.0, np.pi, v_0, 0.0])
    X = rollout(Model(Pendulum.of(physical, creep=1e-3), INTEGRATORS['rk4'], 1e-4), x,
                np.zeros(20_000))
    t = 1e-4 * np.arange(20_001)
    v = (v_0 + dry / c) * np.exp(-c * t / m) - dry / c
    stands = -m / c * np.log(dry / c / (v_0 + dry / c))
    np.testing.assert_allclose(X[t < stands - 0.01, 2], v[t < stands - 0.01], atol=2e-3)
    assert np.abs(X[t > stands + 0.05, 2]).max() < 2e-3


@of_links
def test_mujoco_agrees_on_the_tips(links, rng):
    physical = PendulumParameters(links=links, **UNEVEN)
    model, x = mujoco_model(physical), rng.normal(size=SIZES[links])
    data = mujoco.MjData(model)
    data.qpos[:] = to_relative(x[:links + 1])
    mujoco.mj_forward(model, data)
    tips = joint_positions(x, physical.lengths)
    np.testing.assert_allclose(tips[:-1], data.xpos[2:][:, [0, 2]], atol=1e-12)
    tip = data.xpos[-1] + data.xmat[-1].reshape(3, 3) @ (0, 0, physical.lengths[-1])
    np.testing.assert_allclose(tips[-1], tip[[0, 2]], atol=1e-12)


def test_the_double_pendulum_s_accelerations_are_the_paper_s(rng):
    """(4)-(15), D, C, G and H as they stand there, with (14) corrected."""
    p = PendulumParameters(link1_mass=0.4, link2_mass=0.7, link1_length=0.8, link2_length=1.1)
    m_0, m_1, m_2 = p.masses
    (l_1, l_2), g = p.lengths, p.gravity
    d_1, d_2, d_3 = m_0 + m_1 + m_2, (m_1 / 2 + m_2) * l_1, m_2 * l_2 / 2
    d_4, d_5, d_6 = (m_1 / 3 + m_2) * l_1 ** 2, m_2 * l_1 * l_2 / 2, m_2 * l_2 ** 2 / 3
    for _ in range(20):
        x, u = random_state(rng, 2), rng.normal() * 20
        _, th_1, th_2, _, w_1, w_2 = x
        s_1, s_2, s_12 = np.sin([th_1, th_2, th_1 - th_2])
        c_1, c_2, c_12 = np.cos([th_1, th_2, th_1 - th_2])
        D = np.array([[d_1, d_2 * c_1, d_3 * c_2], [d_2 * c_1, d_4, d_5 * c_12],
                      [d_3 * c_2, d_5 * c_12, d_6]])
        C = np.array([[0, -d_2 * s_1 * w_1, -d_3 * s_2 * w_2], [0, 0, d_5 * s_12 * w_2],
                      [0, -d_5 * s_12 * w_1, 0]])
        G = np.array([0, -d_2 * g * s_1, -d_3 * g * s_2])
        expected = np.linalg.solve(D, np.array([u, 0, 0]) - C @ x[3:] - G)
        np.testing.assert_allclose(derivative(Pendulum.of(p), x, u)[3:], expected, rtol=1e-11)


def test_uniform_links_have_the_paper_s_coefficients_to_the_bit(rng):
    for m_1, m_2, l_1, l_2 in rng.uniform(0.1, 3, (100, 4)):
        p = Pendulum.of(PendulumParameters(link1_mass=m_1, link2_mass=m_2, link1_length=l_1,
                                           link2_length=l_2))
        assert (p.b[0][0], p.b[1][0]) == ((m_1 / 3 + m_2) * (l_1 * l_1), m_2 / 3 * (l_2 * l_2))


@of_links
def test_the_inertia_is_inverted(links, rng):
    p = Pendulum.of(PendulumParameters(links=links, **UNEVEN))
    for _ in range(20):
        D, r = mass_matrix_at(p, random_state(rng, links)), rng.normal(size=links + 1)
        np.testing.assert_allclose(solve(D.tolist(), r), np.linalg.solve(D, r), rtol=1e-9)
        np.testing.assert_allclose(inverse_inertia(D.tolist()), np.linalg.inv(D), rtol=1e-9)


def horizontal(links):
    x = upright(links)
    x[angles(x)] = np.pi / 2
    return x


def energies_of(p, h, steps):
    x = horizontal(len(p.a))
    X = rollout(Model(p, INTEGRATORS['rk4'], h), x, np.zeros(steps))
    return np.array([energy(p, x) for x in X])


@of_links
def test_an_unforced_pendulum_keeps_its_energy(links):
    for values in ({}, SPRINGS):
        energies = energies_of(Pendulum.of(PendulumParameters(links=links, **values)), 5e-4, 4000)
        assert np.abs(energies - energies[0]).max() < 1e-7


@of_links
def test_friction_takes_energy(links):
    energies = energies_of(Pendulum.of(PendulumParameters(links=links, **UNEVEN)), 1e-3, 5000)
    assert np.all(np.diff(energies) < 1e-9)
    assert energies[-1] < energies[0] - 1


def test_the_printed_gravity_does_not_keep_energy():
    """(14) as printed has 0.5 (m1 + m2) l1 g sin θ1, where the potential energy gives more."""
    physical = PendulumParameters()
    p = Pendulum.of(physical)
    printed = 0.5 * (physical.link1_mass + physical.link2_mass) * physical.link1_length

    def f(x, u):
        extra = [0.0, p.g * (printed - p.a[0]) * np.sin(x[1]), 0.0]
        change = np.linalg.solve(mass_matrix_at(p, np.array(x)), extra)
        return np.array(derivative(p, x, u)) + [0.0, 0.0, 0.0, *change]
    x, energies = horizontal(2), []
    for _ in range(3000):
        energies.append(energy(p, x))
        x = rk4(f, x, 0.0, 1e-3)
    assert np.ptp(energies) > 1

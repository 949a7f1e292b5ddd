# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The equations of motion against an outside engine, and against the energy they must keep."""

import mujoco
import numpy as np
import pytest

from dp_swing_ros.pendulum.equations import derivative, energy, joints, Pendulum, stop
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.rk4 import RK4
from dp_swing_ros.pendulum.trajectory import rollout

BODIES = PendulumParameters(
    cart_mass=1.3, link1_mass=0.4, link2_mass=0.7, link1_length=0.8, link2_length=1.1,
    link1_inertia_factor=1.25, link2_inertia_factor=0.6,
    cart_friction=0.3, joint1_friction=0.1, joint2_friction=0.05)


def mujoco_model(bodies):
    """Build the same bodies in MuJoCo, whose second hinge measures θ2 - θ1."""
    def link(mass, length, factor):
        about_centre = factor * mass * length ** 2 / 12
        return (f'<inertial pos="0 0 {length / 2}" mass="{mass}" '
                f'diaginertia="{about_centre} {about_centre} {about_centre}"/>')
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option gravity="0 0 {-bodies.gravity}"/>
          <worldbody><body>
            <joint type="slide" axis="1 0 0" damping="{bodies.cart_friction}"/>
            <inertial pos="0 0 0" mass="{bodies.cart_mass}" diaginertia="1 1 1"/>
            <body>
              <joint type="hinge" axis="0 1 0" damping="{bodies.joint1_friction}"/>
              {link(bodies.link1_mass, bodies.link1_length, bodies.link1_inertia_factor)}
              <body pos="0 0 {bodies.link1_length}">
                <joint type="hinge" axis="0 1 0" damping="{bodies.joint2_friction}"/>
                {link(bodies.link2_mass, bodies.link2_length, bodies.link2_inertia_factor)}
              </body>
            </body>
          </body></worldbody>
        </mujoco>""")


@pytest.mark.parametrize('bodies', [PendulumParameters(), BODIES])
def test_accelerations_agree_with_mujoco(bodies, rng):
    model = mujoco_model(bodies)
    data = mujoco.MjData(model)
    p = Pendulum.of(bodies)
    for _ in range(200):
        x, u = rng.normal(size=6) * (1, 3, 3, 2, 5, 5), rng.normal() * 20
        data.qpos[:] = x[0], x[1], x[2] - x[1]
        data.qvel[:] = x[3], x[4], x[5] - x[4]
        data.qfrc_applied[:] = u, 0, 0
        mujoco.mj_forward(model, data)
        theirs = np.cumsum(data.qacc * (0, 1, 1)) + data.qacc * (1, 0, 0)
        ours = np.array(derivative(p, x[1], x[2], x[3], x[4], x[5], u))
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-12 * np.abs(theirs).max())


def test_uniform_links_have_the_paper_s_coefficients_to_the_bit(rng):
    for m_1, m_2, l_1, l_2 in rng.uniform(0.1, 3, (100, 4)):
        p = Pendulum.of(PendulumParameters(link1_mass=m_1, link2_mass=m_2, link1_length=l_1,
                                           link2_length=l_2))
        assert (p.d_11, p.d_22) == ((m_1 / 3 + m_2) * l_1 ** 2, m_2 * l_2 ** 2 / 3)


def test_mujoco_agrees_on_the_tips(rng):
    model = mujoco_model(BODIES)
    data = mujoco.MjData(model)
    x = rng.normal(size=6)
    data.qpos[:] = x[0], x[1], x[2] - x[1]
    mujoco.mj_forward(model, data)
    tips = joints(x, BODIES)
    np.testing.assert_allclose(tips[:2], data.xpos[2:4][:, [0, 2]], atol=1e-12)
    tip = data.xpos[3] + data.xmat[3].reshape(3, 3) @ (0, 0, BODIES.link2_length)
    np.testing.assert_allclose(tips[2], tip[[0, 2]], atol=1e-12)


HORIZONTAL = np.array([0.0, np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])


def largest_energy_error(p, h, reference):
    X = rollout(RK4.of(p, h), HORIZONTAL, np.zeros(round(5 / h)))
    energies = np.array([energy(reference, x) for x in X])
    return np.max(np.abs(energies - energies[0]))


def test_an_unforced_pendulum_keeps_its_energy():
    p = Pendulum.of(PendulumParameters())
    assert largest_energy_error(p, 1e-3, p) < 1e-8


def test_friction_takes_energy():
    p = Pendulum.of(BODIES)
    X = rollout(RK4.of(p, 1e-3), HORIZONTAL, np.zeros(5000))
    energies = np.array([energy(p, x) for x in X])
    assert np.all(np.diff(energies) < 1e-9)
    assert energies[-1] < energies[0] - 1


def test_the_printed_gravity_does_not_keep_energy():
    """(14) as printed has 0.5 (m1 + m2) l1 g sin θ1, where the potential energy gives more."""
    bodies = PendulumParameters()
    p = Pendulum.of(bodies)
    # As printed, gravity on joint 1 is that of a lighter link 1: scale its share of g d_01 alone.
    printed = 0.5 * (bodies.link1_mass + bodies.link2_mass) * bodies.link1_length
    x, energies = HORIZONTAL.copy(), []
    for _ in range(5000):
        energies.append(energy(p, x))
        x = printed_rk4(p, printed, x, 1e-3)
    assert np.ptp(energies) > 1


def printed_rk4(p, d_g, x, h):
    def f(x):
        a = np.array(derivative(p, x[1], x[2], x[3], x[4], x[5], 0.0))
        D = np.array([
            [p.d_00, p.d_01 * np.cos(x[1]), p.d_02 * np.cos(x[2])],
            [p.d_01 * np.cos(x[1]), p.d_11, p.d_12 * np.cos(x[1] - x[2])],
            [p.d_02 * np.cos(x[2]), p.d_12 * np.cos(x[1] - x[2]), p.d_22]])
        change = np.array([0, p.g * (d_g - p.d_01) * np.sin(x[1]), 0])
        return np.concatenate([x[3:], a + np.linalg.solve(D, change)])
    k_1 = f(x)
    k_2 = f(x + h / 2 * k_1)
    k_3 = f(x + h / 2 * k_2)
    k_4 = f(x + h * k_3)
    return x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)


def test_the_end_stop_conserves_the_momentum_of_the_links(rng):
    """The impulse acts on the cart alone: the links' own generalised momenta do not change."""
    p = Pendulum.of(BODIES)
    x = rng.normal(size=6) + (3, 0, 0, 5, 0, 0)
    before, kinetic = x.copy(), energy(p, x)
    stop(p, 2.4, x)
    D = np.array([
        [p.d_00, p.d_01 * np.cos(x[1]), p.d_02 * np.cos(x[2])],
        [p.d_01 * np.cos(x[1]), p.d_11, p.d_12 * np.cos(x[1] - x[2])],
        [p.d_02 * np.cos(x[2]), p.d_12 * np.cos(x[1] - x[2]), p.d_22]])
    change = D @ (x[3:] - before[3:])
    assert x[0] == 2.4
    assert x[3] == 0
    assert change[0] < 0
    np.testing.assert_allclose(change[1:], 0, atol=1e-12)
    assert energy(p, x) < kinetic


def test_the_end_stop_lets_the_cart_go():
    p = Pendulum.of(BODIES)
    x = np.array([-2.5, 0.1, 0.2, 1.0, 2.0, 3.0])
    stop(p, 2.4, x)
    np.testing.assert_array_equal(x, [-2.4, 0.1, 0.2, 1.0, 2.0, 3.0])

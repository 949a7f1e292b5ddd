# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pendulum as a robot description (URDF), and back.

z is up and every joint turns about y, so a positive angle leans towards +x. θ2 is absolute, so
link 2 hangs on a massless `elbow` that turns back by -θ1 (a mimic joint) at the tip of link 1:
joint1 and joint2 are θ1 and θ2 as they are. What URDF has no word for: gravity, in an element of
our own, which other readers skip; infinity, written as UNLIMITED; and that the damping of joint2
acts between the two links.
"""

import math
from xml.etree import ElementTree

from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters

UNLIMITED = 1e9  # URDF readers know no infinity
RADIUS = 0.02  # [m] of the links as they are drawn
DIGITS = 12  # after the point of an inertia factor, which is read from a ratio of two numbers


def urdf(bodies: PendulumParameters, limits: LimitParameters) -> str:
    """Return the robot description as XML."""
    return f"""\
<?xml version="1.0"?>
<robot name="dp_swing">
  <gravity value="{bodies.gravity!r}"/>
  <material name="steel"><color rgba="0.6 0.6 0.65 1"/></material>
  <material name="blue"><color rgba="0.12 0.47 0.71 1"/></material>
  <material name="orange"><color rgba="1 0.5 0.05 1"/></material>
  <link name="track">
    <visual>
      <origin rpy="0 {math.pi / 2!r} 0"/>
      <geometry><cylinder radius="0.01" length="{_rail(limits)!r}"/></geometry>
      <material name="steel"/>
    </visual>
  </link>
  <link name="cart_body">
    <inertial>
      <mass value="{bodies.cart_mass!r}"/>
{_inertia(*(bodies.cart_mass * square / 12 for square in (0.02, 0.05, 0.05)))}
    </inertial>
    <visual>
      <geometry><box size="0.2 0.1 0.1"/></geometry>
      <material name="steel"/>
    </visual>
  </link>
{_link('link1', bodies.link1_mass, bodies.link1_length, bodies.link1_inertia_factor, 'blue')}
  <link name="elbow"/>
{_link('link2', bodies.link2_mass, bodies.link2_length, bodies.link2_inertia_factor, 'orange')}
  <joint name="cart" type="prismatic">
    <parent link="track"/>
    <child link="cart_body"/>
    <axis xyz="1 0 0"/>
    <limit lower="{_finite(-limits.track_limit)!r}" upper="{_finite(limits.track_limit)!r}" \
effort="{_finite(limits.force_limit)!r}" velocity="{UNLIMITED!r}"/>
    <dynamics damping="{bodies.cart_friction!r}"/>
  </joint>
  <joint name="joint1" type="continuous">
    <parent link="cart_body"/>
    <child link="link1"/>
    <axis xyz="0 1 0"/>
    <dynamics damping="{bodies.joint1_friction!r}"/>
  </joint>
  <joint name="counter" type="continuous">
    <origin xyz="0 0 {bodies.link1_length!r}"/>
    <parent link="link1"/>
    <child link="elbow"/>
    <axis xyz="0 1 0"/>
    <mimic joint="joint1" multiplier="-1"/>
  </joint>
  <joint name="joint2" type="continuous">
    <parent link="elbow"/>
    <child link="link2"/>
    <axis xyz="0 1 0"/>
    <dynamics damping="{bodies.joint2_friction!r}"/>
  </joint>
</robot>
"""


def from_urdf(text: str) -> tuple[PendulumParameters, LimitParameters]:
    """
    Return the bodies and limits of a description made by `urdf`.

    Raises ValueError if it is no such description.
    """
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f'the robot description is no XML: {error}') from None

    def number(path: str, attribute: str) -> float:
        element = robot.find(path)
        if element is None or attribute not in element.attrib:
            raise ValueError('the robot description is not one of the double pendulum on a cart: '
                             f'{path} has no {attribute}')
        value = float(element.attrib[attribute])
        return math.inf if value >= UNLIMITED else value

    def length(link: str) -> float:
        return number(f'link[@name="{link}"]/visual/geometry/cylinder', 'length')

    def mass(link: str) -> float:
        return number(f'link[@name="{link}"]/inertial/mass', 'value')

    def inertia_factor(link: str) -> float:
        rod = _across(mass(link), length(link))
        return round(number(f'link[@name="{link}"]/inertial/inertia', 'ixx') / rod, DIGITS)

    bodies = PendulumParameters(
        cart_mass=mass('cart_body'),
        link1_mass=mass('link1'),
        link2_mass=mass('link2'),
        link1_length=length('link1'),
        link2_length=length('link2'),
        link1_inertia_factor=inertia_factor('link1'),
        link2_inertia_factor=inertia_factor('link2'),
        gravity=number('gravity', 'value'),
        cart_friction=number('joint[@name="cart"]/dynamics', 'damping'),
        joint1_friction=number('joint[@name="joint1"]/dynamics', 'damping'),
        joint2_friction=number('joint[@name="joint2"]/dynamics', 'damping'))
    return bodies, LimitParameters(force_limit=number('joint[@name="cart"]/limit', 'effort'),
                                   track_limit=number('joint[@name="cart"]/limit', 'upper'))


def _across(mass: float, length: float) -> float:
    # of a thin uniform rod about its centre
    return mass * length ** 2 / 12


def _link(name: str, mass: float, length: float, factor: float, material: str) -> str:
    # The inertia about its own length, which changes nothing, must not be zero.
    across = factor * _across(mass, length)
    return f"""\
  <link name="{name}">
    <inertial>
      <origin xyz="0 0 {length / 2!r}"/>
      <mass value="{mass!r}"/>
{_inertia(across, across, mass * RADIUS ** 2 / 2)}
    </inertial>
    <visual>
      <origin xyz="0 0 {length / 2!r}"/>
      <geometry><cylinder radius="{RADIUS}" length="{length!r}"/></geometry>
      <material name="{material}"/>
    </visual>
  </link>"""


def _inertia(xx: float, yy: float, zz: float) -> str:
    return f'      <inertia ixx="{xx!r}" ixy="0" ixz="0" iyy="{yy!r}" iyz="0" izz="{zz!r}"/>'


def _finite(limit: float) -> float:
    return max(-UNLIMITED, min(limit, UNLIMITED))


def _rail(limits: LimitParameters) -> float:
    # An endless track is drawn as long as the default one.
    endless = math.isinf(limits.track_limit)
    return 2 * (LimitParameters() if endless else limits).track_limit

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pendulum as a robot description (URDF), and back.

z is up and every joint turns about y, so a positive angle leans towards +x. All angles are
absolute, so each link but the first hangs on a massless `elbow` that turns back by the angle of
the link before (a mimic joint) at its tip: joint1, joint2 … are θ1, θ2 … as they are. What URDF
has no word for: gravity, in an element of our own, which other readers skip; infinity, written as
UNLIMITED; and that the damping of a joint acts between two links.
"""

import math
from xml.etree import ElementTree

from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import LINKS

UNLIMITED = 1e9  # URDF readers know no infinity
MATERIALS = {'steel': '0.6 0.6 0.65', 'blue': '0.12 0.47 0.71', 'orange': '1 0.5 0.05',
             'purple': '0.8 0.47 0.65'}   # of cart and track, then of the links
RADIUS = 0.02  # [m] of the links as they are drawn
DIGITS = 12  # after the point of an inertia factor, which is read from a ratio of two numbers


def urdf(physical: PendulumParameters, limits: LimitParameters) -> str:
    """Return the robot description as XML."""
    links = ''.join(_link(physical, i) for i in range(physical.links))
    materials = ''.join(f'  <material name="{name}"><color rgba="{colour} 1"/></material>\n'
                        for name, colour in MATERIALS.items())
    return f"""\
<?xml version="1.0"?>
<robot name="dp_swing">
  <gravity value="{physical.gravity!r}"/>
{materials}\
  <link name="track">
    <visual>
      <origin rpy="0 {math.pi / 2!r} 0"/>
      <geometry><cylinder radius="0.01" length="{_rail(limits)!r}"/></geometry>
      <material name="steel"/>
    </visual>
  </link>
  <link name="cart_body">
    <inertial>
      <mass value="{physical.cart_mass!r}"/>
{_inertia(*(physical.cart_mass * square / 12 for square in (0.02, 0.05, 0.05)))}
    </inertial>
    <visual>
      <geometry><box size="0.2 0.1 0.1"/></geometry>
      <material name="steel"/>
    </visual>
  </link>
  <joint name="cart" type="prismatic">
    <parent link="track"/>
    <child link="cart_body"/>
    <axis xyz="1 0 0"/>
    <limit lower="{_finite(-limits.track_limit)!r}" upper="{_finite(limits.track_limit)!r}" \
effort="{_finite(limits.force_limit)!r}" velocity="{UNLIMITED!r}"/>
    <dynamics damping="{physical.cart_friction!r}"/>
  </joint>
{links}\
</robot>
"""


def from_urdf(text: str) -> tuple[PendulumParameters, LimitParameters]:
    """
    Return the physical parameters and limits of a description made by `urdf`.

    Raises ValueError if it is no such description.
    """
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f'the robot description is no XML: {error}') from None

    def number(path: str, attribute: str) -> float:
        element = robot.find(path)
        if element is None or attribute not in element.attrib:
            raise ValueError('the robot description is not one of a pendulum on a cart: '
                             f'{path} has no {attribute}')
        value = float(element.attrib[attribute])
        return math.inf if value >= UNLIMITED else value

    values = {'cart_mass': number('link[@name="cart_body"]/inertial/mass', 'value'),
              'gravity': number('gravity', 'value'),
              'cart_friction': number('joint[@name="cart"]/dynamics', 'damping')}
    links = max([n for n in LINKS if robot.find(f'link[@name="link{n}"]') is not None],
                default=min(LINKS))
    for i in range(1, links + 1):
        link = f'link[@name="link{i}"]'
        length = number(f'{link}/visual/geometry/cylinder', 'length')
        mass = number(f'{link}/inertial/mass', 'value')
        inertia = number(f'{link}/inertial/inertia', 'ixx')
        values.update({f'link{i}_length': length, f'link{i}_mass': mass,
                       f'link{i}_inertia_factor': round(inertia / _across(mass, length), DIGITS),
                       f'joint{i}_friction': number(f'joint[@name="joint{i}"]/dynamics',
                                                    'damping')})
    return PendulumParameters(links=links, **values), LimitParameters(
        force_limit=number('joint[@name="cart"]/limit', 'effort'),
        track_limit=number('joint[@name="cart"]/limit', 'upper'))


def _across(mass: float, length: float) -> float:
    # of a thin uniform rod about its centre
    return mass * length ** 2 / 12


def _link(physical: PendulumParameters, i: int) -> str:
    """Return link i, from 0, with the joint that it turns in, and the elbow below that."""
    length, mass = physical.lengths[i], physical.masses[i + 1]
    # The inertia about its own length, which changes nothing, must not be zero.
    across = physical.inertia_factors[i] * _across(mass, length)
    parent = 'cart_body' if i == 0 else f'elbow{i}' if i > 1 else 'elbow'
    return (_elbow(i, physical.lengths[i - 1]) if i > 0 else '') + f"""\
  <link name="link{i + 1}">
    <inertial>
      <origin xyz="0 0 {length / 2!r}"/>
      <mass value="{mass!r}"/>
{_inertia(across, across, mass * RADIUS ** 2 / 2)}
    </inertial>
    <visual>
      <origin xyz="0 0 {length / 2!r}"/>
      <geometry><cylinder radius="{RADIUS}" length="{length!r}"/></geometry>
      <material name="{list(MATERIALS)[i + 1]}"/>
    </visual>
  </link>
  <joint name="joint{i + 1}" type="continuous">
    <parent link="{parent}"/>
    <child link="link{i + 1}"/>
    <axis xyz="0 1 0"/>
    <dynamics damping="{physical.frictions[i + 1]!r}"/>
  </joint>
"""


def _elbow(i: int, length: float) -> str:
    """Return the massless link at the tip of link i, from 1, that turns back by its angle."""
    number = str(i) if i > 1 else ''
    return f"""\
  <link name="elbow{number}"/>
  <joint name="counter{number}" type="continuous">
    <origin xyz="0 0 {length!r}"/>
    <parent link="link{i}"/>
    <child link="elbow{number}"/>
    <axis xyz="0 1 0"/>
    <mimic joint="joint{i}" multiplier="-1"/>
  </joint>
"""


def _inertia(xx: float, yy: float, zz: float) -> str:
    return f'      <inertia ixx="{xx!r}" ixy="0" ixz="0" iyy="{yy!r}" iyz="0" izz="{zz!r}"/>'


def _finite(limit: float) -> float:
    return max(-UNLIMITED, min(limit, UNLIMITED))


def _rail(limits: LimitParameters) -> float:
    # An endless track is drawn as long as the default one.
    endless = math.isinf(limits.track_limit)
    return 2 * (LimitParameters() if endless else limits).track_limit

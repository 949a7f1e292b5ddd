# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pendulum as a robot description (URDF), and back.

z is up and every joint turns about y, so a positive angle leans towards +x. All angles are
absolute, so each link but the first hangs on a massless `elbow` that turns back by the angle of
the link before (a mimic joint) at its tip: joint1, joint2 … are θ1, θ2 … as they are. What URDF
has no word for: gravity, springs of joints, and a drive that is none by forces, in elements of
our own, which other readers skip; infinity, written as UNLIMITED; and that the damping of a joint
acts between two links.
"""

from collections.abc import Sequence
from dataclasses import replace
import math
from textwrap import indent
from typing import Any
from xml.etree import ElementTree

from dp_swing_ros.pendulum.geometry import drawn_scale
from dp_swing_ros.pendulum.parameters import FORCE, LimitParameters, PendulumParameters, SPRINGS
from dp_swing_ros.pendulum.state import LINKS

ROOT = 'track'   # the link that stands still
UNLIMITED = 1e9  # URDF readers know no infinity
MATERIALS = {'steel': '0.6 0.6 0.65', 'blue': '0.12 0.47 0.71', 'orange': '1 0.5 0.05',
             'purple': '0.8 0.47 0.65'}   # of cart and track, then of the links
RADIUS, RAIL = 0.02, 0.01   # [m] scaled, of the links and the track as they are drawn
CART = (0.2, 0.1, 0.1)      # [m] scaled, sides of it as it is drawn
DIGITS = 12  # after the point of an inertia factor, which is read from a ratio of two numbers


def urdf(physical: PendulumParameters, limits: LimitParameters) -> str:
    """Return the robot description as XML."""
    materials = [f'<material name="{name}"><color rgba="{colour} 1"/></material>'
                 for name, colour in MATERIALS.items()]
    drive = [] if physical.drive == FORCE else [f'<drive value="{physical.drive}"/>']
    bodies = replace(physical, drive=FORCE)   # as they are, not as they count
    links = [element for i in range(1, physical.links + 1) for element in _link(bodies, i)]
    springs = [f'<spring joint="joint{i}" stiffness="{k!r}" preload="{preload!r}"/>'
               for i, (k, preload) in enumerate(zip(bodies.stiffnesses, bodies.preloads), 1)
               if k or preload]
    robot = _element('robot name="dp_swing"', f'<gravity value="{physical.gravity!r}"/>', *drive,
                     *springs, *materials, *_track(physical, limits), *links)
    return f'<?xml version="1.0"?>\n{robot}\n'


def from_urdf(text: str, drive: str = FORCE) -> tuple[PendulumParameters, LimitParameters]:
    """
    Return the physical parameters and limits of a description made by `urdf`.

    drive is that of one that names none. Raises ValueError if it is no such description.
    """
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f'the robot description is no XML: {error}') from None

    def number(path: str, attribute: str, default: str | None = None) -> float:
        element = robot.find(path)
        if element is None or default is None and attribute not in element.attrib:
            raise ValueError('the robot description is not one of a pendulum on a cart: '
                             f'{path} has no {attribute}')
        words = element.get(attribute, default or '').split()
        value = float(words[-1] if words else '')   # of a place, its height
        return math.inf if value >= UNLIMITED else value

    named, limit = robot.find('drive'), 'joint[@name="cart"]/limit'
    values: dict[str, Any] = {
        'cart_mass': number('link[@name="cart_body"]/inertial/mass', 'value'),
        'gravity': number('gravity', 'value'),
        'cart_friction': number('joint[@name="cart"]/dynamics', 'damping'),
        'cart_dry_friction': number('joint[@name="cart"]/dynamics', 'friction', '0')}
    links = max([n for n in LINKS if robot.find(f'link[@name="link{n}"]') is not None],
                default=min(LINKS))
    for i in range(1, links + 1):
        link = f'link[@name="link{i}"]'
        length = number(f'{link}/visual/geometry/cylinder', 'length')
        mass = number(f'{link}/inertial/mass', 'value')
        inertia = number(f'{link}/inertial/inertia', 'ixx')
        centre = number(f'{link}/inertial/origin', 'xyz')
        if not _across(mass, length):
            raise ValueError(f'the robot description has a link{i} without length or mass')
        values.update({f'link{i}_length': length, f'link{i}_mass': mass,
                       f'link{i}_centre': 0.0 if centre == length / 2 else centre,
                       f'link{i}_inertia_factor': round(inertia / _across(mass, length), DIGITS),
                       f'joint{i}_friction': number(f'joint[@name="joint{i}"]/dynamics',
                                                    'damping'),
                       f'joint{i}_dry_friction': number(f'joint[@name="joint{i}"]/dynamics',
                                                        'friction', '0')})
        spring = robot.find(f'spring[@joint="joint{i}"]')
        if spring is not None:
            values |= {f'joint{i}_{name}': float(spring.get(name, '0'))
                       for name in SPRINGS}
    drive = drive if named is None else named.get('value', '')
    return PendulumParameters(links=links, drive=drive, **values), LimitParameters(
        force_limit=number(limit, 'effort'), track_limit=number(limit, 'upper'),
        cart_speed_limit=number(limit, 'velocity', repr(UNLIMITED)),
        acceleration_limit=number(limit, 'acceleration', repr(
            LimitParameters.acceleration_limit)))


def _across(mass: float, length: float) -> float:
    # of a thin uniform rod about its centre
    return mass * length ** 2 / 12


def _track(physical: PendulumParameters, limits: LimitParameters) -> list[str]:
    """Return the track and the cart on it."""
    mass = physical.cart_mass
    track, force, speed, acceleration = (min(limit, UNLIMITED) for limit in (
        limits.track_limit, limits.force_limit, limits.cart_speed_limit,
        limits.acceleration_limit))
    driven = f' acceleration="{acceleration!r}"' if physical.is_driven else ''
    scale = drawn_scale(physical)
    # an endless track is drawn as long as the default one
    end = scale.sized(LimitParameters().track_limit, 'm') if math.isinf(limits.track_limit) \
        else limits.track_limit
    return [
        _element(f'link name="{ROOT}"', _visual(
            f'cylinder radius="{scale.sized(RAIL, "m")!r}" length="{2 * end!r}"', 'steel',
            f'<origin rpy="0 {math.pi / 2!r} 0"/>')),
        _element('link name="cart_body"',
                 _inertial(mass, [mass * scale.sized(square, 'm^2') / 12
                                  for square in (0.02, 0.05, 0.05)]),
                 _visual(f'box size="{" ".join(repr(scale.sized(side, "m")) for side in CART)}"',
                         'steel')),
        _joint('cart', ROOT, 'cart_body',
               f'<limit lower="{-track!r}" upper="{track!r}" effort="{force!r}" '
               f'velocity="{speed!r}"{driven}/>',
               f'<dynamics damping="{physical.cart_friction!r}" '
               f'friction="{physical.cart_dry_friction!r}"/>',
               kind='prismatic', axis='1 0 0')]


def _link(physical: PendulumParameters, i: int) -> list[str]:
    """Return link i, from 1, and the joint that it turns in, below the elbow of the one before."""
    length, mass = physical.lengths[i - 1], physical.masses[i]
    across = physical.inertia_factors[i - 1] * _across(mass, length)
    # The inertia about its own length, which changes nothing, must not be zero.
    radius = drawn_scale(physical).sized(RADIUS, 'm')
    moments = [across, across, mass * radius ** 2 / 2]
    number = str(i - 1) if i > 2 else ''   # of the elbow
    return [
        *(_elbow(number, i - 1, physical.lengths[i - 2]) if i > 1 else ()),
        _element(f'link name="link{i}"',
                 _inertial(mass, moments, _above(
                     getattr(physical, f'link{i}_centre') or length / 2)),
                 _visual(f'cylinder radius="{radius!r}" length="{length!r}"', list(MATERIALS)[i],
                         _above(length / 2))),
        _joint(f'joint{i}', f'elbow{number}' if i > 1 else 'cart_body', f'link{i}',
               f'<dynamics damping="{physical.frictions[i]!r}" '
               f'friction="{physical.dry_frictions[i]!r}"/>')]


def _elbow(number: str, i: int, length: float) -> list[str]:
    """Return the massless link at the tip of link i, from 1, that turns back by its angle."""
    return [f'<link name="elbow{number}"/>',
            _joint(f'counter{number}', f'link{i}', f'elbow{number}',
                   f'<mimic joint="joint{i}" multiplier="-1"/>', origin=[_above(length)])]


def _inertial(mass: float, moments: Sequence[float], *origin: str) -> str:
    xx, yy, zz = moments
    return _element('inertial', *origin, f'<mass value="{mass!r}"/>',
                    f'<inertia ixx="{xx!r}" ixy="0" ixz="0" iyy="{yy!r}" iyz="0" izz="{zz!r}"/>')


def _visual(shape: str, material: str, *origin: str) -> str:
    return _element('visual', *origin, f'<geometry><{shape}/></geometry>',
                    f'<material name="{material}"/>')


def _joint(name: str, parent: str, child: str, *more: str, kind: str = 'continuous',
           axis: str = '0 1 0', origin: Sequence[str] = ()) -> str:
    return _element(f'joint name="{name}" type="{kind}"', *origin, f'<parent link="{parent}"/>',
                    f'<child link="{child}"/>', f'<axis xyz="{axis}"/>', *more)


def _above(height: float) -> str:
    return f'<origin xyz="0 0 {height!r}"/>'


def _element(head: str, *inside: str) -> str:
    lines = indent('\n'.join(inside), '  ')
    return f'<{head}>\n{lines}\n</{head.split()[0]}>'

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A pendulum in anybody's robot description (URDF): a prismatic and one to three revolute joints.

All is taken where every joint is at zero. Links that fixed joints hold together are one body; the
plane in which they move is that of the prismatic axis and the vertical. Angles of joints are
relative there, and what they are where all links stand up follows from where these point at zero.
Source: the URDF specification of ROS (wiki.ros.org/urdf/XML).
"""

from collections.abc import Iterator, Mapping
import math
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import Array, LINKS
from dp_swing_ros.pendulum.urdf import from_urdf

TURNING = ('revolute', 'continuous')
STRAIGHT = 1e-6   # sine of an angle that is none
BESIDE = 1e-3     # share of a length by which a centre of mass may lie beside its link
DIGITS = 9        # of what is computed from a description


class Found(NamedTuple):
    """Parameters by name, those of bodies and limits and of the sensors, and what has none."""

    values: dict[str, Any]
    left_out: list[str]


class Joint(NamedTuple):
    """A joint where all are at zero: its place and axis in the frame of the root."""

    name: str
    kind: str
    parent: str
    child: str
    place: Array
    axis: Array
    element: ElementTree.Element

    def number(self, path: str, attribute: str, default: float) -> float:
        """Return a number of the joint, or what holds where it has none."""
        found = self.element.find(path)
        return default if found is None else float(found.get(attribute, default))


class Body(NamedTuple):
    """Links that are held together."""

    mass: float       # [kg]
    centre: Array     # [m] (3,)
    inertia: float    # [kg m²] about y through the centre


def parameters_of(text: str) -> Found:
    """
    Return the parameters of the pendulum that a robot description describes.

    Raises ValueError where it is none, saying what is in the way.
    """
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f'the robot description is no XML: {error}') from None
    try:
        physical, limits = from_urdf(text)
        found = Found({**physical.by_name, **vars(limits)}, [])
    except (TypeError, ValueError):
        found = _of_robot(robot)
    # who names no drive may have any
    named = robot.find('drive')
    found.values.pop('drive', None)
    return found if named is None else found._replace(
        values={**found.values, 'drive': named.get('value', '')})


def _of_robot(robot: ElementTree.Element) -> Found:
    links = {each.get('name', ''): each for each in robot.findall('link')}
    poses, joints = _placed(robot, links)
    bodies = _held_together(links, joints)
    cart, chain = _chain(joints, bodies)
    x = cart.axis
    if abs(x[2]) > STRAIGHT:
        raise ValueError(f'the axis of {cart.name} is {_shown(x)}; expected a horizontal one')
    y = np.cross([0.0, 0.0, 1.0], x)
    moving = [_body(links, poses, bodies, joint.child, y) for joint in (cart, *chain)]
    values = {'links': len(chain), 'cart_mass': moving[0].mass, **_track(cart)}
    left_out = list(_links(chain, moving[1:], x, y, values))
    for name, joint in zip(('cart', *(f'joint{i}' for i in range(1, 4))), (cart, *chain)):
        values[f'{name}_friction'] = joint.number('dynamics', 'damping', 0.0)
        values[f'{name}_dry_friction'] = joint.number('dynamics', 'friction', 0.0)
    values['joint_names'] = [joint.name for joint in (cart, *chain)]
    values['relative_angles'] = True
    values = {name: _rounded(value) for name, value in values.items()}
    group(PendulumParameters, values), group(LimitParameters, values)   # which check them
    return Found(values, left_out)


def _placed(robot: ElementTree.Element, links: Mapping[str, ElementTree.Element]
            ) -> tuple[dict[str, tuple[Rotation, Array]], list[Joint]]:
    """Return where each link is, and the joints, parents first; raises ValueError."""
    elements, children = dict[str, list[tuple[str, ElementTree.Element]]](), set[str]()
    for element in robot.findall('joint'):
        parent, child = (_attribute(element, path, 'link') for path in ('parent', 'child'))
        for name in {parent, child} - links.keys():
            raise ValueError(f'joint {element.get("name")} is of a link {name!r}, which is not '
                             'there')
        if child in children:
            raise ValueError(f'link {child} hangs on two joints; expected one each')
        children.add(child)
        elements.setdefault(parent, []).append((child, element))
    roots = sorted(links.keys() - children)
    if len(roots) != 1:
        raise ValueError(f'{len(roots)} links hang on no other ({", ".join(roots[:5])}); expected '
                         'one, the world or the track')
    poses, joints, waiting = {roots[0]: (Rotation.identity(), np.zeros(3))}, [], [roots[0]]
    depth = {roots[0]: 0}
    while waiting:
        parent = waiting.pop()
        turned, place = poses[parent]
        for child, element in elements.get(parent, []):
            if element.find('mimic') is not None:
                raise ValueError(f'joint {element.get("name")} mimics another; expected joints '
                                 'that move by themselves')
            step, by = _origin(element)
            poses[child] = (turned * by, place + turned.apply(step))
            axis = poses[child][0].apply(_vector(element.find('axis'), 'xyz', '1 0 0'))
            joints.append(Joint(element.get('name', ''), element.get('type', ''), parent, child,
                                poses[child][1], axis / np.linalg.norm(axis), element))
            depth[child] = depth[parent] + 1
            waiting.append(child)
    return poses, sorted(joints, key=lambda joint: depth[joint.child])


def _held_together(links: Mapping[str, Any], joints: list[Joint]) -> dict[str, str]:
    """Return by link the first link of the body that it is a part of."""
    body = {name: name for name in links}
    for joint in joints:   # parents first
        if joint.kind == 'fixed':
            body[joint.child] = body[joint.parent]
    return body


def _chain(joints: list[Joint], body: Mapping[str, str]) -> tuple[Joint, list[Joint]]:
    """Return the joint of the cart and those of the links in order; raises ValueError."""
    moving = [joint for joint in joints if joint.kind != 'fixed']
    carts = [joint for joint in moving if joint.kind == 'prismatic']
    others = [f'{joint.name} ({joint.kind})' for joint in moving
              if joint.kind not in ('prismatic', *TURNING)]
    if len(carts) != 1 or others:
        raise ValueError(
            f'there are {len(carts)} prismatic joints' + (f', and {", ".join(others)}' if others
                                                          else '')
            + '; expected one, of the cart, and one to three revolute ones')
    chain, last = list[Joint](), carts[0].child
    while following := [joint for joint in moving if body[joint.parent] == last]:
        if len(following) > 1:
            raise ValueError(f'{", ".join(joint.name for joint in following)} begin at one body; '
                             'expected links that hang on each other, one after the other')
        chain += following
        last = following[0].child
    left = {joint.name for joint in moving} - {joint.name for joint in (carts[0], *chain)}
    if left or len(chain) not in LINKS:
        raise ValueError(
            f'{len(chain)} links hang on the cart'
            + (f', and {", ".join(sorted(left))} elsewhere' if left else '')
            + f'; expected {LINKS[0]} to {LINKS[-1]}, and no other joints that move')
    return carts[0], chain


def _body(links: Mapping[str, ElementTree.Element], poses: Mapping[str, tuple[Rotation, Array]],
          body: Mapping[str, str], first: str, y: Array) -> Body:
    """Return the body that begins with a link; raises ValueError where it has no mass."""
    parts = []
    for name, element in links.items():
        inertial = element.find('inertial')
        if body[name] != first or inertial is None:
            continue
        turned, place = poses[name]
        step, by = _origin(inertial)
        axes = (turned * by).as_matrix()
        own = axes @ _tensor(inertial) @ axes.T
        parts.append((float(_attribute(inertial, 'mass', 'value')), place + turned.apply(step),
                      float(y @ own @ y)))
    mass = sum(part[0] for part in parts)
    if not mass > 0:
        raise ValueError(f'link {first} has no mass; expected an element inertial')
    centre = sum(part[0] * part[1] for part in parts) / mass
    return Body(mass, centre, sum(
        inertia + m * float(np.sum(np.cross(y, at - centre) ** 2)) for m, at, inertia in parts))


def _track(cart: Joint) -> dict[str, Any]:
    """Return what the limits of the cart's joint say."""
    lower, upper = (cart.number('limit', name, math.nan) for name in ('lower', 'upper'))
    values: dict[str, Any] = {'joint_offsets': [0.0]}
    if upper > lower:
        values = {'track_limit': (upper - lower) / 2, 'joint_offsets': [(upper + lower) / 2]}
    for name, attribute in (('force_limit', 'effort'), ('cart_speed_limit', 'velocity')):
        if 0 < (limit := cart.number('limit', attribute, 0.0)) < math.inf:
            values[name] = limit
    return values


def _links(chain: list[Joint], moving: list[Body], x: Array, y: Array,
           values: dict[str, Any]) -> Iterator[str]:
    """Add the links and how their sensors count; yield what has no parameter."""
    signs, before = [1.0], 0.0
    for i, (joint, body) in enumerate(zip(chain, moving), 1):
        along = float(joint.axis @ y)
        if abs(along) < 1 - STRAIGHT:
            raise ValueError(f'the axis of {joint.name} is {_shown(joint.axis)}; expected '
                             f'{_shown(y)}, across the plane of the prismatic one')
        to_centre = _in_plane(body.centre - joint.place, x)
        to_next = _in_plane(chain[i].place - joint.place, x) if i < len(chain) else 2 * to_centre
        length = float(np.hypot(*to_next))
        if not length > 0:
            raise ValueError(f'link {i}, of {joint.name}, has no length: its centre of mass, or '
                             'the next joint, is on the joint itself')
        direction = to_next / length
        beside = float(direction[1] * to_centre[0] - direction[0] * to_centre[1])
        centre = float(direction @ to_centre)
        if not centre > 0:
            raise ValueError(f'the centre of mass of link {i}, of {joint.name}, is {centre:.3g} m '
                             'along it; expected it beyond its joint, towards the next one')
        if abs(beside) > BESIDE * length:
            yield (f'the centre of mass of link {i}, of {joint.name}, is {1e3 * beside:.3g} mm '
                   'beside the line from joint to joint: it is taken to be on it')
        values |= {f'link{i}_mass': body.mass, f'link{i}_length': length,
                   f'link{i}_centre': centre, f'link{i}_inertia': body.inertia}
        points, sign = math.atan2(direction[0], direction[1]), math.copysign(1.0, along)
        offset = math.remainder(sign * (before - points), math.tau)
        half = offset < STRAIGHT - math.pi   # a turn, either way
        values['joint_offsets'].append(offset + math.tau if half else offset)
        signs.append(sign)
        before = points
        if joint.kind == 'revolute':
            yield f'{joint.name} has ends: joints turn without end here'
    values['joint_signs'] = signs


def _in_plane(step: Array, x: Array) -> Array:
    """Return a step (3,) as (2,): along the track, and up."""
    return np.array([step @ x, step[2]])


def _origin(element: ElementTree.Element) -> tuple[Array, Rotation]:
    """Return the place (3,) and the turn of an element's origin."""
    origin = element.find('origin')
    return (_vector(origin, 'xyz', '0 0 0'),
            Rotation.from_euler('xyz', _vector(origin, 'rpy', '0 0 0')))


def _tensor(inertial: ElementTree.Element) -> Array:
    """Return the moments of inertia (3, 3)."""
    found = inertial.find('inertia')
    tensor = np.zeros((3, 3))
    for j, k in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        tensor[j, k] = tensor[k, j] = 0.0 if found is None else float(
            found.get(f'i{"xyz"[j]}{"xyz"[k]}', 0.0))
    return tensor


def _vector(element: ElementTree.Element | None, attribute: str, default: str) -> Array:
    """Return three numbers; raises ValueError for others."""
    text = default if element is None else element.get(attribute, default)
    found = np.array([float(number) for number in text.split()])
    if found.shape != (3,) or not np.all(np.isfinite(found)):
        raise ValueError(f'{attribute} is {text!r}; expected three numbers')
    return found


def _attribute(element: ElementTree.Element, path: str, attribute: str) -> str:
    """Return an attribute of an element inside another; raises ValueError where there is none."""
    found = element.find(path)
    if found is None or attribute not in found.attrib:
        raise ValueError(f'{element.tag} {element.get("name", "")} has no {path} {attribute}')
    return found.attrib[attribute]


def _shown(vector: Array) -> str:
    return ' '.join(f'{number:.3g}' for number in vector + 0.0)


def _rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [_rounded(each) for each in value]
    return float(f'{value + 0.0:.{DIGITS}g}') if isinstance(value, float) else value

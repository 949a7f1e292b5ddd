# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Base parameters: what motion tells of the bodies, whatever mass and length each of them has.

Bodies that share them move alike. Source: Gautier and Khalil, "Direct calculation of minimum set
of inertial parameters of serial robots", IEEE Transactions on Robotics and Automation 6(3), 1990.
"""

from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters

Quantity = tuple[float, str]   # value and unit


def base_parameters(physical: PendulumParameters, gain: float = 1.0) -> dict[str, Quantity]:
    """
    Return those of a pendulum that commands move, by name: masses and moments per force gain.

    Moments are those of a link about its joint, with all that it carries at its tip.
    """
    p = Pendulum.of(physical)
    count = range(1, physical.links + 1)
    return {
        'mass of cart and links': (p.m / gain, 'kg'),
        **{f'first moment about joint {i}': (p.a[i - 1] / gain, 'kg m') for i in count},
        **{f'second moment about joint {i}': (p.b[i - 1][0] / gain, 'kg m^2') for i in count},
        **_lengths(physical)}


def base_parameters_of_links(physical: PendulumParameters) -> dict[str, Quantity]:
    """
    Return those of links on a cart whose motion is given, by name: all beside each other alone.

    They move alike with twice of all masses and frictions.
    """
    p = Pendulum.of(physical)
    count = range(1, physical.links + 1)
    return {
        **_lengths(physical),
        **{f'second by first moment about joint {i}': (p.b[i - 1][0] / p.a[i - 1], 'm')
           for i in count},
        **{f'first moment about joint {i} by that about joint 1': (p.a[i - 1] / p.a[0], '1')
           for i in count[1:]},
        **{f'{kind} friction of joint {i} by first moment about joint 1': (
            friction[i] / p.a[0], unit) for kind, friction, unit in (
                ('viscous', p.friction, 'm/s'), ('dry', p.dry, 'm/s^2')) for i in count}}


def _lengths(physical: PendulumParameters) -> dict[str, Quantity]:
    """Return those from joint to joint; that of the last link shows in nothing alone."""
    return {f'joint {i} to joint {i + 1}': (length, 'm')
            for i, length in enumerate(physical.lengths[:-1], 1)}

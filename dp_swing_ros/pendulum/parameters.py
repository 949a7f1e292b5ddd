# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The physical parameters of the pendulum, and the limits of its drive and track."""

import dataclasses

from dp_swing_ros.parameters import parameter, Parameters


@dataclasses.dataclass(frozen=True)
class PendulumParameters(Parameters):
    """The bodies: a cart and two links. Source: the paper, II-A, and its authors' runs."""

    cart_mass: float = parameter(1.0, 'mass of the cart, m0', unit='kg', minimum=1e-3)
    link1_mass: float = parameter(0.5, 'mass of link 1, m1', unit='kg', minimum=1e-3)
    link2_mass: float = parameter(0.5, 'mass of link 2, m2', unit='kg', minimum=1e-3)
    link1_length: float = parameter(1.0, 'length of link 1, l1', unit='m', minimum=1e-3)
    link2_length: float = parameter(1.0, 'length of link 2, l2', unit='m', minimum=1e-3)
    link1_inertia_factor: float = parameter(
        1.0, 'moment of inertia of link 1 about its centre, in those of a uniform rod, m1 l1^2/12',
        minimum=1e-3)
    link2_inertia_factor: float = parameter(
        1.0, 'moment of inertia of link 2 about its centre, in those of a uniform rod, m2 l2^2/12',
        minimum=1e-3)
    gravity: float = parameter(9.81, 'acceleration of gravity, g', unit='m/s^2', minimum=0.0)
    cart_friction: float = parameter(
        0.0, 'viscous friction of the cart on the track', unit='N s/m', minimum=0.0)
    joint1_friction: float = parameter(
        0.0, 'viscous friction between cart and link 1', unit='N m s/rad', minimum=0.0)
    joint2_friction: float = parameter(
        0.0, 'viscous friction between link 1 and link 2', unit='N m s/rad', minimum=0.0)


@dataclasses.dataclass(frozen=True)
class LimitParameters(Parameters):
    """What the actuator and the track allow; plant and controller should be told the same."""

    force_limit: float = parameter(
        20.0, 'largest force on the cart, either way', unit='N', minimum=0.0, finite=False)
    track_limit: float = parameter(
        2.4, 'the cart stays within this distance of the centre', unit='m', minimum=1e-3,
        finite=False)

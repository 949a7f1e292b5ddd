# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The physical parameters of the pendulum, and the limits of its drive and track."""

from collections.abc import Mapping, Sequence
import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.parameters import fields_of, parameter, ParameterError, Parameters
from dp_swing_ros.pendulum.state import angles, Array, DEFAULT_LINKS, equilibria, LINKS, links_of

FORCE, VOLTAGE, ACCELERATION, VELOCITY = 'force', 'voltage', 'acceleration', 'velocity'
# what takes commands, and their units
DRIVES = {FORCE: 'N', VOLTAGE: 'V', ACCELERATION: 'm/s^2', VELOCITY: 'm/s'}
SPRINGS = 'stiffness', 'preload'   # of the spring of a joint
DRIVEN = (ACCELERATION, VELOCITY)   # the cart, whatever the links do
LIGHT = 1e-6      # of a cart that is driven, what all links together weigh
GIVEN = 'given'   # no equilibrium by its name, but the state as it is
EQUILIBRIA = [GIVEN, *(name for links in LINKS for name in equilibria(links))]


def acting(drive: str) -> str:
    """Return what a drive does to the cart, in a word."""
    return 'acceleration' if drive in DRIVEN else 'force'


def acting_unit(drive: str) -> str:
    """Return the unit of what a drive does to the cart: a force, or an acceleration."""
    return 'm/s^2' if drive in DRIVEN else 'N'


def at_equilibrium(parameter: str, name: str, x: Sequence[float]) -> Array:
    """
    Return a state with the angles of a named equilibrium for its own, or as it is where GIVEN.

    Shapes: x (2n + 2,). Raises ParameterError for the name of another number of links.
    """
    state = np.array(x, dtype=float)
    named = equilibria(links_of(state))
    if name != GIVEN:
        if name not in named:
            raise ParameterError(f'parameter {parameter} is {name!r}; expected one of '
                                 f'{", ".join([GIVEN, *named])} for links {links_of(state)}')
        state[angles(state)] = named[name][angles(state)]
    return state


@dataclasses.dataclass(frozen=True)
class PendulumParameters(Parameters):
    """The physical parameters of cart and links. Source: the paper, II-A; its authors' runs."""

    links: int = parameter(DEFAULT_LINKS, 'number of links, n', minimum=min(LINKS),
                           maximum=max(LINKS), live=False)
    drive: str = parameter(
        FORCE, 'what a command is: force, a force on the cart; voltage, one of a motor, by '
        'force_gain [N/V] a force, too; acceleration, or velocity, which a stepper or a servo '
        'gives the cart whatever the links do, so that mass and frictions of the cart do not '
        'count, and all forces on it are accelerations, in m/s^2 for N',
        choices=lambda: list(DRIVES), live=False)
    cart_mass: float = parameter(1.0, 'mass of the cart, m0', unit='kg', minimum=1e-3)
    link1_mass: float = parameter(0.5, 'mass of link 1, m1', unit='kg', minimum=1e-3)
    link2_mass: float = parameter(0.5, 'mass of link 2, m2', unit='kg', minimum=1e-3, links=2)
    link3_mass: float = parameter(0.5, 'mass of link 3, m3', unit='kg', minimum=1e-3, links=3)
    link1_length: float = parameter(1.0, 'length of link 1, l1', unit='m', minimum=1e-3)
    link2_length: float = parameter(1.0, 'length of link 2, l2', unit='m', minimum=1e-3, links=2)
    link3_length: float = parameter(1.0, 'length of link 3, l3', unit='m', minimum=1e-3, links=3)
    link1_centre: float = parameter(
        0.0, 'from joint 1 to the centre of mass of link 1; 0 is half the length', unit='m',
        minimum=0.0)
    link2_centre: float = parameter(
        0.0, 'from joint 2 to the centre of mass of link 2; 0 is half the length', unit='m',
        minimum=0.0, links=2)
    link3_centre: float = parameter(
        0.0, 'from joint 3 to the centre of mass of link 3; 0 is half the length', unit='m',
        minimum=0.0, links=3)
    link1_inertia_factor: float = parameter(
        1.0, 'moment of inertia of link 1 about its centre, in those of a uniform rod, m1 l1^2/12',
        minimum=1e-3)
    link2_inertia_factor: float = parameter(
        1.0, 'moment of inertia of link 2 about its centre, in those of a uniform rod, m2 l2^2/12',
        minimum=1e-3, links=2)
    link3_inertia_factor: float = parameter(
        1.0, 'moment of inertia of link 3 about its centre, in those of a uniform rod, m3 l3^2/12',
        minimum=1e-3, links=3)
    link1_inertia: float = parameter(
        0.0, 'moment of inertia of link 1 about its centre; 0 is what the factor says',
        unit='kg m^2', minimum=0.0)
    link2_inertia: float = parameter(
        0.0, 'moment of inertia of link 2 about its centre; 0 is what the factor says',
        unit='kg m^2', minimum=0.0, links=2)
    link3_inertia: float = parameter(
        0.0, 'moment of inertia of link 3 about its centre; 0 is what the factor says',
        unit='kg m^2', minimum=0.0, links=3)
    gravity: float = parameter(9.81, 'acceleration of gravity, g', unit='m/s^2', minimum=0.0)
    cart_friction: float = parameter(
        0.0, 'viscous friction of the cart on the track; of a voltage drive with its back EMF',
        unit='N s/m', minimum=0.0)
    joint1_friction: float = parameter(
        0.0, 'viscous friction between cart and link 1', unit='N m s/rad',
        minimum=0.0)
    joint2_friction: float = parameter(
        0.0, 'viscous friction between link 1 and link 2', unit='N m s/rad',
        minimum=0.0, links=2)
    joint3_friction: float = parameter(
        0.0, 'viscous friction between link 2 and link 3', unit='N m s/rad',
        minimum=0.0, links=3)
    cart_dry_friction: float = parameter(
        0.0, 'dry friction of the cart on the track', unit='N', minimum=0.0)
    joint1_dry_friction: float = parameter(
        0.0, 'dry friction between cart and link 1', unit='N m', minimum=0.0)
    joint2_dry_friction: float = parameter(
        0.0, 'dry friction between link 1 and link 2', unit='N m', minimum=0.0, links=2)
    joint3_dry_friction: float = parameter(
        0.0, 'dry friction between link 2 and link 3', unit='N m', minimum=0.0, links=3)
    joint1_stiffness: float = parameter(
        0.0, 'stiffness of a spring, as of a cable, between cart and link 1', unit='N m/rad',
        minimum=0.0)
    joint2_stiffness: float = parameter(
        0.0, 'stiffness of a spring, as of a cable, between link 1 and link 2', unit='N m/rad',
        minimum=0.0, links=2)
    joint3_stiffness: float = parameter(
        0.0, 'stiffness of a spring, as of a cable, between link 2 and link 3', unit='N m/rad',
        minimum=0.0, links=3)
    joint1_preload: float = parameter(
        0.0, 'torque of that spring on link 1 that is upright; it winds up from turn to turn',
        unit='N m')
    joint2_preload: float = parameter(
        0.0, 'torque of that spring on link 2 in line with the one before; it winds up from turn '
        'to turn', unit='N m', links=2)
    joint3_preload: float = parameter(
        0.0, 'torque of that spring on link 3 in line with the one before; it winds up from turn '
        'to turn', unit='N m', links=3)

    def __post_init__(self) -> None:
        """Check every value, and that none is given twice; raises ParameterError."""
        super().__post_init__()
        for i in range(1, self.links + 1):
            factor, inertia = (getattr(self, f'link{i}_inertia{end}') for end in ('_factor', ''))
            if inertia > 0.0 and factor != 1.0:
                raise ParameterError(
                    f'parameters link{i}_inertia is {inertia:g} and link{i}_inertia_factor '
                    f'{factor:g}; expected one of them: both say the same')

    @property
    def is_driven(self) -> bool:
        """Return whether the cart moves as it is told, whatever the links do."""
        return self.drive in DRIVEN

    @property
    def lightness(self) -> float:
        """
        Return what masses and frictions of the links count in the equations of motion.

        The links of a driven cart move as with one of 1 kg that they are too light to move; a
        force on that in N is its acceleration in m/s².
        """
        return LIGHT / sum(self._of_links('link{}_mass')) if self.is_driven else 1.0

    @property
    def masses(self) -> tuple[float, ...]:
        """Return the masses of the cart and the links [kg], as they count."""
        return (1.0 if self.is_driven else self.cart_mass, *self._counting('link{}_mass'))

    @property
    def lengths(self) -> tuple[float, ...]:
        """Return the lengths of the links [m]."""
        return self._of_links('link{}_length')

    @property
    def centres(self) -> tuple[float, ...]:
        """Return how far along each link its centre of mass is, as a share of its length."""
        return tuple(centre / length if centre else 0.5 for centre, length in zip(
            self._of_links('link{}_centre'), self.lengths))

    @property
    def inertia_factors(self) -> tuple[float, ...]:
        """Return the moments of inertia of the links about their centres, in those of rods."""
        return tuple(inertia / (mass * length ** 2 / 12) if inertia else factor
                     for inertia, factor, mass, length in zip(
                         self._of_links('link{}_inertia'), self._of_links('link{}_inertia_factor'),
                         self._of_links('link{}_mass'), self.lengths))

    @property
    def frictions(self) -> tuple[float, ...]:
        """Return the viscous frictions of cart [N s/m] and joints [N m s/rad], as they count."""
        return (0.0 if self.is_driven else self.cart_friction,
                *self._counting('joint{}_friction'))

    @property
    def dry_frictions(self) -> tuple[float, ...]:
        """Return the dry frictions of the cart [N] and the joints [N m], as they count."""
        return (0.0 if self.is_driven else self.cart_dry_friction,
                *self._counting('joint{}_dry_friction'))

    @property
    def stiffnesses(self) -> tuple[float, ...]:
        """Return the stiffnesses of the springs of the joints [N m/rad], as they count."""
        return self._counting('joint{}_stiffness')

    @property
    def preloads(self) -> tuple[float, ...]:
        """Return their torques with all angles at zero [N m], as they count."""
        return self._counting('joint{}_preload')

    def estimated(self, values: Mapping[str, float]) -> 'PendulumParameters':
        """
        Return the same bodies as they are estimated to be.

        A centre that is given goes with the length of its link, an inertia with m l² and its
        factor.
        """
        changed: dict[str, Any] = dict(values)
        for i, factor in enumerate(self.inertia_factors, 1):
            mass, length = (values.get(name, getattr(self, name)) / getattr(self, name)
                            for name in (f'link{i}_mass', f'link{i}_length'))
            if centre := getattr(self, f'link{i}_centre'):
                changed.setdefault(f'link{i}_centre', centre * length)
            if inertia := getattr(self, f'link{i}_inertia'):
                times = changed.pop(f'link{i}_inertia_factor', factor) / factor
                changed.setdefault(f'link{i}_inertia', inertia * mass * length ** 2 * times)
        return dataclasses.replace(self, **changed)

    @property
    def by_name(self) -> dict[str, Any]:
        """Return the parameters that a pendulum with so many links has, by name."""
        return {field.name: getattr(self, field.name)
                for field in fields_of(type(self), self.links)}

    def _counting(self, name: str) -> tuple[float, ...]:
        return tuple(self.lightness * each for each in self._of_links(name))

    def _of_links(self, name: str) -> tuple[float, ...]:
        return tuple(getattr(self, name.format(i)) for i in range(1, self.links + 1))


@dataclasses.dataclass(frozen=True)
class DriveParameters(Parameters):
    """What lies between a command and the force on the cart; see pendulum/drive.py."""

    actuation_delay: float = parameter(
        0.0, 'time until a command begins to act', unit='s', minimum=0.0, maximum=1.0)
    motor_time_constant: float = parameter(
        0.0, 'time constant of the first-order lag with which the force follows', unit='s',
        minimum=0.0, maximum=1.0)
    force_gain: float = parameter(
        1.0, 'force on the cart per command: 1 where commands are forces, in N/V where voltages; '
        'of accelerations and velocities the share that the cart makes of them',
        minimum=1e-2, maximum=100.0)
    force_bias: float = parameter(
        0.0, 'lasting force on the cart beside the commanded one, of a tilted track for one; the '
        'drive velocity holds against it, so there the mpc is told none',
        unit='N')


@dataclasses.dataclass(frozen=True)
class RhythmParameters(Parameters):
    """What a plant announces that others rely on: when its states come, and what it takes."""

    rate: float = parameter(20.0, 'states published per second', unit='Hz', minimum=1.0,
                            maximum=1000.0)
    lockstep: bool = parameter(
        False, 'wait for one force after each state instead of running in real time', live=False)
    delay: float = parameter(0.0, 'age of a measurement when it is published', unit='s',
                             minimum=0.0, maximum=1.0)
    disturbance_limit: float = parameter(
        100.0, 'a disturbance is refused where those of a period would exceed this', unit='N',
        minimum=0.0, scaled=True)


class Drive(NamedTuple):
    """The numbers of a drive; the default is none, F = u."""

    delay: float = 0.0          # [s]
    time_constant: float = 0.0  # [s]
    gain: float = 1.0
    bias: float = 0.0           # [N]

    @classmethod
    def of(cls, parameters: DriveParameters) -> 'Drive':
        """Return the drive of some parameters."""
        return cls(parameters.actuation_delay, parameters.motor_time_constant,
                   parameters.force_gain, parameters.force_bias)


DIRECT = Drive()


@dataclasses.dataclass(frozen=True)
class LimitParameters(Parameters):
    """What the actuator and the track allow; plant and controller should have the same."""

    force_limit: float = parameter(
        20.0, 'largest command, either way; the force on the cart is force_gain times as large, '
        'so with a gain in N/V this is in V', unit='N', minimum=0.0, finite=False, scaled=True)
    track_limit: float = parameter(
        2.4, 'the cart stays within this distance of the centre', unit='m', minimum=1e-3,
        finite=False, scaled=True)
    acceleration_limit: float = parameter(
        20.0, 'largest acceleration of the cart, either way, of the drives acceleration and '
        'velocity, whose limit this is instead of force_limit', unit='m/s^2', minimum=0.0,
        finite=False, scaled=True)
    cart_speed_limit: float = parameter(
        math.inf, 'speed of the cart that plans keep below, and no command of the drive velocity '
        'exceeds; see controlled_stop, too', unit='m/s', minimum=0.01, finite=False)

    def input_limit(self, drive: str) -> float:
        """Return the largest command of a drive; of velocities, how fast they change [m/s²]."""
        return self.acceleration_limit if drive in DRIVEN else self.force_limit

    def applied_limit(self, drive: str) -> float:
        """Return the largest force [N] or acceleration [m/s²] that acts; inf where voltages do."""
        return math.inf if drive == VOLTAGE else self.input_limit(drive)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the filter estimates beside the state: the numbers of pendulum and drive.

Masses, lengths, inertias and the gain are never negative, so the logarithms of what they are in
their nominal values are estimated; of all others, what they are above theirs. Motion tells the
masses and the gain in common alone: with twice of all it is the same. What tells them apart is how
uncertain each of them is at first; likewise mass, length and inertia of the last link.

The chain is a general one. With mass beside the line of its joints, as of a bent link, or an
encoder whose zero is elsewhere, a link stands balanced at another angle than zero. Counted from
there it moves as one that has neither, but for the phase of its coupling with the next, which is
off by the angle between the line of the joints and that to the centre of all that it carries.
Cables and bushings are springs at its joints.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.parameters import fields_of, parameter, Parameters
from dp_swing_ros.pendulum.equations import coefficients, Pendulum
from dp_swing_ros.pendulum.parameters import (
    Drive, DriveParameters, PendulumParameters, SPRINGS)
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import SAME, Units

LARGEST_FACTOR = 2.0   # of a mass, a length or the gain, either way
LARGEST_BALANCE = 0.3  # [rad] either way
LONGEST = 0.2          # [s] scaled, of a delay or a time constant
FRICTIONS = 'N s/m, N m s/rad'


@dataclass(frozen=True)
class UnknownsParameters(Parameters):
    """How uncertain pendulum and drive are at first, in standard deviations; zero is certain."""

    body_error: float = parameter(
        0.15, 'standard deviation of masses and lengths, as a share', minimum=0.0)
    inertia_error: float = parameter(
        0.15, 'standard deviation of moments of inertia, as a share of those of rods as long and '
        'heavy', minimum=0.0)
    gain_error: float = parameter(
        0.2, 'standard deviation of the force gain, as a share', minimum=0.0)
    friction_error: float = parameter(
        0.05, 'standard deviation of the frictions', unit=FRICTIONS, minimum=0.0, scaled=True)
    cart_dry_friction_error: float = parameter(
        2.0, 'standard deviation of the dry friction of the cart', unit='N', minimum=0.0,
        scaled=True)
    joint_dry_friction_error: float = parameter(
        0.06, 'standard deviation of the dry frictions of the joints', unit='N m', minimum=0.0,
        scaled=True)
    balance_error: float = parameter(
        0.03, 'standard deviation of the angles at which links stand balanced: the zero of an '
        'encoder, or mass beside the line of the joints', unit='rad', minimum=0.0)
    stiffness_error: float = parameter(
        0.3, 'standard deviation of the stiffnesses of springs at the joints, as of cables, once '
        'the motion shows that something is missing', unit='N m/rad', minimum=0.0, scaled=True)
    preload_error: float = parameter(
        1.0, 'standard deviation of the torques of these springs with all angles at zero',
        unit='N m', minimum=0.0, scaled=True)
    delay_error: float = parameter(
        0.02, 'standard deviation of the actuation delay', unit='s', minimum=0.0,
        scaled=True)
    lag_error: float = parameter(
        0.02, 'standard deviation of the time constant of the motor', unit='s', minimum=0.0,
        scaled=True)
    force_bias: float = parameter(
        3.0, 'standard deviation of a lasting force beside the one sent', unit='N', minimum=0.0,
        scaled=True)


class Unknowns:
    """
    Names, nominal values, standard deviations at first and bounds of the unknowns p.

    Shapes: nominal, deviations, sizes, lowest and highest (m,) with m = 8n + 7. The first so many
    `factors` are logarithms of ratios; the last three belong to the drive, the very last is a
    force. `sizes` are how many times larger each is than with the default bodies, `counts` how
    many times larger each counts than its parameter says; see PendulumParameters.lightness.
    """

    def __init__(self, physical: PendulumParameters, drive: Drive, about: UnknownsParameters,
                 scale: Units = SAME) -> None:
        """Take the nominal pendulum and drive, how uncertain they are, and the scale."""
        n = physical.links
        count = range(1, n + 1)
        self.names = [
            'cart_mass', *(f'link{i}_{each}' for each in ('mass', 'length', 'inertia_factor')
                           for i in count), 'force_gain',
            'cart_friction', *(f'joint{i}_friction' for i in count),
            'cart_dry_friction', *(f'joint{i}_dry_friction' for i in count),
            *(f'link{i}_balance' for i in count),
            *(f'joint{i}_{each}' for each in SPRINGS for i in count),
            'actuation_delay', 'motor_time_constant', 'force_bias']
        self.factors = 3 * n + 2
        self.of_springs = np.array([name.rpartition('_')[2] in SPRINGS for name in self.names])
        self.of_pendulum = np.array([hasattr(physical, name) for name in self.names])
        self.nominal = np.array([
            *physical.masses, *physical.lengths, *physical.inertia_factors, drive.gain,
            *physical.frictions, *physical.dry_frictions, *[0.0] * n,
            *physical.stiffnesses, *physical.preloads,
            drive.delay, drive.time_constant, drive.bias])
        of_links = [physical.lightness] * n
        self.counts = np.array([
            physical.masses[0] / physical.cart_mass, *of_links, *[1.0] * (2 * n + 1),
            1.0, *of_links, 1.0, *of_links, *[1.0] * n, *of_links * 2, *[1.0] * 3])
        is_factor = np.arange(len(self.names)) < self.factors
        self.deviations = np.where(is_factor, 1.0, self.counts) * [
            *[about.body_error] * (2 * n + 1), *[about.inertia_error] * n, about.gain_error,
            *scale.each_joint(about.friction_error, FRICTIONS, n),
            about.cart_dry_friction_error, *[about.joint_dry_friction_error] * n,
            *[about.balance_error] * n, *[about.stiffness_error] * n,
            *[about.preload_error] * n, about.delay_error, about.lag_error, about.force_bias]
        if physical.is_driven:   # no motion tells them
            self.deviations[[name.startswith('cart_') for name in self.names]] = 0.0
        self.sizes = np.where(is_factor, 1.0,
                              self.counts * np.array(sizes_of(self.names, n, scale)))
        longest = scale.sized(LONGEST, 's')
        frictions = slice(self.factors, self.factors + 2 * n + 2)
        self.highest = np.array([
            *[math.log(LARGEST_FACTOR)] * self.factors, *[math.inf] * (2 * n + 2),
            *[LARGEST_BALANCE] * n, *[math.inf] * 2 * n, longest, longest, math.inf])
        self.lowest = np.array([
            *-self.highest[:self.factors], *-self.nominal[frictions], *[-LARGEST_BALANCE] * n,
            *np.negative(physical.stiffnesses), *[-math.inf] * n,
            *-self.nominal[-3:-1], -math.inf])
        self.constants = np.array([physical.gravity, *physical.centres])

    def values(self, p: Array) -> dict[str, float]:
        """Return the parameters that p (m,) stands for, by name."""
        b = np.empty(len(p))
        write_values(self.nominal, self.factors, p, b)
        return dict(zip(self.names, (b / self.counts).tolist()))

    def of(self, physical: PendulumParameters) -> Array:
        """Return the p (m,) of a pendulum, with the nominal drive."""
        factors = {f'link{i}_inertia_factor': factor
                   for i, factor in enumerate(physical.inertia_factors, 1)}
        b = self.counts * np.array([factors.get(name, getattr(physical, name, nominal))
                                    for name, nominal in zip(self.names, self.nominal)])
        with np.errstate(divide='ignore', invalid='ignore'):
            logarithms = np.log(b / self.nominal)
        return np.where(np.arange(len(b)) < self.factors, logarithms, b - self.nominal)


def sizes_of(names: Sequence[str], links: int, scale: Units) -> list[float]:
    """Return how many times larger parameters are than with the default bodies."""
    units = {field.name: field.metadata['unit'] for kind in (PendulumParameters, DriveParameters)
             for field in fields_of(kind, links)}
    return [scale.factor(units.get(name, 'rad')) for name in names]


@kernel
def write_values(nominal, factors, p, b):
    """Write the values b that p stands for; shapes: (m,) each."""
    for i in range(len(nominal)):
        b[i] = nominal[i] * math.exp(p[i]) if i < factors else nominal[i] + p[i]


@unrolled
def model_of(model, b, constants):
    """
    Return the model of another pendulum, or what is learned as it is.

    Shapes: b (m,), constants as of Unknowns (n + 1,).
    """
    if not isinstance(model.pendulum, Pendulum):
        return model
    n = model.pendulum.links
    rest, springs = 3 * n + 2, 6 * n + 4
    return model._replace(pendulum=coefficients(
        [b[i] for i in range(n + 1)], [b[n + 1 + i] for i in range(n)],
        [constants[1 + i] for i in range(n)], [b[2 * n + 1 + i] for i in range(n)], constants[0],
        [b[rest + i] for i in range(n + 1)], [b[rest + n + 1 + i] for i in range(n + 1)],
        model.pendulum.sharpness, [b[springs + i] for i in range(n)],
        [b[springs + n + i] for i in range(n)]))


@kernel
def drive_of(b):
    """Return the drive of values b (m,)."""
    m = len(b)
    n = (m - 7) // 8
    return Drive(b[m - 3], b[m - 2], b[3 * n + 1], b[m - 1])


@kernel
def turn(b, sign, x):
    """Count the angles of a state (2n + 2,) from where links are balanced, or back, in place."""
    n = len(x) // 2 - 1
    for i in range(n):
        x[1 + i] += sign * b[5 * n + 4 + i]

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Rigs that no masses, lengths, frictions and delays describe.

The mass of a link lies beside the line of the joints, as with a bracket or a bent link, or further
along it, as with a weight at the end, or is changed in the middle of a run; a cable pulls the
cart; a motor cogs, a bearing sticks, the rail is tilted, encoders are off.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import math

import numpy as np

from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import angles, Array, DEFAULT_LINKS, to_joints, upright
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.simulation.closed_loop import Controller
from dp_swing_ros.simulation.engines import ENGINES, Motor, MuJoCo

CABLE = 5.0          # [N/m] scaled
COGGING, PITCH = 1.0, 0.02   # [N, m] scaled
STRIBECK = 0.1       # [rad/s] scaled, about which a bearing ceases to stick
STICKING = 2.0       # times the dry friction, at rest
TILT = math.radians(1.0)
CHANGE, ADDED_MASS = 5.0, 0.5   # [s] scaled, and as a share of the mass of the last link
OFF, PLAY = math.radians(2.0), math.radians(1.0)   # of encoders
ZEROS = 5            # before the seed; see scenarios.py


class Uneven(MuJoCo):
    """Links whose centres of mass lie elsewhere than in the middle between their joints."""

    beside, along = 0.0, 0.5   # [m] scaled, and as a share of the length

    def __init__(self, physical: PendulumParameters, limits: LimitParameters,
                 integrator: str) -> None:
        """Take what any engine takes, and move the centres."""
        super().__init__(physical, limits, integrator)
        centres = self.model.body_ipos[2:]   # the first are of the world and the cart
        centres[:, 0] = scale_of(physical).sized(self.beside, 'm')
        centres[:, 2] = self.along * np.array(physical.lengths)
        self.mujoco.mj_setConst(self.model, self.data)


class Beside(Uneven):
    """Links of which the mass lies beside the line of the joints."""

    beside = 0.03


class Along(Uneven):
    """Links of which the mass lies beyond the middle."""

    along = 0.65


class Pulled(MuJoCo):
    """A cart that a cable pulls to the middle of the track."""

    def __init__(self, physical: PendulumParameters, limits: LimitParameters,
                 integrator: str) -> None:
        """Take what any engine takes, and add the cable."""
        super().__init__(physical, limits, integrator)
        self.model.jnt_stiffness[0] = scale_of(physical).sized(CABLE, 'N/m')


class Tilted(MuJoCo):
    """A rail that rises towards +x; angles are from the vertical all the same."""

    def __init__(self, physical: PendulumParameters, limits: LimitParameters,
                 integrator: str) -> None:
        """Take what any engine takes, and turn gravity against the rail."""
        super().__init__(physical, limits, integrator)
        g = physical.gravity
        self.model.opt.gravity[:] = -g * math.sin(TILT), 0.0, -g * math.cos(TILT)

    def advance(self, x: Array, motor: Motor, force: float, target: float, push: float, h: float,
                steps: int) -> tuple[float, float]:
        """Step with angles from what is upright to the rail; see Engine.advance."""
        x[angles(x)] += TILT
        advanced = super().advance(x, motor, force, target, push, h, steps)
        x[angles(x)] -= TILT
        return advanced


class Changed(MuJoCo):
    """A last link with a weight at its end from some time on."""

    def __init__(self, physical: PendulumParameters, limits: LimitParameters,
                 integrator: str) -> None:
        """Take what any engine takes."""
        super().__init__(physical, limits, integrator)
        self.length, self.change_at = physical.lengths[-1], scale_of(physical).sized(CHANGE, 's')

    def advance(self, x: Array, motor: Motor, force: float, target: float, push: float, h: float,
                steps: int) -> tuple[float, float]:
        """Step with the weight or without it; see Engine.advance."""
        if self.data.time > self.change_at - h / 2:
            self.change_at = math.inf
            self.add_weight()
        return super().advance(x, motor, force, target, push, h, steps)

    def add_weight(self) -> None:
        """Add a point mass at the end of the last link."""
        model, mass, centre = self.model, self.model.body_mass[-1], self.model.body_ipos[-1, 2]
        added = ADDED_MASS * mass
        common = (mass * centre + added * self.length) / (mass + added)
        model.body_inertia[-1, :2] += (
            mass * (common - centre) ** 2 + added * (self.length - common) ** 2)
        model.body_mass[-1], model.body_ipos[-1, 2] = mass + added, common
        self.mujoco.mj_setConst(model, self.data)


class Varying(MuJoCo):
    """A force or a friction that goes with the state, and is set for each step."""

    def set_for(self, q: Array, v: Array) -> None:
        """Set it for positions and speeds of the joints; shapes: (n + 1,)."""
        raise NotImplementedError

    def advance(self, x: Array, motor: Motor, force: float, target: float, push: float, h: float,
                steps: int) -> tuple[float, float]:
        """Let MuJoCo step, each step with what is set for it; see Engine.advance."""
        mean = 0.0
        for n in range(steps):
            self.set_for(*map(to_joints, np.split(x, 2)))
            force, acting = super().advance(x, motor, force, target, push, h, 1)
            mean += (acting - mean) / (n + 1)
        return force, mean


class Cogging(Varying):
    """A motor whose magnets pull the cart to and fro along the track."""

    def __init__(self, physical: PendulumParameters, limits: LimitParameters,
                 integrator: str) -> None:
        """Take what any engine takes."""
        super().__init__(physical, limits, integrator)
        scale = scale_of(physical)
        self.strength, self.pitch = scale.sized(COGGING, 'N'), scale.sized(PITCH, 'm')

    def set_for(self, q: Array, v: Array) -> None:
        """Set the force; see Varying."""
        self.data.qfrc_applied[0] = self.strength * math.sin(2 * math.pi * q[0] / self.pitch)


class Sticking(Varying):
    """
    A bearing of joint 1 with more dry friction at low speed.

    Source: Armstrong-Hélouvry, Dupont and Canudas de Wit, "A survey of models, analysis tools and
    compensation methods for the control of machines with friction", Automatica 30, 1994.
    """

    def __init__(self, physical: PendulumParameters, limits: LimitParameters,
                 integrator: str) -> None:
        """Take what any engine takes."""
        super().__init__(physical, limits, integrator)
        self.dry, self.about = (physical.dry_frictions[1],
                                scale_of(physical).sized(STRIBECK, 'rad/s'))

    def set_for(self, q: Array, v: Array) -> None:
        """Set the friction; see Varying."""
        sticking = (STICKING - 1) * math.exp(-(v[1] / self.about) ** 2)
        self.model.dof_frictionloss[1] = self.dry * (1 + sticking)


ADDED: dict[str, type[MuJoCo]] = {
    'beside': Beside, 'along': Along, 'cable': Pulled, 'cogging': Cogging, 'sticking': Sticking,
    'tilted': Tilted, 'changed': Changed}


@contextmanager
def engines() -> Iterator[None]:
    """Let plants be moved by these, too."""
    ENGINES.update(ADDED)
    try:
        yield
    finally:
        for name in ADDED:
            del ENGINES[name]


Encoders = Callable[[Array], Array]   # what they say of a state (2n + 2,)


class Misread:
    """A controller behind encoders."""

    def __init__(self, encoders: Encoders, controller: Controller) -> None:
        """Take both."""
        self.encoders, self.controller = encoders, controller

    def update(self, t: float, x: Array, delay: float) -> Plan:
        """Return its plan for what the encoders say; see Controller."""
        return self.controller.update(t, self.encoders(x), delay)

    def fallback(self, acts_at: float) -> Plan:
        """Return its plan where no state came."""
        return self.controller.fallback(acts_at)


def off_zero(seed: int) -> Encoders:
    """Return encoders at the joints whose zeros are off by OFF, either way by the seed."""
    signs = np.random.default_rng((ZEROS, seed)).choice((-1.0, 1.0), DEFAULT_LINKS)
    offsets = upright(DEFAULT_LINKS)
    offsets[angles(offsets)] = OFF * np.cumsum(signs)   # the angles are sums of the joints'
    return lambda x: x + offsets


class WithPlay:
    """Encoders of which that of joint 1 stays behind until the joint has crossed its play."""

    def __init__(self, seed: int) -> None:
        """Begin in the middle of it, whatever the seed."""
        self.shaft: float | None = None

    def __call__(self, x: Array) -> Array:
        """Return what they say; all angles count from that of link 1."""
        joint = x[1]
        shaft = joint if self.shaft is None else self.shaft
        self.shaft = min(max(shaft, joint - PLAY / 2), joint + PLAY / 2)
        said = x.copy()
        said[angles(x)] += self.shaft - joint
        return said

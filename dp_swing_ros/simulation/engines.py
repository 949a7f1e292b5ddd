# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Engines: what moves the pendulum under a motor's force; our own equations, or MuJoCo.

MuJoCo shares nothing with the models of the controllers: its joints are relative, its dry friction
holds fast, its end stops are springs, and it steps in milliseconds.
"""

import math
from typing import Any, NamedTuple, Protocol

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.drive import lagged
from dp_swing_ros.pendulum.equations import after_impact, Pendulum, scale_of
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model, size, step
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import Array, from_joints, to_joints

CREEP = 0.02          # [m/s, rad/s] scaled, of our own dry friction
MUJOCO_STEP = 1e-3    # [s] scaled, the longest
# of dry friction: what share of a slip is undone, and how soon; else it is weaker when slow
FIRM = 'solimpfriction="0.99 0.99 1e-3" solreffriction="{} 1"'
SLIP = 0.002          # [s] scaled, of that
STOP = 'solreflimit="{} 1" solimplimit="0.9 0.95 {}"'   # an end of the track
REBOUND = 0.02        # [s] scaled, of that, as of any of MuJoCo's limits
DEPTH = 1e-3          # [m] scaled, likewise, in which it is firm
THIN = 1e-3           # of a link's moment of inertia, that about its own axis


class Motor(NamedTuple):
    """
    What a motor does in a step: its force goes a share to the target, or lags behind it.

    One that is a follower gives the cart a speed, which is the target [m/s] and less its gain.
    """

    response: float
    time_constant: float  # [s]
    limit: float          # [N]; of a driven cart, its acceleration [m/s²]
    gain: float
    follows: bool


class Engine(Protocol):
    """Built as ENGINES[name](physical, limits, integrator)."""

    longest_step: float   # [s]

    def advance(self, x: Array, motor: Motor, force: float, target: float, push: float, h: float,
                steps: int) -> tuple[float, float]:
        """
        Advance the state in place by some steps of h [s] under a held target and push [N].

        Returns the last force of the motor, and the mean of what it did to the cart [N]. Shapes: x
        (2n + 2,).
        """


@unrolled
def stopped(model, x):
    """Return the speeds of cart and links after an impact with the end of the track."""
    return tuple(after_impact(model.pendulum, x))


@kernel
def stop_at_end(model, limit, x):
    """
    Bring a cart beyond the end of its track to rest there, by an inelastic impact.

    Shapes: x (2n + 2,), changed.
    """
    if abs(x[0]) <= limit:
        return
    side = math.copysign(1.0, x[0])
    x[0] = side * limit
    cart = size(model) // 2
    if side * x[cart] > 0:
        speeds = stopped(model, x)
        for i in range(len(speeds)):
            x[cart + i] = speeds[i]


@kernel
def motor_step(motor, speed, force, target, h):
    """Return the motor's force after a step [s], and its mean over it, at a speed of the cart."""
    if motor.follows:
        change, _ = lagged(0.0, target - speed / motor.gain, motor.time_constant, h)
        force = min(max(change / h, -motor.limit), motor.limit)
        return force, force
    if motor.time_constant > 0:
        return lagged(force, target, motor.time_constant, h)
    # in this form a response of 1 gives the target to the bit
    force = (1 - motor.response) * force + motor.response * target
    force = min(max(force, -motor.limit), motor.limit)
    return force, force


@kernel
def integrate(model, motor, track_limit, x, force, target, push, steps):
    """Advance the state between the end stops; see Engine.advance."""
    mean = 0.0
    for n in range(steps):
        force, acting = motor_step(motor, x[size(model) // 2], force, target, model.h)
        acting *= motor.gain
        mean += (acting - mean) / (n + 1)
        step(model, x, acting + push, x)
        stop_at_end(model, track_limit, x)
    return force, mean


class Own:
    """Our own equations and integrators."""

    longest_step = math.inf

    def __init__(self, physical: PendulumParameters, limits: LimitParameters,
                 integrator: str) -> None:
        """Take the physical parameters, the end of the track, and how to integrate."""
        self.pendulum = Pendulum.of(physical, CREEP)
        self.integrator, self.track_limit = INTEGRATORS[integrator], limits.track_limit

    def advance(self, x: Array, motor: Motor, force: float, target: float, push: float, h: float,
                steps: int) -> tuple[float, float]:
        """Integrate; see Engine.advance."""
        last, mean = integrate(Model(self.pendulum, self.integrator, h), motor, self.track_limit,
                               x, force, target, push, steps)
        return last, mean


class MuJoCo:
    """The engine of that name."""

    def __init__(self, physical: PendulumParameters, limits: LimitParameters,
                 integrator: str) -> None:
        """Take the physical parameters and the end of the track; MuJoCo integrates its own way."""
        try:
            import mujoco
        except ModuleNotFoundError:
            raise ParameterError("parameter engine is 'mujoco', which is not installed; pip "
                                 'install mujoco, or choose engine own') from None
        self.mujoco: Any = mujoco
        self.longest_step = scale_of(physical).sized(MUJOCO_STEP, 's')
        self.model = mujoco.MjModel.from_xml_string(mjcf(physical, limits))
        self.data = mujoco.MjData(self.model)
        self.data.qfrc_applied[1:] = physical.preloads

    def advance(self, x: Array, motor: Motor, force: float, target: float, push: float, h: float,
                steps: int) -> tuple[float, float]:
        """Let MuJoCo step; see Engine.advance."""
        data, mean = self.data, 0.0
        data.qpos[:], data.qvel[:] = map(to_joints, np.split(x, 2))
        self.model.opt.timestep = h
        for n in range(steps):
            force, acting = motor_step(motor, data.qvel[0], force, target, h)
            acting *= motor.gain
            mean += (acting - mean) / (n + 1)
            data.ctrl[0] = acting + push
            self.mujoco.mj_step(self.model, data)
        x[:] = np.concatenate((from_joints(data.qpos), from_joints(data.qvel)))
        return force, mean


def mjcf(physical: PendulumParameters, limits: LimitParameters) -> str:
    """Return the pendulum as MuJoCo's XML: x to the right, z up, angles about y."""
    n, scale = physical.links, scale_of(physical)
    damping, dry = physical.frictions, physical.dry_frictions
    firm = FIRM.format(scale.sized(SLIP, 's'))
    stop = STOP.format(scale.sized(REBOUND, 's'), scale.sized(DEPTH, 'm'))
    ends = (f'limited="true" range="{-limits.track_limit} {limits.track_limit}" {stop}'
            if math.isfinite(limits.track_limit) else '')
    m_0 = physical.masses[0]
    text, at = '', '0 0 0'
    for i in range(n):
        m, length = physical.masses[i + 1], physical.lengths[i]
        inertia = physical.inertia_factors[i] * m * length ** 2 / 12
        text += (f'<body pos="{at}"><joint type="hinge" axis="0 1 0" damping="{damping[i + 1]}" '
                 f'frictionloss="{dry[i + 1]}" stiffness="{physical.stiffnesses[i]}" {firm}/>'
                 f'<inertial pos="0 0 {physical.centres[i] * length}" mass="{m}" '
                 f'diaginertia="{inertia} {inertia} {inertia * THIN}"/>')
        at = f'0 0 {length}'
    return (f'<mujoco><option gravity="0 0 {-physical.gravity}" integrator="implicitfast">'
            '<flag contact="disable"/></option><worldbody><body><joint name="cart" type="slide" '
            f'axis="1 0 0" damping="{damping[0]}" frictionloss="{dry[0]}" '
            f'{firm} {ends}/><inertial pos="0 0 0" mass="{m_0}" diaginertia="{m_0} {m_0} {m_0}"/>'
            f'{text}{"</body>" * n}</body></worldbody><actuator><motor joint="cart"/></actuator>'
            '</mujoco>')


ENGINES: dict[str, type[Own] | type[MuJoCo]] = {'own': Own, 'mujoco': MuJoCo}

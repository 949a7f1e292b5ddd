#!/usr/bin/env python3
# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A pendulum rig that knows dp_swing_ros by its topics alone: rclpy, MuJoCo and default QoS.

It hangs until the first force, keeps wall time (or its own, with --clock), can misbehave as
sensors and drivers do, and writes at its end what happened as one line of JSON. Bodies, drive and
sensors are ideal or, with --plausible, those of config/rig.yaml. By hand:

    ros2 run dp_swing_ros mpc & python benchmarks/foreign_plant.py --stamp-offset 0.05; kill %1
"""

import argparse
from collections import deque
import json
import math
from pathlib import Path
import sys
import time
from typing import NamedTuple

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
import mujoco
import numpy as np
import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.utilities import remove_ros_args
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

FORCE_LIMIT = 20.0      # [N] of the drive
COMMAND_TIMEOUT = 0.25  # [s] after which the drive lets the force go
CLOCK_RATE = 200.0      # [Hz] of /clock, in simulated time
SAMPLE = 10             # steps between two rows of the record
PATIENCE = 15.0         # [s] of wall time for the first force
LAST_SECOND = 1.0       # [s] in which it must have been upright

# Uniform thin rods; the tip of the first carries the second. Dry friction holds firmly.
MJCF = """
<mujoco model="rig">
  <option timestep="0.001" integrator="RK4" gravity="0 0 -9.81">
    <flag contact="disable"/>
  </option>
  <default>
    <joint solreffriction="0.002 1" solimpfriction="0.99 0.99 0.001"/>
  </default>
  <worldbody>
    <body name="cart">
      <joint name="cart" type="slide" axis="1 0 0" range="-2.4 2.4" limited="true"
             solreflimit="0.004 1" frictionloss="{cart_friction}"/>
      <inertial pos="0 0 0" mass="{masses[0]}" diaginertia="0.01 0.01 0.01"/>
      <body name="lower">
        <joint name="shoulder" type="hinge" axis="0 1 0" frictionloss="{joint_friction}"/>
        <inertial pos="0 0 {middles[0]}" mass="{masses[1]}"
                  diaginertia="{rods[0]} {rods[0]} 1e-5"/>
        <body name="upper" pos="0 0 {lengths[0]}">
          <joint name="elbow" type="hinge" axis="0 1 0" frictionloss="{joint_friction}"/>
          <inertial pos="0 0 {middles[1]}" mass="{masses[2]}"
                    diaginertia="{rods[1]} {rods[1]} 1e-5"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="drive" joint="cart"/></actuator>
</mujoco>"""

PULLEY = 0.2   # [m] of the cart's way in a turn of its encoder
JOINTS = ['cart', 'joint1', 'joint2']
EXTRA = {'gripper': (0.04, 0.0), 'lift': (1.2, -0.1)}   # position and velocity
FAULTS = ('silence', 'nan', 'frozen', 'wrong_names', 'wrong_lengths', 'outlier_constant',
          'outlier_random')


class Hardware(NamedTuple):
    """What a rig is built of; by default, ideal."""

    masses: tuple[float, float, float] = (1.0, 0.5, 0.5)   # [kg] of the cart and the links
    lengths: tuple[float, float] = (1.0, 1.0)              # [m]
    cart_friction: float = 0.0    # [N] dry
    joint_friction: float = 0.0   # [N m] dry
    delay: float = 0.0            # [s] from a command to where it begins to act
    lag: float = 0.0              # [s] time constant of the motor
    counts: int = 0               # of the encoders in a turn, 0 for exact positions
    differenced: bool = False     # whether velocities are differences of positions

    def mjcf(self) -> str:
        """Return the pendulum as MuJoCo's XML."""
        return MJCF.format(
            **self._asdict(), middles=[length / 2 for length in self.lengths],
            rods=[m * length ** 2 / 12 for m, length in zip(self.masses[1:], self.lengths)])


IDEAL = Hardware()
# as in config/rig.yaml
PLAUSIBLE = Hardware(masses=(1.1, 0.45, 0.55), lengths=(1.0, 1.05), cart_friction=1.0,
                     joint_friction=0.01, delay=0.005, lag=0.010, counts=4096, differenced=True)


class Drive:
    """The motor: a command acts late, and the force lags behind it; in steps of 1 ms."""

    def __init__(self, hardware: Hardware) -> None:
        """Begin without a force."""
        self.delay = round(hardware.delay * 1000)   # steps
        self.share = -math.expm1(-1e-3 / hardware.lag) if hardware.lag else 1.0
        self.coming: deque[tuple[int, float]] = deque()   # the step at which each command acts
        self.target = self.force = 0.0   # [N]
        self.expires = 0                 # step at which the target is let go

    def send(self, step: int, force: float) -> None:
        """Take a command [N] at a step."""
        self.coming.append((step + self.delay, force))

    def advance(self, step: int) -> float:
        """Return the force [N] of the next step."""
        while self.coming and self.coming[0][0] <= step:
            begins, self.target = self.coming.popleft()
            self.expires = begins + round(COMMAND_TIMEOUT * 1000)
        if step >= self.expires:
            self.target = 0.0
        self.force += self.share * (self.target - self.force)
        return self.force


class Pendulum:
    """The cart and links in MuJoCo, whose elbow measures θ2 - θ1."""

    def __init__(self, seed: int, hardware: Hardware = IDEAL) -> None:
        """Hang, but for a tiny disturbance."""
        self.model = mujoco.MjModel.from_xml_string(hardware.mjcf())
        self.data = mujoco.MjData(self.model)
        self.set_state(np.array([0, math.pi, math.pi, 0, 0, 0])
                       + np.random.default_rng(seed).normal(0, 1e-3, 6))

    def set_state(self, x: np.ndarray) -> None:
        """Take [x, θ1, θ2, ẋ, θ̇1, θ̇2], both angles from the upward vertical; x (6,)."""
        self.data.qpos[:] = x[0], x[1], x[2] - x[1]
        self.data.qvel[:] = x[3], x[4], x[5] - x[4]

    def state(self) -> np.ndarray:
        """Return what `set_state` takes, (6,)."""
        return np.concatenate((absolute(self.data.qpos), absolute(self.data.qvel)))

    def counted(self, counts: int) -> np.ndarray:
        """Return [x, θ1, θ2] as encoders at the joints count it in a turn, (3,)."""
        unit = np.array([PULLEY, math.tau, math.tau]) / counts
        return absolute(np.round(self.data.qpos / unit) * unit)

    def accelerations(self, force: float) -> np.ndarray:
        """Return ẍ, θ̈1, θ̈2 under a force [N], (3,)."""
        self.data.ctrl[0] = force
        mujoco.mj_forward(self.model, self.data)
        return absolute(self.data.qacc)

    def step(self, force: float) -> None:
        """Advance by a millisecond under a force [N]."""
        self.data.ctrl[0] = force
        mujoco.mj_step(self.model, self.data)


class Sensors:
    """What the driver reads of a pendulum."""

    def __init__(self, hardware: Hardware, pendulum: Pendulum) -> None:
        """Begin at rest."""
        self.hardware, self.pendulum = hardware, pendulum
        self.t, self.q, self.v = 0.0, self.positions(), np.zeros(3)   # the last that were read

    def positions(self) -> np.ndarray:
        """Return [x, θ1, θ2], (3,)."""
        counts = self.hardware.counts
        return self.pendulum.counted(counts) if counts else self.pendulum.state()[:3]

    def read(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities at a time [s], each (3,)."""
        q, v = self.positions(), self.pendulum.state()[3:]
        if self.hardware.differenced:
            # the tick after a late one may fall on the same step
            v = (q - self.q) / (t - self.t) if t > self.t else self.v
        self.t, self.q, self.v = t, q, v
        return q, v


def absolute(q: np.ndarray) -> np.ndarray:
    """Return cart, shoulder and elbow as x, θ1 and θ2, or their derivatives, (3,)."""
    return np.array([q[0], q[1], q[1] + q[2]])


class Record:
    """What happened; times [s] count from the first force that is not zero."""

    def __init__(self) -> None:
        """Begin empty."""
        self.states: list[list[float]] = []   # t, x, θ1, θ2, ẋ, θ̇1, θ̇2, force applied
        self.forces: list[list[float]] = []   # t, force, wall time since the last state
        self.reports: list[tuple[float, str, int, str]] = []   # t, name, level, message
        self.began = math.nan
        self.fault_began = self.fault_ended = math.nan
        self.upright_since = math.nan
        self.gaps: list[float] = []           # [s] of wall time between two ticks

    def add_state(self, t: float, x: np.ndarray, force: float) -> None:
        """Take a row, and note since when it is upright."""
        self.states.append([t, *x.tolist(), force])
        angles = np.remainder(x[1:3] + math.pi, 2 * math.pi) - math.pi
        upright = np.abs(angles).max() < 0.1 and np.abs(x[3:]).max() < 1.0
        if not upright:
            self.upright_since = math.nan
        elif math.isnan(self.upright_since):
            self.upright_since = t

    def add_force(self, t: float, force: float, wait: float) -> None:
        """Take a force that was received; time begins with the first that is not zero."""
        if math.isnan(self.began) and force != 0.0:
            self.began = t
        self.forces.append([t, force, wait])

    def stay(self, t: float) -> float:
        """Return for how long [s] it has been upright, since the end of a fault."""
        latest = np.nanmax([self.upright_since, self.fault_ended, self.began])
        return 0.0 if math.isnan(self.upright_since) else float(t - latest)

    def zero_after(self) -> float | None:
        """Return the time from a fault to the first zero force with none but zeros after it."""
        during = [(t, force) for t, force, _ in self.forces
                  if self.fault_began <= t < np.nanmin([self.fault_ended, math.inf])]
        last = max((t for t, force in during if force != 0.0), default=-math.inf)
        zeros = [t for t, force in during if force == 0.0 and t > last]
        return zeros[0] - self.fault_began if zeros else None

    def summary(self, end: float, period: float) -> dict:
        """Return the figures of the run, which ended at t."""
        forces = [abs(force) if math.isfinite(force) else math.inf for _, force, _ in self.forces]
        waits = [wait for _, _, wait in self.forces]
        upright = end - self.upright_since >= LAST_SECOND
        return {
            'began': not math.isnan(self.began),
            'upright': upright,
            'settling': self.upright_since - self.began if upright else None,
            'largest_position': max(
                (abs(row[1]) for row in self.states if row[0] >= self.began), default=0.0),
            'largest_force': max(forces, default=0.0),
            'zero_after': self.zero_after(),
            'recovery': max(self.upright_since - self.fault_ended, 0.0)
            if upright and not math.isnan(self.fault_ended) else None,
            'fault_began': known(self.fault_began - self.began),
            'fault_ended': known(self.fault_ended - self.began),
            'ticks': len(self.gaps), 'late_ticks': sum(gap > 1.5 * period for gap in self.gaps),
            'largest_lateness': max(self.gaps, default=period) - period,
            'jitter': float(np.percentile(np.abs(np.array(self.gaps) - period), 95))
            if self.gaps else None,
            'median_wait': float(np.median(waits)) if waits else None}

    def rows(self) -> dict:
        """Return the time series, with times from the first force."""
        zero = 0.0 if math.isnan(self.began) else self.began
        return {name: [[round(t - zero, 6), *rest] for t, *rest in getattr(self, name)]
                for name in ('states', 'forces', 'reports')}


def known(number: float) -> float | None:
    """Return a number, None for NaN."""
    return None if math.isnan(number) else number


class Rig(Node):
    """The driver: publishes the state at a rate and applies the force when it comes."""

    def __init__(self, options: argparse.Namespace) -> None:
        """Offer the topics and start the clock."""
        super().__init__('rig')
        self.options, self.record = options, Record()
        self.random = np.random.default_rng([options.seed, 1])
        hardware = PLAUSIBLE if options.plausible else IDEAL
        hardware = hardware._replace(delay=hardware.delay + options.delay)
        self.pendulum, self.drive = Pendulum(options.seed, hardware), Drive(hardware)
        self.sensors = Sensors(hardware, self.pendulum)
        self.steps = 0
        self.joints = JOINTS + list(EXTRA) if options.permute else list(JOINTS)
        if options.permute:
            self.random.shuffle(self.joints)
        self.good = JointState()   # the last one without a fault
        self.states = self.create_publisher(JointState, 'joint_states', self.quality())
        self.create_subscription(Float64, 'force_command', self.on_force, 10)
        self.create_subscription(DiagnosticArray, '/diagnostics', self.on_diagnostics, 10)
        self.speed = options.clock or 1.0   # simulated seconds in one of wall time
        self.started = self.ticked = time.monotonic()
        self.finished = False
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        if options.clock:
            self.clocks = self.create_publisher(ClockMessage, '/clock', 10)
            self.create_timer(1 / (CLOCK_RATE * self.speed), self.on_clock, clock=steady)
        self.create_timer(1 / (options.rate * self.speed), self.on_tick, clock=steady)

    def quality(self) -> QoSProfile | int:
        """Return the quality of service of the states; by default, rclpy's."""
        if self.options.best_effort:
            return QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        if self.options.transient_local:
            return QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        return 10

    def time(self) -> float:
        """Return the time [s] since the start, as the rig's clock has it."""
        return (time.monotonic() - self.started) * self.speed

    def advance(self) -> float:
        """Step the engine up to now, and return the time [s] that they have reached."""
        for step in range(self.steps, int(self.time() * 1000)):
            force = self.drive.advance(step)
            if step % SAMPLE == 0:
                self.record.add_state(step / 1000, self.pendulum.state(), force)
            self.pendulum.step(force)
            self.steps = step + 1
        return self.steps / 1000

    def on_force(self, message: Float64) -> None:
        """Apply a force, within what the drive can do."""
        t, force = self.advance(), message.data
        self.drive.send(self.steps, min(max(force, -FORCE_LIMIT), FORCE_LIMIT)
                        if math.isfinite(force) else 0.0)
        self.record.add_force(t, force, time.monotonic() - self.ticked)

    def on_diagnostics(self, message: DiagnosticArray) -> None:
        """Record what others report."""
        self.record.reports += [(self.time(), status.name, status.level[0], status.message)
                                for status in message.status]

    def on_clock(self) -> None:
        """Publish simulated time."""
        self.clocks.publish(ClockMessage(clock=to_time(self.time())))

    def on_tick(self) -> None:
        """Publish a state, or what a fault makes of it."""
        now = time.monotonic()
        self.record.gaps.append(now - self.ticked)
        self.ticked = now
        t = self.advance()
        message = self.measure(t)
        if self.is_faulty(t):
            message = self.spoil(message)
        else:
            self.good = message
        if message is not None:
            self.states.publish(message)
        self.finished = self.is_over(t)

    def measure(self, t: float) -> JointState:
        """Return the state as the sensors have it, with the stamp that this driver gives it."""
        q, v = self.sensors.read(t)
        values = {**dict(zip(JOINTS, zip(q.tolist(), v.tolist()))), **EXTRA}
        message = JointState(name=list(self.joints),
                             position=[values[joint][0] for joint in self.joints],
                             velocity=[values[joint][1] for joint in self.joints])
        if self.options.stamps == 'now':
            # when it would have been read: stepping the engine up to now takes a while
            now = self.get_clock().now().nanoseconds / 1e9
            zero = t if self.options.clock else now - (self.time() - t)
            message.header.stamp = to_time(zero - self.options.stamp_offset)
        return message

    def is_faulty(self, t: float) -> bool:
        """Return whether the sensor fails at t, and note when that begins and ends."""
        record, options = self.record, self.options
        if options.fault is None:
            return False
        since = t - record.began - options.fault_at   # NaN before the first force
        if math.isnan(record.fault_began) and since >= 0:
            record.fault_began = t
        if math.isnan(record.fault_ended) and since >= options.fault_for:
            record.fault_ended = t
        return not math.isnan(record.fault_began) and math.isnan(record.fault_ended)

    def spoil(self, message: JointState) -> JointState | None:
        """Return what a failing sensor makes of a message, None for nothing."""
        joint1 = message.name.index('joint1')
        match self.options.fault:
            case 'silence':
                return None
            case 'nan':
                message.position[joint1] = math.nan
            case 'frozen':
                message.position, message.velocity = self.good.position, self.good.velocity
            case 'wrong_names':
                message.name = [f'axis_{number}' for number in range(len(message.name))]
            case 'wrong_lengths':
                message.position = message.position[:-1]
            case 'outlier_constant':
                message.position[joint1] = 1e6
            case 'outlier_random':
                message.position, message.velocity = self.random.normal(
                    0, 1e3, (2, len(message.name))).tolist()
        return message

    def is_over(self, t: float) -> bool:
        """Return whether the run has lasted long enough."""
        record, options = self.record, self.options
        if math.isnan(record.began):
            return t / self.speed > PATIENCE
        waiting = options.fault is not None and math.isnan(record.fault_ended)
        held = options.hold > 0 and not waiting and record.stay(t) >= options.hold
        return held or t - record.began >= options.duration


def to_time(t: float) -> Time:
    """Return seconds as a stamp."""
    second, nanosecond = divmod(round(t * 1e9), 1_000_000_000)
    return Time(sec=second, nanosec=nanosecond)


def parse() -> argparse.Namespace:
    """Return the options of the command line, ROS's own left out."""
    parser = argparse.ArgumentParser(description=__doc__.strip().split('\n\n')[0])
    parser.add_argument('--output', type=Path, help='file for the JSON; by default, printed')
    parser.add_argument('--seed', type=int, default=0, help='of the disturbance at the start')
    parser.add_argument('--duration', type=float, default=10.0, help='[s] from the first force')
    parser.add_argument('--hold', type=float, default=0.0,
                        help='[s] upright after which to end early; 0: never')
    parser.add_argument('--rate', type=float, default=20.0, help='states/s')
    parser.add_argument('--plausible', action='store_true',
                        help='other bodies, dry friction, a lagging drive, encoders')
    parser.add_argument('--delay', type=float, default=0.0,
                        help='[s] by which commands act later still')
    parser.add_argument('--stamps', choices=('now', 'zero'), default='now')
    parser.add_argument('--stamp-offset', type=float, default=0.0,
                        help='[s] by which stamps lie in the past, though the state is fresh')
    parser.add_argument('--best-effort', action='store_true')
    parser.add_argument('--transient-local', action='store_true')
    parser.add_argument('--permute', action='store_true',
                        help='shuffle the joints, and add two that are not of the pendulum')
    parser.add_argument('--clock', type=float, metavar='FACTOR',
                        help='publish /clock: simulated seconds in one of wall time')
    parser.add_argument('--fault', choices=FAULTS, help='what becomes of the sensor')
    parser.add_argument('--fault-at', type=float, default=1.0, help='[s] from the first force')
    parser.add_argument('--fault-for', type=float, default=1.5, help='[s]')
    return parser.parse_args(remove_ros_args(sys.argv)[1:])


def main() -> None:
    """Run until the end, or a signal, and write what happened."""
    options = parse()
    rclpy.init()
    rig = Rig(options)
    executor = SingleThreadedExecutor()
    executor.add_node(rig)
    try:
        while not rig.finished:
            executor.spin_once(timeout_sec=0.1)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    summary = rig.record.summary(rig.steps / 1000, 1 / (options.rate * rig.speed))
    if options.output is None:
        print(json.dumps(summary))
    else:
        options.output.write_text(json.dumps({**summary, **rig.record.rows()}))
    rig.destroy_node()
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()

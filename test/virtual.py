# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A controller in virtual time, and a plant: what drives them has clocks that are set by hand."""

from itertools import pairwise
import math

import numpy as np
from recorded_runs import told, written
from std_msgs.msg import Float64, String

from dp_swing_ros.control import controllers
from dp_swing_ros.messages.cdr import to_diagnostics
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.messages.fields import BILLION, Report
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.pendulum.state import joints
from dp_swing_ros.runtime.handshake import Peers
from dp_swing_ros.runtime.loading import kind_of
from dp_swing_ros.runtime.mpc import MpcCore
from dp_swing_ros.runtime.plant import PlantCore, State
from dp_swing_ros.runtime.schedule import Arrived
from dp_swing_ros.runtime.sent import Announcement, Force, Planned, Said, Wake
from dp_swing_ros.simulation import plants
from dp_swing_ros.topics import CONFIGURATION, DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES

DAY = 1_700_000_000      # [s] when it begins
AHEAD = 1e9              # [s] of the steady clock; no deadline by it has passed on any machine
TICK = 0.004             # [s] that a tick takes, as the controller takes it
PERIOD = 0.05            # [s] of the driver's states
LEANING = np.array([0.1, 0.02, -0.01, 0.0, 0.05, 0.0])
KNOWN = Peers({'/driver'}, set(), {'/driver'})


class VirtualClocks:
    """Clocks of which time of day and the steady one go together, and a simulated one."""

    def __init__(self, simulated=None):
        self.time, self.simulated_time = 0.0, simulated   # [s] since it began

    @property
    def simulated(self):
        return self.simulated_time is not None

    def now(self):
        return round((DAY + self.time if self.simulated_time is None else self.simulated_time)
                     * BILLION)

    def today(self):
        return DAY + self.time

    def steady(self):
        return AHEAD + self.time

    def sleep(self, duration):
        self.time += duration


class Running:
    """A core that has prepared itself, what it sent, and when it is to be woken."""

    def __init__(self, simulated=None, peers=KNOWN, tick_time=TICK, **parameters):
        self.clocks, self.sent, self.peers = VirtualClocks(simulated), [], peers
        self.reporting = 0.0   # [s] that a report takes
        self.wakes_at, self.numbers = math.inf, {}
        self.left = []   # [s] of time for each solve
        self.senders = set()   # the nodes that publish states
        self.core = MpcCore(controllers.MPC.complete(parameters), self.clocks, self.take,
                            lambda gid: f'/{gid.decode()}', lambda: self.senders)
        self.core.prepare()
        self.core.schedule.tick_time = tick_time
        self.core.controller.update = self.solving(self.core.controller.update)
        self.core.restart()
        self.sent.clear()

    def solving(self, update):
        """Return a solve that takes the time of a tick."""
        def solve(t, x, delay, deadline, time_noise):
            self.left.append(deadline - self.clocks.steady())
            plan = update(t, x, delay, deadline, time_noise)
            self.clocks.time += TICK
            return plan
        return solve

    def take(self, sent):
        self.sent.append(sent)
        if isinstance(sent, Planned):
            self.clocks.time += self.reporting
        if isinstance(sent, Wake):
            self.wakes_at = math.inf if sent.after is None else self.clocks.time + sent.after

    def of(self, kind):
        return [each for each in self.sent if isinstance(each, kind)]

    @property
    def forces(self):
        return [each.force for each in self.of(Force)]

    @property
    def plan(self):
        """Return the last plan."""
        return self.of(Planned)[-1].plan

    @property
    def reports(self):
        """Return the reports on ticks."""
        return [each for each in self.of(Report) if not each.part]

    @property
    def report(self):
        return self.reports[-1]

    @property
    def answers(self):
        """Return the reports on states."""
        return [each for each in self.reports if not each.values['carried']]

    def log(self, level=None):
        return [each.text for each in self.of(Said) if level in (None, each.level)]

    def announced(self):
        return self.of(Announcement)

    def passes(self, duration):
        """Let a time [s] pass, in which it may be woken."""
        end = self.clocks.time + duration
        while self.wakes_at <= end:
            self.clocks.time = max(self.wakes_at, self.clocks.time)
            self.wakes_at = math.inf
            self.core.on_silence()
        self.clocks.time = max(end, self.clocks.time)

    def came(self, message, publisher=b'driver', number=None, sent=None, way=1e-3):
        """Return a message that arrives now; sent [s] is by the clock of its publisher."""
        self.numbers[publisher] = number or self.numbers.get(publisher, 0) + 1
        now = self.clocks.today()
        return Arrived(message, publisher, self.numbers[publisher],
                       round((now - way if sent is None else sent) * BILLION),
                       round(now * BILLION))

    def hear(self, *messages, **about):
        """Let messages come; return the last force."""
        self.core.on_states([self.came(message, **about) for message in messages])
        self.core.on_peers(self.peers)
        return self.forces[-1] if self.forces else None

    def state(self, x, stamp=None, **about):
        """Let a state come, with the stamp of now or another [s]; return the last force."""
        stamp = self.clocks.now() if stamp is None else round(stamp * BILLION)
        return self.hear(to_joint_state(to_stamp(stamp), np.asarray(x, float), 0.0), **about)

    def stream(self, count, x=LEANING, stamp=lambda now: now, period=PERIOD, each=None,
               ways=(1e-3,)):
        """Let states come at a steady pace, that differ; stamp(now) is that of each [s]."""
        for n in range(count):
            began = self.clocks.time
            self.state(np.asarray(x) * (1 + 1e-3 * n), stamp(self.clocks.now() / BILLION),
                       way=ways[n % len(ways)])
            if each is not None:
                each()
            self.passes(began + period - self.clocks.time)

    def lockstep(self, *states):
        """Let states come in simulated time; return the forces that answer them."""
        return [self.state(x, PERIOD * self.numbers.get(b'driver', 0)) for x in states]

    def plant(self, revision=0, resets=0, name='/plant', **parameters):
        """Let a plant announce itself."""
        self.announce(name, {'lockstep': False, 'rate': 20.0, **parameters}, revision, resets)

    def announce(self, name, values, revision=0, resets=0):
        """Let a node announce itself."""
        self.core.on_configuration(Configuration(
            name, values, '', '', '', '', {}, revision, 0, resets).to_text())

    def change(self, **parameters):
        """Ask for other parameters, and wait until they are loaded."""
        def make(controller):
            made = controller()
            self.core.live.loader.kinds.add(kind_of(made))   # needs no process that compiles
            return made
        self.core.on_change({**self.core.live.values, **parameters}, make)
        thread = self.core.live.loader.thread
        if thread is not None:
            thread.join()


def record(folder, duration, rng, **plant):
    """Record what plant and mpc would send in real time on a machine that is never busy."""
    mpc, core = Running(), PlantCore(plants.plant(plant))
    configured, states, forces = (topic._replace(name=f'/{topic.name}') for topic in (
        CONFIGURATION, JOINT_STATES, FORCE_COMMAND))
    with written(folder, (configured, states, forces, DIAGNOSTICS)) as write:
        def report(node, all_sent):
            for stamp, level, message, values, part in (
                    each for each in all_sent if isinstance(each, Report)):
                name = f'{node}: {part}' if part else node
                write(DIAGNOSTICS, mpc.clocks.now(), to_diagnostics(
                    to_stamp(stamp), name, level, message, values, states.name))

        for name, values in (('plant', plants.PLANT.complete(plant)),
                             ('mpc', mpc.core.live.values)):
            write(configured, mpc.clocks.now(), String(data=told(name, values).to_text()))
        sent = core.begin(mpc.clocks.now(), mpc.clocks.now())
        for n in range(round(duration / PERIOD)):
            state = next(each for each in sent if isinstance(each, State))
            message = to_joint_state(to_stamp(state.stamp), state.x, state.force)
            write(states, mpc.clocks.now(), message)
            before = mpc.clocks.today()
            mpc.clocks.sleep(rng.uniform(2e-4, 8e-3))
            force = mpc.hear(message, sent=before)
            write(forces, mpc.clocks.now(), Float64(data=force))
            report('plant', sent)
            report('mpc', mpc.sent)
            mpc.sent.clear()
            core.on_force(force, mpc.clocks.now())
            mpc.clocks.time = (n + 1) * PERIOD
            sent = core.tick(mpc.clocks.now())
    return folder


def lockstep(**parameters):
    """Return a core in lockstep."""
    return Running(clock='lockstep', **parameters)


def periods(reports):
    """Return the times [s] between the reports."""
    return [after.values['time'] - before.values['time'] for before, after in pairwise(reports)]


def hanging_rig(x, signs=(1.0, -1.0, 1.0), offsets=(-0.2, 2.5, 0.7)):
    """Return position by joint as a rig with zeros and signs of its own measures a state."""
    measured = np.array(offsets) + np.array(signs) * (x[0], x[1], x[2] - x[1])
    return dict(zip(joints(2), measured))

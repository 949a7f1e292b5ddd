# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a recorded run, done again, is the recorded one to the bit.

From the recorded states the controller solves again: forces, costs, iterations and plans. From
the recorded forces the plant of a lockstep run integrates again: states, and forces applied. Both
together are the whole run. What the bag lacks for that is not passed over.
"""

from collections.abc import Callable, Iterable
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros import configuration, provenance
from dp_swing_ros.bags.episodes import configurations_of, CONTROLLER, PLANT, samples_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.messages.fields import BILLION, from_trajectory, nanoseconds, Trajectory
from dp_swing_ros.pendulum.urdf import from_urdf, urdf
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.rerun.plant_again import compared, figures, forces_by_stamp, published
from dp_swing_ros.rerun.sent import commands_of, paired, Pairing
from dp_swing_ros.rerun.ticks import answer, configuration_of, Record, record_of, Tick
from dp_swing_ros.simulation.plant import Plant
from dp_swing_ros.topics import DISTURBANCE, FORCE_COMMAND, PLAN, ROBOT_DESCRIPTION

SHOWN = 5  # numbers of ticks in a sentence


class Difference(NamedTuple):
    """What was recorded otherwise than it comes out again."""

    of: str     # what there are several of: ticks, states, forces
    place: str
    text: str   # of what differs, and by how much


class Verification(NamedTuple):
    """What came of it."""

    solver: str
    ticks: int               # that were solved again
    plans: int               # that were compared
    states: int              # that the plant gave again
    real_time: bool
    differences: list[Difference]
    unchecked: list[str]     # what the bag should hold for it, and does not
    beyond: list[str]        # what no bag of this kind could be checked for
    elsewhere: list[str]     # what is other here than where it was recorded
    incomplete: str          # how many messages of how many the bag holds


def verify(bag: Bag, progress: Callable[[list[Tick]], Iterable[Tick]]) -> Verification:
    """
    Do the run in a bag again, tick by tick.

    `progress` goes through the ticks. Raises BagError where the parameters or the states
    of the controller are not known, and ParameterError where they are none of this one.
    """
    config, record = configuration_of(bag, CONTROLLER), record_of(bag)
    controller = configuration.controller(config.parameters)
    pairing, plans = paired(record, commands_of(bag)), Plans(bag)
    differences = list[Difference]()
    for tick in progress(record.ticks):
        plan = answer(controller, tick)
        text = differs(controller, plan, tick) or was_sent(tick, pairing) \
            or plans.difference(plan, tick)
        if text:
            differences.append(Difference('ticks', _place(tick), text))
    differences += [Difference('forces', f'a force at {command.time} ns', f'{command.force!r} N '
                               f'on {FORCE_COMMAND.name}, which no tick sent')
                    for command in pairing.surplus]
    again = PlantAgain(bag, record)
    return Verification(
        controller.parameters.solver, len(record.ticks), plans.compared, again.states,
        any(tick.real_time for tick in record.ticks), differences + again.differences,
        [*_gap(record), *_lacks(f'on {FORCE_COMMAND.name}', pairing.missing),
         *_lacks(f'on {PLAN.name}', plans.missing), *_unfinished(bag)],
        [*plans.beyond, *again.beyond], elsewhere(config), bag.incomplete)


class Plans:
    """The plans in a bag, by the stamps that they answer, one after the other."""

    def __init__(self, bag: Bag) -> None:
        """Read them; raises BagError."""
        self.compared = 0
        self.missing = list[Tick]()   # whose plan is not there
        self.beyond = [] if bag.has(PLAN) else [f'the plans, for the bag has no {PLAN.name}']
        self._found: dict[int, list[Trajectory]] = {}
        for message in bag.of(PLAN) if bag.has(PLAN) else ():
            self._found.setdefault(nanoseconds(message.header.stamp), []).append(
                bag.parse(from_trajectory, message))

    def difference(self, plan: Plan, tick: Tick) -> str:
        """Return how the recorded plan of a tick differs; nothing where it does not."""
        if self.beyond:
            return ''
        found = self._found.get(tick.stamp)
        if not found:
            self.missing.append(tick)
            return ''
        self.compared += 1
        return _of_plans(found.pop(0), plan)


class PlantAgain:
    """What becomes of the plant under the recorded forces, where that can be known."""

    def __init__(self, bag: Bag, record: Record) -> None:
        """Integrate a lockstep run again; raises BagError and ParameterError."""
        self.states = 0
        self.differences = list[Difference]()
        config = configurations_of(bag).get(PLANT)
        if config is None:
            self.beyond = ['states and efforts, for the bag has no parameters of the plant']
            return
        plant = configuration.plant(configuration_of(bag, PLANT).parameters)
        self.differences += _of_description(bag, plant)
        self.beyond = _why_not(bag, plant)
        if not self.beyond:
            samples = samples_of(bag)
            self.states, found = compared(samples, published(
                plant, forces_by_stamp(record.ticks), samples[-1].stamp), not record.gap)
            self.differences += [
                Difference('states', f'the state at {stamp} ns ({stamp / BILLION:.3f} s)', text)
                for stamp, text in found.items()]


def _why_not(bag: Bag, plant: Plant) -> list[str]:
    if not plant.parameters.lockstep:
        return ['states and efforts, which in real time depend on when each force arrived']
    if bag.has(DISTURBANCE):
        return [f'states and efforts, which depend on when each {DISTURBANCE.name} arrived']
    return []


def _of_description(bag: Bag, plant: Plant) -> list[Difference]:
    """Return whether the robot description is not that of the plant's parameters."""
    if not bag.has(ROBOT_DESCRIPTION):
        return []
    described = bag.parse(from_urdf, bag.of(ROBOT_DESCRIPTION)[-1].data)
    if described == from_urdf(urdf(plant.physical, plant.limits)):
        return []
    return [Difference('descriptions', 'the robot description',
                       'its physical parameters and limits are not those of the plant')]


def _gap(record: Record) -> list[str]:
    return [f'{record.gap}; from there on nothing can be verified, for a tick depends on all '
            'before it'] if record.gap else []


def _lacks(where: str, missing: list[Tick]) -> list[str]:
    numbers = [str(tick.number) for tick in missing[:SHOWN]]
    more = f' and {len(missing) - SHOWN} more' if len(missing) > SHOWN else ''
    return [f'the bag has nothing {where} of tick {", ".join(numbers)}{more}'] if missing else []


def _unfinished(bag: Bag) -> list[str]:
    # who asks for a part is content with it
    return [f'{bag.incomplete}; ask for what is there (partial)'] \
        if bag.incomplete and not bag.partial else []


def _place(tick: Tick) -> str:
    return f'tick {tick.number} at {tick.stamp} ns ({tick.stamp / BILLION:.3f} s), {tick.status}'


def differs(controller: RecedingHorizon, plan: Plan, tick: Tick) -> str:
    """Return how a tick's answer differs from the recorded one; nothing where it does not."""
    force, stats = plan.first_force(controller.nominal.u_max), plan.stats
    if not _same(force, tick.force):
        return figures('force', 'N', tick.force, force)
    if not _same(stats.cost, tick.cost):
        return figures('cost', '', tick.cost, stats.cost)
    if stats.solves != tick.solves:
        return f'iterations {tick.solves} recorded, {stats.solves} now, for the same force'
    return ''


def was_sent(tick: Tick, pairing: Pairing) -> str:
    """Return how the force on the topic differs from the one reported; nothing if it does not."""
    if tick.number not in pairing.others:
        return ''
    return figures(f'force on {FORCE_COMMAND.name}', 'N', pairing.others[tick.number], tick.force)


def _of_plans(recorded: Trajectory, plan: Plan) -> str:
    """Return how a recorded plan differs; nothing where it does not."""
    times = np.array([round(n * plan.dt * BILLION) for n in range(len(plan.X))]) / BILLION
    for name, before, after in (('times', recorded.t, times), ('states', recorded.X, plan.X),
                                ('forces', recorded.U, plan.U)):
        if before.shape != after.shape:
            return f'{name} of the plan of shape {before.shape} recorded, {after.shape} now'
        apart = float(np.max(np.abs(before - after), initial=0.0))
        if not np.array_equal(before, after, equal_nan=True):
            return f'{name} of the plan: {apart!r} apart'
    return ''


def _same(a: float, b: float) -> bool:
    return a == b or math.isnan(a) and math.isnan(b)


def elsewhere(recorded: Configuration) -> list[str]:
    """Return what is other here than where a node ran: code, packages, machine."""
    here = {'code': provenance.sources(), **provenance.packages(),
            'machine': provenance.machine()}
    there = {'code': recorded.sources, **recorded.packages, 'machine': recorded.machine}
    return [f'{name} {there.get(name, "unknown")} there, {here.get(name, "none")} here'
            for name in {**here, **there} if here.get(name) != there.get(name)]

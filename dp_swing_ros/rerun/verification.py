# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a recorded run, done again, is the recorded one to the bit.

From the recorded states the controller solves again: forces, costs, iterations and plans. From
the recorded forces the plant of a lockstep run integrates again: states, and forces applied. Both
together are the whole run. What the bag lacks for that is not passed over.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import numpy as np

from dp_swing_ros import configuration, provenance
from dp_swing_ros.bags.episodes import CONTROLLER
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.messages.fields import BILLION, from_trajectory, nanoseconds, Trajectory
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.rerun.plant_again import changed, Difference, plant_again
from dp_swing_ros.rerun.sent import commands_of, paired
from dp_swing_ros.rerun.ticks import answer, configuration_of, Record, record_of, Tick
from dp_swing_ros.topics import FORCE_COMMAND, PLAN, Topic

SHOWN = 5  # numbers of ticks in a sentence


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
        sent = pairing.others.get(tick.number, tick.force)
        text = differs(controller, plan, tick) \
            or changed(f'force on {FORCE_COMMAND.name}', 'N', sent, tick.force) \
            or plans.difference(plan, tick)
        if text:
            differences.append(Difference(
                'ticks', f'tick {tick.number} at {tick.stamp} ns ({tick.stamp / BILLION:.3f} s), '
                f'{tick.status}', text))
    differences += [Difference('forces', f'a force at {command.time} ns', f'{command.force!r} N '
                               f'on {FORCE_COMMAND.name}, which no tick sent')
                    for command in pairing.surplus]
    again = plant_again(bag, record)
    return Verification(
        controller.parameters.solver, len(record.ticks), plans.compared, again.states,
        any(tick.real_time for tick in record.ticks), differences + again.differences,
        _unchecked(bag, record, {FORCE_COMMAND: pairing.missing, PLAN: plans.missing}),
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


def _unchecked(bag: Bag, record: Record, lacking: Mapping[Topic, list[Tick]]) -> list[str]:
    """Return what the bag should hold, and does not."""
    found = []
    if record.gap:
        found.append(f'{record.gap}; from there on nothing can be verified, for a tick depends '
                     'on all before it')
    for topic, ticks in lacking.items():
        numbers = ', '.join(str(tick.number) for tick in ticks[:SHOWN])
        more = f' and {len(ticks) - SHOWN} more' if len(ticks) > SHOWN else ''
        if ticks:
            found.append(f'the bag has nothing on {topic.name} of tick {numbers}{more}')
    if bag.incomplete and not bag.partial:   # who asks for a part is content with it
        found.append(f'{bag.incomplete}; ask for what is there (partial)')
    return found


def differs(controller: RecedingHorizon, plan: Plan, tick: Tick) -> str:
    """Return how a tick's answer differs from the recorded one; nothing where it does not."""
    force, stats = plan.first_force(controller.nominal.u_max), plan.stats
    text = changed('force', 'N', tick.force, force) or changed('cost', '', tick.cost, stats.cost)
    if not text and stats.solves != tick.solves:
        return f'iterations {tick.solves} recorded, {stats.solves} now, for the same force'
    return text


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


def elsewhere(recorded: Configuration) -> list[str]:
    """Return what is other here than where a node ran: code, packages, machine."""
    here = {'code': provenance.sources(), **provenance.packages(),
            'machine': provenance.machine()}
    there = {'code': recorded.sources, **recorded.packages, 'machine': recorded.machine}
    return [f'{name} {there.get(name, "unknown")} there, {here.get(name, "none")} here'
            for name in {**here, **there} if here.get(name) != there.get(name)]

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a recorded run, done again, is the recorded one to the bit.

From the recorded states the controller solves again: forces, costs, iterations and plans. From
the recorded forces the plant of a lockstep run integrates again: states, and forces applied. Both
together are the whole run. What the bag lacks for that is not passed over.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import SequenceMatcher
from itertools import takewhile
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
from dp_swing_ros.rerun.ticks import answer, configuration_of, Record, record_of, Tick
from dp_swing_ros.topics import FORCE_COMMAND, PLAN, Topic

SHOWN = 5     # numbers of ticks in a sentence
AGREEING = 3  # forces in a row that are the same, where two sequences meet again


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
    pairing, plans = paired(record, commands_of(bag)), _plans_of(bag, record)
    differences = list[Difference]()
    for tick in progress(record.ticks):
        plan = answer(controller, tick)
        sent = pairing.others.get(tick.number, tick.force)
        text = differs(controller, plan, tick) \
            or changed(f'force on {FORCE_COMMAND.name}', 'N', sent, tick.force) \
            or (_of_plans(plans[tick.number], plan) if tick.number in plans else '')
        if text:
            differences.append(Difference(
                'ticks', f'tick {tick.number} at {tick.stamp} ns ({tick.stamp / BILLION:.3f} s), '
                f'{tick.status}', text))
    differences += [Difference('forces', f'a force at {command.time} ns', f'{command.force!r} N '
                               f'on {FORCE_COMMAND.name}, which no tick sent')
                    for command in pairing.surplus]
    again = plant_again(bag, record)
    lacking = {FORCE_COMMAND: pairing.missing}
    if bag.has(PLAN):
        lacking[PLAN] = [tick for tick in record.ticks if tick.number not in plans]
    else:
        again.beyond.insert(0, f'the plans, for the bag has no {PLAN.name}')
    return Verification(
        controller.parameters.solver, len(record.ticks), len(plans), again.states,
        any(tick.real_time for tick in record.ticks), differences + again.differences,
        _unchecked(bag, record, lacking), again.beyond, elsewhere(config), bag.incomplete)


def _plans_of(bag: Bag, record: Record) -> dict[int, Trajectory]:
    """Return the plans in a bag by the numbers of their ticks; of one stamp, in their order."""
    found = defaultdict[int, list[Trajectory]](list)
    for message in reversed(bag.any_of(PLAN)):
        found[nanoseconds(message.header.stamp)].append(bag.parse(from_trajectory, message))
    return {tick.number: found[tick.stamp].pop() for tick in record.ticks if found[tick.stamp]}


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


class Command(NamedTuple):
    """A force on the topic."""

    number: int   # that its publisher gave it
    time: int     # [ns] when it was sent, or received where that is not known
    force: float  # [N]


class Pairing(NamedTuple):
    """How the topic differs from what the ticks sent."""

    others: dict[int, float]  # [N] instead of the tick's, by its number
    missing: list[Tick]       # whose forces are not there
    surplus: list[Command]    # that no tick sent


def commands_of(bag: Bag) -> list[Command]:
    """Return the forces on their topic in the order in which they were sent."""
    entries = bag.entries_of(FORCE_COMMAND) if bag.has(FORCE_COMMAND) else []
    found = [Command(entry.sequence, entry.sent or entry.received, bag.parse(
        lambda message: float(message.data), bag.decoded(entry))) for entry in entries]
    return sorted(found, key=lambda command: command.time)


def paired(record: Record, commands: Sequence[Command]) -> Pairing:
    """
    Pair the ticks of a record with what is on the topic.

    The numbers that their publisher gave them pair them. Where a bag has none, as one that was
    converted, they are paired by their order in time: between ticks that agree, what one side
    alone has is missing or too much, and what both have is another force. What was sent after
    the first tick that is missing in the record is not looked at.
    """
    forces = {tick.number: tick.force for tick in record.ticks}
    numbered = sum(forces.get(command.number) == command.force for command in commands)
    if 2 * numbered > len(record.ticks):
        return by_number(record.ticks, [each for each in commands if not record.gap
                                        or each.number <= len(record.ticks)])
    return in_order(record.ticks, commands, whole=not record.gap)


def by_number(ticks: Sequence[Tick], commands: Sequence[Command]) -> Pairing:
    """Pair a tick with the force of its number; a second one, or of another number, is surplus."""
    forces = {tick.number: tick.force for tick in ticks}
    own = {command.number: command for command in commands}
    # of several with one number rather the one that the tick reports
    own |= {command.number: command for command in commands
            if command.force == forces.get(command.number)}
    others = {number: own[number].force for number, force in forces.items()
              if number in own and own[number].force != force}
    missing = [tick for tick in ticks if tick.number not in own]
    second = [command for command in commands
              if command.number in forces and command is not own[command.number]]
    rest = [command for command in commands if command.number not in forces]
    if rest and rest[0].force == 0.0:   # with which a controller ends
        del rest[0]
    return Pairing(others, missing, second + rest)


def in_order(ticks: Sequence[Tick], commands: Sequence[Command], whole: bool) -> Pairing:
    """Pair them one after the other, and after a difference where they meet again."""
    others: dict[int, float] = {}
    missing, surplus = list[Tick](), list[Command]()
    sent, found = [tick.force for tick in ticks], [command.force for command in commands]
    if whole:
        sent.append(0.0)   # with which a controller ends
    begin = i = j = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(sent, found)))
    for block in SequenceMatcher(None, sent[begin:], found[begin:]).get_matching_blocks():
        next_i, next_j = begin + block.a, begin + block.b
        if block.size < AGREEING and next_i + block.size < len(sent):
            continue
        pairs = list(zip(ticks[i:next_i], commands[j:next_j]))
        others |= {tick.number: command.force for tick, command in pairs
                   if tick.force != command.force}
        missing += ticks[i + len(pairs):next_i]
        if whole or next_i < len(sent):
            surplus += commands[j + len(pairs):next_j]
        i, j = next_i + block.size, next_j + block.size
    return Pairing(others, missing, surplus)

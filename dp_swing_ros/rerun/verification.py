# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Whether a recorded run, done again, is the recorded one to the bit.

From the recorded states the controller solves again: forces, costs, iterations and plans. From
the recorded forces the plant of a lockstep run integrates again: states, and forces applied. Both
together are the whole run. What the bag lacks for that is not passed over.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
import math
import re
from typing import NamedTuple

import numpy as np

from dp_swing_ros import provenance
from dp_swing_ros.bags.episodes import (
    commands_of, configurations_of, description_of, pushes_of, revisions_of, Sample, samples_of)
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.configuration import BEFORE, Configuration, CONTROLLER, PLANT
from dp_swing_ros.messages.fields import BILLION, from_trajectory, nanoseconds, Trajectory
from dp_swing_ros.messages.states import FEW
from dp_swing_ros.pendulum.parameters import acting_unit, DRIVES
from dp_swing_ros.pendulum.state import links_of, symbols, units
from dp_swing_ros.pendulum.urdf import from_urdf, urdf
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.rerun.answers import answer, Tick
from dp_swing_ros.rerun.ticks import configuration_of, gone, own, paired, Record, record_of
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.plant import Plant
from dp_swing_ros.simulation.stepper import Stepper
from dp_swing_ros.topics import COMMANDS, DIAGNOSTICS, PLAN, ROBOT_DESCRIPTION, Topic

SHOWN = 5  # numbers of ticks in a sentence
RIVALS = re.compile(r'(\S+) has \d+ publishers, [^;]*')   # of nodes/diagnostics.py


class Difference(NamedTuple):
    """What was recorded otherwise than it comes out again."""

    of: str     # what there are several of: ticks, states, forces
    place: str
    text: str   # of what differs, and by how much


class Verification(NamedTuple):
    """What came of it."""

    solver: str
    ticks: int               # that were solved again
    silent: int              # of these, for which no state came
    plans: int               # that were compared
    states: int              # that the plant gave again
    real_time: bool
    differences: list[Difference]
    unchecked: list[str]     # what the bag should hold for it, and does not
    unverifiable: list[str]        # what no bag of this kind could be checked for
    environment_changes: list[str]     # what is other here than where it was recorded
    rivals: list[str]        # topics that several nodes published, as the nodes said
    incomplete: str          # how many messages of how many the bag holds


def verify(bag: Bag, progress: Callable[[list[Tick]], Iterable[Tick]]) -> Verification:
    """
    Do the run in a bag again, tick by tick.

    `progress` goes through the ticks. Raises BagError where the parameters or the states
    of the controller are not known, and ParameterError where they are none of this one.
    """
    rivals = rivals_of(bag)
    try:
        config, record = configuration_of(bag, CONTROLLER), record_of(bag)
    except BagError as error:
        cause = f'; likely cause: {"; ".join(rivals)}' if rivals else ''
        raise BagError(f'{error}{cause}') from None
    controller = controllers.controller(config.parameters)
    drive = controller.nominal.physical.drive
    topic, unit = COMMANDS[drive], DRIVES[drive]
    pairing, plans = paired(record, commands_of(bag)), _plans_of(bag, record)
    differences = list[Difference]()
    for tick in progress(record.ticks):
        plan = answer(controller, tick)
        sent = pairing.others.get(tick.number, tick.force)
        text = differs(controller, plan, tick) \
            or changed(f'command on {topic.name}', unit, sent, tick.force) \
            or (_of_plans(plans[tick.number], controller.belief.as_measured(plan))
                if tick.number in plans else '')
        if text:
            differences.append(Difference(
                'ticks', f'tick {tick.number} at {tick.stamp} ns ({tick.stamp / BILLION:.3f} s), '
                f'{tick.status}', text))
    differences += [Difference('forces', f'a force at {command.time} ns', f'{command.force!r} '
                               f'{unit} on {topic.name}, which no tick sent')
                    for command in pairing.unpaired]
    again = plant_again(bag, record, bool(pairing.unpaired))
    lacking = {topic: pairing.missing}
    if bag.has(PLAN):
        lacking[PLAN] = [tick for tick in record.ticks if tick.number not in plans]
    else:
        again.unverifiable.insert(0, f'the plans, for the bag has no {PLAN.name}')
    return Verification(
        controller.parameters.solver, len(record.ticks),
        sum(tick.x is None for tick in record.ticks), len(plans), again.states,
        any(tick.real_time for tick in record.ticks), differences + again.differences,
        _unchecked(bag, record, lacking), again.unverifiable,
        gone(config) + environment_changes(config), rivals, bag.incomplete)


def rivals_of(bag: Bag) -> list[str]:
    """Return what the nodes of a run said of topics that had more publishers than one."""
    entries = bag.entries_of(DIAGNOSTICS) if bag.has(DIAGNOSTICS) else []
    # of an hour it takes minutes to decode them all
    of_rivals = bag.parse(lambda: [entry for entry in entries if b'rivals' in entry.data])
    messages = list(map(bag.decoded, of_rivals))
    said = bag.parse(lambda: [status.message for message in messages for status in message.status
                              if 'rivals' in {pair.key for pair in status.values}])
    # the last one on each topic, without whom a node obeys
    return list({found[1]: found[0] for text in said for found in RIVALS.finditer(text)}.values())


def _plans_of(bag: Bag, record: Record) -> dict[int, Trajectory]:
    """
    Return the plans in a bag by the numbers of their ticks; of one stamp, in their order.

    Where stamps stand still, and a plan is missing, nobody knows which.
    """
    found = defaultdict[int, list[Trajectory]](list)
    for message in reversed(bag.any_of(PLAN)):
        found[nanoseconds(message.header.stamp)].append(bag.parse(from_trajectory, message))
    answers = [tick for tick in record.ticks if tick.x is not None]
    for plans in list(found.values()):
        if len(plans) == len(answers) > FEW:   # the stamp of all states
            found |= {tick.stamp: [plan] for tick, plan in zip(answers, reversed(plans))}
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
    force, stats = plan.command(controller.nominal.u_max), plan.stats
    unit = DRIVES[controller.nominal.physical.drive]
    text = changed('force', unit, tick.force, force) or changed('cost', '', tick.cost, stats.cost)
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


def environment_changes(recorded: Configuration) -> list[str]:
    """Return what is other here than where a node ran: code, packages, machine."""
    here = {'code': provenance.sources(), **provenance.packages(),
            'machine': provenance.machine()}
    there = {'code': recorded.sources, **recorded.packages, 'machine': recorded.machine}
    return [f'{name} {there.get(name, "unknown")} there, {here.get(name, "none")} here'
            for name in {**here, **there} if here.get(name) != there.get(name)]


class PlantAgain(NamedTuple):
    """What becomes of the plant under the recorded forces."""

    states: int                    # that were compared
    differences: list[Difference]
    unverifiable: list[str]              # what could not be compared


def plant_again(bag: Bag, record: Record, has_others: bool) -> PlantAgain:
    """
    Compare a plant with the recorded one; raises BagError and ParameterError.

    In lockstep it is known which force acts when, and noise and losses come from seeds; but not
    where the bag has others than the mpc's, and with these it began.
    """
    if PLANT not in configurations_of(bag):
        return PlantAgain(0, [], [
            'states and efforts, for the bag has no parameters of the plant'])
    revisions = list(revisions_of(bag)[PLANT].values())
    # a recording that began after changes has the last of them alone
    begun = [each for each in revisions if each.revision == 0 or each.since == BEFORE]
    plant, last = (plants.plant(own(found)) for found in (
        [*revisions[:1], *begun][-1], revisions[-1]))
    differences = []
    if bag.has(ROBOT_DESCRIPTION) and description_of(bag) != from_urdf(
            urdf(last.physical, last.limits)):
        differences.append(Difference(
            'descriptions', 'the robot description',
            'its physical parameters and limits are not those of the plant'))
    if not plant.parameters.lockstep:
        return PlantAgain(0, differences, [
            'states and efforts, which in real time depend on when each force arrived'])
    if record.begins_later:
        return PlantAgain(0, differences, [
            'states and efforts, for the bag begins while the plant moves'])
    try:
        pushes = pushes_of(bag)
    except BagError as error:
        return PlantAgain(0, differences, [f'states and efforts: {error}'])
    if has_others and samples_of(bag)[0].stamp not in {tick.stamp for tick in record.ticks}:
        return PlantAgain(0, differences, [
            'states and efforts, which began under forces that no tick sent'])
    states, found = _of_states(bag, plant, record, pushes, [
        each for each in revisions if each.revision > 0 and each.since != BEFORE])
    return PlantAgain(states, differences + found, [])


def _of_states(bag: Bag, plant: Plant, record: Record, pushes: Mapping[int, float],
               changes: Sequence[Configuration]) -> tuple[int, list[Difference]]:
    """Return how many recorded states the plant has too, and how some differ."""
    samples = samples_of(bag)
    forces = {tick.stamp: tick.force for tick in record.ticks if tick.x is not None}
    again = {sample.stamp: sample for sample in published(
        plant, forces, samples[-1].stamp, pushes, changes)}
    differences = []
    for sample in samples:
        text = ''
        if sample.stamp in again:
            text = difference(sample, again[sample.stamp], acting_unit(plant.physical.drive))
        elif not record.gap or sample.stamp <= max(again, default=-1):
            text = 'the plant has no state then'
        if text:
            differences.append(Difference('states', f'the state at {sample.stamp} ns '
                                          f'({sample.stamp / BILLION:.3f} s)', text))
    return sum(sample.stamp in again for sample in samples), differences


def published(plant: Plant, forces: Mapping[int, float], end: int, pushes: Mapping[int, float],
              changes: Sequence[Configuration] = ()) -> Iterator[Sample]:
    """
    Yield the states that a plant in lockstep publishes, up to a time [ns].

    forces are those [N] that answered the states, by their stamps [ns]; where one is not known,
    nothing is known of what follows. pushes are those [N] through the periods that began at times
    [ns]. changes of its parameters count since their times.
    """
    stepper = Stepper(plant)
    while plant.t - plant.parameters.delay <= end / BILLION + stepper.period / 2:
        now = round(plant.t * BILLION)
        measured = stepper.begin(pushes.get(now, 0.0))
        if measured is not None:
            stamp = round(measured.t * BILLION)
            yield Sample(stamp, measured.x, measured.force)
            if stamp not in forces:
                return
        for change in changes:
            if change.since == now:
                plant.reconfigure(plants.plant(own(change)))
        stepper.finish(None if measured is None else forces[stamp])


def difference(recorded: Sample, again: Sample, unit: str) -> str:
    """Return how a state, or what acted before it [unit], differs; nothing where it does not."""
    links = links_of(recorded.x)
    numbers = [*zip(symbols(links), units(links), recorded.x, again.x),
               ('effort', unit, recorded.force, again.force)]
    texts = (changed(name, unit, float(before), float(after))
             for name, unit, before, after in numbers)
    return next(filter(None, texts), '')


def changed(name: str, unit: str, recorded: float, again: float) -> str:
    """Return how far a number is from the recorded one; nothing where it is the same."""
    if recorded == again or math.isnan(recorded) and math.isnan(again):
        return ''
    before, after, apart = (f'{number!r} {unit}'.strip()
                            for number in (recorded, again, abs(again - recorded)))
    return f'{name} {before} recorded, {after} now: {apart} apart'

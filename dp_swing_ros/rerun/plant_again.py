# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A recorded plant again, under the recorded forces.

In lockstep it is known which force acts when, and noise and losses come from seeds: the states
that it publishes come out again to the bit, and so do the forces that its actuator applied.
"""

from collections.abc import Iterator, Mapping
import math
from typing import NamedTuple

from dp_swing_ros import configuration
from dp_swing_ros.bags.episodes import (
    configurations_of, description_of, PLANT, Sample, samples_of)
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.state import links_of, symbols, units
from dp_swing_ros.pendulum.urdf import from_urdf, urdf
from dp_swing_ros.rerun.ticks import configuration_of, Record
from dp_swing_ros.simulation.plant import Plant
from dp_swing_ros.topics import DISTURBANCE, ROBOT_DESCRIPTION


class Difference(NamedTuple):
    """What was recorded otherwise than it comes out again."""

    of: str     # what there are several of: ticks, states, forces
    place: str
    text: str   # of what differs, and by how much


class PlantAgain(NamedTuple):
    """What becomes of the plant under the recorded forces."""

    states: int                    # that were compared
    differences: list[Difference]
    beyond: list[str]              # what could not be compared


def plant_again(bag: Bag, record: Record) -> PlantAgain:
    """Compare the plant with its own parameters; raises BagError and ParameterError."""
    if PLANT not in configurations_of(bag):
        return PlantAgain(0, [], [
            'states and efforts, for the bag has no parameters of the plant'])
    plant = configuration.plant(configuration_of(bag, PLANT).parameters)
    differences = []
    if bag.has(ROBOT_DESCRIPTION) and description_of(bag) != from_urdf(
            urdf(plant.physical, plant.limits)):
        differences.append(Difference(
            'descriptions', 'the robot description',
            'its physical parameters and limits are not those of the plant'))
    if not plant.parameters.lockstep:
        return PlantAgain(0, differences, [
            'states and efforts, which in real time depend on when each force arrived'])
    if bag.has(DISTURBANCE):
        return PlantAgain(0, differences, [
            f'states and efforts, which depend on when each {DISTURBANCE.name} arrived'])
    states, others = _of_states(bag, plant, record)
    return PlantAgain(states, differences + others, [])


def _of_states(bag: Bag, plant: Plant, record: Record) -> tuple[int, list[Difference]]:
    """Return how many recorded states the plant has too, and how some differ."""
    samples = samples_of(bag)
    forces = {tick.stamp: tick.force for tick in record.ticks if tick.x is not None}
    again = {sample.stamp: sample for sample in published(plant, forces, samples[-1].stamp)}
    differences = []
    for sample in samples:
        text = ''
        if sample.stamp in again:
            text = difference(sample, again[sample.stamp])
        elif not record.gap or sample.stamp <= max(again, default=-1):
            text = 'the plant has no state then'
        if text:
            differences.append(Difference('states', f'the state at {sample.stamp} ns '
                                          f'({sample.stamp / BILLION:.3f} s)', text))
    return sum(sample.stamp in again for sample in samples), differences


def published(plant: Plant, forces: Mapping[int, float], end: int) -> Iterator[Sample]:
    """
    Yield the states that a plant in lockstep publishes, up to a time [ns].

    forces are those [N] that answered the states, by their stamps [ns]; where one is not known,
    nothing is known of what follows.
    """
    period = 1 / plant.parameters.rate
    while plant.t - plant.parameters.delay <= end / BILLION + period / 2:
        measured = plant.measure()
        if measured is not None:
            stamp = round(measured.t * BILLION)
            yield Sample(stamp, measured.x, plant.mean_force)
            if stamp not in forces:
                return
            plant.obey(forces[stamp])
        plant.begin_period(0.0)
        plant.advance(period)


def difference(recorded: Sample, again: Sample) -> str:
    """Return how a state, or the force applied before it, differs; nothing where it does not."""
    links = links_of(recorded.x)
    numbers = [*zip(symbols(links), units(links), recorded.x, again.x),
               ('effort', 'N', recorded.force, again.force)]
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

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A recorded plant again, under the recorded forces.

In lockstep it is known which force acts when, and noise and losses come from seeds: the states
that it publishes come out again to the bit, and so do the forces that its actuator applied.
"""

from collections.abc import Iterator, Mapping, Sequence

from dp_swing_ros.bags.episodes import Sample
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.state import links_of, symbols, units
from dp_swing_ros.rerun.ticks import Tick
from dp_swing_ros.simulation.plant import Plant


def published(plant: Plant, forces: Mapping[int, float], end: int) -> Iterator[Sample]:
    """
    Yield the states that a plant in lockstep publishes, up to a time [ns].

    forces are those [N] that answered the states, by their stamps [ns]; where one is not known,
    nothing is known of what follows.
    """
    period = 1 / plant.parameters.rate
    while plant.t - plant.parameters.delay <= end / BILLION + period / 2:
        measured = plant.measure()
        plant_force = plant.mean_force
        plant.begin_period(0.0)
        if measured is not None:
            stamp = round(measured.t * BILLION)
            yield Sample(stamp, measured.x, plant_force)
            if stamp not in forces:
                return
            plant.obey(forces[stamp])
        plant.advance(period)


def compared(samples: Sequence[Sample], again: Iterator[Sample],
             whole: bool) -> tuple[int, dict[int, str]]:
    """
    Return how many recorded states were compared with those of the plant, and how some differ.

    The differences are by stamp [ns]. Unless the record is whole, the plant need not come as far
    as the recording. Of a state that the bag lacks nothing is said.
    """
    recorded, last = {sample.stamp: sample for sample in samples}, -1
    found: dict[int, str] = {}
    seen = set[int]()
    for sample in again:
        last = sample.stamp
        if last in recorded:
            seen.add(last)
            text = difference(recorded[last], sample)
            if text:
                found[last] = text
    for stamp in recorded:
        if stamp not in seen and (whole or stamp <= last):
            found[stamp] = 'the plant has no state then'
    return len(seen), dict(sorted(found.items()))


def difference(recorded: Sample, again: Sample) -> str:
    """Return how a state, or the force applied before it, differs; nothing where it does not."""
    links = links_of(recorded.x)
    for name, unit, before, after in zip(symbols(links), units(links), recorded.x, again.x):
        if before != after:
            return figures(name, unit, float(before), float(after))
    if recorded.force != again.force:
        return figures('effort', 'N', recorded.force, again.force)
    return ''


def figures(name: str, unit: str, recorded: float, again: float) -> str:
    """Return how far a number is from the recorded one."""
    before, after, apart = (f'{number!r} {unit}'.strip()
                            for number in (recorded, again, abs(again - recorded)))
    return f'{name} {before} recorded, {after} now: {apart} apart'


def forces_by_stamp(ticks: Sequence[Tick]) -> dict[int, float]:
    """Return the forces [N] that answered states, by the stamps of the states."""
    return {tick.stamp: tick.force for tick in ticks if tick.x is not None}

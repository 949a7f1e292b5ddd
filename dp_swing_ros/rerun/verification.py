# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a recorded controller, asked again, sends the recorded forces to the bit."""

from collections.abc import Callable, Iterable
import math
from typing import NamedTuple

from dp_swing_ros import configuration, provenance
from dp_swing_ros.bags.configurations import Configuration
from dp_swing_ros.bags.episodes import CONTROLLER
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.mpc import RecedingHorizon
from dp_swing_ros.rerun.ticks import answer, record_of, Tick, told
from dp_swing_ros.topics import FORCE_COMMAND


class Difference(NamedTuple):
    """A tick that was recorded otherwise than it comes out again."""

    tick: Tick
    text: str   # of what differs, and by how much


class Verification(NamedTuple):
    """What came of it."""

    solver: str
    ticks: int               # that were asked again
    real_time: bool
    differences: list[Difference]
    unheard: int             # forces that were sent, and are not in the bag
    gap: str                 # what ends the record early
    elsewhere: list[str]     # what is other here than where it was recorded


def verify(bag: Bag, progress: Callable[[list[Tick]], Iterable[Tick]]) -> Verification:
    """
    Ask the controller of a bag again, tick by tick.

    `progress` goes through the ticks. Raises BagError where it is not known what the controller
    was told or given, and ParameterError where this one cannot be told so.
    """
    config, record = told(bag, CONTROLLER), record_of(bag)
    controller = configuration.controller(config.parameters)
    sent = forces_of(bag)
    differences = list[Difference]()
    for tick in progress(record.ticks):
        text = differs(controller, tick) or was_sent(tick, sent)
        if text:
            differences.append(Difference(tick, text))
    return Verification(
        controller.parameters.solver, len(record.ticks),
        any(tick.real_time for tick in record.ticks), differences,
        sum(tick.number not in sent for tick in record.ticks), record.gap, elsewhere(config))


def forces_of(bag: Bag) -> dict[int, list[float]]:
    """Return the forces on their topic [N] by the numbers that their publishers gave them."""
    found: dict[int, list[float]] = {}
    for entry in bag.entries_of(FORCE_COMMAND) if bag.has(FORCE_COMMAND) else ():
        force = bag.parse(lambda message: float(message.data), bag.decoded(entry))
        found.setdefault(entry.sequence, []).append(force)
    return found


def differs(controller: RecedingHorizon, tick: Tick) -> str:
    """Return how a tick's answer differs from the recorded one; nothing where it does not."""
    plan = answer(controller, tick)
    force, stats = plan.first_force(controller.nominal.u_max), plan.stats
    if not _same(force, tick.force):
        return _figures('force', 'N', tick.force, force)
    if not _same(stats.cost, tick.cost):
        return _figures('cost', '', tick.cost, stats.cost)
    if stats.solves != tick.solves:
        return f'iterations {tick.solves} recorded, {stats.solves} now, for the same force'
    return ''


def was_sent(tick: Tick, sent: dict[int, list[float]]) -> str:
    """Return how the force on the topic differs from the one reported; nothing if it does not."""
    # someone else may have sent forces too, with the same numbers
    forces = sent.get(tick.number)
    if forces is None or tick.force in forces:
        return ''
    return _figures(f'force on {FORCE_COMMAND.name}', 'N', forces[-1], tick.force)


def _figures(name: str, unit: str, recorded: float, again: float) -> str:
    before, after, apart = (f'{number!r} {unit}'.strip()
                            for number in (recorded, again, abs(again - recorded)))
    return f'{name} {before} recorded, {after} now: {apart} apart'


def _same(a: float, b: float) -> bool:
    return a == b or math.isnan(a) and math.isnan(b)


def elsewhere(recorded: Configuration) -> list[str]:
    """Return what is other here than where a node ran: code, packages, machine."""
    here = {'code': provenance.sources(), **provenance.packages(),
            'machine': provenance.machine()}
    there = {'code': recorded.sources, **recorded.packages, 'machine': recorded.machine}
    return [f'{name} {there.get(name, "unknown")} there, {here.get(name, "none")} here'
            for name in {**here, **there} if here.get(name) != there.get(name)]

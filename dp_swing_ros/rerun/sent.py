# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The forces on force_command, each paired with the tick that sent it.

The numbers that their publisher gave them pair them. Where a bag has none, as one that was
converted, they are paired by their order in time: between ticks that agree, what one side alone
has is missing or too much, and what both have is another force.
"""

from collections.abc import Sequence
from typing import NamedTuple

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.rerun.ticks import Record, Tick
from dp_swing_ros.topics import FORCE_COMMAND

AGREEING = 3  # forces in a row that are the same, where two sequences meet again
REACH = 20    # forces ahead at which they may


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
    found = [Command(entry.sequence, entry.sent or entry.received, bag.parse(
        lambda message: float(message.data), bag.decoded(entry)))
        for entry in (bag.entries_of(FORCE_COMMAND) if bag.has(FORCE_COMMAND) else ())]
    return sorted(found, key=lambda command: command.time)


def paired(record: Record, commands: Sequence[Command]) -> Pairing:
    """
    Pair the ticks of a record with what is on the topic, by number or by order.

    What was sent after the first tick that is missing in the record is not looked at.
    """
    forces = {tick.number: tick.force for tick in record.ticks}
    numbered = sum(forces.get(command.number) == command.force for command in commands)
    if 2 * numbered > len(record.ticks):
        return by_number(record.ticks, [each for each in commands if not record.gap
                                        or each.number <= len(record.ticks)])
    return in_order(record.ticks, commands, whole=not record.gap)


def by_number(ticks: Sequence[Tick], commands: Sequence[Command]) -> Pairing:
    """Pair a tick with the force of its number; a second one, or of another number, is surplus."""
    others: dict[int, float] = {}
    missing, surplus = list[Tick](), list[Command]()
    left: dict[int, list[Command]] = {}
    for command in commands:
        left.setdefault(command.number, []).append(command)
    for tick in ticks:
        found = left.pop(tick.number, [])
        if not found:
            missing.append(tick)
            continue
        own = next((each for each in found if each.force == tick.force), found[-1])
        found.remove(own)
        surplus += found
        if own.force != tick.force:
            others[tick.number] = own.force
    rest = [command for command in commands if command.number in left]
    return Pairing(others, missing, surplus + without_last_zero(rest))


def in_order(ticks: Sequence[Tick], commands: Sequence[Command], whole: bool) -> Pairing:
    """Pair them one after the other, and after a difference where they meet again."""
    others: dict[int, float] = {}
    missing, surplus = list[Tick](), list[Command]()
    i = j = 0
    while i < len(ticks):
        if j < len(commands) and ticks[i].force == commands[j].force:
            i, j = i + 1, j + 1
            continue
        next_i, next_j = _meeting(ticks, commands, i, j, whole)
        both = min(next_i - i, next_j - j)
        others |= {tick.number: command.force
                   for tick, command in zip(ticks[i:i + both], commands[j:j + both])}
        missing += ticks[i + both:next_i]
        surplus += commands[j + both:next_j]
        i, j = next_i, next_j
    return Pairing(others, missing, surplus + without_last_zero(commands[j:]) if whole
                   else surplus)


def _meeting(ticks: Sequence[Tick], commands: Sequence[Command], i: int, j: int,
             whole: bool) -> tuple[int, int]:
    """Return the next place from which both agree."""
    for far in range(1, REACH):
        for near in range(far + 1):
            # rather one side lacks some than that all differ
            for place in ((i + far, j + near), (i + near, j + far)):
                if _agree(ticks, commands, *place, whole):
                    return place
    return i + 1, min(j + 1, len(commands))


def _agree(ticks: Sequence[Tick], commands: Sequence[Command], i: int, j: int,
           whole: bool) -> bool:
    if i >= len(ticks) or j >= len(commands):
        return i == len(ticks) and j <= len(commands) and not (
            whole and without_last_zero(commands[j:j + 2]))
    return all(tick.force == command.force for tick, command in zip(
        ticks[i:i + AGREEING], commands[j:j + AGREEING]))


def without_last_zero(commands: Sequence[Command]) -> list[Command]:
    """Leave out the zero with which a controller ends."""
    return list(commands[1:] if commands and commands[0].force == 0.0 else commands)

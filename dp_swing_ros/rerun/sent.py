# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The forces on force_command, each paired with the tick that sent it.

The numbers that their publisher gave them pair them. Where a bag has none, as one that was
converted, they are paired by their order in time: between ticks that agree, what one side alone
has is missing or too much, and what both have is another force.
"""

from collections.abc import Sequence
from difflib import SequenceMatcher
from itertools import takewhile
from typing import NamedTuple

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.rerun.ticks import Record, Tick
from dp_swing_ros.topics import FORCE_COMMAND

AGREEING = 3  # forces in a row that are the same, where two sequences meet again


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

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which messages on `joint_states` are states of this pendulum.

Robots share the topic. A state names all joints of ours; what names none of them is another
robot's. Of several publishers of states the one that was heard first is obeyed.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from enum import Enum
from itertools import pairwise
from typing import Any

import numpy as np

SILENCE = 1.0   # [s] after which another publisher takes the place of a silent one
FEW = 3         # states of one stamp; more tell that a driver gives all the same
SOON = 100      # messages, among which is the next of a publisher that goes on
SAID = 20       # sets of joints at most that are spoken of


class Kind(Enum):
    """What a JointState is to a pendulum."""

    STATE = 'it names all joints'
    PART = 'it names some joints, but not all'
    OTHER = 'it names none: it is of another robot'


def kind_of(names: Collection[str], wanted: Sequence[str]) -> Kind:
    """Return what a message with joints of these names is to a pendulum of wanted ones."""
    found = set(wanted).intersection(names)
    return Kind.OTHER if not found else Kind.STATE if len(found) == len(wanted) else Kind.PART


def missing(names: Iterable[str], wanted: Sequence[str]) -> str:
    """Return in words which joints a message lacks, which it has, and a remedy."""
    names = list(names)
    lacking = ', '.join(joint for joint in wanted if joint not in names)
    return (f'JointState has no {lacking}; it names {names}; expected [{", ".join(wanted)}]: set '
            'joint_names of the mpc, or start plant and mpc with the same links')


class States:
    """
    Picks the states out of the messages on their topic, and counts those of one publisher.

    `warn` is called once for each kind of message that is passed over, and where another
    publisher is obeyed; `name` returns the node of a publisher.
    """

    def __init__(self, wanted: Sequence[str], warn: Callable[[str], None] = lambda _: None,
                 name: Callable[[bytes], str] = repr) -> None:
        """Take the names of the joints of a state."""
        self.wanted, self.warn, self.name = wanted, warn, name
        self.number = 0        # of the newest state, those that were lost on their way included
        self.obeyed, self.obeyed_name = b'', ''   # the publisher of the states, and its node
        self.refusal = ''      # what the last message lacked, where it was no whole state
        self.others = set[bytes]()          # publishers that have named no joint of ours
        self._heard = dict[bytes, float]()  # [s] when others last sent states, by the first one
        self._numbers = dict[bytes, int]()  # of the last message of each publisher
        self._said = set[frozenset[str]]()
        self._last: tuple[Any, ...] = ()    # stamp and content of the newest state
        self._repeats = 0

    def picks(self, message: Any, publisher: bytes, number: int, now: float,
              asked_again: bool = False) -> bool:
        """
        Return whether a message that was heard now [s] is a new state of the publisher obeyed.

        `number` is that of its publisher. One with stamp and content of the state before is that
        state, unless a plant in lockstep may have `asked_again`.
        """
        lost = max(number - self._numbers.get(publisher, number) - 1, 0)
        self._numbers[publisher] = number
        kind = kind_of(message.name, self.wanted)
        if kind is not Kind.STATE:
            self._pass_over(kind, message, publisher)
            return False
        self.refusal = ''
        self.others.discard(publisher)
        if not self._is_obeyed(publisher, now) or not asked_again and self._is_repeated(message):
            return False
        self.number += lost + 1
        return True

    def caught_up(self, now: float) -> None:
        """Take that no message was taken until now [s], as a publisher in lockstep may know."""
        if self.obeyed in self._heard:
            self._heard[self.obeyed] = now

    def _pass_over(self, kind: Kind, message: Any, publisher: bytes) -> None:
        if kind is Kind.PART:
            self.refusal = text = missing(message.name, self.wanted)
        else:
            text = (f'a JointState of {self.name(publisher)} names none of '
                    f'[{", ".join(self.wanted)}]: it is of another robot, and passed over')
            if publisher not in self._heard:
                self.others.add(publisher)
        joints = frozenset(message.name)
        if joints not in self._said and len(self._said) < SAID:
            self._said.add(joints)
            self.warn(text)

    def _is_obeyed(self, publisher: bytes, now: float) -> bool:
        """Return whether a publisher of states is the first of those that are not silent."""
        if publisher not in self._heard:   # and one that has ended does not come back
            self._heard = {each: heard for each, heard in self._heard.items()
                           if now - heard <= SILENCE}
            if self._heard:
                self.obeyed_name = self.name(self.obeyed)   # of one that is there
                self.warn(f'{self.name(publisher)} publishes states, too; {self.obeyed_name}'
                          ' was heard first, and is obeyed')
        self._heard[publisher] = now
        first = next(each for each, heard in self._heard.items() if now - heard <= SILENCE)
        if publisher != first:
            return False
        if self.obeyed != first:
            before, self.obeyed_name = self.obeyed_name, self.name(first)
            if before:
                self.warn(f'{before} is obeyed no more; {self.obeyed_name} is')
            self.obeyed = first
        return True

    def _is_repeated(self, message: Any) -> bool:
        """Return whether a state is the one before; where stamps stand still, so may states."""
        stamp = message.header.stamp
        content = (stamp.sec, stamp.nanosec, tuple(message.name), *(
            np.asarray(values).tobytes() for values in (
                message.position, message.velocity, message.effort)))
        self._repeats = self._repeats + 1 if content == self._last else 0
        self._last = content
        return 0 < self._repeats < FEW and (stamp.sec, stamp.nanosec) != (0, 0)


def by_publisher(numbers: Sequence[int], positions: Iterable[Any]) -> list[bytes]:
    """
    Return who sent states of these sequence numbers and positions, as a bag does not say.

    Each publisher counts its own, so a number follows on that of the same publisher before, or on
    the largest before after which one is lost, for it is not soon to come. Where two have come to
    the same number, it is the one whose pendulum was closer.
    """
    if all(before < after for before, after in pairwise(numbers)) or len(set(numbers)) < 2:
        return [b''] * len(numbers)
    found, last = list[bytes](), dict[bytes, tuple[int, Any]]()
    for n, (number, position) in enumerate(zip(numbers, map(np.nan_to_num, positions))):
        coming = numbers[n + 1:n + 1 + SOON]
        before = [each for each, (its, _) in last.items()
                  if its == number - 1 or its < number and its + 1 not in coming]
        # of two that are as close the one that was heard last is more likely to go on
        publisher = max(reversed(before), default=f'publisher {len(last)}'.encode(),
                        key=lambda each: (last[each][0], -np.abs(last[each][1] - position).sum()))
        last.pop(publisher, None)
        last[publisher] = number, position
        found.append(publisher)
    return found

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded controller: its configuration, its ticks, its forces."""

from collections.abc import Sequence
from difflib import SequenceMatcher
from itertools import dropwhile, pairwise, takewhile
from typing import Any, NamedTuple

from dp_swing_ros.bags.episodes import (
    Command, configurations_of, reports_of, revisions_of, samples_of)
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError
from dp_swing_ros.estimators import ESTIMATORS
from dp_swing_ros.messages.configuration import Configuration, CONTROLLER, PLANT
from dp_swing_ros.messages.fields import BILLION, Report
from dp_swing_ros.messages.ticks import NEEDED, TickReport
from dp_swing_ros.parameters.files import is_of_rclpy
from dp_swing_ros.rerun.answers import Tick
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.topics import JOINT_STATES

CHOSEN = ('solver', 'estimator')   # whose parameters count
AGREEING = 3  # forces in a row that are the same, where two sequences meet again
# parameters of earlier controllers that decided no force, or none with dynamics of today
DROPPED = {'shadow', 'unseen', 'disagreement_weight'}
# others, each with the value at which it did what is done now
FIXED: dict[str, Any] = {
    'ddp.hessian': 'exact', 'initial_plan': 'random', 'bounded_lqr': True, 'regulator': True,
    'ekf.refusals': 3, 'mppi.monotone': True, 'solve_rate': 0.0}


class Record(NamedTuple):
    """
    The ticks of a controller, and what is missing between them or after the last.

    They begin with its first, or with the first after a reset, which makes it forget all before.
    """

    ticks: list[Tick]
    gap: str

    def up_to(self, tick: Tick) -> list[Tick]:
        """Return a tick and those before it."""
        return [each for each in self.ticks if each.number <= tick.number]

    @property
    def begins_later(self) -> bool:
        """Return whether the controller had sent forces before."""
        return bool(self.ticks) and self.ticks[0].number > 1


def configuration_of(bag: Bag, node: str) -> Configuration:
    """Return the configuration of a node without rclpy's parameters; raises BagError."""
    found = configurations_of(bag)
    if node not in found:
        raise BagError(f'{bag} has no parameters of the {node}, but those of '
                       f'{", ".join(sorted(found)) or "no node"}; record a run of plant and mpc '
                       'with the topic configuration')
    return found[node]._replace(parameters=own(found[node]))


def own(found: Configuration) -> dict[str, Any]:
    """
    Return the parameters of a node without rclpy's.

    Nor those of solvers and estimators of other packages that the run did not use, and that are
    not installed here, nor those that nodes no longer have.
    """
    used = {found.parameters.get(name) for name in CHOSEN}
    known = {'', *SOLVERS, *ESTIMATORS, *used}
    return {name: value for name, value in found.parameters.items()
            if not is_of_rclpy(name) and name.rpartition('.')[0] in known
            and name not in DROPPED | FIXED.keys()}


def gone(found: Configuration) -> list[str]:
    """Return in words what a controller was told to do that none does any more."""
    return [f'{name} {found.parameters[name]} there, not to be had here'
            for name, value in FIXED.items()
            if name in found.parameters and found.parameters[name] != value
            and name.rpartition('.')[0] in ('', *map(found.parameters.get, CHOSEN))]


def record_of(bag: Bag, anywhere: bool = False) -> Record:
    """
    Return the ticks of a bag up to a gap; raises BagError for none, or two controllers.

    If they may begin `anywhere`, those after a gap come too, the first of them as after a reset:
    what the controller knew is lost.
    """
    reports = reports_of(bag)
    if not reports:
        raise BagError(f'{bag} has no ticks of an {CONTROLLER}; record one with /diagnostics')
    missing = [name for name in NEEDED if any(name not in report.values for report in reports)]
    if missing:
        raise BagError(f'{bag} is of an {CONTROLLER} without {", ".join(missing)} '
                       'at every tick; record it anew')
    return bag.parse(_record, bag, reports, anywhere)


class Reported(NamedTuple):
    """What a controller reported of a tick, and the stamp of its state [ns]."""

    stamp: int
    tick: TickReport


def _from_a_beginning(reports: list[Reported]) -> list[Reported]:
    """Return the reports from the first tick of a controller, or the first after a reset, on."""
    if reports[0].tick.number == 1:
        return reports
    first = (n for n, (before, after) in enumerate(pairwise(reports), start=1)
             if after.tick.resets > before.tick.resets)
    return reports[next(first, len(reports)):]


def _of_the_last_run(reports: list[Reported]) -> list[Reported]:
    """Return the reports since states last went back in time, as in a plant that began anew."""
    answers = [each for each in reports if not each.tick.carried]
    first = [after.tick.number for before, after in pairwise(answers)
             if after.stamp < before.stamp]
    return [each for each in reports if each.tick.number >= first[-1]] if first else reports


def _record(bag: Bag, reports: list[Report], anywhere: bool) -> Record:
    reported = sorted((Reported(report.stamp, TickReport.read(report.values))
                       for report in reports), key=lambda each: each.tick.number)
    states = {sample.stamp: sample.x for sample in samples_of(bag)}
    found = list(dropwhile(lambda each: each.stamp not in states, _of_the_last_run(reported))) \
        if anywhere else _from_a_beginning(reported)
    if not found:
        return Record([], f'tick 1 is missing (the next is {reported[0].tick.number}), and '
                      'there is none after a reset')
    revisions = revisions_of(bag).get(CONTROLLER, {})
    ticks: list[Tick] = []
    resets, gap = 0, ''
    revision = known = min(revisions, default=0)
    due = found[0].tick.number - found[0].tick.again
    for stamp, tick in found:
        number = tick.number
        if number - tick.again < due:
            raise BagError(f'{bag} has two ticks number {number}: the {CONTROLLER} was started '
                           'again, or two ran; record one at a time')
        revision = revision if tick.revision is None else tick.revision
        lost = ''   # with which the tick cannot be answered
        if not tick.carried and stamp not in states:
            lost = (f'the state of tick {number} is missing ({stamp} ns)'
                    + ('' if ticks else _early(bag)))
        elif revision != known and revision not in revisions:
            lost = (f'the parameters of tick {number} are missing, changed for the '
                    f'{revision}th time')
        missing = lost if number - tick.again == due else (
            f'tick {due} is missing (the next is {number})')
        due = number + 1
        if missing:
            gap = missing
            if not anywhere:
                break
        if lost:
            continue
        after_gap = bool(ticks) and number - tick.again > ticks[-1].number + 1
        ticks.append(Tick(
            number, stamp, stamp / BILLION if tick.time is None else tick.time,
            None if tick.carried else states[stamp], tick.time_noise, tick.delay, tick.real_time,
            after_gap or tick.resets > resets, tick.enabled, tick.stopping,
            tuple(map(int, tick.solves.split())), tick.status, tick.cost, tick.force,
            tick.again, own(revisions[revision]) if revision != known else None))
        resets, known = tick.resets, revision
    return Record(ticks, gap)


def _early(bag: Bag) -> str:
    """Return why the first states are not in a bag, where their publisher's numbers tell."""
    first = bag.entries_of(JOINT_STATES)[0]
    if first.sequence < 2:
        return ''
    return (f': {first.sequence - 1} were sent on {first.topic} before the logger could hear '
            f'them, as happens on a busy machine; a {PLANT} with `-p qos_overrides.{first.topic}'
            '.publisher.durability:=transient_local` keeps them for it')


def sent_by(ticks: Sequence[Tick]) -> list[tuple[int, Tick]]:
    """Return the numbers of the forces that were sent, again or not, and the ticks they are of."""
    found = list[tuple[int, Tick]]()
    for tick in ticks:
        if found:
            found += [(tick.number - n, found[-1][1]) for n in range(tick.again, 0, -1)]
        found.append((tick.number, tick))
    return found


class Pairing(NamedTuple):
    """How the topic differs from what the ticks sent."""

    others: dict[int, float]  # [N] instead of the tick's, by its number
    missing: list[Tick]       # whose forces are not there
    unpaired: list[Command]    # that no tick sent


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
        first, last = record.ticks[0].number, record.ticks[-1].number
        return by_number(record.ticks, [each for each in commands if each.number >= first
                                        and not (record.gap and each.number > last)])
    return in_order(record.ticks, commands, whole=not record.gap)


def by_number(ticks: Sequence[Tick], commands: Sequence[Command]) -> Pairing:
    """Pair a tick with the force of its number; a second one, or one of none, is unpaired."""
    forces = {number: tick.force for number, tick in sent_by(ticks)}
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
    # a controller ends with a zero, and a recording may end before the report on its last force
    if rest and (rest[0].force == 0.0 or rest == [commands[-1]]):
        del rest[0]
    return Pairing(others, missing, second + rest)


def in_order(ticks: Sequence[Tick], commands: Sequence[Command], whole: bool) -> Pairing:
    """Pair them one after the other, and after a difference where they meet again."""
    ticks = [tick for _, tick in sent_by(ticks)]
    others: dict[int, float] = {}
    missing, unpaired = list[Tick](), list[Command]()
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
            unpaired += commands[j + len(pairs):next_j]
        i, j = next_i + block.size, next_j + block.size
    return Pairing(others, missing, unpaired)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The motion in a bag: when each state was measured and each command sent, by one clock."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dp_swing_ros.bags.episodes import (
    command_topic, commands_of, completed, configurations_of, links_of, reports_of, samples_of,
    states_in)
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError, UserError
from dp_swing_ros.identification.segments import check_sizes, check_span, Motion, period_of
from dp_swing_ros.messages.configuration import CONTROLLER, PLANT
from dp_swing_ros.messages.fields import BILLION, nanoseconds, Report
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.parameters import (
    Drive, DriveParameters, LimitParameters, PendulumParameters)
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.topics import DISTURBANCE

APART = 1.0    # [s] between stamps and the times of sending, beyond which their clocks differ
LOOSE = 0.02   # [s] by which two clocks may differ from a straight line
LOCKSTEP = 'lockstep: a command acts as long after the stamp of its state as the mpc says'
SAME = 'a command counts from when it was sent; stamps are of the same clock'
OTHER = 'a command counts from when it was sent; stamps are of another clock, which was fitted'
LOGGED = ('stamps cannot be used: states and commands count from when they were sent, and the '
          'delay holds what the sensors take')


class Recorded(NamedTuple):
    """
    The motion in a bag, how its times were found, and what its controller took for granted.

    V (K, n + 1) are the speeds, as measured or else as estimated; NaN where they are neither.
    estimated are pendulum and drive as the controller had them in the end, but for gain, bias.
    """

    motion: Motion
    V: Array
    times: str
    physical: PendulumParameters
    drive: Drive
    estimated: tuple[PendulumParameters, Drive]


class Log(NamedTuple):
    """When states were sent, and the stamps that they bear [s]; shapes: (K,)."""

    sent: Array
    stamps: Array


def recorded(bag: Bag, links: int | None = None, commanded: bool = True) -> Recorded:
    """
    Return the motion in a bag, of so many links if it is said; without commands, if not wanted.

    Raises BagError, also where its times and numbers are those of no motion.
    """
    try:
        found = _recorded(bag, links, commanded)
        period_of(found.motion.t)
        check_sizes(found.motion.Q, found.V, found.motion.commands)
    except BagError:
        raise
    except UserError as error:
        raise BagError(f'{bag} has no motion to learn from: {error}') from None
    return found


def _recorded(bag: Bag, links: int | None, commanded: bool) -> Recorded:
    if links not in (None, links_of(bag)):
        raise BagError(f'{bag} is of {links_of(bag)} links; {links} were asked for (--links)')
    if commanded and not bag.has(command_topic(bag)):
        raise BagError(f'{bag} has no commands on {command_topic(bag).name}; record joint_states '
                       'and commands together, or identify the links alone (--cart given)')
    (times, log), reports = clock_of(bag), reports_of(bag)
    samples = completed(samples_of(bag, as_sent=times == LOGGED), reports)
    start = log.stamps[0] if times != LOGGED else log.sent[0]
    samples = [each for each in samples if np.all(np.isfinite(each.x[:len(each.x) // 2]))]
    if len(samples) < 2:
        raise BagError(f'{bag} has {len(samples)} states with finite positions; expected some '
                       'half minute of them')
    sent, commands = commands_in(bag, times, log, reports) if commanded else np.zeros((2, 0))
    if commanded and not len(sent):
        raise BagError(f'{bag} has no finite command on {command_topic(bag).name}; record a run '
                       'under control')
    order = np.argsort(sent, kind='stable')
    Q, V = np.hsplit(np.array([each.x for each in samples]), 2)
    Q[:, 1:] = np.unwrap(Q[:, 1:], axis=0)
    values = configurations_of(bag)
    nominal = values[CONTROLLER].parameters if CONTROLLER in values else {}
    t = np.array([each.stamp / BILLION for each in samples])
    motion = Motion(t - start, Q, sent[order] - start, commands[order],
                    pushes_in(bag, times, log) - start,
                    bag.parse(group, LimitParameters, nominal).track_limit)
    physical = bag.parse(group, PendulumParameters, {**nominal, 'links': links_of(bag)})
    drive = Drive.of(bag.parse(group, DriveParameters, nominal))
    return Recorded(motion, V, times, physical, drive, estimated(reports, physical, drive))


def recorded_of_one(bags: Sequence[Bag], links: int | None = None,
                    commanded: bool = True) -> list[Recorded]:
    """Return the motions in bags of one pendulum; raises BagError, and UserError for several."""
    found = [recorded(bag, links, commanded) for bag in bags]
    first = found[0].physical.links
    for bag, each in zip(bags, found):
        if each.physical.links != first:
            raise UserError(f'{bag} is of {each.physical.links} links, {bags[0]} of {first}; take '
                            'one rig at a time')
    return found


def estimated(reports: Sequence[Report], physical: PendulumParameters,
              drive: Drive) -> tuple[PendulumParameters, Drive]:
    """Return pendulum, delay and lag as the last report has them that has any, else nominal."""
    for report in reversed(reports):
        found = report.values
        if 'motor_time_constant' in found:
            known = {name: float(found[name]) for name in vars(physical) if name in found}
            return physical.estimated(known), Drive(
                float(found['actuation_delay']), float(found['motor_time_constant']))
    return physical, Drive(drive.delay, drive.time_constant)


def clock_of(bag: Bag) -> tuple[str, Log]:
    """Return how times of stamps and of sending go together."""
    states = states_in(bag)
    log = Log(np.array([entry.time for entry, _ in states]) / BILLION,
              np.array([nanoseconds(message.header.stamp) for _, message in states]) / BILLION)
    plant = configurations_of(bag).get(PLANT)
    if plant is not None and plant.parameters.get('lockstep'):
        return LOCKSTEP, log
    if len(set(log.stamps)) < 0.9 * len(log.stamps):
        return LOGGED, log
    if np.median(np.abs(log.sent - log.stamps)) < APART:
        return SAME, log
    ages = log.stamps - on_stamps(log, log.sent)
    return (OTHER if np.std(ages) < LOOSE else LOGGED), log


def on_stamps(log: Log, times: Array) -> Array:
    """
    Return times of sending [s] by the clock of the stamps, as a straight line has it.

    Raises UserError where there is no such line.
    """
    check_span(log.sent)
    middle = log.sent.mean()
    pace, at_middle = np.polyfit(log.sent - middle, log.stamps, 1)
    on_line: Array = at_middle + pace * (times - middle)
    return on_line


def commands_in(bag: Bag, times: str, log: Log,
                reports: Sequence[Report]) -> tuple[Array, Array]:
    """Return when finite commands were sent, by the clock of the motion [s], and which [N]."""
    reports = [each for each in reports if {'delay', 'force'} <= each.values.keys()]
    if times == LOCKSTEP and reports:
        found = [(each.stamp / BILLION + float(each.values['delay']), float(each.values['force']))
                 for each in reports]
    else:
        found = [(each.time / BILLION, each.force) for each in commands_of(bag)]
    sent, commands = np.array([each for each in found if np.isfinite(each[1])]).reshape(-1, 2).T
    if times == LOCKSTEP and not reports:   # each answers the last state before it
        sent = log.stamps[np.maximum(np.searchsorted(log.sent, sent) - 1, 0)]
    elif times == OTHER:
        sent = on_stamps(log, sent)
    return sent, commands


def pushes_in(bag: Bag, times: str, log: Log) -> Array:
    """Return about when disturbances were sent, by the clock of the motion [s]."""
    entries = bag.entries_of(DISTURBANCE) if bag.has(DISTURBANCE) else []
    sent = np.array([entry.time for entry in entries]) / BILLION
    return on_stamps(log, sent) if entries and times != LOGGED else sent

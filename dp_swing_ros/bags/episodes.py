# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads a bag as an episode, and what its nodes ran with; needs no ROS."""

from collections.abc import Iterable
from contextlib import suppress
from functools import lru_cache
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.bags.mcap_reader import Entry
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.configuration import (
    Configuration, CONTROLLER, from_text, PLANT, role_of)
from dp_swing_ros.messages.fields import (
    BILLION, from_diagnostics, links_in, nanoseconds, Report, to_force, to_measured, to_state)
from dp_swing_ros.messages.states import by_publisher, FEW, Kind, kind_of, States
from dp_swing_ros.messages.ticks import keys_of_state, KINDS
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.parameters import (
    DRIVES, FORCE, LimitParameters, PendulumParameters, VELOCITY)
from dp_swing_ros.pendulum.sensors import default_sensors, SensorParameters
from dp_swing_ros.pendulum.state import (
    Array, joints, LINKS, links_of as links_of_state, to_turn_of)
from dp_swing_ros.pendulum.urdf import from_urdf
from dp_swing_ros.simulation.episode import Episode, Ticks
from dp_swing_ros.topics import (
    COMMAND_TOPICS, CONFIGURATION, DIAGNOSTICS, DISTURBANCE, FORCE_COMMAND, JOINT_STATES,
    ROBOT_DESCRIPTION, Topic)

LARGEST = 1e100   # [m, rad, m/s, rad/s] of a run; what has diverged further cannot be drawn
LONGEST = 1e6     # [s] of a run


class Sample(NamedTuple):
    """A state as it was published."""

    stamp: int    # [ns]
    x: Array
    force: float  # [N] over the period before


class Command(NamedTuple):
    """A force on the topic."""

    number: int   # that its publisher gave it
    time: int     # [ns] when it was sent, or received where that is not known
    force: float  # [N]


def read_episode(path: Path | str, partial: bool = False,
                 namespace: str | None = None) -> Episode:
    """
    Read the run in a bag, given its folder or its MCAP file.

    A file without an end, as a logger leaves that was killed, is read only if `partial`. Of
    several pendulums the namespace, such as '/second', says which.
    Raises BagError, saying what was found, what is expected and what to do.
    """
    return episode_of(Bag(path, partial, namespace))


def episode_of(bag: Bag) -> Episode:
    """Return the run in a bag; raises as `read_episode`."""
    reports = reports_of(bag)
    samples = differenced(completed(samples_of(bag), reports, drive_of(bag) == VELOCITY))
    start = samples[0].stamp
    physical, limits = description_of(bag)
    if physical.links != links_of_state(samples[0].x):
        raise BagError(f'{bag} has states of {links_of_state(samples[0].x)} links, but a robot '
                       f'description of {physical.links}; record a run with the logger')
    check_run(bag, samples)
    return Episode(
        t=np.array([sample.stamp - start for sample in samples]) / BILLION,
        X=np.array([sample.x for sample in samples]),
        U=np.array([sample.force for sample in samples[1:]]),
        # where the plant has ended, or its states were lost, nothing more is of the run
        ticks=bag.parse(_ticks, [report for report in reports
                                 if report.stamp <= samples[-1].stamp], start),
        solver=str(reports[-1].values.get('solver', '')) if reports else '',
        physical=physical, limits=limits, incomplete=bag.incomplete,
        goal=goal_of(bag, physical.links))


def check_run(bag: Bag, samples: list[Sample]) -> None:
    """Raise BagError where times or states are those of no run, so that none can be repeated."""
    duration = (samples[-1].stamp - samples[0].stamp) / BILLION
    largest = max(float(np.max(np.abs(each.x), initial=0.0, where=np.isfinite(each.x)))
                  for each in samples)
    if duration > LONGEST or largest > LARGEST:
        raise BagError(f'{bag} has states over {duration:.3g} s of up to {largest:.3g}; expected '
                       f'a run of at most {LONGEST:g} s and {LARGEST:g} m, rad, m/s or rad/s')


def samples_of(bag: Bag, as_sent: bool = False) -> list[Sample]:
    """
    Return the states of a run in the order of their stamps; raises as `read_episode`.

    If `as_sent`, and where the stamps of a driver stand still, they are the times of sending.
    """
    samples: dict[int, Sample] = {}
    links = links_of(bag)
    sensors, entries = sensors_of(bag, links), states_in(bag)
    found = [bag.parse(_sample, message, links, sensors) for _, message in entries]
    if as_sent or stand_still(sample.stamp for sample in found):
        found = [sample._replace(stamp=entry.time)
                 for (entry, _), sample in zip(entries, found)]
    for sample in found:
        before = samples.setdefault(sample.stamp, sample)
        if not np.array_equal(before.x, sample.x, equal_nan=True):
            raise BagError(f'{bag} has two states at {sample.stamp} ns: the '
                           'plant was reset in lockstep, or two plants ran; record one run')
    if len(samples) < 2:
        raise BagError(f'{bag} has {len(samples)} states; at least 2 make a run')
    return [samples[stamp] for stamp in sorted(samples)]


def states_in(bag: Bag) -> list[tuple[Entry, Any]]:
    """
    Return the states on their topic, as an mpc picks them live; raises as `read_episode`.

    Those of other robots are left out, and of a second publisher, and one that is there twice.
    """
    wanted = sensors_of(bag, links_of(bag)).joint_names
    messages = [(entry, bag.decoded(entry)) for entry in bag.entries_of(JOINT_STATES)]
    found = [(entry, message) for entry, message in messages
             if kind_of(message.name, wanted) is Kind.STATE]
    if not found:
        bag.parse(to_measured, messages[0][1], wanted)   # says what is missing
    states = States(wanted)
    publishers = by_publisher([entry.sequence for entry, _ in found], [
        bag.parse(to_measured, message, wanted)[:len(wanted)] for _, message in found])
    return [(entry, message) for (entry, message), publisher in zip(found, publishers)
            if states.picks(message, publisher, entry.sequence, entry.received / BILLION)]


def completed(samples: list[Sample], reports: list[Report],
              of_velocities: bool = False) -> list[Sample]:
    """
    Return states in which estimate and command of the controller stand for what is missing.

    Of velocities that were commanded, the acceleration from one to the next does.
    """
    ticks = {report.stamp: report.values for report in reports}
    found, command, sent = [], math.nan, math.nan
    for sample, after in zip(samples, [*samples[1:], samples[-1]]):
        values = ticks.get(sample.stamp, {})
        q, v = np.hsplit(sample.x, 2)
        if np.isfinite(q).all():   # else it is no state at all
            keys = keys_of_state('estimate', links_of_state(sample.x))[len(q):]
            v = np.where(np.isnan(v), [values.get(key, math.nan) for key in keys], v)
        found.append(Sample(sample.stamp, np.concatenate((q, v)),
                            sent if math.isnan(sample.force) else sample.force))
        before, command = command, float(values.get('force', command))
        sent = command
        if of_velocities:
            lasts = (after.stamp - sample.stamp) / BILLION
            sent = (command - before) / lasts if lasts else math.nan
    return found


def differenced(samples: list[Sample]) -> list[Sample]:
    """
    Return states in which differences of positions stand for velocities that nobody gave.

    So of states without velocities from before the first tick, and after the last.
    """
    found = []
    for sample, other in zip(samples, [samples[1], *samples]):
        q, v = np.hsplit(sample.x, 2)
        moved = np.hsplit(to_turn_of(sample.x, other.x) - other.x, 2)[0]
        missing = np.isnan(v) & np.isfinite(q).all()
        rate = moved * BILLION / (sample.stamp - other.stamp)
        found.append(sample._replace(x=np.concatenate((q, np.where(missing, rate, v)))))
    return found


def drive_of(bag: Bag) -> str:
    """Return what takes the commands in a bag, a force where nothing is said; raises BagError."""
    drives = (found.parameters.get('drive') for found in configurations_of(bag).values())
    return next((drive for drive in drives if drive in tuple(DRIVES)), FORCE)


def command_topic(bag: Bag) -> Topic:
    """Return the topic of commands that a bag has; that of forces where it has none."""
    return next(filter(bag.has, COMMAND_TOPICS), FORCE_COMMAND)


def commands_of(bag: Bag) -> list[Command]:
    """Return the commands on their topic in the order in which they were sent."""
    topic = command_topic(bag)
    entries = bag.entries_of(topic) if bag.has(topic) else []
    found = [Command(entry.sequence, entry.time, bag.parse(
        lambda message: float(message.data), bag.decoded(entry))) for entry in entries]
    return sorted(found, key=lambda command: command.time)


def links_of(bag: Bag) -> int:
    """
    Return the number of links of the pendulum in a bag.

    It is what the plant, or else the controller, was configured with; without that, what the
    robot description says, if it is one of a pendulum; else it is by the names of the joints, of
    which another robot may have more. Raises BagError.
    """
    configurations = configurations_of(bag)
    for node in (PLANT, CONTROLLER):
        if node in configurations and 'links' in configurations[node].parameters:
            return bag.parse(_checked_links, configurations[node].parameters['links'])
    for message in bag.any_of(ROBOT_DESCRIPTION)[-1:]:
        with suppress(AttributeError, TypeError, ValueError):  # of another robot
            return from_urdf(message.data)[0].links
    messages = bag.of(JOINT_STATES)
    return bag.parse(links_in, next((message for message in messages if kind_of(
        message.name, joints(links_in(message))) is Kind.STATE), messages[0]))


def sensors_of(bag: Bag, links: int) -> SensorParameters:
    """
    Return how the controller of a bag read its sensors, if it was one of so many links.

    Raises BagError where what it announced is for another number of them.
    """
    found = configurations_of(bag)
    values = found[CONTROLLER].parameters if CONTROLLER in found else {}
    given = values if values.get('links') == links else {}
    sensors = bag.parse(group, SensorParameters, {**default_sensors(links), **given})
    for name, default in default_sensors(links).items():
        if len(getattr(sensors, name)) != len(default):
            raise BagError(f'{bag} is of {links} links, but its {CONTROLLER} announced '
                           f'{len(getattr(sensors, name))} {name}; expected {len(default)}')
    return sensors


def goal_of(bag: Bag, links: int) -> Array | None:
    """Return the state that the controller was to hold, if there was one of so many links."""
    found = configurations_of(bag)
    values = found[CONTROLLER].parameters if CONTROLLER in found else {}
    if values.get('links') != links or 'reference' not in values:
        return None
    # with numba, which a logger does without
    from dp_swing_ros.problem.parameters import CostParameters
    return bag.parse(lambda: group(CostParameters, values).x_r)


def _checked_links(links: Any) -> int:
    if links not in LINKS:
        raise ValueError(f'links is {links!r}; expected one of {", ".join(map(str, LINKS))}')
    return int(links)


_configuration = lru_cache(8)(from_text)   # who looks at a bag asks for the same ones often


def configurations_of(bag: Bag) -> dict[str, Configuration]:
    """
    Return what the nodes of a bag ran with, by their roles: plant, mpc, logger.

    Of a node that was started again it is the last start, before any change. Raises BagError.
    """
    return {node: revisions[min(revisions)] for node, revisions in revisions_of(bag).items()}


def revisions_of(bag: Bag) -> dict[str, dict[int, Configuration]]:
    """
    Return what the nodes of a bag ran with, one change after the other; raises BagError.

    By their roles, and by the number of the change.
    """
    found: dict[str, dict[str, dict[int, Configuration]]] = {}   # by role and name
    for message in bag.any_of(CONFIGURATION):
        each = bag.parse(lambda message: _configuration(message.data), message)
        revisions = found.setdefault(role_of(each), {}).setdefault(each.node, {})
        if each.revision == 0:   # it was started again, or says it once more
            revisions.clear()
        revisions[each.revision] = each
    names = {name for nodes in found.values() for name in nodes}
    if bag.nodes - names:
        raise BagError(f'{bag} has no node {", ".join(bag.nodes - names)}, but '
                       f'{", ".join(sorted(names)) or "none that says what it is"}')
    return {role: nodes[bag.chosen(role, sorted(nodes))] for role, nodes in found.items()}


def description_of(bag: Bag) -> tuple[PendulumParameters, LimitParameters]:
    """
    Return what the robot description of a bag says; raises BagError.

    A rig that has none, or one of its own, is what its controller takes it for; so is the drive of
    one that names none.
    """
    found = configurations_of(bag)
    if CONTROLLER in found and PLANT not in found:
        with suppress(AttributeError, IndexError, TypeError, ValueError):
            return from_urdf(bag.any_of(ROBOT_DESCRIPTION)[-1].data, drive_of(bag))
        values = found[CONTROLLER].parameters
        return (bag.parse(group, PendulumParameters, values),
                bag.parse(group, LimitParameters, values))
    return bag.parse(lambda message: from_urdf(message.data), bag.of(ROBOT_DESCRIPTION)[-1])


def reports_of(bag: Bag) -> list[Report]:
    """Return the controller's reports on its ticks, in order; nothing where there was none."""
    reports = _reports(bag, CONTROLLER, 'solver')
    answers = [report for report in reports if report.values.get('sent')]
    if stand_still(report.stamp for report in answers):
        reports = [report._replace(stamp=int(report.values.get('sent') or report.stamp))
                   for report in reports]
    return sorted(reports, key=lambda report: report.stamp)


def pushes_of(bag: Bag) -> dict[int, float]:
    """
    Return the pushes that the plant took [N], by the times that their periods began at [ns].

    Raises BagError where somebody pushed, and the plant does not say when that acted.
    """
    if not bag.has(DISTURBANCE):
        return {}
    reports = _reports(bag, PLANT, 'lost_commands')
    if not any('push' in report.values for report in reports):
        raise BagError(f'{bag} has {DISTURBANCE.name}, but its {PLANT} does not say through which '
                       'period each push acted; record it anew, with /diagnostics')
    return bag.parse(lambda: {report.stamp: float(report.values['push'])
                              for report in reports if report.values.get('push')})


def _reports(bag: Bag, role: str, sign: str) -> list[Report]:
    """
    Return the status of the plant, or of the controller, again and again as it came.

    Where it has not announced itself, it is known by its name, or by a figure that is its sign.
    """
    if not bag.has(DIAGNOSTICS):
        return []
    driven = f'/{bag.entries_of(JOINT_STATES)[0].topic.lstrip("/")}'
    configurations, messages = configurations_of(bag), bag.of(DIAGNOSTICS)
    if role in configurations:
        name = configurations[role].node.lstrip('/')
    else:
        names = {status.name for message in messages for status in message.status
                 if status.hardware_id == driven and ':' not in status.name
                 and sign in {pair.key for pair in status.values}}
        name = bag.chosen(role, sorted(names)) if names else role
    return list(filter(None, (bag.parse(from_diagnostics, message, name, driven)
                              for message in messages)))


def stand_still(stamps: Iterable[int]) -> bool:
    """Return whether the stamps of a driver tell nothing, for all are the same."""
    found = list(stamps)
    return len(found) > FEW and len(set(found)) == 1


def _sample(message: Any, links: int, sensors: SensorParameters) -> Sample:
    return Sample(nanoseconds(message.header.stamp), to_state(message, links, sensors),
                  to_force(message, sensors.joint_names[0]))


def _ticks(reports: list[Report], start: int) -> Ticks:
    found: dict[str, Any] = {}
    for key in Ticks._fields[1:]:
        if not all(key in report.values for report in reports):
            raise ValueError(f'a tick of {CONTROLLER} does not give its {key}')
        found[key] = np.array([report.values[key] for report in reports], dtype=KINDS[key])
    return Ticks(np.array([report.stamp - start for report in reports]) / BILLION,
                 **{**found, 'status': found['status'].tolist()})

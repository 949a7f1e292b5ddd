# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What --help prints of a node: what it does, its topics, its parameters."""

from collections.abc import Iterator
import textwrap
from typing import NamedTuple

from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.parameters import expected, shown
from dp_swing_ros.parameters.nodes import OWN
from dp_swing_ros.pendulum.state import DEFAULT_LINKS
from dp_swing_ros.topics import (
    COMMAND_TOPICS, CONFIGURATION, CONTROLLER_COMMANDS, DIAGNOSTICS, DISTURBANCE, JOINT_STATES,
    PLAN, ROBOT_DESCRIPTION, STAMPED_COMMANDS, Topic, TRIES)

WIDTH = 99
SWITCHES = ('mpc/enable', 'plant/pause')   # services that are asked for true or false
USAGE = """\
usage: ros2 run dp_swing_ros {name} [-h] [--ros-args [-p PARAMETER:=VALUE ...]
           [--params-file FILE ...] [-r __ns:=/NAMESPACE] [-r TOPIC:=OTHER ...]]"""


class About(NamedTuple):
    """What a node does, and by which topics and services."""

    does: str
    publishes: tuple[Topic, ...]
    subscribes: tuple[Topic, ...]
    services: tuple[str, ...] = ()


NODE: dict[str, About] = {
    'plant': About(
        'Integrates the pendulum on its cart, publishes its state at a fixed rate and '
        'obeys the force: in real time, on /clock with use_sim_time, or in lockstep.',
        (JOINT_STATES, DIAGNOSTICS, ROBOT_DESCRIPTION, CONFIGURATION),
        (*COMMAND_TOPICS, DISTURBANCE), ('plant/reset', 'plant/pause', 'plant/step')),
    'mpc': About(
        'Solves for a plan from each state, warm-started by the last one, and publishes the '
        'force that it begins with.',
        (*COMMAND_TOPICS, *dict.fromkeys(STAMPED_COMMANDS.values()), PLAN, TRIES, DIAGNOSTICS,
         CONFIGURATION), (JOINT_STATES, ROBOT_DESCRIPTION, CONFIGURATION),
        ('mpc/reset', 'mpc/enable')),
    'relay': About(
        'Hands commands on to a forward_command_controller of ros2_control, and a zero where '
        'none comes for 0.25 s.', (*CONTROLLER_COMMANDS.values(), CONFIGURATION),
        (*COMMAND_TOPICS, JOINT_STATES)),
    'logger': About('Writes topics to an MCAP bag that rosbag2 opens.', (CONFIGURATION,), ()),
    'replay': About(
        'Plays a bag back onto its topics with its recorded timing.',
        (CONFIGURATION,), (), tuple(f'replay/{name}' for name in (
            'pause', 'resume', 'toggle_paused', 'is_paused', 'play_next'))),
    'console': About(
        'Serves a page that shows the pendulum, its plan and its parameters, and lets hands on '
        'them; of a recorded run, without ROS: console BAG.',
        (DISTURBANCE, CONFIGURATION),
        (JOINT_STATES, *COMMAND_TOPICS, DISTURBANCE, PLAN, TRIES, DIAGNOSTICS, ROBOT_DESCRIPTION,
         CONFIGURATION))}


def lines(name: str) -> Iterator[str]:
    """Yield the lines of the help on a node."""
    about = NODE[name]
    yield USAGE.format(name=name)
    yield from ('', *textwrap.wrap(about.does, WIDTH))
    for title, topics in (('publishes', about.publishes), ('subscribes', about.subscribes)):
        if topics:
            yield from ('', f'{title}:', *(f'  {each.name:21} {each.type}' for each in topics))
    if about.services:
        yield from ('', 'services:', *(
            f'  {each:21} std_srvs/srv/{"SetBool" if each in SWITCHES else "Trigger"}'
            for each in about.services))
    fields = OWN[name] if name in OWN else DECLARATIONS[name].fields(DEFAULT_LINKS)
    if fields:
        yield from ('', 'parameters, with their defaults:')
    for full, field in fields.items():
        yield f'  {full}:={shown(field.default)} {field.metadata["unit"]}'.rstrip()
        text, limits = field.metadata['description'], expected(field)
        text += f' ({limits})' if limits else ''
        yield from textwrap.wrap(text, WIDTH, initial_indent=' ' * 6, subsequent_indent=' ' * 6)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Parameters of logger, replay and relay, and of all nodes but plant and mpc; needs no ROS.

Plant and mpc have theirs where the plant and the controller are: see declarations.py.
"""

import dataclasses

from dp_swing_ros.parameters import named, parameter, Parameters
from dp_swing_ros.parameters.console import ConsoleParameters
from dp_swing_ros.topics import TOPICS

POSITION = 'position'
# whose commands a controller takes, by its command interface
RELAYED = {'effort': 'force', 'acceleration': 'acceleration', 'velocity': 'velocity',
           POSITION: 'velocity'}
SENT, RECEIVED = ORDERS = ('sent', 'received')  # the time of a message that counts


@dataclasses.dataclass(frozen=True)
class LoggerParameters(Parameters):
    """What to record, where, and how safely."""

    output: str = parameter(
        '', 'folder of the bag, which must not exist; empty: named by the time, here')
    topics: tuple[str, ...] = parameter(
        tuple(topic.name for topic in TOPICS), 'topics to record, as soon as they have publishers')
    flush_period: float = parameter(
        0.05, 'longest time that a message stays in the process, which a kill would lose',
        unit='s', minimum=0.001)
    chunk_size: int = parameter(
        1 << 20, 'size of uncompressed messages after which they are written at once',
        unit='bytes', minimum=1024)
    fsync: bool = parameter(
        False, 'wait for the disk at each flush, so that messages survive a power cut, too')
    max_bagfile_size: int = parameter(
        0, 'size after which the next file of the bag begins (0: never)', unit='bytes', minimum=0)
    max_bagfile_duration: float = parameter(
        0.0, 'time after which the next file of the bag begins (0: never)', unit='s', minimum=0.0)
    progress_period: float = parameter(
        5.0, 'time between two lines on the progress (0: none)', unit='s', minimum=0.0)


@dataclasses.dataclass(frozen=True)
class ReplayParameters(Parameters):
    """What to play, and how; named as the options of `ros2 bag play` are."""

    bag: str = parameter('', 'folder of the bag to play, or its .mcap file; must be given')
    partial: bool = parameter(False, 'play what there is of a bag whose logger was killed')
    # an empty list would not show of what it is a list
    topics: tuple[str, ...] = parameter(('',), 'topics to play; empty: all')
    rate: float = parameter(1.0, 'times as fast as recorded', minimum=1e-3)
    start_offset: float = parameter(
        0.0, 'where to begin, after the first message of the bag', unit='s', minimum=0.0)
    playback_duration: float = parameter(
        0.0, 'how much of the bag to play, in its own time (0 or less: all)', unit='s')
    message_order: str = parameter(
        SENT, 'the time that counts of each message: when it was sent, or when it was received',
        choices=lambda: list(ORDERS))
    loop: bool = parameter(False, 'begin again after the last message')
    clock: float = parameter(
        0.0, 'publish the time of the bag on /clock so often, and before every message, for '
        'nodes with use_sim_time (0: not at all)', unit='Hz', minimum=0.0, maximum=1e4)
    start_paused: bool = parameter(False, 'wait for the service replay/resume or replay/play_next')
    wait: float = parameter(
        2.0, 'at most, for subscribers of the topics to be found', unit='s', minimum=0.0)
    delay: float = parameter(0.0, 'before the first message', unit='s', minimum=0.0)


@dataclasses.dataclass(frozen=True)
class RelayParameters(Parameters):
    """What the controller takes that commands are handed on to."""

    interface: str = parameter(
        'effort', 'command interface of the controller: effort, for the drives force and voltage; '
        'acceleration; velocity, or position, their integral, for the drive velocity',
        choices=lambda: list(RELAYED))
    joint: str = parameter(
        'cart', 'joint of the cart in joint_states, which tells where positions begin')


# by the name of the node, but for plant and mpc
OWN = {'relay': named(RelayParameters), 'logger': named(LoggerParameters),
       'replay': named(ReplayParameters), 'console': named(ConsoleParameters)}

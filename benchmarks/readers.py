# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags of numbered messages, through our reader and those of others."""

from collections.abc import Callable
from pathlib import Path
import shutil
import subprocess
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
from rosbags.highlevel import AnyReader

from dp_swing_ros.bags.reader import Bag

Numbers = dict[str, list[int]]  # by topic, as recorded
Verdicts = dict[str, bool]      # by reader: it reads the bag, and finds the same


def read(bag: Path) -> tuple[Numbers, Verdicts]:
    """Return the numbers in a bag of one file, and which other readers get them, too."""
    numbers: Numbers = {}
    content = Bag(bag, topics=[''])
    for entry in content.entries:
        numbers.setdefault(entry.topic, []).append(round(content.decoded(entry).data))
    readers = {'rosbags': agrees(rosbags_numbers, bag, numbers),
               'mcap-ros2-support': agrees(mcap_numbers, bag, numbers)}
    if shutil.which('rerun') is not None:
        readers['`rerun mcap check`'] = subprocess.run(
            ['rerun', 'mcap', 'check', *bag.glob('*.mcap')], capture_output=True).returncode == 0
    return numbers, readers


def agrees(reader: Callable[[Path], Numbers], bag: Path, numbers: Numbers) -> bool:
    """Return whether a reader finds these numbers; how it fails is for people to see."""
    try:
        return reader(bag) == numbers
    except Exception as error:
        print(f'{bag}: {type(error).__name__}: {error}', file=sys.stderr)
        return False


def rosbags_numbers(bag: Path) -> Numbers:
    """Read with rosbags."""
    numbers: Numbers = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            value = reader.deserialize(data, connection.msgtype).data
            numbers.setdefault(connection.topic, []).append(round(value))
    return numbers


def mcap_numbers(bag: Path) -> Numbers:
    """Read with mcap-ros2-support."""
    numbers: Numbers = {}
    with next(bag.glob('*.mcap')).open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            numbers.setdefault(channel.topic, []).append(round(message.data))
    return numbers


def whole(numbers: Numbers) -> bool:
    """Return whether no number is missing between the first and the last of each topic."""
    return all((np.diff(each) == 1).all() for each in numbers.values())

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags through the readers of others; those of numbered messages through ours, too."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
import shutil
import subprocess
import sys
from typing import Any

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
from rosbags.highlevel import AnyReader

from dp_swing_ros.bags.reader import Bag

Messages = Iterator[tuple[str, Callable[[], Any]]]   # their topics, and what decodes them
Numbers = dict[str, list[int]]  # by topic, as recorded
Verdicts = dict[str, bool]      # by reader: it reads the bag, and finds the same


def by_rosbags(bag: Path) -> Messages:
    """Read with rosbags."""
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            yield connection.topic, partial(reader.deserialize, data, connection.msgtype)


def by_mcap(bag: Path) -> Messages:
    """Read with mcap-ros2-support."""
    factory = DecoderFactory()
    with next(bag.glob('*.mcap')).open('rb') as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            decode: Any = factory.decoder_for(channel.message_encoding, schema)
            yield channel.topic, partial(decode, message.data)


OTHERS: dict[str, Callable[[Path], Messages]] = {
    'rosbags': by_rosbags, 'mcap-ros2-support': by_mcap}


def read(bag: Path) -> tuple[Numbers, Verdicts]:
    """Return the numbers in a bag of one file, and which other readers get them, too."""
    numbers: Numbers = {}
    content = Bag(bag, topics=[''])
    for entry in content.entries:
        numbers.setdefault(entry.topic, []).append(round(content.decoded(entry).data))
    readers = {name: agrees(messages, bag, numbers) for name, messages in OTHERS.items()}
    if shutil.which('rerun') is not None:
        readers['`rerun mcap check`'] = subprocess.run(
            ['rerun', 'mcap', 'check', *bag.glob('*.mcap')], capture_output=True).returncode == 0
    return numbers, readers


def agrees(messages: Callable[[Path], Messages], bag: Path, numbers: Numbers) -> bool:
    """Return whether a reader finds these numbers; how it fails is for people to see."""
    try:
        return numbers_of(messages(bag)) == numbers
    except Exception as error:
        print(f'{bag}: {type(error).__name__}: {error}', file=sys.stderr)
        return False


def numbers_of(messages: Messages) -> Numbers:
    """Return the numbers that messages hold."""
    numbers: Numbers = {}
    for topic, decode in messages:
        numbers.setdefault(topic, []).append(round(decode().data))
    return numbers


def whole(numbers: Numbers) -> bool:
    """Return whether no number is missing between the first and the last of each topic."""
    return all((np.diff(each) == 1).all() for each in numbers.values())

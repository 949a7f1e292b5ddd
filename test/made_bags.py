# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags that are made up: numbers on topics, each with its times."""

import struct

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.messages.definitions import schema

FLOAT = 'std_msgs/msg/Float64'
START = 1_700_000_000_000_000_000  # [ns] when the recording begins
VOLATILE = {'history': 'keep_last', 'depth': 10, 'reliability': 'reliable',
            'durability': 'volatile'}
LATCHED = {**VOLATILE, 'durability': 'transient_local'}


def encoded(number):
    """Return a Float64 as it is on the wire."""
    return b'\x00\x01\x00\x00' + struct.pack('<d', number)


def write_bag(folder, messages, qos=VOLATILE):
    """Write (time [s], topic, number) or (time, topic, number, time of receipt); return it."""
    writer = BagWriter(folder)
    for topic in sorted({message[1] for message in messages}):
        writer.add(Recorded(topic, FLOAT, schema(FLOAT), '', [qos]))
    for time, topic, number, *received in messages:
        sent = START + round(time * 1e9)
        writer.write(topic, encoded(number),
                     START + round(received[0] * 1e9) if received else sent, sent)
    writer.close()
    return folder

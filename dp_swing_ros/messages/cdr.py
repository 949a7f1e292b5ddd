# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What messages are as bytes: the parts of them, and many that differ in numbers alone.

Source of the encoding: OMG, DDS-XTypes 1.3, 7.4 (XCDR version 1, little endian).
"""

from collections.abc import Sequence
import struct
from typing import Any

import numpy as np

from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.state import Array

ENCAPSULATION = b'\0\1\0\0'   # CDR, little endian
STAMP = 8                     # [bytes]; what is aligned is so from behind the encapsulation


def count(number: int) -> bytes:
    """Return how many there are of what follows."""
    return struct.pack('<I', number)


def string(text: str) -> bytes:
    """Return a string, up to a multiple of four bytes."""
    data = text.encode()
    return count(len(data) + 1) + data + bytes(4 - len(data) % 4)   # ends with a zero


def text(words: str) -> bytes:
    """Return a String message."""
    return ENCAPSULATION + string(words)


def floats(values: Array) -> Array:
    """Return values (K,) as Float64 messages (K,)."""
    rows = np.zeros(len(values), [('head', f'V{len(ENCAPSULATION)}'), ('data', '<f8')])
    rows['head'], rows['data'] = np.void(ENCAPSULATION), values
    return rows


def joint_states(stamps: Array, q: Array, v: Array | None, force: Array | None,
                 names: Sequence[str]) -> Array:
    """
    Return positions, speeds and the force on the cart as JointState messages (K,).

    Shapes: stamps (K,) [ns], q and v (K, n + 1), force (K,) [N].
    """
    fixed: list[tuple[str, bytes]] = [('encapsulation', ENCAPSULATION)]
    fields: list[Any] = [('encapsulation', f'V{len(ENCAPSULATION)}'), ('sec', '<i4'),
                         ('nanosec', '<u4')]
    head, place = b''.join((string(''), count(len(names)), *map(string, names))), STAMP
    effort = None if force is None else np.pad(force[:, None], ((0, 0), (0, len(names) - 1)))
    numbers = {'position': q, 'velocity': v, 'effort': effort}
    for name, values in numbers.items():
        head += count(0 if values is None else len(names))
        if values is not None:
            head += bytes(-(place + len(head)) % 8)
            fixed.append((f'before_{name}', head))
            fields += [(f'before_{name}', f'V{len(head)}'), (name, '<f8', (len(names),))]
            place, head = place + len(head) + 8 * len(names), b''
    if head:
        fixed.append(('end', head))
        fields.append(('end', f'V{len(head)}'))
    rows = np.zeros(len(stamps), fields)
    for name, data in fixed:
        rows[name] = np.void(data)
    rows['sec'], rows['nanosec'] = np.divmod(stamps, BILLION)
    for name, values in numbers.items():
        if values is not None:
            rows[name] = values
    return rows

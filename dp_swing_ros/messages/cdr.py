# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Messages as the bytes that are sent and recorded: publishers take them as they take messages.

To make a plan or a report of Python objects, and to take them apart again, takes longer than to
solve for it; of a log there are a million. Source of the encoding: OMG, DDS-XTypes 1.3, 7.4 (XCDR
version 1, little endian).
"""

from collections.abc import Iterable, Mapping, Sequence
import functools
import struct
from typing import Any

import numpy as np

from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.state import Array, joints, links_of
from dp_swing_ros.problem.plan import Plan

ENCAPSULATION = b'\0\1\0\0'   # CDR, little endian
STAMP = 8   # [bytes]; what is aligned is so from behind the encapsulation
HALF = 4    # [bytes] by which what is aligned to four may be off from what is aligned to eight


def to_trajectory(plan: Plan, stamp: Any) -> bytes:
    """
    Return a plan as a JointTrajectory.

    The force of a point acts until the next, and that of the last is zero.
    """
    names = joints(links_of(plan.X))
    head = b''.join((_header(stamp), _count(len(names)), *map(_string, names),
                     _count(len(plan.X))))
    points = np.zeros(len(plan.X), _point(len(names)))
    for field in ('positions', 'velocities', 'effort'):
        points[f'{field}_count'] = len(names)
    points['positions'], points['velocities'] = plan.X[:, :len(names)], plan.X[:, len(names):]
    points['effort'][:-1, 0] = plan.U
    points['sec'], points['nanosec'] = divmod(
        np.rint(plan.dt * np.arange(len(plan.X)) * BILLION).astype(np.int64), BILLION)
    # the first has no gap after its first count where that ends on a multiple of eight
    gap = HALF if len(head) % 8 else 0
    data = points.tobytes()
    return b''.join((ENCAPSULATION, head, data[:4], data[4 + gap:]))


def to_diagnostics(stamp: Any, name: str, level: int, message: str,
                   values: Mapping[str, float | int | str], hardware: str = '') -> bytes:
    """Return a node's status as a DiagnosticArray; numbers are written to read back the same."""
    return b''.join((
        ENCAPSULATION, _header(stamp), _count(1), struct.pack('<B3x', level),
        *map(_string, (name, message, hardware)), _count(len(values)), *_pairs(values)))


def to_string(words: str) -> bytes:
    """Return a String message."""
    return ENCAPSULATION + _string(words)


def to_floats(values: Array) -> Array:
    """Return values (K,) as Float64 messages (K,)."""
    rows = np.zeros(len(values), [('head', f'V{len(ENCAPSULATION)}'), ('data', '<f8')])
    rows['head'], rows['data'] = np.void(ENCAPSULATION), values
    return rows


def to_joint_states(stamps: Array, q: Array, v: Array | None, force: Array | None,
                    names: Sequence[str]) -> Array:
    """
    Return positions, speeds and the force on the cart as JointState messages (K,).

    Shapes: stamps (K,) [ns], q and v (K, n + 1), force (K,) [N].
    """
    fixed: list[tuple[str, bytes]] = [('encapsulation', ENCAPSULATION)]
    fields: list[Any] = [('encapsulation', f'V{len(ENCAPSULATION)}'), ('sec', '<i4'),
                         ('nanosec', '<u4')]
    head, place = b''.join((_string(''), _count(len(names)), *map(_string, names))), STAMP
    effort = None if force is None else np.pad(force[:, None], ((0, 0), (0, len(names) - 1)))
    numbers = {'position': q, 'velocity': v, 'effort': effort}
    for name, values in numbers.items():
        head += _count(0 if values is None else len(names))
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


def _pairs(values: Mapping[str, float | int | str]) -> Iterable[bytes]:
    for key, value in values.items():
        yield _key(key)
        yield _string(_text(value))


def _header(stamp: Any) -> bytes:
    return struct.pack('<iI', stamp.sec, stamp.nanosec) + _string('')


def _count(number: int) -> bytes:
    return struct.pack('<I', number)


def _string(text: str) -> bytes:
    data = text.encode()
    return _count(len(data) + 1) + data + bytes(4 - len(data) % 4)   # ends with a zero


_key = functools.lru_cache(_string)   # of which there are few


@functools.cache
def _point(count: int) -> np.dtype:
    """Return the layout of a point of so many joints, from a multiple of eight bytes on."""
    return np.dtype([
        ('positions_count', '<u4'), ('', '<u4'), ('positions', '<f8', (count,)),
        ('velocities_count', '<u4'), ('', '<u4'), ('velocities', '<f8', (count,)),
        ('accelerations_count', '<u4'),   # there are none, so nothing is aligned to eight
        ('effort_count', '<u4'), ('effort', '<f8', (count,)),
        ('sec', '<i4'), ('nanosec', '<u4')])


def _text(value: float | int | str) -> str:
    # true and false are numbers too, and a NumPy number's repr is not its text
    if isinstance(value, str):
        return value
    return str(int(value)) if float(value).is_integer() else repr(float(value))

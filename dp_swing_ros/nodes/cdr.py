# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Long messages as the bytes that are sent: publishers take them as they take messages.

To make a plan or a report of Python objects, and to take them apart again, takes longer than to
solve for it. Source of the encoding: OMG, DDS-XTypes 1.3, 7.4 (XCDR version 1, little endian).
"""

from collections.abc import Iterable, Mapping
import functools
import struct

from builtin_interfaces.msg import Time
import numpy as np

from dp_swing_ros.messages.cdr import count, ENCAPSULATION, string
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.state import joints, links_of
from dp_swing_ros.problem.plan import Plan

HALF = 4   # [bytes] by which what is aligned to four may be off from what is aligned to eight


def to_trajectory(plan: Plan, stamp: Time) -> bytes:
    """
    Return a plan as a JointTrajectory.

    The force of a point acts until the next, and that of the last is zero.
    """
    names = joints(links_of(plan.X))
    head = b''.join((_header(stamp), count(len(names)), *map(string, names),
                     count(len(plan.X))))
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


def to_diagnostics(stamp: Time, name: str, level: int, message: str,
                   values: Mapping[str, float | int | str], hardware: str = '') -> bytes:
    """Return a node's status as a DiagnosticArray; numbers are written to read back the same."""
    return b''.join((
        ENCAPSULATION, _header(stamp), count(1), struct.pack('<B3x', level),
        *map(string, (name, message, hardware)), count(len(values)), *_pairs(values)))


def _pairs(values: Mapping[str, float | int | str]) -> Iterable[bytes]:
    for key, value in values.items():
        yield _key(key)
        yield string(_text(value))


def _header(stamp: Time) -> bytes:
    return struct.pack('<iI', stamp.sec, stamp.nanosec) + string('')


_key = functools.lru_cache(string)   # of which there are few


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

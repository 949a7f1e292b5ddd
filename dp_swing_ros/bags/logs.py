# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Logs as people have them, tables in CSV or Parquet, as bags that everything here reads."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
import math
from pathlib import Path
import re
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.bags.log_files import read_columns
from dp_swing_ros.bags.metadata import Recorded, RECOVERED
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.errors import UserError
from dp_swing_ros.messages.cdr import to_floats, to_joint_states, to_string
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.state import Array, from_joints, hanging, joints, LINKS, to_joints
from dp_swing_ros.topics import FORCE_COMMAND, JOINT_STATES, ROBOT_DESCRIPTION

GAP = 3.0          # periods without a row, from which on they count as a gap
EPOCH = 1e8        # [s] from which on times are those of a clock, and not from a beginning
BEGIN = 1.0        # [s] that the first row has else: at zero, bags say, there is no message
VELOCITY = '_velocity'
TIME, FORCE = 't', 'force'
DEGREE = math.pi / 180
LATEST = 2.0 ** 31  # [s] that a stamp may be
LONGEST = 1e5       # [s] of a log
# what a column is in, by what its name may end in, in SI
UNITS: dict[str, dict[str, float]] = {
    'time': {'s': 1.0, 'sec': 1.0, 'ms': 1e-3, 'us': 1e-6, 'µs': 1e-6, 'ns': 1e-9},
    'length': {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3},
    'angle': {'rad': 1.0, 'mrad': 1e-3, 'deg': DEGREE, 'degree': DEGREE,
              'degrees': DEGREE, '°': DEGREE, 'rev': 2 * math.pi},
    'speed': {'m/s': 1.0, 'm_s': 1.0, 'cm/s': 1e-2, 'mm/s': 1e-3, 'mm_s': 1e-3},
    'angular speed': {'rad/s': 1.0, 'rad_s': 1.0, 'deg/s': DEGREE, '°/s': DEGREE,
                      'deg_s': DEGREE, 'rpm': math.pi / 30},
    'force': {'N': 1.0, 'mN': 1e-3, 'kN': 1e3, 'V': 1.0}}
KINDS = {name: kind for kind, units in UNITS.items() for name in units}
AT_END = re.compile(rf'_({"|".join(map(re.escape, KINDS))})$')
IN_BRACKETS = re.compile(r'[\[(]([^\[(]*)[\])]$')   # which is a unit, known or not


class Column(NamedTuple):
    """What stands for a number of the state: a column of the table, or one value throughout."""

    name: str          # of a column, '' for a value
    unit: str = ''     # as it is said, or found in the name; '' for SI
    factor: float = 1.0
    value: float = math.nan


@dataclass
class Counts:
    """What was odd in a table."""

    rows: int = 0
    without_time: int = 0
    out_of_order: int = 0
    doubled: int = 0
    missing: dict[str, int] = field(default_factory=dict)   # cells, by column


class Log(NamedTuple):
    """
    A table in SI units, in order; what is not there is NaN.

    Shapes: t (K,) [s], from the clock if it has one, else from BEGIN; q and v (K, n + 1) as the
    state has them, force (K,) [N], or [V] as the drive takes it.
    """

    t: Array
    q: Array
    v: Array
    force: Array
    counts: Counts

    @property
    def links(self) -> int:
        """Return the number of links."""
        return self.q.shape[1] - 1

    @property
    def period(self) -> float:
        """Return the median time from a row to the next [s]."""
        return float(np.median(np.diff(self.t)))

    @property
    def gaps(self) -> Array:
        """Return how long the gaps are [s]."""
        steps = np.diff(self.t)
        long: Array = steps[steps > GAP * self.period]
        return long


def names_of(links: int) -> dict[str, str]:
    """Return what can be imported with so many links, and the kind of its units."""
    cart, *others = joints(links)
    return {TIME: 'time', cart: 'length', **dict.fromkeys(others, 'angle'),
            f'{cart}{VELOCITY}': 'speed',
            **{f'{joint}{VELOCITY}': 'angular speed' for joint in others}, FORCE: 'force'}


def columns_of(texts: Mapping[str, str], rate: float = 0.0) -> dict[str, Column]:
    """Return what stands for each name; a rate stands for the time. Raises UserError."""
    known = names_of(max(LINKS))
    if strange := [name for name in texts if name not in known]:
        raise UserError(f'a pendulum has no {", ".join(map(repr, strange))}; expected of '
                        f'{", ".join(known)}')
    found = {name: column_of(name, given) for name, given in texts.items()
             if name != TIME or not rate}
    cart, *_ = joints(min(LINKS))
    # which is not measured where it is clamped
    return found if cart in found else {**found, cart: Column('', value=0.0)}


def column_of(name: str, given: str) -> Column:
    """
    Read what stands for a name: COLUMN, COLUMN:UNIT or a number; raises UserError.

    Without a UNIT it is what the column's own name ends in, as x_mm, `x [mm]` or `x (mm)`.
    """
    kind = names_of(max(LINKS))[name]
    try:
        value = float(given)
    except ValueError:
        pass
    else:
        if not math.isfinite(value):
            raise UserError(f'{name}={given} is no value; expected a finite one, or a column')
        return Column('', value=value)
    column, _, said = given.rpartition(':')
    if not column or said not in KINDS:
        column, said = given, ''
    found = IN_BRACKETS.search(column) or AT_END.search(column)
    unit = said or (found[1].strip() if found else '')
    if unit and unit not in UNITS[kind]:
        raise UserError(f'{name}={given} is in {unit!r}; expected {kind}, in '
                        f'{", ".join(UNITS[kind])}: name its unit, as {name}={column}:'
                        f'{next(iter(UNITS[kind]))}')
    return Column(column, unit, UNITS[kind][unit] if unit else 1.0)


def read_log(path: Path, columns: Mapping[str, Column], rate: float = 0.0,
             progress: Callable[..., Any] = iter) -> Log:
    """
    Read a table whose columns stand for numbers of the state by their names.

    With a rate [Hz] its rows are so far apart, whatever their times. Raises UserError, also for a
    cell that is no number.
    """
    links = max((n for n in LINKS if f'joint{n}' in columns), default=0)
    wanted = names_of(max(links, 1))
    if not links or (TIME not in columns and not rate):
        raise UserError(f'there are columns for {", ".join(columns)}; expected t (or --rate) and '
                        'at least joint1, as t=time joint1=theta1')
    if lacking := [name for name in joints(links)[1:] if name not in columns]:
        raise UserError(f'there is a column for joint{links}; expected a column for '
                        f'{", ".join(lacking)}, too')
    needed = dict.fromkeys(one.name for one in columns.values() if one.name)
    if not needed:
        raise UserError(f'of {path} no column is read: a number stands for itself, and the '
                        'columns of a file without names are #1, #2, ...')
    table = read_columns(path, list(needed), progress)
    rows = len(next(iter(table.values())))
    counts, found = Counts(rows), dict[str, Array]()
    for name in wanted:
        column = columns.get(name, Column(''))
        if not column.name:
            found[name] = np.full(rows, column.value)
            continue
        found[name] = table[column.name] * column.factor
        if name != TIME and (missing := int(np.isnan(found[name]).sum())):
            counts.missing[column.name] = missing
    if rate:
        found[TIME] = np.arange(rows) / rate
    kept = _in_order(found[TIME], counts)
    t = found[TIME][kept]
    if len(t) < 2:
        raise UserError(f'{path} has {len(t)} different times in {rows} rows; expected a run '
                        '(--rate HZ stands for times)')
    if not (abs(t[-1]) < LATEST and t[-1] - t[0] < LONGEST):
        remedy = f'give a rate in Hz, not {rate:g}' if rate else (
            f'name their unit, as t={columns[TIME].name}:ms, and leave out rows of another clock')
        raise UserError(f'{path} has times from {t[0]:.6g} to {t[-1]:.6g} s; expected at most '
                        f'{LONGEST:g} s: {remedy}')
    names = joints(links)
    return Log(t if t[0] > EPOCH else t - t[0] + BEGIN,
               np.column_stack([found[name][kept] for name in names]),
               np.column_stack([found[f'{name}{VELOCITY}'][kept] for name in names]),
               found[FORCE][kept], counts)


def _in_order(t: Array, counts: Counts) -> Array:
    """Return which rows (K,), in the order of their times, once each; count the others."""
    known = np.flatnonzero(np.isfinite(t))
    counts.without_time = len(t) - len(known)
    counts.out_of_order = int(np.sum(np.diff(t[known]) < 0))
    order = known[np.argsort(t[known], kind='stable')]
    nanoseconds = np.rint(t[order] * BILLION)
    first: Array = np.diff(nanoseconds, prepend=-math.inf) > 0
    counts.doubled = int(np.sum(~first))
    kept: Array = order[first]
    return kept


def as_state(log: Log, signs: Sequence[float] | None, relative: bool, hangs_at_zero: bool) -> Log:
    """
    Return a log whose sensors count another way, as the state has it; raises UserError.

    Shapes: signs (n + 1,), -1 where one counts down towards +x. Relative angles are from the link
    before; where it hangs at zero, the angles of all are zero there.
    """
    signs = signs or [1.0] * (log.links + 1)
    if len(signs) != log.links + 1:
        raise UserError(f'there are {len(signs)} --signs; expected {log.links + 1}, of the cart '
                        'and each joint')
    q, v = np.multiply(log.q, signs), np.multiply(log.v, signs)
    if hangs_at_zero:
        at_rest, _ = np.hsplit(hanging(log.links), 2)
        q = q + (to_joints(at_rest) if relative else at_rest)
    if relative:
        q, v = from_joints(q), from_joints(v)
    return log._replace(q=q, v=v)


def write_log(log: Log, folder: Path, description: str,
              progress: Callable[..., Any] = iter) -> dict[str, int]:
    """
    Write a log as a bag, and return the messages of each topic; raises BagError.

    A row is a JointState, and where it has a force also a command, at the same time. Before all
    stands the description of the robot.
    """
    stamps = np.rint(log.t * BILLION).astype(np.int64)
    is_sent, first = np.isfinite(log.force), int(stamps[0])
    v = log.v if np.isfinite(log.v).any() else None
    # a state has the force that acted until then
    acted = np.concatenate(([math.nan], log.force[:-1])) if is_sent.any() else None
    states = _rows(to_joint_states(stamps, log.q, v, acted, joints(log.links)))
    forces = _rows(to_floats(log.force))
    bag = BagWriter(folder)
    # so that what an interrupt or a full disk leaves of it says so
    bag.custom[RECOVERED] = str(1 + len(stamps) + int(is_sent.sum()))
    try:
        for topic in (ROBOT_DESCRIPTION, JOINT_STATES,
                      *([FORCE_COMMAND] if is_sent.any() else [])):
            bag.add(Recorded(f'/{topic.name}', topic.type, schema(topic.type), '', []))
        bag.write(f'/{ROBOT_DESCRIPTION.name}', to_string(description), first, first)
        sent = 0
        for n, stamp in enumerate(progress(stamps.tolist())):
            bag.write(f'/{JOINT_STATES.name}', next(states), stamp, stamp, n)
            force = next(forces)
            if is_sent[n]:
                bag.write(f'/{FORCE_COMMAND.name}', force, stamp, stamp, sent)
                sent += 1
        del bag.custom[RECOVERED]
    finally:
        bag.close()
    return bag.counts


def _rows(rows: Array) -> Iterator[bytes]:
    size, data = rows.dtype.itemsize, memoryview(rows.tobytes())
    return (bytes(data[n * size:(n + 1) * size]) for n in range(len(rows)))

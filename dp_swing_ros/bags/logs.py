# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Logs as people have them, tables in CSV or Parquet, as bags that everything here reads."""

from collections.abc import Callable, Iterator, Mapping, Sequence
import csv
from dataclasses import dataclass, field
import math
from pathlib import Path
import re
from typing import Any, NamedTuple
import warnings

import numpy as np
import pandas

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.errors import UserError
from dp_swing_ros.messages.cdr import floats, joint_states, text
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.state import Array, hanging, joints, LINKS, to_joints
from dp_swing_ros.topics import FORCE_COMMAND, JOINT_STATES, ROBOT_DESCRIPTION

ROWS = 100_000     # read at a time
LOOKED_AT = 20     # lines, to find the form of a file
GAP = 3.0          # periods without a row, from which on they count as a gap
EPOCH = 1e8        # [s] from which on times are those of a clock, and not from a beginning
BEGIN = 1.0        # [s] that the first row has else: at zero, bags say, there is no message
VELOCITY = '_velocity'
TIME, FORCE = 't', 'force'
# what a column is in, by what its name may end in, in SI
UNITS: dict[str, dict[str, float]] = {
    'time': {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9},
    'length': {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3},
    'angle': {'rad': 1.0, 'mrad': 1e-3, 'deg': math.pi / 180, 'rev': 2 * math.pi},
    'speed': {'m/s': 1.0, 'm_s': 1.0, 'cm/s': 1e-2, 'mm/s': 1e-3, 'mm_s': 1e-3},
    'angular speed': {'rad/s': 1.0, 'rad_s': 1.0, 'deg/s': math.pi / 180,
                      'deg_s': math.pi / 180, 'rpm': math.pi / 30},
    'force': {'N': 1.0, 'mN': 1e-3, 'V': 1.0}}
KINDS = {name: kind for kind, units in UNITS.items() for name in units}
UNIT_AT_END = re.compile(rf'(?:_| ?[\[(])({"|".join(map(re.escape, KINDS))})[\])]?$')


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


def columns_of(texts: Mapping[str, str]) -> dict[str, Column]:
    """Return what stands for each name; raises UserError."""
    known = names_of(max(LINKS))
    if strange := [name for name in texts if name not in known]:
        raise UserError(f'a pendulum has no {", ".join(map(repr, strange))}; expected of '
                        f'{", ".join(known)}')
    return {name: column_of(name, text) for name, text in texts.items()}


def column_of(name: str, given: str) -> Column:
    """
    Read what stands for a name: COLUMN, COLUMN:UNIT or a number; raises UserError.

    Without a UNIT it is what the column's own name ends in, as x_mm, `x [mm]` or `x (mm)`.
    """
    kind = names_of(max(LINKS))[name]
    try:
        return Column('', value=float(given))
    except ValueError:
        pass
    column, _, said = given.rpartition(':')
    if not column or said not in KINDS:
        column, said = given, ''
    found = UNIT_AT_END.search(column)
    unit = said or (found[1] if found else '')
    if unit and unit not in UNITS[kind]:
        raise UserError(f'{name}={given} is in {unit}; expected {kind}, in '
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
    needed = [one.name for one in columns.values() if one.name]
    table = _table(path, list(dict.fromkeys(needed)), progress)
    rows = len(next(iter(table.values())))
    counts, found = Counts(rows), dict[str, Array]()
    for name in wanted:
        # of a cart that is not measured it is the middle of the track where it stands
        column = columns.get(name, Column('', value=0.0 if name == 'cart' else math.nan))
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
        raise UserError(f'{path} has {len(t)} rows with a time; expected a run')
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
        for each in (q, v):
            each[:, 1:] = np.cumsum(each[:, 1:], axis=1)
    return log._replace(q=q, v=v)


def write_log(log: Log, folder: Path, description: str,
              progress: Callable[..., Any] = iter) -> dict[str, int]:
    """
    Write a log as a bag, and return the messages of each topic; raises BagError.

    A row is a JointState, and where it has a force also a command, at the same time. Before all
    stands the description of the robot.
    """
    stamps = np.rint(log.t * BILLION).astype(np.int64)
    v = log.v if np.isfinite(log.v).any() else None
    states = _rows(joint_states(stamps, log.q, v, joints(log.links)))
    forces = _rows(floats(log.force))
    is_sent, first = np.isfinite(log.force), int(stamps[0])
    bag = BagWriter(folder)
    try:
        for topic in (ROBOT_DESCRIPTION, JOINT_STATES,
                      *([FORCE_COMMAND] if is_sent.any() else [])):
            bag.add(Recorded(f'/{topic.name}', topic.type, schema(topic.type), '', []))
        bag.write(f'/{ROBOT_DESCRIPTION.name}', text(description), first, first)
        sent = 0
        for n, stamp in enumerate(progress(stamps.tolist())):
            bag.write(f'/{JOINT_STATES.name}', next(states), stamp, stamp, n)
            force = next(forces)
            if is_sent[n]:
                bag.write(f'/{FORCE_COMMAND.name}', force, stamp, stamp, sent)
                sent += 1
    finally:
        bag.close()
    return bag.counts


def _rows(rows: Array) -> Iterator[bytes]:
    size, data = rows.dtype.itemsize, memoryview(rows.tobytes())
    return (bytes(data[n * size:(n + 1) * size]) for n in range(len(rows)))


def _table(path: Path, needed: Sequence[str], progress: Callable[..., Any]) -> dict[str, Array]:
    """Return columns of a file by name; raises UserError."""
    try:
        parts = _parquet(path, needed) if path.suffix == '.parquet' else _csv(path, needed)
        tables = [{name: _numbers(path, part, name) for name in needed}
                  for part in progress(parts)]
    except (OSError, pandas.errors.ParserError, pandas.errors.EmptyDataError,
            pandas.errors.ParserWarning, UnicodeDecodeError, csv.Error) as error:
        raise UserError(f'cannot read {path}: {getattr(error, "strerror", None) or error}') \
            from None
    return {name: np.concatenate([table[name] for table in tables]) if tables else np.empty(0)
            for name in needed}


def _numbers(path: Path, part: pandas.DataFrame, name: str) -> Array:
    """Return a column as numbers, NaN where a cell is empty; raises UserError."""
    found = pandas.to_numeric(part[name], errors='coerce').to_numpy(float)
    odd = np.isnan(found) & part[name].notna().to_numpy()
    odd &= part[name].astype(str).str.strip().str.lower().ne('nan').to_numpy()
    if odd.any():
        row = int(np.flatnonzero(odd)[0])
        raise UserError(f'{path} has {part[name].iloc[row]!r} in column {name!r}, row '
                        f'{part.index[row] + 1}; expected a number, or nothing')
    return np.where(np.isfinite(found), found, math.nan)


def _csv(path: Path, needed: Sequence[str]) -> Iterator[pandas.DataFrame]:
    separator, has_names, decimal = _form(path)
    form: dict[str, Any] = {'sep': separator, 'header': 0 if has_names else None,
                            'index_col': False, 'skipinitialspace': True}
    head = pandas.read_csv(path, nrows=1, **form)
    known = [str(name).strip() if has_names else f'#{name + 1}' for name in head.columns]
    _check(path, needed, known)
    with warnings.catch_warnings(), pandas.read_csv(
            path, names=known, chunksize=ROWS, decimal=decimal, **form) as parts:
        # all columns are read, for of some alone a row that is too long is none to pandas
        warnings.simplefilter('error', pandas.errors.ParserWarning)
        yield from parts


def _form(path: Path) -> tuple[str, bool, str]:
    """Return the separator of a CSV file, whether its first row has names, and its decimal."""
    first = pandas.read_csv(path, sep='\x00', header=None, nrows=LOOKED_AT, dtype=str,
                            engine='python', quoting=csv.QUOTE_NONE)[0].astype(str).tolist()
    counted = {each: min(line.count(each) for line in first) for each in ';\t,'}
    separator = next((each for each, count in counted.items() if count), r'\s+')
    cells = re.split(separator, first[0])
    decimal = ',' if separator != ',' and any(re.search(r'\d,\d', line) for line in first[1:]) \
        else '.'
    numeric = all(re.fullmatch(r'\s*[-+]?[\d.,]+(e[-+]?\d+)?\s*|\s*nan\s*|\s*', cell, re.I)
                  for cell in cells)
    return separator, not numeric, decimal


def _parquet(path: Path, needed: Sequence[str]) -> Iterator[pandas.DataFrame]:
    try:
        from pyarrow import ArrowException
        from pyarrow.parquet import ParquetFile
    except ModuleNotFoundError:
        raise UserError('Parquet needs pyarrow, which is not installed: python3 -m pip install '
                        'pyarrow, or give a CSV file') from None
    try:
        with ParquetFile(path) as file:
            _check(path, needed, file.schema_arrow.names)
            begin = 0
            for batch in file.iter_batches(ROWS, columns=list(needed)):
                part = batch.to_pandas()
                part.index += begin
                begin += len(part)
                yield part
    except ArrowException as error:
        raise UserError(f'cannot read {path}: {error}') from None


def _check(path: Path, needed: Sequence[str], known: Sequence[str]) -> None:
    """Raise UserError where a file lacks a column."""
    if missing := [name for name in needed if name not in known]:
        raise UserError(f'{path} has no column {", ".join(map(repr, missing))}; it has '
                        f'{", ".join(map(repr, known))}')

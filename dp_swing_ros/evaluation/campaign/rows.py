# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The table on disk: one row an episode, appended as it comes.

A campaign that is killed leaves at most its last line torn; such a line is dropped when the
campaign continues. What is to be kept for good is compressed.
"""

from collections.abc import Callable, Iterable, Iterator
import contextlib
import csv
import dataclasses
import gzip
import io
import math
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, TypeVar
import zlib

import numpy as np

from dp_swing_ros.evaluation.metrics import Metrics
from dp_swing_ros.pendulum.state import Array

MICRO = 1e-6
ERROR = 'ERROR'  # the outcome of an episode that raised

Item = TypeVar('Item')
Name = TypeVar('Name')


class CampaignError(Exception):
    """A campaign cannot continue; the message states why, and what to do. What was run is kept."""


class Key(NamedTuple):
    """Which episode a row is of; see scenarios.Case."""

    contestant: str
    scenario: str
    parameter: str
    level: float | None
    seed: int


@dataclasses.dataclass(frozen=True)
class Row:
    """
    One episode: how it ended, its metrics, and the solve time of each tick.

    Shapes: solve_times (M,) [s], to the microsecond.
    """

    key: Key
    outcome: str     # the name of an Outcome, or ERROR
    detail: str      # of the error
    metrics: Metrics
    solve_times: Array


KINDS: list[Any] = [field.type for field in dataclasses.fields(Metrics)]
NOTHING: dict[Any, Any] = {bool: False, int: 0, float: math.nan}
UNKNOWN = Metrics(*(NOTHING[kind] for kind in KINDS))  # of an episode that raised
# what a clock decides, and not the seed
CLOCKED = ('median_solve_time', 'p99_solve_time', 'largest_solve_time', 'median_latency',
           'p99_latency', 'late_ticks', 'deadline_misses')
OPTIONAL = {field.name for field in dataclasses.fields(Metrics) if field.type is float}
COLUMNS = [*Key._fields, 'outcome', 'detail',
           *(field.name for field in dataclasses.fields(Metrics)), 'solve_times_us']


def grouped(items: Iterable[Item], name: Callable[[Item], Name]) -> dict[Name, list[Item]]:
    """Return items by what they have in common, in the order in which they come."""
    groups: dict[Name, list[Item]] = {}
    for item in items:
        groups.setdefault(name(item), []).append(item)
    return groups


def solves(rows: Iterable[Row]) -> Array:
    """Return the times of all solves of some rows [s]; a tick without a solve took none."""
    times = np.concatenate([np.zeros(0), *(row.solve_times for row in rows)])
    return times[times > 0]


def untimed(row: Row) -> Row:
    """Return a row without what a clock decided, which other processes disturb."""
    metrics = dataclasses.replace(row.metrics, **{
        name: getattr(UNKNOWN, name) for name in CLOCKED})
    return dataclasses.replace(row, metrics=metrics, solve_times=np.zeros(0))


def identical(a: Row, b: Row) -> bool:
    """Return whether two rows are the same to the bit, the clock apart."""
    return _cells(untimed(a)) == _cells(untimed(b))


class Table:
    """The rows of a campaign, those on disk already and those to come."""

    def __init__(self, path: Path) -> None:
        """
        Open the table, or make it, and drop a torn last line.

        Raises CampaignError where the file is another table, or its place cannot be written.
        """
        self.path = path
        self.rows = read(path) if path.exists() else []
        with self._opened() as file:
            whole = _whole(path.read_bytes())
            file.truncate(whole)
            if not whole:
                file.write(_line(COLUMNS))

    def append(self, row: Row) -> None:
        """Keep a row; raises CampaignError where it cannot be written."""
        with self._opened() as file:
            file.write(_line(_cells(row)))
        self.rows.append(row)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[BinaryIO]:
        try:
            with self.path.open('ab') as file:
                yield file
        except OSError as error:
            raise CampaignError(f'cannot write {self.path}: {error.strerror}') from None


def store(path: Path, rows: Iterable[Row]) -> None:
    """Write rows as a compressed table, the same bytes for the same rows."""
    data = b''.join(map(_line, [COLUMNS, *map(_cells, rows)]))
    path.write_bytes(gzip.compress(data, mtime=0))


def read(path: Path) -> list[Row]:
    """
    Read the whole rows of a table, compressed or not; raises CampaignError for another.

    A measure that an older table has no column of is unknown.
    """
    data = path.read_bytes()
    if path.suffix == '.gz':
        try:
            data = gzip.decompress(data)
        except (OSError, EOFError, zlib.error) as error:
            raise CampaignError(f'{path} cannot be decompressed: {error}') from None
    header, *lines = _lines(data[:_whole(data)].decode(errors='replace')) or [COLUMNS]
    if set(header) - set(COLUMNS) or set(COLUMNS) - set(header) - OPTIONAL:
        raise CampaignError(f'{path} is not the table of a campaign of this version')
    rows = []
    for number, cells in enumerate(lines, 2):
        try:
            rows.append(_row(dict(zip(header, cells, strict=True))))
        except ValueError as error:
            raise CampaignError(f'{path}, line {number}: {error}; remove the line for the episode '
                                'to be run again') from None
    return rows


def _lines(text: str) -> list[list[str]]:
    usual = csv.field_size_limit(len(text))   # else the ticks of a long episode are too many
    try:
        return list(csv.reader(io.StringIO(text, newline='')))
    finally:
        csv.field_size_limit(usual)


def _cells(row: Row) -> list[str]:
    ticks = ' '.join(str(round(time / MICRO)) for time in row.solve_times)
    return [*map(_text, row.key), row.outcome, row.detail,
            *map(_text, dataclasses.astuple(row.metrics)), ticks]


def _line(values: list[str]) -> bytes:
    line = io.StringIO()
    csv.writer(line, lineterminator='\n').writerow(values)
    return line.getvalue().encode()


def _whole(data: bytes) -> int:
    """Return the length of the lines that are whole."""
    return data.rfind(b'\n') + 1


def _row(cells: dict[str, str]) -> Row:
    contestant, scenario, parameter, level, seed = (cells[name] for name in Key._fields)
    key = Key(contestant, scenario, parameter, float(level) if level else None, int(seed))
    metrics = Metrics(**{field.name: _value(field.type, cells.get(field.name, ''))
                         for field in dataclasses.fields(Metrics)})
    return Row(key, cells['outcome'], cells['detail'], metrics,
               MICRO * np.array(cells['solve_times_us'].split(), dtype=float))


def _text(value: Any) -> str:
    if value is None or value != value:   # as NaN is
        return ''
    return str(int(value) if isinstance(value, bool) else value)


def _value(kind: Any, text: str) -> Any:
    if kind is bool:
        return bool(int(text))
    return float(text or math.nan) if kind is float else int(text)

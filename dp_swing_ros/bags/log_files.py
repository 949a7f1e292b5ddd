# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers in CSV files of any form, and in Parquet files."""

from collections.abc import Callable, Iterator, Sequence
import csv
import gzip
import io
from itertools import islice
import math
from pathlib import Path
import re
from typing import Any, NamedTuple
import warnings
import zlib

import numpy as np
import pandas

from dp_swing_ros.errors import UserError
from dp_swing_ros.pendulum.state import Array

ROWS = 100_000      # read at a time
LOOKED_AT = 50      # lines, to find the form of a file
SEPARATORS = ';\t,'
BLANKS = r'\s+'
COMMENTS = ('#', '%')
NUMBER = re.compile(r'[-+]?(\d+([.,]\d*)?|[.,]\d+)(e[-+]?\d+)?|nan|', re.I)
UNREADABLE = (OSError, EOFError, zlib.error, UnicodeError, csv.Error, pandas.errors.ParserError,
              pandas.errors.EmptyDataError, pandas.errors.ParserWarning)


class Form(NamedTuple):
    """How a CSV file is written: its separator, its decimal, its columns, where it begins."""

    separator: str
    decimal: str
    names: list[str]
    skipped: int     # lines before the first row


def read_columns(path: Path, needed: Sequence[str],
                 progress: Callable[..., Any] = iter) -> dict[str, Array]:
    """
    Return columns of a file by their names, of as many rows each; what is empty is NaN.

    The columns of a file without names are #1, #2 and so on. Raises UserError.
    """
    try:
        parts = _parquet(path, needed) if path.suffix == '.parquet' else _csv(path, needed)
        tables = [{name: _numbers(path, part, name) for name in needed}
                  for part in progress(parts)]
    except UNREADABLE as error:
        raise UserError(f'cannot read {path}: {getattr(error, "strerror", None) or error}') \
            from None
    return {name: np.concatenate([table[name] for table in tables]) if tables else np.empty(0)
            for name in needed}


def _numbers(path: Path, part: pandas.DataFrame, name: str) -> Array:
    """Return a column as numbers, NaN where a cell is empty or no finite number."""
    if part[name].dtype.kind in 'mM':
        raise UserError(f'{path} has dates or durations in column {name!r}; expected numbers: '
                        'save them as seconds')
    found = pandas.to_numeric(part[name], errors='coerce').to_numpy(float)
    odd = np.isnan(found) & part[name].notna().to_numpy()
    odd &= part[name].astype(str).str.strip().str.lower().ne('nan').to_numpy()
    if odd.any():
        row = int(np.flatnonzero(odd)[0])
        raise UserError(f'{path} has {part[name].iloc[row]!r} in column {name!r}, row '
                        f'{part.index[row] + 1}; expected a number, or nothing (--rate HZ stands '
                        'for times that are none)')
    return np.where(np.isfinite(found), found, math.nan)


def _csv(path: Path, needed: Sequence[str]) -> Iterator[pandas.DataFrame]:
    form = form_of(path)
    _check(path, needed, form.names)
    with warnings.catch_warnings(), pandas.read_csv(
            path, sep=form.separator, decimal=form.decimal, names=form.names, header=None,
            skiprows=form.skipped, index_col=False, chunksize=ROWS,
            skipinitialspace=True) as parts:
        # all columns are read, for of some alone a row that is too long is none to pandas
        warnings.simplefilter('error', pandas.errors.ParserWarning)
        for part in parts:
            if form.decimal != '.':   # where a cell is no number, pandas leaves the others as text
                part = part.map(lambda cell: cell.replace(form.decimal, '.')
                                if isinstance(cell, str) else cell)
            yield part


def form_of(path: Path) -> Form:
    """Find out how a CSV file is written, from its first lines; raises UserError."""
    with gzip.open(path) if path.suffix == '.gz' else path.open('rb') as file:
        lines = [line.strip('\r\n') for line in islice(
            io.TextIOWrapper(file, encoding='utf-8-sig'), LOOKED_AT)]
    if any('\0' in line for line in lines):
        raise UserError(f'{path} is no text; expected CSV or Parquet: save it as one of these')
    begin = next((n for n, line in enumerate(lines)
                  if line.strip() and not line.lstrip().startswith(COMMENTS)), len(lines))
    if begin == len(lines):
        raise UserError(f'{path} has no rows in its first lines; expected a row a sample')
    rows = [line for line in lines[begin:] if line.strip()]
    separator = next((each for each in SEPARATORS
                      if sum(each in row for row in rows) > len(rows) / 2), BLANKS)
    decimal = ',' if separator != ',' and any(
        re.search(r'\d,\d', row) for row in rows[1:] or rows) else '.'
    first, skipped = _cells(rows[0], separator), begin
    if not all(NUMBER.fullmatch(cell) for cell in first):
        return Form(separator, decimal, first, begin + 1)
    # names may stand behind the sign of a comment, as numpy.savetxt writes them
    above = _cells(lines[begin - 1].lstrip(' #%'), separator) if begin else []
    names = above if len(above) == len(first) else [f'#{n + 1}' for n in range(len(first))]
    return Form(separator, decimal, names, skipped)


def _cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line without the blanks and the quotes around them."""
    cells = line.split() if separator == BLANKS else next(
        csv.reader([line], delimiter=separator, skipinitialspace=True))
    return [cell.strip() for cell in cells]


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
                part = batch.to_pandas(ignore_metadata=True)   # an index is a column here
                part.index += begin
                begin += len(part)
                yield part
    except ArrowException as error:
        raise UserError(f'cannot read {path}: {error}') from None


def _check(path: Path, needed: Sequence[str], known: Sequence[str]) -> None:
    """Raise UserError where a file has a column not once."""
    if missing := [name for name in needed if name not in known]:
        raise UserError(f'{path} has no column {", ".join(map(repr, missing))}; it has '
                        f'{", ".join(map(repr, known))}')
    if doubled := sorted({name for name in known if known.count(name) > 1}):
        raise UserError(f'{path} has several columns {", ".join(map(repr, doubled))}; rename all '
                        'but one')

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Markdown tables, from rows of cells of which the first is the head."""

from collections.abc import Iterable, Sequence


def compact(rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table for a page."""
    cells = _escaped(rows)
    return _joined(cells, '| --- ' * len(cells[0]) + '|')


def aligned(rows: Iterable[Sequence[str]], names: int) -> str:
    """Return a Markdown table for a terminal; all but the first columns are numbers."""
    cells = _escaped(rows)
    widths = [max(map(len, column)) for column in zip(*cells)]
    padded = [[cell.ljust(width) if column < names else cell.rjust(width)
               for column, (cell, width) in enumerate(zip(row, widths))] for row in cells]
    rule = '|'.join('-' * (width + 1) + ('-' if column < names else ':')
                    for column, width in enumerate(widths))
    return _joined(padded, f'|{rule}|')


def _escaped(rows: Iterable[Sequence[str]]) -> list[list[str]]:
    return [[cell.replace('|', r'\|') for cell in row] for row in rows]


def _joined(rows: list[list[str]], rule: str) -> str:
    head, *body = (f'| {" | ".join(row)} |' for row in rows)
    return '\n'.join([head, rule, *body])

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run as pandas frames whose columns name their units: its states and its plans."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any, TYPE_CHECKING

import numpy as np

from dp_swing_ros.bags.episodes import reports_of, samples_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.messages.fields import BILLION, from_trajectory, nanoseconds
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array, columns, joints, LINKS, links_of, units, wrapped
from dp_swing_ros.topics import PLAN

if TYPE_CHECKING:
    from pandas import DataFrame

KINDS = ('position', 'velocity')
UNITS = {'solve_time': 's', 'latency': 's', 'delay': 's', 'force': 'N', 'force_bias': 'N',
         **{field.name: field.metadata['unit']
            for field in dataclasses.fields(PendulumParameters)},
         **{f'{what}_{joint}_{kind}': unit for what in ('estimate', 'innovation')
            for (kind, joint), unit in zip(itertools.product(KINDS, joints(max(LINKS))),
                                           units(max(LINKS)))}}
ANGULAR = [f'estimate_{joint}_position' for joint in joints(max(LINKS))[1:]]


def state_columns(links: int) -> list[str]:
    """Return the columns of a state, with their units."""
    return [f'{name} [{unit}]' for name, unit in zip(columns(links), units(links))]


def states_of(bag: Bag, whole_turns: bool = False) -> DataFrame:
    """
    Return a row a state, and what the controller reported of its tick for it.

    `force [N]` acted over the period that begins there, `force_sent [N]` was the answer to the
    state. Angles are in (-π, π], 0 upright, unless with `whole_turns`. Raises BagError.
    """
    samples = samples_of(bag)
    stamps = [sample.stamp for sample in samples]
    table: dict[str, Any] = {
        't [s]': (np.array(stamps) - stamps[0]) / BILLION, 'stamp [ns]': stamps,
        **_states(np.array([sample.x for sample in samples]), whole_turns),
        'force [N]': [*(sample.force for sample in samples[1:]), np.nan]}
    reports = {report.stamp: report.values for report in reports_of(bag)}
    for key in dict.fromkeys(key for values in reports.values() for key in values):
        column = [reports.get(stamp, {}).get(key) for stamp in stamps]
        if key in ANGULAR and not whole_turns:
            column = [None if value is None else _wrapped_angle(value) for value in column]
        table[column_of(key)] = _of_one_kind(column)
    return _frame([table], bag)


def plans_of(bag: Bag, whole_turns: bool = False) -> DataFrame:
    """
    Return a row a step of a plan: which state it answers, the step k, and how far ahead it is.

    The angles are as in `states_of`; the last step of a plan has no force. Raises BagError.
    """
    first = samples_of(bag)[0]
    columns = ['t [s]', 'stamp [ns]', 'k', 'ahead [s]', *state_columns(links_of(first.x)),
               'force [N]']
    tables: list[dict[str, Any]] = []
    for message in bag.of(PLAN) if bag.has(PLAN) else ():
        plan, stamp = bag.parse(from_trajectory, message), nanoseconds(message.header.stamp)
        tables.append({'t [s]': (stamp - first.stamp) / BILLION, 'stamp [ns]': stamp,
                       'k': np.arange(len(plan.X)), 'ahead [s]': plan.t,
                       **_states(plan.X, whole_turns), 'force [N]': [*plan.U, np.nan]})
    return _frame(tables or [dict.fromkeys(columns, np.empty(0))], bag)


def column_of(key: str) -> str:
    """Return the column of a figure in the diagnostics, with its unit."""
    name = 'force_sent' if key == 'force' else key
    return f'{name} [{UNITS[key]}]' if UNITS.get(key) else name


def _frame(tables: list[dict[str, Any]], bag: Bag) -> DataFrame:
    import pandas  # here: it takes half a second, which no node should wait for

    frame = pandas.concat(map(pandas.DataFrame, tables), ignore_index=True)
    if bag.incomplete:
        frame['incomplete'] = bag.incomplete
    frame.attrs = {'bag': bag.path.resolve().name, 'incomplete': bag.incomplete}
    return frame


def _states(X: Array, whole_turns: bool) -> dict[str, Array]:
    return dict(zip(state_columns(links_of(X)), np.transpose(X if whole_turns else wrapped(X))))


def _wrapped_angle(angle: Any) -> float:
    return float(wrapped(np.array([0.0, angle, 0.0, 0.0]))[1])


def _of_one_kind(column: list[Any]) -> list[Any]:
    # '3 2' stands beside 3 where a tick solved twice, once
    if any(isinstance(value, str) for value in column):
        return [None if value is None else str(value) for value in column]
    return [np.nan if value is None else value for value in column]

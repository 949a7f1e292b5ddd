# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run as pandas frames whose columns name their units: its states and its plans."""

import dataclasses

import numpy as np
import pandas

from dp_swing_ros.bags.episodes import drive_of, reports_of, samples_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.messages.fields import BILLION, from_trajectory, nanoseconds
from dp_swing_ros.messages.ticks import keys_of_state, TickReport
from dp_swing_ros.pendulum.parameters import (
    acting_unit, DriveParameters, DRIVES, PendulumParameters)
from dp_swing_ros.pendulum.state import Array, columns, LINKS, links_of, units, wrapped
from dp_swing_ros.topics import PLAN

UNNAMED = {'age', 'time', 'time_noise', 'sent'}   # columns that have always been without a unit
UNITS = {**{field.name: field.metadata['unit']
            for group in (TickReport, PendulumParameters, DriveParameters)
            for field in dataclasses.fields(group) if field.name not in UNNAMED},
         **{key: unit for what in ('estimate', 'innovation')
            for key, unit in zip(keys_of_state(what, max(LINKS)), units(max(LINKS)))}}


def state_columns(links: int) -> list[str]:
    """Return the columns of a state, with their units."""
    return [f'{name} [{unit}]' for name, unit in zip(columns(links), units(links))]


def states_of(bag: Bag, whole_turns: bool = False) -> pandas.DataFrame:
    """
    Return a row a state, and what the controller reported of its tick for it.

    `force [N]` acted over the period that begins there, `force_sent [N]` was the answer to the
    state; of other drives these are in their own units. Angles are in (-π, π], 0 upright, unless
    with `whole_turns`. Raises BagError.
    """
    samples, drive = samples_of(bag), drive_of(bag)
    stamps = [sample.stamp for sample in samples]
    states = pandas.DataFrame({
        't [s]': (np.array(stamps) - stamps[0]) / BILLION, 'stamp [ns]': stamps,
        **_states(np.array([sample.x for sample in samples]), whole_turns),
        f'force [{acting_unit(drive)}]': [*(sample.force for sample in samples[1:]), np.nan]})
    reports = {report.stamp: report.values for report in reports_of(bag)}
    ticks = pandas.DataFrame([reports.get(stamp, {}) for stamp in stamps])
    for key, column in ticks.items():
        if UNITS.get(key) == 'rad' and key.startswith('estimate_') and not whole_turns:
            ticks[key] = wrapped(np.outer(column, (0.0, 1.0, 0.0, 0.0)))[:, 1]
        elif column.dtype == object:
            # '3 2' stands beside 3 where a tick solved twice, once
            ticks[key] = column.map(str, na_action='ignore')
    ticks = ticks.rename(columns={'force': f'force_sent [{DRIVES[drive]}]'}).rename(
        columns=_with_unit)
    return _noted(pandas.concat([states, ticks], axis=1), bag)


def plans_of(bag: Bag, whole_turns: bool = False) -> pandas.DataFrame:
    """
    Return a row a step of a plan: which state it answers, the step k, and how far ahead it is.

    The angles are as in `states_of`; the last step of a plan has no force. Raises BagError.
    """
    first, force = samples_of(bag)[0], f'force [{acting_unit(drive_of(bag))}]'
    columns = ['t [s]', 'stamp [ns]', 'k', 'ahead [s]', *state_columns(links_of(first.x)),
               force]
    tables = []
    for message in bag.any_of(PLAN):
        plan, stamp = bag.parse(from_trajectory, message), nanoseconds(message.header.stamp)
        tables.append(pandas.DataFrame({
            't [s]': (stamp - first.stamp) / BILLION, 'stamp [ns]': stamp,
            'k': np.arange(len(plan.X)), 'ahead [s]': plan.t, **_states(plan.X, whole_turns),
            force: [*plan.U, np.nan]}))
    return _noted(pandas.concat(tables, ignore_index=True) if tables else
                  pandas.DataFrame(columns=columns, dtype=float), bag)


def _with_unit(key: str) -> str:
    """Return the column of a figure in the diagnostics."""
    return f'{key} [{UNITS[key]}]' if UNITS.get(key) else key


def _noted(table: pandas.DataFrame, bag: Bag) -> pandas.DataFrame:
    return table.assign(incomplete=bag.incomplete) if bag.incomplete else table


def _states(X: Array, whole_turns: bool) -> dict[str, Array]:
    return dict(zip(state_columns(links_of(X)), np.transpose(X if whole_turns else wrapped(X))))

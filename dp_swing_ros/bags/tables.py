# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run as pandas frames whose columns name their units: its states and its plans."""

from __future__ import annotations

import dataclasses
from typing import Any, TYPE_CHECKING

import numpy as np

from dp_swing_ros.bags.episodes import reports_of, samples_of
from dp_swing_ros.bags.fields import BILLION, from_trajectory, nanoseconds
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import ANGLES, JOINTS, UNITS, wrapped
from dp_swing_ros.simulation.episode import STATE
from dp_swing_ros.topics import PLAN

if TYPE_CHECKING:
    from pandas import DataFrame

STATES = [f'{name} [{unit}]' for name, unit in zip(STATE, UNITS)]  # columns
TIMES = ['t [s]', 'stamp [ns]']
FIGURES = {'solve_time': 's', 'latency': 's', 'delay': 's', 'force': 'N', 'force_bias': 'N',
           **{field.name: field.metadata['unit']
              for field in dataclasses.fields(PendulumParameters)},
           **{f'{what}_{joint}_{kind}': unit for what in ('estimate', 'innovation')
              for (kind, joint), unit in zip(((kind, joint) for kind in ('position', 'velocity')
                                              for joint in JOINTS), UNITS)}}
ANGULAR = [f'estimate_{joint}_position' for joint in JOINTS[ANGLES]]


def states_of(bag: Bag, whole_turns: bool = False) -> DataFrame:
    """
    Return a row a state, and what the controller said of its tick for it.

    `force [N]` acted over the period that begins there, `force_sent [N]` was the answer to the
    state. Angles are in (-π, π], 0 upright, unless with `whole_turns`. Raises BagError.
    """
    import pandas  # here: it takes half a second, which no node should wait for

    samples = samples_of(bag)
    X = np.array([sample.x for sample in samples])
    frame = pandas.DataFrame(X if whole_turns else wrapped(X), columns=STATES)
    stamps = [sample.stamp for sample in samples]
    for name, column in zip(TIMES, ((np.array(stamps) - stamps[0]) / BILLION, stamps)):
        frame.insert(TIMES.index(name), name, column)
    frame['force [N]'] = [*(sample.force for sample in samples[1:]), np.nan]
    reports = {report.stamp: report.values for report in reports_of(bag)}
    for key in dict.fromkeys(key for values in reports.values() for key in values):
        column = [reports.get(stamp, {}).get(key) for stamp in stamps]
        if key in ANGULAR and not whole_turns:
            column = [None if value is None else _wrapped_angle(value) for value in column]
        frame[column_of(key)] = _of_one_kind(column)
    return _described(frame, bag)


def plans_of(bag: Bag, whole_turns: bool = False) -> DataFrame:
    """
    Return a row a step of a plan: which state it answers, the step k, and how far ahead it is.

    The angles are as in `states_of`; the last step of a plan has no force. Raises BagError.
    """
    import pandas

    start = samples_of(bag)[0].stamp
    parts = []
    for message in bag.of(PLAN) if bag.has(PLAN) else ():
        plan, stamp = bag.parse(from_trajectory, message), nanoseconds(message.header.stamp)
        part = pandas.DataFrame(plan.X if whole_turns else wrapped(plan.X), columns=STATES)
        part.insert(0, TIMES[0], (stamp - start) / BILLION)
        part.insert(1, TIMES[1], stamp)
        part.insert(2, 'k', np.arange(len(part)))
        part.insert(3, 'ahead [s]', plan.t)
        parts.append(part.assign(**{'force [N]': [*plan.U, np.nan]}))
    columns = [*TIMES, 'k', 'ahead [s]', *STATES, 'force [N]']
    return _described(pandas.concat(parts, ignore_index=True) if parts
                      else pandas.DataFrame(columns=columns, dtype=float), bag)


def column_of(key: str) -> str:
    """Return the column of a figure in the diagnostics, with its unit."""
    name = 'force_sent' if key == 'force' else key
    return f'{name} [{FIGURES[key]}]' if FIGURES.get(key) else name


def _described(frame: DataFrame, bag: Bag) -> DataFrame:
    if bag.incomplete:
        frame['incomplete'] = bag.incomplete
    frame.attrs = {'bag': bag.path.resolve().name, 'incomplete': bag.incomplete}
    return frame


def _wrapped_angle(angle: Any) -> float:
    x = np.zeros(len(STATE))
    x[ANGLES] = angle
    return float(wrapped(x)[ANGLES][0])


def _of_one_kind(column: list[Any]) -> list[Any]:
    # '3 2' stands beside 3 where a tick solved twice, once
    if any(isinstance(value, str) for value in column):
        return [None if value is None else str(value) for value in column]
    return [np.nan if value is None else value for value in column]

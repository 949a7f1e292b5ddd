# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page on how often intervals hold the truth, of one rig, and of rows that are made up."""

import re

import intervals
import numpy as np
import pandas as pd
import pytest

from dp_swing_ros.identification.base_parameters import base_parameters
from dp_swing_ros.learning.learner import Learner
from dp_swing_ros.simulation import plants

STEP = 1e-3   # [s]


def test_rigs_are_drawn_alike_and_of_every_kind():
    rigs = [intervals.drawn(number) for number in range(8)]
    assert rigs[3] == intervals.drawn(3)
    for kind, count in (('links', 2), ('engine', 3), ('commands', 2)):
        assert len({rig.kinds[kind] for rig in rigs}) == count
    for rig in rigs:
        lengths = rig.physical.lengths
        assert all(intervals.LENGTHS[0] <= length <= intervals.LENGTHS[1] for length in lengths)


def test_a_rig_is_recorded_identified_and_compared_with_its_truth(monkeypatch):
    monkeypatch.setattr(intervals, 'DURATION', 5.0)
    rig = intervals.drawn(0)
    rows = pd.DataFrame(intervals.found_of(rig))
    truth = base_parameters(rig.physical, rig.plant['force_gain'])
    bodies = rows[rows.is_base].set_index('parameter')
    assert list(bodies.index) == list(truth)
    for name, row in bodies.iterrows():
        assert row.truth == truth[name][0] and row.low < row.value < row.high
        assert row.value == pytest.approx(row.truth, rel=0.05), name
    assert 'cart_dry_friction' in set(rows.parameter)
    text = intervals.page(rows, 'made\n')
    assert '| mass of cart and links | ' in text and 'links: 1' in text
    assert 'was met on 0 rigs' in text


def test_what_holds_the_truth_is_counted_and_what_met_a_bound_left_out():
    rows = pd.DataFrame([{
        'rig': rig, **intervals.drawn(0).kinds, 'at_bound': 'link1_mass' if rig == 20 else '',
        'parameter': name, 'is_base': name != 'friction', 'truth': 1.0, 'value': 1.1,
        'low': 0.9 if rig % 20 else 1.05, 'high': 1.3}
        for rig in range(21) for name in ('mass', 'friction')])
    text = intervals.page(rows, 'made\n')
    assert '| mass | 19 of 20 (76.4-99.1 %) | met | 20 | 10 | 10 |' in text
    assert '| 20 | link1_mass | 1 | 10 |' in text
    rows.loc[rows.rig < 4, 'low'] = 1.05
    assert '| mass | 16 of 20 (58.4-91.9 %) | **too few** |' in intervals.page(rows, 'made\n')
    rows.low = 0.9
    assert '| mass | 20 of 20 (83.9-100.0 %) | **too many** |' in intervals.page(rows, 'made\n')


def test_engines_are_counted_apart_too():
    rows = pd.DataFrame([{
        'rig': rig, **intervals.drawn(0).kinds, 'engine': engine, 'at_bound': '',
        'parameter': name, 'is_base': name != 'friction', 'truth': 1.0, 'value': value,
        'low': value - 0.01, 'high': value + 0.01}
        for engine, value, rigs in ((intervals.SHARP, 1.005, range(20)),
                                    (intervals.SOFT, 1.02, range(20, 25)))
        for rig in rigs for name in ('mass', 'friction')])
    text = intervals.page(rows, 'made\n')
    assert '| mass | 20 of 25 ' in text and '| 0.5 | 2 | - | 20 of 20 | 0 of 5 |' in text
    assert re.search(r'\| friction \| 20 of 25 [^|]* \| [^|]* \| - \| 20 of 20 \| 0 of 5 \|', text)


@pytest.mark.parametrize('number', [2, 4])
def test_the_friction_of_mujoco_sets_in_soon_unless_it_is_soft(number, monkeypatch):
    seen = []
    monkeypatch.setattr(intervals, 'watched', lambda plant, controller, pushes: seen.append(plant))
    rig = intervals.drawn(number)
    intervals.record(rig)
    steps = seen[0].engine.model.dof_solref[:, 0] / rig.plant['physics_step']
    assert steps == pytest.approx(20.0 if rig.engine == intervals.SOFT else 2.0, rel=1e-5)


def test_the_steps_of_mujoco_act_like_half_of_one_less_of_delay():
    def moved(engine, delay):
        plant = plants.plant({'links': 1, 'engine': engine, 'physics_step': STEP,
                              'actuation_delay': delay})
        controller = Learner({'links': 1}, np.inf)
        return intervals.watched(plant, controller, np.zeros(20)).Q
    seen = moved('mujoco', 0.02)
    off = [np.abs(moved('own', 0.02 - less * STEP) - seen).max() for less in (0.0, 0.5, 1.0)]
    assert off[1] < 0.5 * min(off[0], off[2])
    rigs = {rig.engine: rig for rig in map(intervals.drawn, range(6))}
    assert {engine: rig.truth('actuation_delay') - rig.plant['actuation_delay']
            for engine, rig in rigs.items()} == pytest.approx({
                engine: 0.0 if engine == intervals.OWN else -rig.plant['physics_step'] / 2
                for engine, rig in rigs.items()})

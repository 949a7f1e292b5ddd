# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A few of the damages of benchmarks/mutated_bags.py, a made-up run instead of a recorded one."""

from mutated_bags import page, play, TOOLS
from mutations import MUTATIONS
from recorded_bags import record

SEEDS = range(12)  # each kind once


def test_no_damage_makes_a_tool_fail(tmp_path):
    counts, fails = play(record(tmp_path / 'bag', duration=3.0).parent, SEEDS)
    assert not fails, '\n'.join(fails)
    assert counts.total() == len(SEEDS) * len(TOOLS)
    shown = page(counts, SEEDS)
    assert all(f'| {kind} |' in shown for kind in MUTATIONS)
    # what was damaged for real is either refused or told, never taken for whole
    assert counts['cut off anywhere', 'analyse', 'error'] == 1

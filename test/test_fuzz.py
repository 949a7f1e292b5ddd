# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A minute of benchmarks/fuzz.py: the first of what has once broken running nodes."""

import fuzz

ENTRIES = ['states', 'forces', 'configuration', 'shown', 'bytes', 'services', 'parameters', 'page',
           'http', 'clock']


def test_no_attack_ends_a_node_or_costs_it_a_force(capsys):
    code = fuzz.main(['--known', '4', '--seed', '36', '--entries', *ENTRIES])
    said = capsys.readouterr().out
    assert code == 0, said
    assert all(f'{entry}: ' in said and f'{entry}: 0 attacks' not in said for entry in ENTRIES)

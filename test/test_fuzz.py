# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A minute of benchmarks/fuzz.py: all that has once broken something, and an attack by chance."""

import fuzz
import pytest


@pytest.mark.parametrize('entries', [
    ['states', 'forces', 'configuration', 'shown', 'bytes', 'services', 'http', 'clock', 'page'],
    ['parameters'], ['files']], ids=lambda entries: entries[0])
def test_no_attack_ends_a_node_or_costs_it_a_force(entries, capsys):
    code = fuzz.main(['--entries', *entries, '--seed', '36', '--seconds', '5'])
    said = capsys.readouterr().out
    assert code == 0, said
    assert all(f'{entry}: ' in said for entry in entries)

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
from dp_swing_ros.tables import aligned, compact

ROWS = [('name', 'value'), ('a', '1.5'), ('a|b', '10.25')]


def test_a_compact_table_has_a_line_a_row_and_bars_are_escaped():
    assert compact(iter(ROWS)) == (
        '| name | value |\n| --- | --- |\n| a | 1.5 |\n| a\\|b | 10.25 |')


def test_names_of_an_aligned_table_stand_left_and_numbers_right():
    assert aligned(ROWS, names=1).splitlines() == [
        '| name | value |', '|------|------:|', '| a    |   1.5 |', '| a\\|b | 10.25 |']

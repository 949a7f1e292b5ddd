# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import argparse

import pytest

from dp_swing_ros.tools.argument_types import within


@pytest.mark.parametrize('text, value', [('1', 1), ('9', 9)])
def test_bounds_are_included(text, value):
    assert within(int, 1, 9)(text) == value


@pytest.mark.parametrize('kind, high, text', [
    (int, 9, '0'), (int, 9, '10'), (float, 1e3, '1e4'), (float, float('inf'), 'inf'),
    (float, float('inf'), 'nan'), (int, 9, '9' * 400)])
def test_what_is_outside_is_refused_with_the_bounds(kind, high, text):
    with pytest.raises(argparse.ArgumentTypeError, match='of at least 1') as error:
        within(kind, 1, high)(text)
    assert len(str(error.value)) < 150


def test_a_word_is_no_number():
    with pytest.raises(ValueError):
        within(float, 0)('much')

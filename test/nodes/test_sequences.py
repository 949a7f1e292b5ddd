# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import random

import pytest

from dp_swing_ros.nodes.logger import Recording


def tally(messages):
    result = Recording('', None)
    for publisher, number in messages:
        result.count(publisher, number)
    return result


def test_one_publisher_is_exact():
    random.seed(0)
    numbers = sorted(random.sample(range(40, 1000), 500))
    result = tally((b'one', number) for number in numbers)
    assert result.came == 500
    assert result.lost == numbers[-1] - numbers[0] + 1 - 500
    assert result.early == numbers[0] - 1


@pytest.mark.parametrize('seed', range(5))
def test_of_publishers_that_mix_each_is_exact(seed):
    """However close their numbers are."""
    random.seed(seed)
    last, messages, lost = {b'one': 1, b'two': 400, b'three': 40}, [], 0
    for publisher, number in last.items():
        messages.append((publisher, number))
    for _ in range(1000):
        publisher, gap = random.choice(list(last)), random.choice([0, 0, 0, 1, 5])
        last[publisher] += 1 + gap
        lost += gap
        messages.append((publisher, last[publisher]))
    assert tally(messages).lost == lost > 0


def test_a_publisher_that_starts_again_is_another():
    assert tally([(b'one', 1), (b'one', 2), (b'two', 1), (b'two', 2)]).lost == 0


def test_a_number_that_comes_again_is_no_loss():
    assert tally([(b'one', 4), (b'one', 4), (b'one', 5)]).lost == 0

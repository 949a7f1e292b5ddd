# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import random

import pytest

from dp_swing_ros.nodes.logger import Recording


def tally(numbers, publishers):
    result = Recording(None, publishers)
    for number in numbers:
        result.count(number)
    return result


def test_one_publisher_is_exact():
    random.seed(0)
    numbers = sorted(random.sample(range(40, 1000), 500))
    result = tally(numbers, publishers=1)
    assert result.came == 500
    assert result.lost == numbers[-1] - numbers[0] + 1 - 500


@pytest.mark.parametrize('seed', range(5))
def test_publishers_that_mix_lose_nothing(seed):
    random.seed(seed)
    last = [1, 400, 40]
    numbers = list(last)
    for _ in range(1000):
        one = random.randrange(3)
        last[one] += 1
        numbers.append(last[one])
    assert tally(numbers, publishers=3).lost == 0


def test_gap_among_several_publishers():
    assert tally([1, 1, 2, 2, 3, 5, 6, 3], publishers=2).lost == 1


def test_publisher_that_starts_again():
    assert tally([1, 2, 3, 1, 2, 3], publishers=1).lost == 0

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from made_bags import encoded, FLOAT, START
import pytest

from dp_swing_ros.bags.definitions import schema
from dp_swing_ros.bags.recovery import recover
from dp_swing_ros.bags.writer import BagWriter, Recorded


@pytest.mark.parametrize('numbers, missing', [
    ([1, 2, 3], 0), ([7, 8, 9], 0), ([1, 2, 5, 7], 3),
    ([1, 1, 2, 2], None), ([1, 2, 1, 2], None), ([5, 6, 1, 7], None)])
def test_numbers_are_missing_only_where_one_publisher_counts(numbers, missing, tmp_path):
    writer = BagWriter(tmp_path / 'bag')
    writer.add(Recorded('/a', FLOAT, schema(FLOAT), '', []))
    for place, number in enumerate(numbers):
        writer.write('/a', encoded(place), START + place, START, number)
    writer.close()
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    account = recover(tmp_path / 'bag', tmp_path / 'new').topics['/a']
    assert (account.saved, account.missing) == (len(numbers), missing)
    assert (account.first, account.last) == (START, START + len(numbers) - 1)

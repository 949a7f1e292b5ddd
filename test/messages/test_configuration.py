# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from dp_swing_ros.messages.configuration import Configuration, from_text

TOLD = Configuration('/second/mpc', {'solver': 'ddp', 'horizon': 30, 'force_limit': math.inf,
                                     'mppi.temperature': 0.1 + 0.2, 'state_weights': [1e-5, 2.0]},
                     '0.1.0', 'abc-dirty', '0123', 'a processor, 2 cores', {'numpy': '2.3'})


def test_what_was_told_reads_back_to_the_bit():
    assert from_text(TOLD.to_text()) == TOLD


@pytest.mark.parametrize('text', ['', '{', 'mpc', 'node: /mpc', 'a: [', TOLD.to_text()[:-60]])
def test_anything_else_is_an_error_that_tells_it(text):
    with pytest.raises(ValueError, match='a configuration is'):
        from_text(text)

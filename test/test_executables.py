# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What `ros2 run` calls, where it needs no process of its own."""

import pytest

from dp_swing_ros.__main__ import main, NODES
from dp_swing_ros.executables import show_help


@pytest.mark.parametrize('name', NODES)
def test_a_node_has_one_help_however_it_is_called(name, capsys):
    assert show_help(name) == 0
    text = capsys.readouterr().out
    assert text.startswith(f'usage: ros2 run dp_swing_ros {name} ')
    assert main([name, '--help']) == 0
    assert capsys.readouterr().out == text

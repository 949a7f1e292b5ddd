# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import pytest

from dp_swing_ros.errors import UserError
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.tools.exit_codes import exit_code, FAILED, INTERRUPTED, MISUSED


def ends(error):
    def work():
        raise error
    return work


def test_the_code_of_the_work_is_that_of_the_tool():
    assert exit_code('tool', lambda: 7) == 7


@pytest.mark.parametrize('error', [UserError('no'), ParameterError('no'), OSError('no')])
def test_what_the_user_can_put_right_is_one_line(error, capsys):
    assert exit_code('tool', ends(error)) == MISUSED
    assert capsys.readouterr().err == 'tool: error: no\n'


def test_a_failure_is_no_misuse(capsys):
    assert exit_code('tool', ends(OSError('full')), (OSError,)) == FAILED
    assert capsys.readouterr().err == 'tool: error: full\n'


def test_an_interrupted_tool_says_how_to_go_on(capsys):
    assert exit_code('tool', ends(KeyboardInterrupt()), resume='; call again') == INTERRUPTED
    assert capsys.readouterr().err == 'tool: interrupted; call again\n'


def test_a_bug_has_its_traceback():
    with pytest.raises(ZeroDivisionError):
        exit_code('tool', ends(ZeroDivisionError()))

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import argparse
from importlib import import_module
import os
import signal
import subprocess
import sys
import time

from conftest import PATIENCE
import pytest

from dp_swing_ros import executables
from dp_swing_ros.__main__ import MODULES
from dp_swing_ros.errors import UserError
from dp_swing_ros.executables import ENDING, INTERRUPTED, UNREAD
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.tools.command_lines import (
    beside, execute, FAILED, interrupt_on_signals, MISUSED, postponed, within)
from dp_swing_ros.topics import COMMAND_TOPICS


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


def test_place_beside_follows_the_name_of_the_bag(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert beside(tmp_path / 'runs.d', 'analysis') == tmp_path / 'runs.d_analysis'
    assert beside(tmp_path / 'bag' / 'bag_0.mcap', 'analysis') \
        == tmp_path / 'bag' / 'bag_0_analysis'
    assert beside(tmp_path / '.', 'analysis') == tmp_path.with_name(f'{tmp_path.name}_analysis')


def executed(work, *failures):
    return execute(argparse.ArgumentParser(prog='ros2 run dp_swing_ros tool'), work, [], failures)


def ends(error):
    def work(arguments):
        raise error
    return work


def test_the_code_of_the_work_is_that_of_the_tool():
    assert executed(lambda arguments: 7) == 7


@pytest.mark.parametrize('error', [UserError('no'), ParameterError('no'), OSError('no')])
def test_what_the_user_can_put_right_is_one_line(error, capsys):
    assert executed(ends(error)) == MISUSED
    assert capsys.readouterr().err == 'tool: error: no\n'


def test_a_failure_is_no_misuse(capsys):
    assert executed(ends(OSError('full')), OSError) == FAILED
    assert capsys.readouterr().err == 'tool: error: full\n'


@pytest.mark.parametrize('interrupt, line', [
    (KeyboardInterrupt(), 'tool: interrupted\n'),
    (KeyboardInterrupt('call again'), 'tool: interrupted; call again\n')])
def test_an_interrupted_tool_prints_how_to_go_on(interrupt, line, capsys):
    assert executed(ends(interrupt)) == INTERRUPTED
    assert capsys.readouterr().err == line


@pytest.mark.usefixtures('here')
@pytest.mark.parametrize('number', ENDING)
def test_every_signal_that_asks_for_the_end_interrupts_a_tool(number, monkeypatch, capsys):
    monkeypatch.setattr(sys, 'unraisablehook', sys.unraisablehook)
    signal.signal(number, signal.SIG_DFL)
    interrupt_on_signals.cache_clear()   # as in a process that begins
    assert executed(lambda arguments: signal.raise_signal(number)) == INTERRUPTED
    assert capsys.readouterr().err == 'tool: interrupted\n'


@pytest.mark.usefixtures('here')
@pytest.mark.parametrize('obeyed', [False, True])
def test_a_postponed_signal_comes_later_unless_it_was_obeyed(obeyed):
    def work(_):
        with postponed() as signals:
            signal.raise_signal(signal.SIGTERM)
            assert signals == [signal.SIGTERM]
            if obeyed:
                signals.clear()
        return 0
    script = argparse.ArgumentParser(prog='tool')
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        assert execute(script, work, []) == (0 if obeyed else INTERRUPTED)
    finally:
        signal.signal(signal.SIGTERM, before)


class Half:
    """What asks this process to end when it is forgotten."""

    def __del__(self):
        signal.raise_signal(signal.SIGTERM)


@pytest.mark.usefixtures('here')
def test_an_interrupt_in_a_destructor_comes_again(monkeypatch, capsys):
    monkeypatch.setattr(sys, 'unraisablehook', sys.unraisablehook)
    interrupt_on_signals.cache_clear()

    def work(_):
        Half()
        time.sleep(PATIENCE)
    assert executed(work) == INTERRUPTED
    assert capsys.readouterr().err == 'tool: interrupted\n'


@pytest.fixture
def unread():
    """Return a file whose reader has ended, as `| head` does at some time."""
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, 'w') as file:
        yield file


def test_output_that_nobody_reads_ends_a_tool_without_a_word(unread):
    script = 'import sys; from dp_swing_ros import executables; sys.exit(executables.parameters())'
    done = subprocess.run([sys.executable, '-c', script], stdout=unread, stderr=subprocess.PIPE,
                          text=True)
    assert (done.returncode, done.stderr) == (UNREAD, '')


@pytest.mark.usefixtures('here')
def test_help_that_nobody_reads_ends_a_node_without_a_word(unread, monkeypatch, capsys):
    monkeypatch.setattr(sys, 'argv', ['plant', '--help'])
    monkeypatch.setattr(sys, 'stdout', unread)
    assert (executables.plant(), capsys.readouterr().err) == (UNREAD, '')


def test_a_tool_ends_its_work_where_nobody_reads_on():
    with pytest.raises(BrokenPipeError):
        executed(ends(BrokenPipeError()), OSError)


def test_a_bug_has_its_traceback():
    with pytest.raises(ZeroDivisionError):
        executed(ends(ZeroDivisionError()))


@pytest.mark.parametrize('tool, argument', [
    *((tool, 'BAG') for tool in ('analyse', 'compare', 'export', 'identify', 'recover',
                                 'verify')),
    *((tool, topic.name) for tool in ('identify', 'import', 'train') for topic in COMMAND_TOPICS),
    ('demo', '--solver'), ('evaluate', '--scenarios'), ('import', 'LOG'),
    ('parameters', '--help')])
def test_help_names_tool_and_arguments(tool, argument, capsys):
    with pytest.raises(SystemExit) as end:
        import_module(f'dp_swing_ros.tools.{MODULES.get(tool, tool)}').main(['--help'])
    assert end.value.code == 0
    shown = capsys.readouterr().out
    assert f'dp_swing_ros {tool}' in shown
    assert argument in shown


@pytest.mark.parametrize('tool', ['evaluate', 'verify'])
def test_a_signal_while_a_tool_loads_ends_it_without_a_word(tool):
    script = f"""
import signal, sys
from dp_swing_ros import executables

class Finder:
    def find_spec(self, name, *_):
        if name == 'numpy':
            signal.raise_signal(signal.SIGTERM)

sys.meta_path.insert(0, Finder())
sys.exit(executables.{tool}())"""
    done = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (INTERRUPTED, '', '')

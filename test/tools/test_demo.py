# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the demo does before it starts anything; whole runs are in test_end_to_end.py."""

from pathlib import Path
import re

import numpy as np
import pytest

from dp_swing_ros.errors import UserError
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tools import demo, play


pytestmark = pytest.mark.usefixtures('here')


def folders(*arguments):
    return demo.folders_of(demo.command_line().parse_args(arguments))


@pytest.mark.parametrize('arguments, complaint', [
    (['--solver', 'none'], f"choose from .*{'.*'.join(SOLVERS)}"),
    (['--duration', '0'], '0 is not a number of at least 0.001'),
    (['--duration', 'nan'], 'nan is not a number of at least 0.001'),
    (['--duration', 'inf'], 'inf is not a number of at least 0.001'),
    (['--duration', 'long'], 'invalid'),
    (['--links', '4'], 'invalid choice: 4'), (['--links', 'two'], 'invalid'),
    (['--runs', '0'], '0 is not a whole number of at least 1'),
    (['--runs', '1.5'], 'invalid'),
    (['--speed', '2'], 'unrecognized arguments')])
def test_misuse_is_refused_at_once(arguments, complaint, capsys, here):
    with pytest.raises(SystemExit) as end:
        demo.main(arguments)
    assert end.value.code == 2
    assert re.search(complaint, capsys.readouterr().err)
    assert not list(here.iterdir())


def test_help_names_every_solver(capsys):
    with pytest.raises(SystemExit) as end:
        demo.main(['--help'])
    assert end.value.code == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in SOLVERS)


@pytest.mark.parametrize('text, words', [
    (None, 'cannot read the parameter file file.yaml: No such file'),
    ('horizon: 3\n', "line 1: 'horizon' stands where a node is named: it is not a ROS parameter"),
    ('/**/mpc:\n  ros__parameters:\n    horizon: [3\n    a: b\n', 'is not YAML: line 4: '),
    ('/**/mpc:\n  ros__parameters:\n    state_weights: [1, 2.0]\n', 'line 3: parameter '
     "'state_weights' is [1, 2.0]; ROS wants the values of a list alike: [1.0, 2.0]"),
    ('/**/mpc:\n  ros__parameters:\n    mppi: {samples: 3}\n  seed: 3\n',
     "line 4: 'seed' stands beside ros__parameters"),
    ('\n/**/mcp:\n  ros__parameters: {horizon: 3}\n',
     "file.yaml, line 2: '/**/mcp' is no node of this package in the root namespace; did you mean "
     "'mpc'?"),
    ('/rig/mpc:\n  ros__parameters: {horizon: 3}\n', "'/rig/mpc' is no node"),
    ('/**:\n  ros__parameters: {horizn: 3}\n', "no node has 'horizn'; did you mean 'horizon'?"),
    ('/**/mpc:\n  ros__parameters: {horizn: 3}\n',
     "unknown parameter 'horizn' of the node 'mpc'; did you mean 'horizon'?\n"),
    ('/**/plant:\n  ros__parameters: {xyzzy: 3}\n', "'plant'; available: acceleration_limit, "),
    ('/**/plant:\n  ros__parameters: {rate: 0}\n', "parameter 'rate' is 0.0; expected"),
    ('/**/mpc:\n  ros__parameters: {link3_mass: 1.0}\n', 'a pendulum with 3 links')])
@pytest.mark.parametrize('tool', [demo, play], ids=['demo', 'play'])
def test_a_parameter_file_is_checked_before_anything_is_there(tool, text, words, here, capsys):
    if text is not None:
        (here / 'file.yaml').write_text(text)
    assert tool.main(['--params', 'file.yaml']) == 2
    output, error = capsys.readouterr()
    assert output == '' and words in error and error.count('\n') == 1
    assert not list(here.glob('runs'))


def test_folder_with_something_in_it_is_not_overwritten(here, capsys):
    (here / 'old').mkdir()
    (here / 'old' / 'bag').write_text('')
    assert demo.main(['--output', 'old']) == 2
    assert capsys.readouterr().err == (
        'demo: error: old exists already; give another --output\n')


def test_missing_ros2_is_one_line(monkeypatch, capsys):
    monkeypatch.setenv('PATH', '')
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', '')
    assert demo.main([]) == 2
    error = capsys.readouterr().err
    assert error.startswith('demo: error: there is no ros2 on the PATH')
    assert error.count('\n') == 1


def test_one_run_has_the_folder_for_itself(here):
    (seed, folder), = folders('--solver', 'mppi', '--seed', '7').items()
    assert seed == 7
    assert re.fullmatch(r'runs/mppi_\d{8}_\d{6}', str(folder))
    assert folder.is_dir()


def test_several_runs_have_a_folder_and_a_seed_each(here):
    several = folders('--runs', '3', '--seed', '5', '--output', 'out')
    assert several == {n: Path('out', f'seed_{n}') for n in (5, 6, 7)}
    assert all(folder.is_dir() for folder in several.values())


@pytest.mark.parametrize('arguments, given', [((), None), (('--links', '3'), 3)])
def test_the_number_of_links_is_that_of_the_parameter_files_unless_it_is_given(arguments, given):
    assert demo.command_line().parse_args(arguments).links == given


def test_folder_that_is_a_file_is_refused(here):
    (here / 'file').write_text('')
    with pytest.raises(UserError, match='file exists already'):
        folders('--output', 'file')


@pytest.mark.parametrize('drive, shown', [('voltage', '+12.5 N'), ('velocity', '+12.5 m/s^2')])
def test_progress_shows_the_unit_of_what_acts(drive, shown, here):
    (here / 'file.yaml').write_text(f'/**:\n  ros__parameters: {{drive: {drive}}}\n')
    assert demo.drive_in([Path('file.yaml')]) == drive
    assert demo.in_words(np.zeros(4), 12.5, drive).endswith(shown)


@pytest.mark.parametrize('links, angles', [
    (1, 'θ1 +3.00 rad'), (2, 'θ1 +3.00 θ2 -3.00 rad'), (3, 'θ1 +3.00 θ2 -3.00 θ3 +0.50 rad')])
def test_progress_shows_every_angle_within_half_a_turn(links, angles):
    x = np.zeros(2 * links + 2)
    x[0], x[1:links + 1] = -0.25, (3.0, 2 * np.pi - 3.0, 0.5)[:links]
    assert demo.in_words(x, 12.5) == f'{angles}  x -0.25 m  u  +12.5 N'

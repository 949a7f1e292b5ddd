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
from dp_swing_ros.tools.processes import ProcessError


pytestmark = pytest.mark.usefixtures('here')


FILE = """\
/**:
  ros__parameters: {links: 1, seed: 4}
/**/mpc:
  ros__parameters: {solver: mppi}
/**/plant:
  ros__parameters: {duration: 3, lockstep: true}
"""


def started(*arguments, files=()):
    """Return what the nodes are started with."""
    return demo.asked(demo.command_line().parse_args(arguments), {
        node: demo.given_in(files, node) for node in demo.OPTIONS})


@pytest.fixture
def performed(monkeypatch):
    """Return what runs are asked for, none of which is done."""
    runs = []

    def fail(folder, parameters, files):
        runs.append((folder, parameters))
        raise ProcessError('the plant broke')
    monkeypatch.setattr(demo, 'perform', fail)
    monkeypatch.setenv('ROS_DOMAIN_ID', '')
    return runs


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
    words = ' '.join(shown.split())
    for option, default in (('SECONDS', 10), ('{1,2,3} of the pendulum', 2), ('solver', 0),
                            ('{' + ','.join(SOLVERS) + '}', 'ilqr'), ('to the bit', 'not')):
        assert f'{option} (default: as in --params, else {default})' in words


def test_what_neither_an_option_nor_a_file_says_has_a_default():
    assert started() == {'mpc': {'solver': 'ilqr', 'seed': 0},
                         'plant': {'seed': 0, 'duration': 10.0, 'lockstep': False}}


def test_an_option_that_is_not_given_leaves_what_a_file_says(here):
    Path('file.yaml').write_text(FILE)
    files = [Path('file.yaml')]
    assert started(files=files) == {
        'mpc': {'solver': 'mppi', 'seed': 4, 'links': 1},
        'plant': {'seed': 4, 'links': 1, 'duration': 3, 'lockstep': True}}
    assert started('--solver', 'ilqr', '--seed', '0', '--links', '2', '--duration', '10',
                   '--no-lockstep', files=files) == {
        'mpc': {'solver': 'ilqr', 'seed': 0, 'links': 2},
        'plant': {'seed': 0, 'links': 2, 'duration': 10.0, 'lockstep': False}}


def test_what_is_run_is_shown(here, performed, capsys):
    Path('file.yaml').write_text(FILE)
    assert demo.main(['--params', 'file.yaml']) == 1
    (folder, parameters), = performed
    assert parameters['mpc'] == {'solver': 'mppi', 'seed': 4, 'links': 1}
    assert re.fullmatch(r'runs/mppi_\d{8}_\d{6}', str(folder))
    assert f'mppi, seed 4 -> {folder}\n' in capsys.readouterr().out


def test_a_plant_that_would_never_end_is_refused(here, performed, capsys):
    Path('file.yaml').write_text('/**/plant:\n  ros__parameters: {duration: 0.0}\n')
    assert demo.main(['--params', 'file.yaml']) == 2
    assert 'never end; give --duration' in capsys.readouterr().err
    assert not performed and not list(here.glob('runs'))
    assert demo.main(['--params', 'file.yaml', '--duration', '1']) == 1
    assert performed[0][1]['plant']['duration'] == 1.0


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
    (seed, folder), = demo.folders_of(None, 'mppi', ['7']).items()
    assert seed == '7'
    assert re.fullmatch(r'runs/mppi_\d{8}_\d{6}', str(folder))
    assert folder.is_dir()


def test_several_runs_have_a_folder_and_a_seed_each(here):
    runs = demo.runs_of(started('--seed', '5'), 3)
    assert [run['plant']['seed'] for run in runs.values()] == [5, 6, 7]
    several = demo.folders_of(Path('out'), 'ilqr', runs)
    assert several == {str(n): Path('out', f'seed_{n}') for n in (5, 6, 7)}
    assert all(folder.is_dir() for folder in several.values())


def test_nodes_may_have_a_seed_each(here):
    Path('file.yaml').write_text('/**/plant:\n  ros__parameters: {seed: 4}\n')
    runs = demo.runs_of(started(files=[Path('file.yaml')]), 2)
    assert list(runs) == ['0,4', '1,5']
    assert {node: own['seed'] for node, own in runs['1,5'].items()} == {'mpc': 1, 'plant': 5}


def test_folder_that_is_a_file_is_refused(here):
    (here / 'file').write_text('')
    with pytest.raises(UserError, match='file exists already'):
        demo.folders_of(Path('file'), 'ilqr', ['0'])


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


def test_a_run_that_fails_leaves_the_table_of_those_before_it(
        here, lockstep_bag, monkeypatch, capsys):
    bags = iter([lockstep_bag, lockstep_bag])

    def perform(folder, parameters, files):
        try:
            return next(bags)
        except StopIteration:
            raise ProcessError('the plant broke') from None
    monkeypatch.setattr(demo, 'perform', perform)
    monkeypatch.setenv('ROS_DOMAIN_ID', '')
    assert demo.main(['--runs', '4', '--no-figures', '--output', 'run']) == 1
    out, error = capsys.readouterr()
    assert 'seed 0' in out and 'settling time' in out and 'upright in 2 of 2 runs' in out
    assert [line for line in out.splitlines() if line.startswith('bag, logs')] == [
        f'bag, logs and pictures: run/seed_{seed}' for seed in (0, 1)]
    assert error == 'demo: error: the plant broke\n'

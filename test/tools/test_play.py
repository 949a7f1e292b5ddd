# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plant, mpc and page by one command."""

import os
from pathlib import Path
import time
from types import SimpleNamespace

from conftest import wait_until
from pages import Page, port_of
import pytest

from dp_swing_ros.tools import play
from dp_swing_ros.tools.play import follow
from dp_swing_ros.tools.processes import Crew


def processes_of(folder):
    """Return the processes that work in a folder, beside this one."""
    def place(process):
        try:
            return (process / 'cwd').readlink()
        except OSError:
            return None
    return [process for process in Path('/proc').iterdir()
            if process.name.isdecimal() and int(process.name) != os.getpid()
            and place(process) == folder]


def test_all_is_there_and_all_ends(start_node, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    running = start_node('play', options=['--port', '0', '--no-browser', '--solver', 'ddp',
                                          '--lockstep'], environment={'ROS_DOMAIN_ID': ''})
    port = port_of(running)
    running.wait_for('the plant starts once the page is open')
    assert not list(tmp_path.glob('runs/play_*/plant.log'))
    with Page(port) as page:
        page.until(lambda page: page.newest.get('frame', {}).get('tick')
                   and page.newest['hello']['nodes']['mpc'])
        assert page.newest['frame']['tick']['solver'] == 'ddp'
        assert page.newest['hello']['lockstep']
        assert page.until(lambda page: page.newest['hello']['pausable'])
        assert page.until(lambda page: page.newest['frame']['tries'])
    assert len(processes_of(tmp_path)) >= 4
    assert running.stop() == 0
    assert wait_until(lambda: not processes_of(tmp_path))
    assert {log.name for log in tmp_path.glob('runs/play_*/*')} == {
        'plant.log', 'mpc.log', 'console.log'}


@pytest.fixture
def asked(here, monkeypatch):
    """Return the parameters with which nodes are started, none of which is, by name."""
    found = {}
    monkeypatch.setenv('ROS_DOMAIN_ID', '')
    monkeypatch.setattr(play, 'follow', lambda processes, start_plant, browse: start_plant())
    monkeypatch.setattr(Crew, 'start', lambda crew, name, parameters, *files: found.update({
        name: parameters}))
    return found


@pytest.mark.parametrize('options', [[], ['--lockstep']])
def test_the_plant_waits_for_the_mpc_where_it_is_asked_to(options, asked):
    assert play.main(options) == 0
    assert asked.keys() == {'console', 'mpc', 'plant'}
    assert asked['plant'] == ({'lockstep': True, 'pace': 1.0} if options else {})
    assert asked['mpc'] == {'shown_tries': play.TRIES}


def test_an_option_that_is_not_given_leaves_what_a_file_says(asked, here):
    (here / 'file.yaml').write_text(
        'mpc:\n  ros__parameters: {solver: ddp, shown_tries: 3}\n'
        'plant:\n  ros__parameters: {lockstep: true, pace: 0.5}\n'
        'console:\n  ros__parameters: {port: 1}\n')
    assert play.main(['--params', 'file.yaml']) == 0
    assert asked == {'console': {}, 'mpc': {}, 'plant': {}}   # beside the file
    assert play.main(['--params', 'file.yaml', '--solver', 'ilqr', '--lockstep', '--port', '2',
                      '--links', '2']) == 0
    assert asked == {'console': {'port': 2}, 'mpc': {'solver': 'ilqr', 'links': 2},
                     'plant': {'lockstep': True, 'links': 2}}


def test_help_tells_the_defaults(capsys):
    with pytest.raises(SystemExit):
        play.main(['--help'])
    words = ' '.join(capsys.readouterr().out.split())
    for default in ('ilqr', '2', 'not', '8080'):
        assert f'(default: as in --params, else {default}' in words


def test_the_plant_starts_without_a_page_after_a_while(monkeypatch, capsys):
    monkeypatch.setattr('dp_swing_ros.tools.play.PATIENCE', 0.3)
    lines = iter([['the page is at http://127.0.0.1:1/']])
    console = SimpleNamespace(name='console', new_lines=lambda: next(lines, []),
                              check=lambda: None)

    def start_plant():
        raise KeyboardInterrupt

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        follow([console], start_plant, browse=False)
    assert time.monotonic() - began >= 0.3
    assert capsys.readouterr().out == (
        'console: the page is at http://127.0.0.1:1/\n'
        'play: the plant starts once the page is open, or in 0.3 s\n')


def test_a_process_that_fails_ends_all_with_its_own_words(here, monkeypatch, capsys):
    monkeypatch.setenv('ROS_DOMAIN_ID', '')
    (here / 'wrong.yaml').write_text(
        '/**/mpc:\n  ros__parameters: {dynamics: learned, model: none.json}\n')
    assert play.main(['--port', '0', '--no-browser', '--params', 'wrong.yaml']) == 1
    assert 'none.json' in capsys.readouterr().err
    assert wait_until(lambda: not processes_of(here))

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plant, mpc and page by one command."""

import os
from pathlib import Path

from conftest import wait_until
from pages import Page, port_of
import pytest


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


@pytest.mark.parametrize('lockstep', [False, True])
def test_all_is_there_and_all_ends(start_node, tmp_path, monkeypatch, lockstep):
    monkeypatch.chdir(tmp_path)
    play = start_node('play', options=['--port', '0', '--no-browser', '--solver', 'ddp',
                                       *(['--lockstep'] if lockstep else [])],
                      environment={'ROS_DOMAIN_ID': ''})
    with Page(port_of(play)) as page:
        page.until(lambda page: page.newest.get('frame', {}).get('tick')
                   and page.newest['hello']['nodes']['mpc'])
        assert page.newest['frame']['tick']['solver'] == 'ddp'
        assert page.newest['hello']['lockstep'] == lockstep
        assert page.until(lambda page: page.newest['hello']['pausable'] == lockstep)
        assert page.until(lambda page: page.newest['frame']['tries'])
    assert len(processes_of(tmp_path)) >= 4
    assert play.stop() == 0
    assert wait_until(lambda: not processes_of(tmp_path), 10)
    assert {log.name for log in tmp_path.glob('runs/play_*/*')} == {
        'plant.log', 'mpc.log', 'console.log'}


def test_a_process_that_fails_ends_all_with_its_own_words(start_node, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / 'wrong.yaml'
    file.write_text('/**/mpc:\n  ros__parameters: {dynamics: learned, model: none.json}\n')
    play = start_node('play', options=['--port', '0', '--no-browser', '--params', str(file)],
                      environment={'ROS_DOMAIN_ID': ''})
    assert play.wait() == 1
    assert 'none.json' in play.output()
    assert wait_until(lambda: not processes_of(tmp_path), 10)

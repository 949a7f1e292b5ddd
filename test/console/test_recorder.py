# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of the console, by processes that stand in for logger and analyse."""

import os

from conftest import wait_until
import pytest

from dp_swing_ros.console.recorder import Recorder

# in place of what begins each process
SETPRIV = """\
#!/bin/sh
case "$*" in
    *" analyse "*) echo 'analyse: error: two states at 0 ns'; exit 2;;
esac
trap 'exit 0' INT; echo recording; while :; do sleep 0.02; done
"""


@pytest.fixture
def recorder(tmp_path, monkeypatch):
    (tmp_path / 'setpriv').write_text(SETPRIV)
    (tmp_path / 'setpriv').chmod(0o755)
    monkeypatch.setenv('PATH', str(tmp_path), prepend=os.pathsep)
    return Recorder(tmp_path / 'recordings')


def test_why_there_is_no_report_on_a_recording_is_said(recorder):
    folder = recorder.start(['joint_states'])
    assert wait_until((folder / 'logger.log').read_text)
    assert recorder.poll() == '' and recorder.state()['folder'] == str(folder)
    assert recorder.stop() == folder
    said = []
    assert wait_until(lambda: said.append(recorder.poll()) or said[-1])
    assert said[-1] == f'no report on {folder.name}: analyse: error: two states at 0 ns'
    found, = recorder.state()['finished']
    assert found['name'] == folder.name and found['report'] is None
    assert recorder.poll() == ''

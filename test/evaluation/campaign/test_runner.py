# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import contextlib
from dataclasses import replace
import fcntl
import itertools
import os
import re
import struct
import sys
import termios

from conftest import PATIENCE
import pytest

from dp_swing_ros.evaluation.campaign import runner
from dp_swing_ros.evaluation.campaign.contestants import parse_all
from dp_swing_ros.evaluation.campaign.rows import CampaignError, identical, read, Table
from dp_swing_ros.evaluation.campaign.runner import run
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.parameters import ParameterError

CONTESTANTS = ('ilqr', 'nothing')
SEEDS = range(4)


def play(folder, jobs=2, dask='', contestants=CONTESTANTS, seeds=SEEDS):
    """Run a small campaign and return its rows."""
    folder.mkdir(exist_ok=True)
    cases = [case for name in ('random', 'force_noise')
             for case in SCENARIOS[name].cases(name, seeds, 1, 1.0)]
    run(list(itertools.product(parse_all(contestants), cases)), Table(folder / 'episodes.csv'),
        jobs, dask)
    return read(folder / 'episodes.csv')


def assert_identical(rows, others):
    """Compare rows in order, the clock apart."""
    assert all(itertools.starmap(identical, zip(rows, others, strict=True)))


def in_order(rows):
    """Return rows by their keys."""
    return sorted(rows, key=lambda row: str(row.key))


def cluster_of(workers, processes=True):
    """Return a Dask cluster on this machine; only two tests wait for it to be loaded."""
    from distributed import LocalCluster
    return LocalCluster(n_workers=workers, threads_per_worker=1, processes=processes,
                        host='tcp://127.0.0.1', dashboard_address=None)


@pytest.fixture(scope='module')
def alone(tmp_path_factory):
    """Return the rows of the campaign by one process."""
    return play(tmp_path_factory.mktemp('campaign'), jobs=1)


def test_every_contestant_meets_every_case(alone):
    assert len({row.key for row in alone}) == len(alone) == 2 * 2 * len(SEEDS)
    assert {row.outcome for row in alone} <= {'NEVER_UP', 'NEVER_HELD', 'TOO_LATE', 'HELD'}


def test_two_processes_give_the_rows_of_one(alone, tmp_path):
    assert_identical(play(tmp_path), alone)


def test_a_dask_cluster_gives_the_same_rows(alone, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, 'CONNECTION', PATIENCE)   # of a busy machine
    with cluster_of(workers=2) as cluster:
        rows = play(tmp_path, dask=cluster.scheduler_address)
    assert_identical(rows, alone)


def test_a_cluster_without_workers_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, 'CONNECTION', PATIENCE)   # of a busy machine
    with cluster_of(workers=0, processes=False) as cluster:
        with pytest.raises(CampaignError, match='no workers'):
            play(tmp_path, dask=cluster.scheduler_address)


def test_a_scheduler_that_is_not_there_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, 'CONNECTION', 0.5)
    with pytest.raises(CampaignError, match='tcp://127.0.0.1:1 does not answer'):
        play(tmp_path, dask='tcp://127.0.0.1:1')


def everything(screen):
    """Return what a terminal showed until its last writer closed it, and close it."""
    shown = bytearray()
    with contextlib.suppress(OSError):   # which is how a terminal ends
        while piece := os.read(screen, 1 << 16):
            shown += piece
    os.close(screen)
    return shown.decode()


def test_only_what_is_missing_is_run(alone, tmp_path, monkeypatch):
    path = tmp_path / 'episodes.csv'
    play(tmp_path, jobs=1, seeds=range(2))
    before = path.read_bytes()
    screen, terminal = os.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack('4H', 24, 80, 0, 0))   # it has no size
    with os.fdopen(terminal, 'w') as stderr, monkeypatch.context() as patch:
        patch.setattr('sys.stderr', stderr)
        rows = play(tmp_path, jobs=1)
    shown = everything(screen)
    assert path.read_bytes().startswith(before)
    assert_identical(in_order(rows), in_order(alone))
    assert '8/16' in shown
    play(tmp_path, jobs=1)
    assert len(read(path)) == 16


def test_a_file_is_told_how_much_is_left(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(runner, 'TOLD', 0.0)
    play(tmp_path, jobs=1, seeds=range(1), contestants=['nothing'])
    assert re.search(r'^1 of 2 episodes, 1 not held; 0\d:\d\d gone, about 0\d:\d\d left$',
                     capsys.readouterr().err, re.M)


def test_a_contestant_that_cannot_be_made_ends_it_before_it_begins(tmp_path):
    with pytest.raises(ParameterError, match='horison'):
        play(tmp_path, contestants=('ilqr:horison=3',))
    assert not any(tmp_path.iterdir())


def test_an_engine_that_is_not_installed_ends_it_before_it_begins(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    case, = SCENARIOS['hanging'].cases('hanging', range(1), None, 1.0)
    other = replace(case, plant={**case.plant, 'engine': 'mujoco'})
    contestant, = parse_all(['nothing'])
    with pytest.raises(ParameterError, match='pip install mujoco'):
        run([(contestant, case), (contestant, other)], Table(tmp_path / 'episodes.csv'), 1)
    assert not read(tmp_path / 'episodes.csv')


def test_an_episode_that_raises_is_shown_and_the_rest_goes_on(tmp_path, capsys):
    good, bad, after = SCENARIOS['hanging'].cases('hanging', range(3), None, 1.0)
    bad = replace(bad, plant={**bad.plant, 'cart_mass': -1.0})
    run([(contestant, case) for contestant in parse_all(['nothing'])
         for case in (good, bad, after)], Table(tmp_path / 'episodes.csv'), 1)
    rows = read(tmp_path / 'episodes.csv')
    assert [row.outcome == 'ERROR' for row in rows] == [False, True, False]
    assert 'cart_mass' in rows[1].detail
    assert 'nothing hanging' in capsys.readouterr().err

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from base64 import b64encode
from contextlib import redirect_stdout
import io
import re

import numpy as np
from PIL import Image
import pytest
from recorded_runs import write_bag
from synthetic import swing_up, without_ticks

from dp_swing_ros.bags import read_episode
from dp_swing_ros.evaluation.comparison import table
from dp_swing_ros.evaluation.metrics import measure, outcome
from dp_swing_ros.tools import analyse
from dp_swing_ros.tools.analyse import main
from dp_swing_ros.tools.command_lines import beside

STILLS = {'hero.png', 'snapshots.png', 'squared_error.png', 'timeline.png'}


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp('analyse') / 'bag'
    return write_bag(swing_up(duration=2.5), folder)


@pytest.fixture(scope='module')
def analysed(bag, tmp_path_factory):
    """Return a folder with all that the tool makes of a bag, and what it printed."""
    folder = tmp_path_factory.mktemp('analysed') / 'new' / 'pictures'
    with redirect_stdout(io.StringIO()) as printed:
        assert main([str(bag), '--output', str(folder)]) == 0
    return folder, printed.getvalue()


def test_bag_gives_table_and_all_pictures(bag, analysed):
    folder, shown = analysed
    made = {path.name for path in folder.iterdir()}
    assert made == STILLS | {'animation.gif', 'report.html'}
    for name in made:
        assert str(folder / name) in shown
    for name in made - {'report.html'}:
        with Image.open(folder / name) as image:
            image.verify()
    assert table({'ilqr': measure(read_episode(bag))}) in shown


def test_table_is_that_of_the_episode_before_it_was_recorded(bag):
    before, after = measure(swing_up(duration=2.5)), measure(read_episode(bag))
    np.testing.assert_allclose(
        [float(value) for value in vars(after).values()],
        [float(value) for value in vars(before).values()], rtol=1e-6, atol=1e-9)


def test_report_holds_the_pictures_and_stays_small(bag, analysed):
    folder, _ = analysed
    report = (folder / 'report.html').read_text()
    assert f'iLQR: {outcome(read_episode(bag)).value}' in report
    for name in (*STILLS, 'animation.gif'):
        assert b64encode((folder / name).read_bytes()).decode() in report
    assert len(report) < 3e6


def test_several_bags_stand_side_by_side(bag, tmp_path, capsys, monkeypatch):
    second = write_bag(swing_up(duration=2.0, solver='$x<'), tmp_path / 'second')
    third = write_bag(without_ticks(swing_up(duration=1.0)), tmp_path / 'third')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(analyse, 'PICTURES', {'hero': analyse.PICTURES['hero']})
    assert main([str(bag), str(second), str(third), '--no-animation']) == 0
    runs = {name: read_episode(each) for name, each in
            {'ilqr': bag, '$x<': second, 'no controller': third}.items()}
    assert table({name: measure(run) for name, run in runs.items()}) in capsys.readouterr().out
    (folder,) = tmp_path.glob('comparison_*')
    assert {path.name for path in folder.iterdir()} == {
        '1_ilqr', '2__x_', '3_no_controller', 'overlay.png', 'report.html'}
    for number in '123':
        (own,) = folder.glob(f'{number}_*')
        assert {path.name for path in own.iterdir()} == {'hero.png'}
    report = (folder / 'report.html').read_text()
    assert '3 runs side by side' in report
    assert len(re.findall('<img ', report)) == 3 + 1


def test_one_solver_twice_is_told_apart_by_the_bags(bag, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(analyse, 'PICTURES', {})
    again = write_bag(swing_up(duration=1.0), tmp_path / 'again')
    arguments = [str(bag), str(again), '--no-animation', '--output', str(tmp_path / 'out')]
    assert main(arguments) == 0
    assert '| ilqr bag | ilqr again |' in capsys.readouterr().out
    assert (tmp_path / 'out' / 'report.html').exists()


def test_bag_given_twice_is_one_line(bag, tmp_path, capsys):
    assert main([str(bag), str(bag), '--output', str(tmp_path / 'out')]) == 2
    assert 'given twice' in one_line(capsys)
    assert not (tmp_path / 'out').exists()


def test_pictures_lie_beside_the_bag_by_default(bag, monkeypatch):
    monkeypatch.setattr(analyse, 'PICTURES', {'hero': analyse.PICTURES['hero']})
    before = sorted(bag.iterdir())
    assert main([str(bag), '--no-animation']) == 0
    assert {path.name for path in beside(bag, 'analysis').iterdir()} == {'hero.png', 'report.html'}
    assert sorted(bag.iterdir()) == before


def one_line(capsys):
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert error.startswith('analyse: error: ')
    return error


def test_missing_bag_is_one_line(tmp_path, capsys):
    assert main([str(tmp_path / 'none')]) == 2
    assert 'none' in one_line(capsys)


def test_file_that_is_no_bag_is_one_line(tmp_path, capsys):
    (tmp_path / 'text.mcap').write_text('text')
    assert main([str(tmp_path / 'text.mcap')]) == 2
    assert 'text.mcap' in one_line(capsys)


def test_folder_that_cannot_be_made_is_one_line(bag, tmp_path, capsys):
    (tmp_path / 'file').write_text('')
    assert main([str(bag), '--output', str(tmp_path / 'file')]) == 2
    assert 'file' in one_line(capsys)


def test_bag_without_an_end_is_read_when_asked(bag, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(analyse, 'PICTURES', {})
    whole = next(bag.glob('*.mcap')).read_bytes()
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(whole[:-200])
    assert main([str(cut), '--no-animation']) == 2
    one_line(capsys)
    assert main([str(cut), '--no-animation', '--partial']) == 0


def test_missing_argument_is_misuse(capsys):
    with pytest.raises(SystemExit) as end:
        main([])
    assert end.value.code == 2

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A bag that lacks messages says so on every output of every tool."""

import shutil

from matplotlib.colors import to_rgb
from mcap.reader import make_reader
import numpy as np
import pandas
from PIL import Image
import pytest
from recorded_bags import record
import yaml

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.figures.style import WARNING
from dp_swing_ros.tools import analyse, export, recover


@pytest.fixture(scope='module')
def original(tmp_path_factory):
    return record(tmp_path_factory.mktemp('whole') / 'bag', duration=3.0, solver='ddp').parent


@pytest.fixture
def bag(original, tmp_path):
    shutil.copytree(original, tmp_path / 'bag')
    return tmp_path / 'bag'


def cut(bag, share):
    file = next(bag.glob('*.mcap'))
    with file.open('r+b') as stream:
        stream.truncate(int(share * file.stat().st_size))
    return bag


def count(bag):
    return len(Bag(bag, partial=True).entries)


@pytest.mark.parametrize('part', range(1, 23))
def test_every_truncation_is_told(bag, original, part):
    cut(bag, 0.15 + 0.85 * part / 23)
    found, whole = Bag(bag, partial=True), count(original)
    if len(found.entries) == whole:     # only the end is gone
        assert found.incomplete == ''
    else:
        assert found.incomplete == f'Incomplete: {len(found.entries)} of {whole} messages'
    (bag / 'metadata.yaml').unlink()
    assert Bag(bag, partial=True).incomplete \
        == f'Incomplete: {len(found.entries)} of unknown messages'


def test_a_whole_bag_says_nothing(original):
    assert Bag(original).incomplete == Bag(next(original.glob('*.mcap'))).incomplete == ''
    with next(original.glob('*.mcap')).open('rb') as file:
        assert make_reader(file).get_summary().statistics.message_count == count(original)


def test_a_bag_with_an_end_is_held_against_its_metadata(bag):
    about = bag / 'metadata.yaml'
    content = yaml.safe_load(about.read_text())
    content['rosbag2_bagfile_information']['message_count'] += 7
    about.write_text(yaml.safe_dump(content))
    assert Bag(bag).incomplete == f'Incomplete: {count(bag)} of {count(bag) + 7} messages'


def test_analyse_says_it_everywhere(tmp_path, capsys):
    original, bag = (record(tmp_path / name, flush=2, duration=0.5, rise=0.2).parent
                     for name in ('original', 'bag'))
    notice = Bag(cut(bag, 0.4), partial=True).incomplete
    assert notice.startswith('Incomplete: ')
    out, whole = tmp_path / 'out', tmp_path / 'whole'
    assert analyse.main([str(bag), '--partial', '--output', str(out)]) == 0
    assert f'\n{notice}\n' in capsys.readouterr().out
    assert notice in (out / 'report.html').read_text()
    assert analyse.main([str(original), '--output', str(whole)]) == 0
    assert 'Incomplete' not in capsys.readouterr().out + (whole / 'report.html').read_text()
    for name in ('hero.png', 'snapshots.png', 'squared_error.png', 'timeline.png',
                 'animation.gif'):
        assert has_warning(out / name) and not has_warning(whole / name), name


def has_warning(path):
    """Return whether a picture has the red of the notice in its upper right corner."""
    with Image.open(path) as image:
        corner = image.convert('RGB').crop((image.width // 2, 0, image.width, 30))
    return bool(np.any(np.abs(np.asarray(corner, float) / 255 - to_rgb(WARNING)).sum(2) < 0.1))


def test_several_bags_say_which(bag, original, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(analyse, 'PICTURES', {})
    notice = Bag(cut(bag, 0.6), partial=True).incomplete
    assert analyse.main([str(bag), str(original), '--partial', '--no-animation', '--output',
                         str(tmp_path / 'out')]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if 'Incomplete' in line)
    assert line.endswith(f': {notice}') and 'ddp' in line
    assert has_warning(tmp_path / 'out' / 'overlay.png')


def test_recover_says_it_and_marks_the_new_bag(bag, original, capsys):
    notice = Bag(cut(bag, 0.6), partial=True).incomplete
    assert recover.main([str(bag)]) == 0
    assert notice in capsys.readouterr().out
    new = bag.with_name('bag_recovered')
    assert Bag(new).incomplete == notice
    assert recover.main([str(new)]) == 0
    shown = capsys.readouterr().out
    assert 'nothing to repair' in shown and notice in shown
    cut(new, 0.5)   # and again: it is still held against what once was recorded
    assert recover.main([str(new)]) == 0
    assert f'of {count(original)} messages' in Bag(bag.with_name('bag_recovered_recovered')
                                                   ).incomplete


def test_recover_without_metadata_does_not_know_of_how_many(bag):
    cut(bag, 0.6)
    (bag / 'metadata.yaml').unlink()
    assert recover.main([str(bag)]) == 0
    new = bag.with_name('bag_recovered')
    assert Bag(new).incomplete == f'Incomplete: {count(new)} of unknown messages'


@pytest.mark.parametrize('kind', ['csv', 'parquet'])
def test_export_says_it_in_the_file(bag, original, kind, tmp_path, capsys):
    notice = Bag(cut(bag, 0.6), partial=True).incomplete
    path = tmp_path / f'run.{kind}'
    assert export.main([str(bag), '--partial', '--output', str(path)]) == 0
    assert notice in capsys.readouterr().out
    frame = (pandas.read_csv if kind == 'csv' else pandas.read_parquet)(path)
    assert set(frame['incomplete']) == {notice}

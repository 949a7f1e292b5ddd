# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Published figures cannot outlive their code: some of their episodes are played again.

Where processor, versions and sources are those that a page names, the rows must be the stored ones
to the bit; elsewhere in what another rounding cannot change.
"""

import dataclasses
from functools import cache
from pathlib import Path
import subprocess
import sys

import campaigns
import methods
import numpy as np
import published
import pytest
import seeded
import stamp
import summary

from dp_swing_ros import provenance
from dp_swing_ros.evaluation.campaign.contestants import key, play
from dp_swing_ros.evaluation.campaign.rows import identical, read
from dp_swing_ros.evaluation.scenarios import PERIOD
from dp_swing_ros.kernels import processor

TOP = Path(__file__).parents[1]
RESULTS = TOP / 'docs' / 'results'
SAMPLE = RESULTS / 'sample'
PAGES = {path.stem: path.read_text() for path in RESULTS.glob('*.md')}
STAMPS = {name: of for text in PAGES.values() for name, of in stamp.read(text).items()}
SEEDED = [part for part in seeded.SEEDED if part in STAMPS]
NEEDED = {'summary': summary.NEEDED, 'methods': methods.NEEDED}
TICKS = 2               # by which another rounding may move the settling


def differs(found, stored, exactly):
    """Tell in words in what a row is not the stored one; nothing where it is."""
    if exactly:
        return '' if identical(found, stored) else f'{found.key} is not the stored row to the bit'
    if found.outcome != stored.outcome:
        return f'{found.key} ended {found.outcome}, stored {stored.outcome}'
    moved = abs(found.metrics.settling_time - stored.metrics.settling_time) / PERIOD
    apart = found.key.scenario in seeded.SETTLES and moved > TICKS + 1e-6
    return f'{found.key} settled {moved:.1f} ticks apart' if apart else ''


@pytest.fixture(autouse=True, scope='module')
def once():
    """Make the hundreds of episodes of each part once: digests and tests ask for them again."""
    with pytest.MonkeyPatch.context() as patch:
        for part, of in seeded.SEEDED.items():
            patch.setitem(seeded.SEEDED, part, of._replace(episodes=cache(of.episodes)))
        yield


@pytest.mark.parametrize('part', SEEDED)
def test_stored_rows_are_those_of_the_present_code(part):
    """To the bit where processor, versions and sources are those that the page names."""
    of = STAMPS[part]
    exactly = (of.sources, of.processor, of.versions) == (
        seeded.sources(part), processor(), stamp.versions(seeded.SEEDED[part].packages))
    rows = [row for row in read(SAMPLE / f'{part}.csv.gz') if exactly or seeded.is_sure(row.key)]
    episodes = {key(*episode): episode for episode in seeded.SEEDED[part].episodes()}
    apart = [differs(play(*episodes[row.key]), row, exactly) for row in rows]
    assert not any(apart), (
        f'{[one for one in apart if one]}: run `make results PAGES={part}`; the page names {of}, '
        f'these sources are {seeded.sources(part)}')


def test_every_page_is_there_and_its_parts_name_their_commit_and_sources():
    assert PAGES.keys() == published.PAGES.keys()
    for page, of in published.PAGES.items():
        there = published.parts_in(PAGES[page])
        assert list(there) == [part for part in of.parts if part in there]
        assert PAGES[page] == published.composed(page, there)
        for part, text in there.items():
            needed = NEEDED.get(part)
            assert list(stamp.read(text)) == ([] if needed else [part])
            assert stamp.TOGETHER.findall(text) == ([', '.join(needed)] if needed else [])
    assert not any(of.commit.endswith('dirty') for of in STAMPS.values())
    assert {path.name for path in SAMPLE.iterdir()} == {f'{part}.csv.gz' for part in SEEDED}


def test_all_pages_take_at_most_three_hours():
    parts = published.parts_of(published.PAGES)
    assert sorted(parts) == sorted(published.PARTS)
    assert sum(published.PARTS[part].minutes for part in parts) <= 180


def test_readme_has_the_figures_of_the_page():
    text = (TOP / 'README.md').read_text()
    assert summary.between(text) == summary.between(PAGES['reliability']) != ''


@pytest.mark.parametrize('part', [
    part for part in (*campaigns.CAMPAIGNS, *published.OF_ROWS)
    if (published.ROWS / f'{part}.csv.gz').exists()])
def test_a_page_says_what_its_rows_say(part, tmp_path):
    """Where `make results` has left them; who has none makes a page of a few below."""
    rows = read(published.ROWS / f'{part}.csv.gz')
    page = next(text for text in PAGES.values() if part in stamp.read(text))
    (tmp_path / 'figures').mkdir()
    text = published.OF_ROWS[part](rows, '') if part in published.OF_ROWS else campaigns.page(
        part, rows, '', tmp_path / 'figures')
    tables = [line for line in text.splitlines() if line.startswith('| ')]
    assert tables and set(tables) <= set(page.splitlines())


def test_what_is_no_longer_the_stored_row_is_seen():
    row = read(SAMPLE / 'robustness.csv.gz')[0]
    row = dataclasses.replace(row, key=row.key._replace(scenario='hanging'))
    later = row.metrics.settling_time + 3 * PERIOD
    changed = type(row)(row.key, row.outcome, '', type(row.metrics)(
        **{**vars(row.metrics), 'settling_time': later}), row.solve_times)
    rounded = type(row)(row.key, row.outcome, '', type(row.metrics)(
        **{**vars(row.metrics), 'energy': np.nextafter(row.metrics.energy, 0)}), row.solve_times)
    assert differs(changed, row, exactly=True) and differs(changed, row, exactly=False)
    assert differs(rounded, row, exactly=True) and not differs(rounded, row, exactly=False)
    assert not differs(row, row, exactly=True)


@pytest.fixture(scope='module')
def needed():
    """Return the modules that an episode needs, and those that it or a live page's nodes do."""
    script = """
import sys

def imported(*names):
    for name in names:
        __import__(f'dp_swing_ros.{name}')
    print(*(m.partition('.')[2] for m in sys.modules if m.startswith('dp_swing_ros.')))

imported('evaluation.campaign.contestants', 'evaluation.scenarios', 'solvers.device')
imported('nodes.plant', 'nodes.mpc', 'nodes.logger')"""
    loaded = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True,
                            check=True, cwd=TOP).stdout
    return [set(line.replace('.', '/').split()) for line in loaded.splitlines()]


def test_the_digest_is_of_the_modules_that_an_episode_needs_and_no_others(needed):
    places = [path.relative_to(provenance.PACKAGE).with_suffix('').as_posix()
              for path in provenance.PACKAGE.rglob('*.py')]
    digested = {place.removesuffix('/__init__') for place in places if place != '__init__'
                and not f'{place}.py'.startswith(provenance.AFTERWARDS)}
    assert digested == needed[0]
    for place in provenance.AFTERWARDS:
        assert (provenance.PACKAGE / place).exists(), place


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """Let `make results` keep, write and play in an empty folder; a few episodes a part."""
    monkeypatch.setattr(published, 'KEPT', tmp_path / 'kept')
    monkeypatch.setattr(published, 'ROWS', tmp_path / 'rows')
    monkeypatch.setattr(published, 'DOCS', tmp_path / 'docs')
    monkeypatch.setattr(stamp, 'TOP', tmp_path)
    monkeypatch.setattr(stamp, 'commit', lambda: 'abc')
    monkeypatch.setattr(stamp, 'changed', list)
    for name, scenario in (('random', 'random'), ('robustness', 'hanging')):
        few = campaigns.CAMPAIGNS[name]._replace(
            scenarios=(scenario,), seeds=range(1), timed={scenario: 1}, pictures={})
        monkeypatch.setitem(campaigns.CAMPAIGNS, name, few)
        monkeypatch.setitem(seeded.SEEDED, name, seeded.Seeded(few.episodes, few.is_timed))
    return tmp_path


def test_a_part_is_made_and_kept_and_gone_on_with(elsewhere, capsys):
    assert published.main(['random']) == 0
    page, stored = elsewhere / 'docs' / 'results' / 'reliability.md', elsewhere / 'rows'
    text = page.read_text()
    of = stamp.read(text)['random']
    assert (of.commit, of.sources, of.processor) == ('abc', seeded.sources('random'), processor())
    assert list(published.parts_in(text)) == ['random']
    assert '| `ilqr` | 1 of 1' in text and 'seeds 0 to 0 of `random`' in text
    rows = read(stored / 'random.csv.gz')
    assert [row.key.contestant for row in rows] == list(campaigns.METHODS)
    # what the clock says is that of the episodes which one process played alone
    assert all(len(row.solve_times) > 0 for row in rows)
    sample = read(elsewhere / 'docs' / 'results' / 'sample' / 'random.csv.gz')
    assert {row.key for row in sample} == {row.key for row in rows}
    assert all(identical(row, rows[campaigns.METHODS.index(row.key.contestant)])
               and not len(row.solve_times) for row in sample)
    assert '1 of 1: 3 min; 3 min left' in capsys.readouterr().out
    page.unlink()
    assert published.main(['random']) == 0
    assert 'same sources' in capsys.readouterr().out
    assert page.read_text() == text
    # a part that was stopped: its rows are there, and none is played again
    kept, = (elsewhere / 'kept').iterdir()
    (kept / 'docs').rename(kept / 'begun')
    before = (kept / 'timed.csv').read_bytes()
    assert published.main(['random']) == 0
    assert (kept / 'timed.csv').read_bytes() == before
    assert all(map(identical, read(stored / 'random.csv.gz'), rows))


def test_what_puts_others_together_comes_after_them_and_goes_into_readme(elsewhere, capsys):
    assert published.main(['summary']) == 1
    assert "make results PAGES='random robustness'" in capsys.readouterr().err
    readme = elsewhere / 'README.md'
    readme.write_text(f'before\n{summary.BEGIN}old\n{summary.END}after\n')
    assert published.main(['summary', 'random', 'robustness']) == 0
    page = (elsewhere / 'docs' / 'results' / 'reliability.md').read_text()
    assert list(published.parts_in(page)) == ['summary', 'random', 'robustness']
    assert readme.read_text() == (
        f'before\n{summary.BEGIN}{summary.between(page)}{summary.END}after\n')
    assert '| `ilqr` | 1 of 1 ' in readme.read_text()


def test_a_dirty_tree_is_refused(elsewhere, monkeypatch, capsys):
    monkeypatch.setattr(stamp, 'changed', lambda: ['dp_swing_ros/configuration.py'])
    assert published.main(['random']) == 2
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert 'dp_swing_ros/configuration.py' in error
    assert '--dirty' in error
    assert not (elsewhere / 'kept').exists()


def test_an_unknown_page_is_refused(capsys):
    with pytest.raises(SystemExit) as end:
        published.main(['randon'])
    assert end.value.code == 2
    assert 'reliability' in capsys.readouterr().err


def test_generated_files_do_not_make_a_tree_dirty(tmp_path, monkeypatch):
    monkeypatch.setattr(stamp, 'TOP', tmp_path)
    for name in ('README.md', 'docs/results/random.md', 'solver.py'):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text('one')
    for command in (['init', '-q'], ['add', '.'],
                    ['-c', 'user.name=a', '-c', 'user.email=a', 'commit', '-qm', 'one']):
        subprocess.run(['git', '-C', str(tmp_path), *command], check=True)
    for name in ('README.md', 'docs/results/random.md', 'docs/results/new.csv.gz'):
        (tmp_path / name).write_text('two')
    assert stamp.changed() == []
    assert not stamp.commit().endswith('dirty')
    (tmp_path / 'solver.py').write_text('two')
    assert stamp.changed() == ['solver.py']
    assert stamp.commit().endswith('-dirty')


def test_what_a_page_measures_exists():
    assert set(stamp.MEASURED) <= set(published.PARTS)
    for of in stamp.MEASURED.values():
        for file in of.files:
            assert (TOP / 'benchmarks' / file).exists(), file
        for place in of.parts:
            assert (provenance.PACKAGE / place).exists(), place


def test_the_digest_of_live_pages_is_of_the_modules_that_their_nodes_need(needed):
    needed = {f'{name}.py' for name in needed[1]}
    assert {name for name in needed if name.startswith(('bags/', 'messages/', 'nodes/', 'rerun/'))
            and not name.startswith(stamp.LIVE)} == set()
    assert {name for name in stamp.LIVE if name.startswith(('nodes/', 'rerun/'))} <= needed


def test_comments_docstrings_and_layout_do_not_outdate_a_page_but_a_number_does():
    code = 'def force(x):\n    """Return it."""\n    return f"{x}", -0.1 * (x + 2)\n'
    told = ('# why\n\ndef force(x):\n    """Give a force."""\n    return (f"{x}",  # what\n'
            '            -0.1 * (x + 2))\n')
    assert stamp.meaning(told) == stamp.meaning(code)
    for other in (code.replace('0.1', '0.2'), code.replace('{x}', '{-x}'),
                  code.replace('return f', 'yield f'), code.replace('(x + 2)', 'x + 2')):
        assert stamp.meaning(other) != stamp.meaning(code)


def test_parts_say_that_they_are_older_and_no_other_does():
    wrong = [path.name for path, text in published.marked(RESULTS).items()
             if path.read_text() != text]
    assert not wrong, f'{wrong}: run `python benchmarks/published.py --mark`'


def test_an_older_part_is_marked_and_unmarked():
    text = f'# A page\n\n{stamp.made("random", 16 * "a")}\n{stamp.made("links", 16 * "b")}'
    of = stamp.read(text)['links']
    assert of.sources == 16 * 'b'
    marked = stamp.marked(text, {'links'}, of.processor)
    assert stamp.marked(marked, {'links'}, of.processor) == marked
    assert marked.count(stamp.OLDER) == 1
    assert f'{stamp.OLDER}, which has changed since commit {of.commit}.**\n\nMade by ' \
        '`make results PAGES=links`' in marked
    assert stamp.marked(marked, set(), of.processor) == text
    assert f'({of.processor}) is also not that of' in stamp.marked(text, {'links'}, 'another')


def test_what_puts_others_together_is_as_old_as_these():
    text = f'# In short\n\n{stamp.together(["random", "robustness"])}\nAll are held.\n'
    marked = stamp.marked(text, {'links', 'robustness'}, '')
    assert marked == text.replace('Put', f'**{stamp.OLDER}: robustness.**\n\nPut')
    assert stamp.marked(marked, {'robustness'}, '') == marked
    assert stamp.marked(marked, {'links'}, '') == text

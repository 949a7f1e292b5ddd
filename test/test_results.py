# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Published figures cannot outlive their code: some of their episodes are played again.

Where processor, versions and sources are those that a page names, the rows must be the stored ones
to the bit; elsewhere in what another rounding cannot change.
"""

from pathlib import Path
import subprocess
import sys

import campaigns
import numpy as np
import pandas as pd
from PIL import Image
import published
import pytest
import readme
import rig
import seeded
import stamp

from dp_swing_ros import provenance
from dp_swing_ros.evaluation.campaign.contestants import key, play
from dp_swing_ros.evaluation.campaign.rows import identical, read, store
from dp_swing_ros.evaluation.scenarios import PERIOD
from dp_swing_ros.kernels import processor

TOP = Path(__file__).parents[1]
RESULTS = TOP / 'docs' / 'results'
# some are registered before they are made; those that docs link to must be there (test_docs.py)
MADE = [page for page in published.PAGES if (RESULTS / f'{page}.md').exists()]
SEEDED = [page for page in seeded.SEEDED if page in MADE]
AGAIN = 6               # episodes of a page that are played again
ESTIMATES = 3           # and of those of which a page has estimates
TICKS = 2               # by which another rounding may move the settling
# whatever the rounding, the solvers with their defaults hold these, and settle where they do
SETTLES = {'hanging', 'near_goal', 'swing-up', 'near the goal'}
HOLDS = {*SETTLES, 'random'}
DEFAULTS = {f'{name}{setup}' for name in campaigns.METHODS
            for setup in ('', ', defaults', ', nothing', ', nothing: the defaults',
                          ', one link, 20 N')}


def chosen(page, exactly):
    """Return the stored rows that are played again, of as many contestants as possible."""
    rows = [row for row in read(RESULTS / f'{page}.csv.gz') if exactly or (
        row.key.scenario in HOLDS and row.key.contestant in DEFAULTS)]
    order = np.random.default_rng(11).permutation(len(rows))
    first = {}
    for row in (rows[n] for n in order):
        first.setdefault(row.key.contestant, row)
    return list(first.values())[:AGAIN]


def differs(found, stored, exactly):
    """Tell in words in what a row is not the stored one; nothing where it is."""
    if exactly:
        return '' if identical(found, stored) else f'{found.key} is not the stored row to the bit'
    if found.outcome != stored.outcome:
        return f'{found.key} ended {found.outcome}, stored {stored.outcome}'
    moved = abs(found.metrics.settling_time - stored.metrics.settling_time) / PERIOD
    apart = found.key.scenario in SETTLES and moved > TICKS + 1e-6
    return f'{found.key} settled {moved:.1f} ticks apart' if apart else ''


def is_made_like_here(page):
    """Return whether processor, versions and sources are those that a page names."""
    of = stamp.read(RESULTS / f'{page}.md')
    return (of.sources, of.processor, of.versions) == (
        seeded.sources(page), processor(), stamp.versions(seeded.SEEDED[page].packages))


@pytest.mark.parametrize('page', SEEDED)
def test_stored_rows_are_those_of_the_present_code(page):
    exactly = is_made_like_here(page)
    episodes = {key(*episode): episode for episode in seeded.SEEDED[page].episodes()}
    apart = [differs(play(*episodes[row.key]), row, exactly) for row in chosen(page, exactly)]
    assert not any(apart), (
        f'{[one for one in apart if one]}: run `make results PAGES={page}`; the page names '
        f'{stamp.read(RESULTS / f"{page}.md")}, these sources are {seeded.sources(page)}')


def test_stored_estimates_are_those_of_the_present_code():
    stored = pd.read_csv(RESULTS / 'rig_estimates.csv.gz', float_precision='round_trip')
    rigs = {one.rig.scenario: one.rig for one in rig.SOUGHT}
    for row in stored.sample(ESTIMATES, random_state=11).itertuples():
        case, = rigs[row.scenario].cases(range(row.seed, row.seed + 1))
        one, = rig.estimated(case, [row.parameter])
        assert one.true == row.true
        assert one.found == row.found or not is_made_like_here('rig'), row


@pytest.mark.parametrize('page', SEEDED)
def test_a_page_has_a_row_of_every_episode(page):
    assert [row.key for row in read(RESULTS / f'{page}.csv.gz')] == [
        key(*episode) for episode in seeded.SEEDED[page].episodes()]


@pytest.mark.parametrize('page', MADE)
def test_every_page_names_its_commit_and_sources(page):
    of = stamp.read(RESULTS / f'{page}.md')
    assert of.page == page
    assert not of.commit.endswith('dirty')


def test_what_readme_puts_side_by_side_is_from_one_processor():
    alone = {'paper'}   # whose sentence compares its own runs alone
    assert len({stamp.read(RESULTS / f'{page}.md').processor
                for page in {*readme.STORED, 'benchmark'} - alone}) == 1


def test_readme_has_the_figures_that_are_stored():
    text = (TOP / 'README.md').read_text()
    assert readme.replaced(text, readme.block(RESULTS)) == text, 'run `make results`'


def test_what_is_no_longer_the_stored_row_is_seen():
    row = chosen('near_goal', exactly=True)[0]
    later = row.metrics.settling_time + 3 * PERIOD
    changed = type(row)(row.key, row.outcome, '', type(row.metrics)(
        **{**vars(row.metrics), 'settling_time': later}), row.solve_times)
    rounded = type(row)(row.key, row.outcome, '', type(row.metrics)(
        **{**vars(row.metrics), 'energy': np.nextafter(row.metrics.energy, 0)}), row.solve_times)
    assert differs(changed, row, exactly=True) and differs(changed, row, exactly=False)
    assert differs(rounded, row, exactly=True) and not differs(rounded, row, exactly=False)
    assert not differs(row, row, exactly=True)


def test_the_digest_is_of_the_modules_that_an_episode_needs_and_no_others():
    script = ('import sys, dp_swing_ros.evaluation.campaign.contestants, '
              'dp_swing_ros.evaluation.scenarios, dp_swing_ros.solvers.device\n'
              'print(*(m for m in sys.modules if m.startswith("dp_swing_ros.")))')
    loaded = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True,
                            check=True, cwd=TOP).stdout.split()
    needed = {name.partition('.')[2].replace('.', '/') for name in loaded}
    places = [path.relative_to(provenance.PACKAGE).with_suffix('').as_posix()
              for path in provenance.PACKAGE.rglob('*.py')]
    digested = {place.removesuffix('/__init__') for place in places if place != '__init__'
                and not f'{place}.py'.startswith(provenance.AFTERWARDS)}
    assert digested == needed
    for place in provenance.AFTERWARDS:
        assert (provenance.PACKAGE / place).exists(), place


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """Let `make results` keep, write and play in an empty folder; a few episodes a page."""
    monkeypatch.setattr(published, 'KEPT', tmp_path / 'kept')
    monkeypatch.setattr(published, 'DOCS', tmp_path / 'docs')
    monkeypatch.setattr(stamp, 'TOP', tmp_path)
    monkeypatch.setattr(stamp, 'commit', lambda: 'abc')
    monkeypatch.setattr(stamp, 'changed', list)
    (tmp_path / 'README.md').write_text(f'before\n{readme.BEGIN}old\n{readme.END}after\n')
    few = seeded.SEEDED['near_goal'].episodes()[:6]
    monkeypatch.setitem(seeded.SEEDED, 'near_goal', seeded.Seeded(
        lambda: few, lambda case: case.seed == 0))
    return tmp_path


def test_a_page_is_made_and_kept_and_gone_on_with(elsewhere, capsys):
    assert published.main(['near_goal']) == 0
    page = (elsewhere / 'docs' / 'results' / 'near_goal.md')
    of = stamp.read(page)
    assert (of.commit, of.sources, of.processor) == (
        'abc', seeded.sources('near_goal'), processor())
    rows = read(elsewhere / 'docs' / 'results' / 'near_goal.csv.gz')
    # what the clock says is that of the episodes which one process played alone
    assert [len(row.solve_times) > 0 for row in rows] == [True] * 3 + [False] * 3
    assert '1 of 1: 1 min; 1 min left' in capsys.readouterr().out
    page.unlink()
    assert published.main(['near_goal']) == 0
    assert 'same sources' in capsys.readouterr().out
    assert page.exists()
    # a page that was stopped: its rows are there, and none is played again
    kept, = (elsewhere / 'kept').iterdir()
    (kept / 'docs' / 'results' / 'near_goal.md').unlink()
    (kept / 'docs').rename(kept / 'begun')
    before = (kept / 'others.csv').read_bytes()
    assert published.main(['near_goal']) == 0
    assert (kept / 'others.csv').read_bytes() == before
    assert all(map(identical, read(elsewhere / 'docs' / 'results' / 'near_goal.csv.gz'), rows))


def test_a_campaign_s_page_has_tables_pictures_and_rows(elsewhere, monkeypatch):
    few = campaigns.CAMPAIGNS['baselines']._replace(
        scenarios=('hanging',), seeds=range(1), timed={'hanging': 1})
    monkeypatch.setitem(campaigns.CAMPAIGNS, 'baselines', few)
    monkeypatch.setitem(seeded.SEEDED, 'baselines', seeded.Seeded(few.episodes, few.is_timed))
    assert published.main(['baselines']) == 0
    docs = elsewhere / 'docs'
    text = (docs / 'results' / 'baselines.md').read_text()
    assert text.startswith('# Baselines\n\nMade by `make results PAGES=baselines` on ')
    assert '| `tvlqr` | 1 of 1' in text
    assert 'seeds 0 to 0 of `hanging`' in text
    rows = read(docs / 'results' / 'baselines.csv.gz')
    assert [row.key.contestant for row in rows] == [one.label for one in few.parsed()]
    with Image.open(docs / 'figures' / 'baselines.png') as image:
        image.verify()


def test_a_dirty_tree_is_refused(elsewhere, monkeypatch, capsys):
    monkeypatch.setattr(stamp, 'changed', lambda: ['dp_swing_ros/configuration.py'])
    assert published.main(['near_goal']) == 2
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert 'dp_swing_ros/configuration.py' in error
    assert '--dirty' in error
    assert not (elsewhere / 'kept').exists()


def test_an_unknown_page_is_refused(capsys):
    with pytest.raises(SystemExit) as end:
        published.main(['randon'])
    assert end.value.code == 2
    assert 'robustness' in capsys.readouterr().err


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
    assert set(stamp.MEASURED) <= set(published.PAGES)
    for of in stamp.MEASURED.values():
        for script in of.scripts.split():
            assert (TOP / 'benchmarks' / f'{script}.py').exists(), script
        for place in of.parts:
            assert (provenance.PACKAGE / place).exists(), place


def test_the_digest_of_live_pages_is_of_the_modules_that_their_nodes_need():
    nodes = ', '.join(f'dp_swing_ros.nodes.{name}' for name in ('plant', 'mpc', 'logger'))
    script = (f'import sys, {nodes}\n'
              'print(*(m for m in sys.modules if m.startswith("dp_swing_ros.")))')
    loaded = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True,
                            check=True, cwd=TOP).stdout.split()
    needed = {f'{name.partition(".")[2].replace(".", "/")}.py' for name in loaded}
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


def test_pages_say_in_their_first_line_that_they_are_older_and_no_other_does():
    wrong = [path.name for path, text in published.marked(RESULTS).items()
             if path.read_text() != text]
    assert not wrong, f'{wrong}: run `python benchmarks/published.py --mark`'


def test_an_older_page_is_marked_and_unmarked(elsewhere, monkeypatch):
    assert published.main(['near_goal']) == 0
    page = elsewhere / 'docs' / 'results' / 'near_goal.md'
    text = page.read_text()
    assert stamp.OLDER not in text
    now = published.PAGES['near_goal']
    monkeypatch.setitem(published.PAGES, 'near_goal', now._replace(sources=lambda: 'other'))
    for _ in range(2):
        assert published.main(['--mark']) == 0
        first = page.read_text().split('\n\n')[1]
        assert first == f'**{stamp.OLDER}, which has changed since commit abc.**'
    monkeypatch.setitem(published.PAGES, 'near_goal', now)
    assert published.main(['--mark']) == 0
    assert page.read_text() == text
    of = stamp.read(page)
    assert f'({of.processor}) is also not that of' in stamp.marked(text, of, True, 'another')


def test_readme_s_figures_come_from_rows(tmp_path):
    row = chosen('near_goal', exactly=True)[0]
    store(tmp_path / 'random.csv.gz', [row])
    text = f'a\n{readme.BEGIN}old{readme.END}b\n'
    assert readme.replaced(text, 'new\n') == f'a\n{readme.BEGIN}new\n{readme.END}b\n'
    (tmp_path / 'README.md').write_text(text)
    readme.write(tmp_path / 'README.md', tmp_path)    # not all is there yet
    assert (tmp_path / 'README.md').read_text() == text

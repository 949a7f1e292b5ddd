# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command behind `make results PAGES=paper`, on a few seeds, through the real nodes."""

from pathlib import Path
import re

from joblib import Parallel
import numpy as np
import paper
import paper_experiments
from PIL import Image
import pytest

from dp_swing_ros.bags import read_episode
from dp_swing_ros.evaluation.campaign.contestants import key, play
from dp_swing_ros.evaluation.campaign.rows import identical, read

TOP = Path(__file__).parents[1]
NUMBERS = range(2, 11)


def test_a_figure_comes_from_bags_that_hold_the_runs_without_ros_to_the_bit(
        tmp_path, monkeypatch, capsys):
    which = paper_experiments.Key('ddp', 'near the goal', 'paper')
    monkeypatch.setattr(paper, 'keys', lambda figures: [which])
    monkeypatch.setattr(paper, 'Parallel', lambda **_: Parallel(n_jobs=1, return_as='generator'))
    assert paper.main(['--figures', '8', '--seeds', '2', '--docs', str(tmp_path),
                       '--output', str(tmp_path / 'bags')]) == 0
    assert len(re.findall(r'1206 numbers in the bag of seed 0, equal to the bit',
                          capsys.readouterr().out)) == 1
    with Image.open(tmp_path / 'figures' / 'paper_fig8.png') as image:
        image.verify()
    assert [path.name for path in (tmp_path / 'figures').iterdir()] == ['paper_fig8.png']
    bag, = (tmp_path / 'bags').glob('ddp_near_the_goal_*')
    theirs = read_episode(bag / 'bag')
    np.testing.assert_allclose(theirs.X[0], [0, 0.2, 0.2, 0, 0, 0], atol=0.01)
    assert theirs.limits.force_limit == np.inf
    text = (tmp_path / 'results' / 'paper.md').read_text()
    assert '| DDP | paper | 2 of 2 (34-100 %) |' in text
    rows = read(tmp_path / 'results' / 'paper.csv.gz')
    assert [row.key.contestant for row in rows] == ['ddp, paper'] * 2
    assert rows[0].metrics.largest_force > 20.0
    again = [one for one in paper_experiments.episodes() if key(*one) == rows[1].key]
    assert identical(rows[1], play(*again[0]))


def test_a_figure_needs_all_set_ups_of_its_solver():
    assert [which.setup for which in paper_experiments.keys([8])] == [
        setup for setup, about in paper_experiments.SETUPS.items() if 'ddp' in about.solvers]


def test_no_two_seeds_start_alike_and_all_solvers_start_alike():
    starts = {(one.scenario, one.seed): one.plant['initial_state']
              for _, one in paper_experiments.episodes()}
    assert len(set(starts.values())) == len(starts)
    assert all(one.plant['initial_state'] == starts[one.scenario, one.seed]
               for _, one in paper_experiments.episodes())


def test_the_bound_is_in_the_plant_and_known_to_the_mpc():
    for which in paper_experiments.keys():
        one = paper_experiments.contestant(which)
        limits = {part.get('force_limit', 20.0) for part in (one.plant, one.mpc)}
        free = 75.0 if which.solver == 'mppi' else np.inf
        assert limits == {20.0 if '20 N' in which.setup or which.setup == 'defaults' else free}


@pytest.fixture(scope='module')
def held():
    """Return how many of a hundred runs the page says were held, by start, solver and set-up."""
    page = (TOP / 'docs' / 'results' / 'paper.md').read_text()
    found = {}
    for section in page.split('\n### ')[1:]:
        start = section.partition('\n')[0].lower()
        lines = re.findall(r'^\| (DDP|iLQR|MPPI) \| ([^|]+) \| (\d+) of 100 ', section, re.M)
        found |= {(start, solver.lower(), setup): int(count) for solver, setup, count in lines}
    return found


def test_the_page_has_a_line_of_every_experiment(held):
    assert set(held) == {(start, solver, setup)
                         for solver, start, setup in paper_experiments.keys()}


def test_what_the_documents_conclude_is_on_the_page(held):
    for start in paper_experiments.STARTS:
        for name in ('ilqr', 'ddp'):
            for plant in ('', ', RK4 plant', ', fine plant'):
                assert held[start, name, f'paper{plant}, 20 N'] >= 95
            for plant in ('', ', RK4 plant'):
                assert held[start, name, f'paper{plant}'] >= 95
            assert held[start, name, 'paper, fine plant'] < 40
        mppi = {setup: count for (at, name, setup), count in held.items()
                if (at, name) == (start, 'mppi') and setup.startswith('paper')}
        assert {setup for setup, count in mppi.items() if count} == {
            'paper, fine plant, 20 N, our gains and sampling',
            'paper, fine plant, 20 N, our gains, sampling and cost'}
        assert mppi['paper, fine plant, 20 N, our gains, sampling and cost'] >= 95


@pytest.mark.parametrize('arguments, complaint', [
    (['--seeds', '0'], 'not a whole number of at least 1'),
    (['--figures', '11'], 'invalid choice: 11')])
def test_misuse_is_one_line(arguments, complaint, capsys):
    with pytest.raises(SystemExit) as end:
        paper.main(arguments)
    assert end.value.code == 2
    assert complaint in capsys.readouterr().err


def test_every_figure_of_the_paper_is_stored_small_and_shown():
    page = (TOP / 'docs' / 'paper.md').read_text()
    for number in NUMBERS:
        path = TOP / 'docs' / 'figures' / f'paper_fig{number}.png'
        assert path.stat().st_size < 300_000
        assert f'](figures/{path.name})' in page


def test_the_page_finds_every_equation_in_the_code():
    page = (TOP / 'docs' / 'paper.md').read_text()
    equations = page.split('## Every equation')[1]
    covered = set()
    for first, last in re.findall(r'\((\d+)\)(?:-\((\d+)\))?', equations):
        covered.update(range(int(first), int(last or first) + 1))
    assert set(range(1, 38)) <= covered
    for file, name in re.findall(r'`(dp_swing_ros/[\w/]+\.py)`: `(\w+)`', equations):
        assert re.search(rf'(?:def|class) {name}\b', (TOP / file).read_text()), (file, name)

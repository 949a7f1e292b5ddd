# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
from contextlib import suppress
import dataclasses
import json
import os
from pathlib import Path
import re
import signal
import subprocess
import sys

from conftest import PATIENCE, wait_until
from PIL import Image
import pytest
from results import row

from dp_swing_ros.evaluation.campaign.rows import ERROR, read, store
from dp_swing_ros.pendulum.state import LINKS
from dp_swing_ros.tools.evaluate import command_line, main

SOURCES = Path(__file__).parents[2]

pytestmark = pytest.mark.usefixtures('here')


def test_the_installed_command_leaves_table_report_and_pictures(tmp_path):
    command = ['ros2', 'run', 'dp_swing_ros', 'evaluate', '--contestants', 'ilqr', 'nothing',
               '--scenarios', 'hanging', 'delay', '--seeds', '2', '--levels', '2',
               '--duration', '3', '--jobs', '1', '--output', 'new/campaign']
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    new, folder = Path('new', 'campaign'), tmp_path / 'new' / 'campaign'
    made = {path.name for path in folder.iterdir()}
    pictures = {'successes.png', 'criteria.png', 'sweeps.png', 'settling.png', 'solve_times.png'}
    assert made == {'campaign.json', 'episodes.csv', 'summary.md', 'summary.json', *pictures}
    for name in pictures:
        with Image.open(folder / name) as image:
            image.verify()
    page = (folder / 'summary.md').read_text()
    assert '--levels 2' in page
    shown = done.stdout.splitlines()
    assert all(len(line) < 120 for line in shown)
    assert shown[1] == '12 episodes of 3 s.'
    assert shown[2].startswith('ilqr: held 4 of 6 (least in delay, 2 of 4), median settling 1.')
    assert shown[3] == 'nothing: held 0 of 6 (least in hanging, 0 of 2)'
    assert shown[4:] == [f'report: {new / "summary.md"}', f'episodes: {new / "episodes.csv"}',
                         f'pictures: {new / "*.png"}']
    summary = json.loads((folder / 'summary.json').read_text())
    assert summary['episodes'] == len(read(folder / 'episodes.csv')) == 2 * (2 + 2 * 2)
    assert summary['standings'][0]['held'] == {
        'successes': 2, 'runs': 2, 'low': pytest.approx(0.342, abs=1e-3), 'high': 1.0}


SMALL = ['--contestants', 'nothing', '--scenarios', 'hanging', '--seeds', '3', '--duration', '1',
         '--jobs', '1', '--no-figures', '--output', 'campaign']


def test_a_finished_campaign_is_only_reported(capsys):
    assert main(SMALL) == 0
    rows = Path('campaign/episodes.csv').read_bytes()
    Path('campaign/summary.md').unlink()
    assert main(SMALL) == 0
    assert main(['--output', 'campaign', '--summary-only']) == 0
    assert Path('campaign/episodes.csv').read_bytes() == rows
    assert '0 of 3' in Path('campaign/summary.md').read_text()
    assert Path('campaign/successes.png').exists()


def one_line(capsys):
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert error.startswith('evaluate: error: ')
    return error


def test_another_campaign_in_its_folder_is_refused(capsys):
    assert main(SMALL) == 0
    capsys.readouterr()
    assert main([*SMALL, '--seeds', '4']) == 1
    assert '[0, 3]' in one_line(capsys)


def test_a_campaign_of_another_number_of_links_is_refused(capsys):
    assert main(SMALL) == 0
    capsys.readouterr()
    assert main([*SMALL, '--links', '3']) == 1
    assert 'links' in one_line(capsys)


@pytest.mark.parametrize('links', LINKS)
def test_all_contestants_and_cases_have_the_number_of_links(links):
    scenarios = ['--scenarios', 'hanging', 'random', 'model', '--seeds', '2', '--levels', '2']
    assert main([*SMALL, *scenarios, '--figures', '--links', str(links)]) == 0
    about = json.loads(Path('campaign/campaign.json').read_text())
    assert about['links'] == links
    assert about['contestants']['nothing'] == {
        'name': 'nothing', 'plant': {'links': links}, 'mpc': {'links': links}}
    rows = read(Path('campaign/episodes.csv'))
    assert not [row.detail for row in rows if row.outcome == ERROR]
    assert {f'link{i}_mass' for i in range(1, links + 1)} == {
        row.key.parameter for row in rows if re.fullmatch(r'link\d_mass', row.key.parameter)}
    assert len(rows) == 2 + 2 + 2 * 2 * (1 + 4 * links)
    assert Path('campaign/starts.png').exists()


def test_a_contestant_may_be_given_its_own_number_of_links():
    file = Path('single.yaml')
    file.write_text('/**:\n  ros__parameters: {links: 1}\n')
    assert main(['--contestants', f'nothing:{file}', *SMALL[2:], '--links', '1']) == 0
    given = json.loads(Path('campaign/campaign.json').read_text())['contestants']
    assert given == {'nothing:single': {
        'name': 'nothing', 'plant': {'links': 1}, 'mpc': {'links': 1}}}


@pytest.mark.parametrize('part', ['links=3', 'single.yaml', 'plant.yaml'])
def test_a_contestant_of_another_number_of_links_than_the_campaign_is_refused(part, capsys):
    Path('single.yaml').write_text('/**:\n  ros__parameters: {links: 1}\n')
    Path('plant.yaml').write_text('plant:\n  ros__parameters: {links: 1}\n')
    assert main(['--contestants', f'nothing:{part}', *SMALL[2:]]) == 2
    error = one_line(capsys)
    assert f'contestant \'nothing:{part.removesuffix(".yaml")}\'' in error and '--links' in error
    assert not Path('campaign').exists()


def test_a_campaign_is_compared_with_a_stored_one_row_by_row(capsys):
    assert main(SMALL) == 0
    rows = read(Path('campaign/episodes.csv'))
    store(Path('stored.csv.gz'), [dataclasses.replace(rows[0], metrics=dataclasses.replace(
        rows[0].metrics, energy=rows[0].metrics.energy + 1e-9)), *rows[1:]])
    capsys.readouterr()
    for place, equal in (('campaign', 3), ('stored.csv.gz', 2)):
        assert main([*SMALL, '--against', place]) == 0
        assert (f'against {place}: {equal} of 3 episodes are identical; 0 held only now, '
                '0 only as stored') in capsys.readouterr().out
        page = Path('campaign/summary.md').read_text()
        assert f'## Against {place}' in page
        assert f'| hanging | `nothing` | 3 | {equal} | 0 | 0 | 1.000 | - | - |' in page


def test_what_cannot_be_compared_is_one_line(capsys):
    store(Path('stored.csv.gz'), [row('ddp', 'random')])
    assert main([*SMALL, '--against', 'stored.csv.gz']) == 1
    assert 'stored are ddp in random' in one_line(capsys)
    assert not Path('campaign').exists()
    assert main([*SMALL, '--against', 'none.csv.gz']) == 1
    assert 'none.csv.gz' in one_line(capsys)


@pytest.mark.parametrize('arguments, code, word', [
    (['--contestants', 'sqp'], 2, 'sqp'),
    (['--contestants', 'ilqr:none.yaml'], 2, 'none.yaml'),
    (['--contestants', 'ilqr:horison=3', '--seeds', '1'], 2, "did you mean 'horizon'?"),
    (['--output', 'none', '--summary-only'], 1, 'no campaign'),
    (['--summary-only'], 2, '--output DIR'),
    (['--output', 'file/below', '--contestants', 'nothing'], 1, 'file')])
def test_what_cannot_work_is_one_line(arguments, code, word, capsys):
    Path('file').write_text('')
    assert main(arguments) == code
    output, error = capsys.readouterr()
    assert error.startswith('evaluate: error: ') and error.count('\n') == 1 and word in error
    assert output == '' and not Path('runs').exists()   # before anything is counted or made


@pytest.mark.parametrize('arguments, word', [
    (['--scenarios', 'none'], 'near_goal'), (['--seeds', '0'], 'no seeds'),
    (['--seeds', '5:5'], 'no seeds'), (['--seeds', 'all'], 'invalid'),
    (['--levels', '0'], 'least 1'), (['--jobs', '0'], 'least 1'), (['--duration', 'inf'], '0.05'),
    (['--links', '4'], 'invalid choice'), (['--speed', '2'], 'unrecognized')])
def test_misuse_is_refused_at_once(arguments, word, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert word in capsys.readouterr().err


@pytest.mark.parametrize('text, seeds', [('3', range(3)), ('10:12', range(10, 12))])
def test_seeds_are_a_count_or_a_range(text, seeds):
    assert command_line().parse_args(['--seeds', text]).seeds == seeds


def test_help_tells_scenarios_and_examples(capsys):
    with pytest.raises(SystemExit):
        main(['--help'])
    shown = capsys.readouterr().out
    assert all(word in shown for word in ('near_goal', 'tvlqr', 'dask worker', 'examples:'))


# stands still once its table has so many lines, so that it is not done before it is ended
WAITING = """
import math, signal, sys
from dp_swing_ros.evaluation.campaign import rows, runner
from dp_swing_ros.tools.evaluate import main
lines, append, runner.TOLD = int(sys.argv.pop(1)), rows.Table.append, math.inf
def append_and_wait(table, row):
    append(table, row)
    while len(table.rows) + 1 >= lines:
        signal.pause()
rows.Table.append = append_and_wait
sys.exit(main())
"""
LONG = ['--contestants', 'nothing', 'ilqr', '--scenarios', 'random', '--seeds', '20',
        '--duration', '0.5', '--jobs', '2', '--no-figures', '--output', 'campaign']


def started(lines=5):
    """Start a campaign in a session of its own, and wait for the first lines of its table."""
    process = subprocess.Popen(
        [sys.executable, '-c', WAITING, str(lines), *LONG], start_new_session=True, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        env={**os.environ, 'PYTHONPATH': str(SOURCES)})
    table = Path('campaign/episodes.csv')
    assert wait_until(lambda: table.exists() and table.read_bytes().count(b'\n') >= lines)
    return process


def left(session):
    """Return the processes of a session that still live."""
    found = []
    for place in Path('/proc').glob('[0-9]*/stat'):
        with suppress(OSError):   # one that has ended meanwhile
            name, _, rest = place.read_text().rpartition(')')
            state, _, _, its, *_ = rest.split()
            found += [name] if state != 'Z' and int(its) == session else []
    return found


def test_a_campaign_goes_on_after_it_was_killed(capsys):
    process = started()
    process.kill()
    process.communicate()
    survived = Path('campaign/episodes.csv').read_bytes()
    whole = survived[:survived.rfind(b'\n') + 1]
    assert 0 < whole.count(b'\n') < 41
    # as if the last line had been torn
    Path('campaign/episodes.csv').write_bytes(whole + b'ilqr,random,,,7,HE')
    assert wait_until(lambda: not left(process.pid)), left(process.pid)
    assert main([*LONG, '--jobs', '1']) == 0
    assert Path('campaign/episodes.csv').read_bytes().startswith(whole)
    rows = read(Path('campaign/episodes.csv'))
    assert len({row.key for row in rows}) == len(rows) == 40
    shown = capsys.readouterr()
    assert f'{whole.count(10) - 1} episodes are there already' in shown.out
    assert 'episode/s' not in shown.err   # which is no terminal


@pytest.mark.parametrize('number, lines', [(signal.SIGINT, 1), (signal.SIGTERM, 5)],
                         ids=['starting', 'playing'])
def test_an_interrupt_ends_all_workers_and_says_how_to_go_on(number, lines):
    process = started(lines)
    os.killpg(process.pid, number)
    error = process.communicate(timeout=PATIENCE)[1]
    assert process.returncode == 130
    # joblib's own process may warn, of a folder that was removed before it could do so
    said = re.sub(r'.*resource_tracker.*\n  warnings\.warn\(.*\n', '', error)
    assert said == 'evaluate: interrupted; call again with --output campaign to go on\n'
    assert 'Traceback' not in error
    assert wait_until(lambda: not left(process.pid)), left(process.pid)
    assert len(read(Path('campaign/episodes.csv'))) >= lines - 1

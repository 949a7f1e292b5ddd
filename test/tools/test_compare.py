# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from diagnostic_msgs.msg import KeyValue
import numpy as np
from PIL import Image
import pytest
from real_bags import rewritten, tick
from std_msgs.msg import Float64
from virtual import record

from dp_swing_ros import figures
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.rerun.counterfactual import counterfactual, Run
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.descent import ILQR
from dp_swing_ros.tools.command_lines import beside
from dp_swing_ros.tools.compare import main
from dp_swing_ros.topics import CONFIGURATION, DIAGNOSTICS, DISTURBANCE


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return a run of a real-time plant, in virtual time."""
    return record(tmp_path_factory.mktemp('run') / 'bag', 3.05, np.random.default_rng(20))


def compared(capsys, *arguments):
    """Return the exit code, what was printed, and the error."""
    code = main([str(argument) for argument in arguments])
    shown = capsys.readouterr()
    return code, shown.out, shown.err.split('\r')[-1].strip()


def columns(table):
    """Return the rows of a Markdown table by their names."""
    rows = [[cell.strip() for cell in line.strip('| ').split('|')]
            for line in table.splitlines() if line.startswith('| ')]
    return {row[0]: row[1:] for row in rows}


def is_a_picture(path):
    with Image.open(path) as image:
        return min(image.size) > 300 and np.asarray(image.convert('L')).std() > 5


def test_one_take_over_gives_a_table_and_a_picture(bag, capsys):
    code, out, _ = compared(capsys, bag)
    assert code == 0
    rows = columns(out)
    assert list(rows)[1:] == ['recorded ilqr', *SOLVERS]
    assert list(rows)[0].startswith('from 0.5')   # the first tick from there on
    costs = [float(row[0]) for row in list(rows.values())[1:]]
    regrets = [float(row[1]) for row in list(rows.values())[1:]]
    np.testing.assert_allclose(regrets, np.array(costs) - min(costs), atol=2e-3)
    assert {row[2] for row in list(rows.values())[1:]} <= {'yes', 'no'}
    assert out.splitlines()[-1] == str(beside(bag, 'analysis') / 'counterfactual.png')
    assert is_a_picture(beside(bag, 'analysis') / 'counterfactual.png')


def test_it_is_the_same_every_time(bag, tmp_path, capsys):
    first, second = (compared(capsys, bag, '--at', '0.7', '--duration', '1', '--solvers', 'mppi',
                              '--output', tmp_path) for _ in range(2))
    assert first == second
    assert 'from 0.7' in first[1] and 'to 1.7' in first[1]


@pytest.mark.parametrize('duration', [0.1, 1.0, None])
def test_in_real_time_too_all_are_judged_over_the_same_window(bag, duration):
    run = Run(Bag(bag))
    for at in (0.0, 0.3, 0.8, 1.3):
        one = counterfactual(run, run.tick_at(at, duration), ['ddp'], duration, lambda: None)
        assert one.others[0].t[-1] == pytest.approx(one.recorded.t[-1], abs=0.026)
        if duration is not None:   # on a busy machine a state may be late, and the next one closer
            nearest = max(np.diff([run.time(sample.stamp) for sample in run.samples])) / 2 + 1e-3
            assert one.recorded.t[-1] - one.at == pytest.approx(duration, abs=nearest)


def test_many_take_overs_give_the_regret_over_the_run(bag, tmp_path, capsys):
    code, out, _ = compared(capsys, bag, '--every', '1', '--solvers', 'ddp', 'mppi', 'ddp',
                            '--output', tmp_path / 'new')
    assert code == 0
    rows = columns(out)
    assert rows['from [s]'] == ['least cost to go', 'recorded ilqr', 'ddp', 'mppi']
    assert len(rows) in (4, 5)
    for row in list(rows.values())[1:]:
        assert min(map(float, row[1:])) == 0.0
    assert is_a_picture(tmp_path / 'new' / 'regret.png')


@pytest.fixture
def more_solvers(monkeypatch):
    """Register two solvers more, and return their names."""
    for name in ('mine', 'yours'):
        monkeypatch.setitem(SOLVERS, name, ILQR)
    return ['mine', 'yours']


@pytest.mark.parametrize('when', [['--at', '0.5'], ['--every', '2']])
def test_solvers_that_others_register_are_in_table_and_picture(bag, more_solvers, when, tmp_path,
                                                               capsys, monkeypatch):
    drawn = []
    monkeypatch.setattr(figures, 'mark', lambda figure, text: drawn.append(figure))
    code, out, _ = compared(capsys, bag, *when, '--duration', '0.3', '--output', tmp_path)
    assert code == 0
    rows = columns(out)
    expected = ['recorded ilqr', *SOLVERS]
    assert expected in (list(rows)[1:], rows.get('from [s]', [])[1:])
    named = ['recorded (iLQR)', 'iLQR', 'DDP', 'MPPI', *more_solvers]
    legends = [axes.get_legend() for axes in drawn[0].axes if axes.get_legend()]
    assert [text.get_text() for text in legends[-1].get_texts()] == named
    colours = [line.get_color() for line in legends[-1].get_lines()]
    assert len(set(colours)) == len(named)


@pytest.fixture(params=['push', 'age'])
def pushed(request, bag, tmp_path):
    """Return a bag with a push, a value of each report of its plant, and how many there are."""
    reports = []

    def change(message):
        if message.status[0].name == 'plant':
            message.status[0].values = [KeyValue(key=request.param, value='5.0')]
            reports.append(message)
        return message
    more = {DISTURBANCE: Float64(data=5.0)}
    return (rewritten(bag, tmp_path / 'bag', DIAGNOSTICS, change, more), request.param,
            len(reports))


def test_pushes_act_in_the_periods_that_the_plant_says(pushed, capsys):
    folder, value, count = pushed
    code, out, error = compared(capsys, folder, '--solvers', 'ilqr', '--duration', '0.2')
    if value == 'push':
        assert code == 0
        assert f'everyone is pushed as was recorded; periods with a push: {count}\n' in out
    else:   # as bags from before
        assert code == 2
        assert 'does not say through which period each push acted; record it anew' in error


def drop(_):
    return None


def without(node):
    return lambda message: None if f'node: /{node}' in message.data else message


@pytest.mark.parametrize('topic, change, complaint', [
    (CONFIGURATION, without('mpc'), 'has no parameters of the mpc'),
    (CONFIGURATION, without('plant'), 'has no parameters of the plant, but those of mpc'),
    (DIAGNOSTICS, drop, 'has no ticks of an mpc')])
def test_a_bag_that_does_not_tell_enough_is_one_line(bag, topic, change, complaint, tmp_path,
                                                     capsys):
    code, out, error = compared(capsys, rewritten(bag, tmp_path / 'bag', topic, change))
    assert (code, out) == (2, '')
    assert error.startswith('compare: error: ') and '\n' not in error
    assert complaint in error


def test_a_tick_that_is_missing_is_told(bag, tmp_path, capsys):
    code, out, _ = compared(capsys, rewritten(bag, tmp_path / 'bag', DIAGNOSTICS, tick(3, drop)),
                            '--solvers', 'ddp', '--duration', '0.5')
    assert code == 0
    assert list(columns(out))[1:] == ['recorded ilqr', 'ddp']
    assert 'note: tick 3 is missing (the next is 4); whoever' in out


@pytest.mark.parametrize('arguments, complaint', [
    (['--at', '9'], 'there is no tick at 9 s or later with a state after it'),
    (['--at', '1', '--duration', '2.5'], 'there is no tick at 1 s or later with 2.5 s after it'),
    (['--every', '1', '--duration', '7'], 'there is no tick at all with 7 s after it')])
def test_a_time_outside_of_the_run_is_one_line(bag, arguments, complaint, capsys):
    code, out, error = compared(capsys, bag, *arguments)
    assert (code, out) == (2, '')
    assert error.startswith('compare: error: ') and '\n' not in error
    assert complaint in error and 'takes 3 s' in error


@pytest.mark.parametrize('arguments, complaint', [
    (['--solvers', 'none'], 'invalid choice'), (['--at', '-1'], 'not a number of at least 0'),
    (['--every', '0'], 'not a number of at least 0.001'),
    (['--duration', 'nan'], 'not a number'),
    (['--at', '1', '--every', '1'], 'not allowed with')])
def test_misuse_is_refused_at_once(arguments, complaint, capsys):
    with pytest.raises(SystemExit) as end:
        main(['bag', *arguments])
    assert end.value.code == 2
    assert complaint in capsys.readouterr().err


def test_a_missing_bag_is_one_line(tmp_path, capsys):
    assert compared(capsys, tmp_path / 'none')[::2] == (
        2, f'compare: error: there is no bag {str(tmp_path / "none")!r}')


def test_help_names_the_default(capsys):
    with pytest.raises(SystemExit) as end:
        main(['--help'])
    assert end.value.code == 0
    assert '(default: 0.5 with links of 1 m' in ' '.join(capsys.readouterr().out.split())

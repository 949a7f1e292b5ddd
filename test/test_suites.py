# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tasks of others: what we read from their models moves as they do, and what the page says."""

from importlib.util import find_spec
import re

from campaigns import METHODS
import numpy as np
import published
import pytest
import suites
import suites_episodes
from suites_episodes import Episode, Outcome

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.model import rollout

# two capsules on a box with a motor, made by nobody's suite: links of different make and length
MJCF = """
<mujoco>
  <option timestep="0.002" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body>
      <joint name="slide" type="slide" axis="1 0 0" range="-1.5 1.5" limited="true" damping="0.3"/>
      <geom type="box" size="0.2 0.1 0.1" mass="1.2"/>
      <body>
        <joint axis="0 1 0" damping="0.02"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.8" size="0.05" mass="0.4"/>
        <body pos="0 0 0.8">
          <joint axis="0 1 0" damping="0.01"/>
          <geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.03" mass="0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="slide" gear="15" ctrllimited="true" ctrlrange="-1 1"/></actuator>
</mujoco>
"""


def of_tasks():
    """Return each task, those skipped whose suite is not installed."""
    missing = [name for name in ('dm_control', 'gymnasium') if find_spec(name) is None]
    return [pytest.param(name, marks=pytest.mark.skipif(
        task.begin.__name__ in missing,
        reason=f'{task.begin.__name__} is not installed; see make results PAGES=suites'))
        for name, task in suites_episodes.TASKS.items()]


def moves_as_ours(model, advance, data, period, rng):
    """Check that a model and what is read from it are moved alike by a force for a while."""
    values = suites_episodes.parameters(model)
    problem = controllers.problem({**values, 'step': period / 10})
    data.qpos[:] = np.append(0.1, rng.uniform(-np.pi, np.pi, values['links']))
    data.qvel[:] = rng.normal(size=values['links'] + 1)
    x, action = suites_episodes.state(data), 0.3
    advance(action)
    expected = rollout(problem.model, x, np.full(10, action * values['force_limit']))[-1]
    np.testing.assert_allclose(suites_episodes.state(data), expected, rtol=0, atol=2e-4)


def test_what_is_read_from_a_model_moves_as_it_does(rng):
    mujoco = pytest.importorskip('mujoco')
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)

    def advance(action):
        data.ctrl[:] = action
        mujoco.mj_step(model, data, 5)
    assert suites_episodes.parameters(model)['link2_length'] == pytest.approx(0.5)
    assert suites_episodes.parameters(model)['force_limit'] == pytest.approx(15)
    moves_as_ours(model, advance, data, 0.01, rng)


@pytest.mark.parametrize('name', of_tasks())
def test_a_task_moves_as_what_is_read_from_its_model(name, rng):
    task = suites_episodes.TASKS[name]
    environment = task.begin(task.name, 0)
    moves_as_ours(environment.model, environment.step, environment.data, environment.period, rng)


@pytest.mark.parametrize('name', of_tasks())
@pytest.mark.parametrize('solver', METHODS)
def test_a_task_is_played(name, solver):
    outcome = suites_episodes.play(Episode(name, 'defaults', solver, 0), steps=30)
    assert outcome.steps == 30
    assert outcome.total == pytest.approx(10 * sum(outcome.rewards))


@pytest.mark.parametrize('solver', METHODS)
@pytest.mark.parametrize('name, links', [('two_poles', 2), ('three_poles', 3)])
def test_tuned_sets_are_of_the_mpc(name, links, solver):
    values = suites_episodes.tuned(suites_episodes.TASKS[name], solver)
    assert values['horizon']
    controllers.MPC.complete({'links': links, **values})


@pytest.fixture
def outcomes(rng):
    """Return outcomes that are made up, two of each line."""
    def outcome():
        rewards = rng.uniform(size=100)
        return Outcome(10 * rewards.sum(), suites.STEPS, tuple(rewards))
    return {episode: outcome() for episode in suites.episodes(2)}


def test_the_page_has_every_line_and_what_others_publish(outcomes):
    page = suites.page(outcomes, 'made\n')
    for task in suites_episodes.TASKS:
        for solver in METHODS:
            totals = [outcome.total for episode, outcome in outcomes.items()
                      if episode[:3] == (task, 'defaults', solver)]
            line, = re.findall(rf'^\| `{task}` \| `{solver}`, defaults \| .*', page, re.M)
            assert f'| 2 | {np.mean(totals):.1f} (' in line
        for one in suites.PUBLISHED[task]:
            assert f'| `{task}` | {one.method} | {one.runs} | {one.mean} |' in page


def test_the_picture_shows_every_solver(outcomes):
    figure = suites.picture(outcomes)
    assert [axes.get_title() for axes in figure.axes] == list(suites.SHOWN)
    assert all(len(axes.lines) == len(METHODS) + 1 for axes in figure.axes)


def test_episodes_are_gone_on_with(tmp_path, monkeypatch, outcomes):
    """What a file holds is not played again, but for a torn line and other sources."""
    few = list(outcomes)[:4]
    monkeypatch.setattr(suites, 'play', outcomes.get)
    file = tmp_path / 'rows' / 'suites.jsonl'
    assert suites.played(few[:3], file, jobs=1) == {one: outcomes[one] for one in few[:3]}
    file.write_text(file.read_text()[:-20])
    again = []
    monkeypatch.setattr(suites, 'play', lambda one: again.append(one) or outcomes[one])
    assert list(suites.played(few, file, jobs=1).items()) == [(one, outcomes[one]) for one in few]
    assert again == few[2:]
    monkeypatch.setattr(suites, 'sources', lambda: 'others')
    suites.played(few, file, jobs=1)
    assert again == [*few[2:], *few]


def test_the_rows_have_every_episode(outcomes):
    table = suites.table_of(outcomes)
    assert len(table) == len(outcomes)
    assert table['return'].tolist() == [outcome.total for outcome in outcomes.values()]


def test_a_missing_environment_is_an_error_that_says_what_makes_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(published, 'KEPT', tmp_path)
    monkeypatch.setitem(published.PAGES, 'suites', published.of_script(
        'suites', 1, python=tmp_path / 'nowhere' / 'python'))
    assert published.main(['--dirty', 'suites']) == 1
    error = capsys.readouterr().err
    assert error.count('\n') == 1 and '`make results PAGES=suites` installs it' in error

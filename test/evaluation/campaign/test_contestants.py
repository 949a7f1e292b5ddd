# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

from learned_dynamics import model_of, of_chain
import pytest

from dp_swing_ros.dynamics.files import from_text
from dp_swing_ros.evaluation.baselines import Nothing
from dp_swing_ros.evaluation.campaign.contestants import of_inertias, parse, parse_all
from dp_swing_ros.evaluation.scenarios import Case
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.parameters import PendulumParameters

CONFIG = Path(__file__).parents[3] / 'config'


def test_a_name_alone_is_the_solver_with_its_defaults():
    contestant = parse('ddp')
    assert (contestant.label, contestant.name) == ('ddp', 'ddp')
    assert contestant.plant == contestant.mpc == {}
    controller = contestant.prepare()(7)
    assert (controller.parameters.solver, controller.parameters.seed) == ('ddp', 7)


def test_files_set_plant_and_mpc():
    contestant = parse(f'mppi:{CONFIG}/paper.yaml+{CONFIG}/paper_mppi.yaml')
    assert contestant.label == 'mppi:paper+paper_mppi'
    assert contestant.plant['force_limit'] == 75.0
    assert contestant.prepare()(0).nominal.horizon == 35


def test_single_parameters_come_last():
    contestant = parse(f'ilqr:horizon=12+{CONFIG}/paper_mppi.yaml+force_weight=1e-2')
    assert contestant.label == 'ilqr:horizon=12+paper_mppi+force_weight=1e-2'
    assert (contestant.mpc['horizon'], contestant.mpc['force_weight']) == (12, 0.01)


def test_a_label_may_be_given():
    contestant = parse('quick=mppi:mppi.samples=64')
    assert (contestant.label, contestant.name) == ('quick', 'mppi')
    assert contestant.prepare()(0).planner.solver_parameters.samples == 64


def test_a_baseline_is_built_on_the_same_problem():
    controller = parse('nothing:step=0.1').prepare()(0)
    assert isinstance(controller, Nothing)
    assert controller.problem.dt == 0.1


def test_a_learned_model_is_what_its_file_was_when_the_contestant_was_read(tmp_path):
    """So a campaign that goes on after another training plays nothing else under its name."""
    file, values = tmp_path / 'model.json', tmp_path / 'learned.yaml'
    file.write_text(model_of(of_chain(PendulumParameters(link2_mass=0.8))).to_text())
    values.write_text(f'mpc:\n  ros__parameters: {{dynamics: learned, model: {file}}}\n')
    contestant = parse(f'ilqr:{values}')
    other = model_of(of_chain(PendulumParameters())).to_text()
    file.write_text(other)
    found = contestant.prepare()(0).nominal.learned.dynamics.inertia
    assert found[5, 0] == pytest.approx(1.6 * from_text(other).dynamics.inertia[5, 0])
    assert parse(f'ddp:dynamics=learned+model={file}').mpc['model'] == other
    with pytest.raises(ParameterError, match='none.json.*No such file'):
        parse('ilqr:dynamics=learned+model=none.json')


@pytest.mark.parametrize('text, words', [
    ('sqp', ["'sqp'", 'ilqr, ddp, mppi, tvlqr, tvlqr_ekf, energy_ekf']),
    ('', ['LABEL=']), (':x', ['LABEL=']), ('ilqr:none.yaml', ['none.yaml'])])
def test_what_is_no_contestant_is_refused(text, words):
    with pytest.raises(ParameterError) as error:
        parse(text)
    assert all(word in str(error.value) for word in words), error.value


@pytest.mark.parametrize('text', ['ilqr:horison=3', 'ilqr:horizon=long', 'tvlqr:horizon=0'])
def test_parameters_are_checked_when_the_controller_is_made(text):
    with pytest.raises(ParameterError, match='hori[sz]on'):
        parse(text).prepare()(0)


def test_a_baseline_sends_no_velocities():
    with pytest.raises(ParameterError, match="tvlqr sends .*'velocity'"):
        parse('tvlqr:drive=velocity')
    parse('tvlqr:drive=acceleration')


def test_two_of_one_name_are_refused():
    with pytest.raises(ParameterError, match="'ilqr'"):
        parse_all(['ilqr', 'ddp', 'ilqr'])
    assert [one.label for one in parse_all(['ilqr', 'other=ilqr'])] == ['ilqr', 'other']


def test_an_inertia_that_is_told_is_off_by_the_share_of_a_case():
    case = Case('model', 0, plant={'link1_inertia_factor': 0.75, 'link2_inertia_factor': 0.75})
    nominal = PendulumParameters(link1_inertia=0.04)
    assert of_inertias(case, nominal).plant == {
        'link1_inertia': pytest.approx(0.03), 'link2_inertia_factor': 0.75}

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import math
from pathlib import Path

from learned_dynamics import model_of, of_chain
import numpy as np
import pytest

from dp_swing_ros import declarations
from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign import contestants
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.parameters.files import value_of
from dp_swing_ros.pendulum.parameters import DIRECT, DriveParameters, PendulumParameters
from dp_swing_ros.pendulum.state import LINKS, SIZES
from dp_swing_ros.problem.cost import ANGLE_ERRORS
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate

CONFIG = Path(__file__).parents[1] / 'config'


def test_names_reach_their_groups():
    controller = controllers.controller({
        'solver': 'mppi', 'horizon': 12, 'mppi.samples': 64, 'link1_mass': 0.7, 'seed': 4,
        'force_weight': 0.01})
    assert controller.belief.problem.horizon == 12
    assert controller.belief.problem.cost.R == 0.01
    assert controller.planner.solver_parameters.samples == 64
    assert (controller.parameters.solver, controller.parameters.seed) == ('mppi', 4)


def test_the_pendulum_of_the_plant_is_not_that_of_the_model():
    plant = plants.plant({'link1_mass': 0.7, 'force_noise': 1})
    assert plant.physical.link1_mass == 0.7
    assert plant.parameters.force_noise == 1.0
    model = controllers.problem({}).model
    assert model != controllers.problem({'link1_mass': 0.7}).model


def test_plant_and_controller_have_a_drive_each():
    values = {'actuation_delay': 0.03, 'motor_time_constant': 0.02, 'force_gain': 0.9,
              'force_bias': 1.5}
    controller = controllers.controller(values)
    assert controller.belief.drive == controller.observer.nominal_drive == (0.03, 0.02, 0.9, 1.5)
    assert controller.belief.problem.bounds == pytest.approx((1.5 - 18.0, 1.5 + 18.0))
    assert controller.nominal.bounds == (-20.0, 20.0)
    assert vars(plants.plant(values).drive) == values
    assert controllers.controller({}).belief.drive == DIRECT
    assert plants.plant({}).drive == DriveParameters()


@pytest.mark.parametrize('build, values, words', [
    (controllers.controller, {'mppi.sample': 9}, ["'mppi.sample'", "'mpc'", "'mppi.samples'"]),
    (controllers.controller, {'force_noise': 1.0}, ["'force_noise'", "'mpc'"]),
    (plants.plant, {'horizon': 3}, ["'horizon'", "'plant'", 'force_noise']),
    (controllers.controller, {'mppi.samples': 2.5}, ['mppi.samples', '2.5', 'whole number']),
    (controllers.controller, {'solver': 'sqp'}, ["'sqp'", 'ddp, ilqr, mppi'])])
def test_what_a_node_would_refuse_is_refused(build, values, words):
    with pytest.raises(ParameterError) as error:
        build(values)
    assert all(word in str(error.value) for word in words), error.value


@pytest.mark.parametrize('links', LINKS)
def test_the_defaults_are_of_the_number_of_links(links):
    plant, controller = (build({'links': links}) for build in (
        plants.plant, controllers.controller))
    assert plant.physical.links == controller.belief.problem.physical.links == links
    problem = controller.belief.problem
    assert len(plant.parameters.initial_state) == len(problem.x_r) == SIZES[links]
    assert plant.limits.force_limit == problem.u_max == (40.0 if links == 3 else 20.0)


@pytest.mark.parametrize('node, values, words', [
    ('plant', {'link3_mass': 0.4}, ["'link3_mass'", '3 links', 'this one has 2']),
    ('mpc', {'links': 1, 'joint2_friction': 0.1}, ["'joint2_friction'", '2 links', 'has 1']),
    ('plant', {'links': 3, 'initial_state': [0.0] * 6}, ['initial_state', '8 numbers']),
    ('mpc', {'links': 1, 'state_weights': [1.0] * 6}, ['state_weights', '4 numbers']),
    ('mpc', {'links': 4}, ['links', '4', 'at most 3'])])
def test_what_another_number_of_links_has_is_refused(node, values, words):
    with pytest.raises(ParameterError) as error:
        declarations.DECLARATIONS[node].complete(values)
    assert all(word in str(error.value) for word in words), error.value


def test_the_paper_s_file_is_read():
    values = declarations.read([CONFIG / 'paper.yaml'])
    assert plants.plant(values['plant']).limits.force_limit == math.inf
    problem = controllers.problem(values['mpc'])
    assert problem.cost.angle_error is ANGLE_ERRORS['angle']
    np.testing.assert_array_equal(problem.cost.P, 1000 * np.diag(problem.cost.S))


def test_of_several_files_the_later_prevails():
    files = [CONFIG / 'paper.yaml', CONFIG / 'paper_mppi.yaml']
    values = declarations.read(files)
    assert values['plant']['force_limit'] == values['mpc']['force_limit'] == 75.0
    assert values['mpc']['mppi.samples'] == 100


def written(folder, text):
    path = folder / 'parameters.yaml'
    path.write_text(text)
    return path


def test_all_that_ros_allows_is_read(tmp_path):
    path = written(tmp_path, """
/**:
  ros__parameters:
    use_sim_time: true
    link1_mass: 0.6
/second/mpc:
  ros__parameters:
    mppi: {samples: 9, temperature: 1e-2}
    force_limit: .inf
plant:
  ros__parameters: {rate: 50}
""")
    assert declarations.read([path]) == {
        'plant': {'link1_mass': 0.6, 'rate': 50},
        'mpc': {'link1_mass': 0.6, 'mppi.samples': 9, 'mppi.temperature': 0.01,
                'force_limit': math.inf}}


@pytest.mark.parametrize('pattern', ['/**', '/*', '/**/*'])
def test_what_is_for_any_node_is_taken_by_those_that_have_it(pattern, tmp_path):
    path = written(tmp_path, f"""
{pattern}:
  ros__parameters: {{solver: ddp, cart_mass: 1.2, frame_rate: 30, qos_overrides: {{/t: {{d: 1}}}}}}
second:
  mpc:
    ros__parameters: {{horizon: 20}}
""")
    with pytest.warns(UserWarning, match="no node has 'frame_rate'"):
        found = declarations.read([path])
    assert found == {
        'plant': {'cart_mass': 1.2}, 'mpc': {'solver': 'ddp', 'cart_mass': 1.2, 'horizon': 20}}


@pytest.mark.parametrize('text, words', [
    ('a: [', ['not YAML']), ('', ['not a ROS parameter file']),
    ('horizon: 3', ['not a ROS parameter file']),
    ('/**/mpc:\n  horizon: 3', ['ros__parameters']),
    ('/**/logger:\n  ros__parameters: {output: x}', ['/**/logger', 'plant or mpc'])])
def test_a_file_that_is_none_is_refused(text, words, tmp_path):
    path = written(tmp_path, text)
    with pytest.raises(ParameterError) as error:
        declarations.read([path])
    assert all(word in str(error.value) for word in [str(path), *words]), error.value


def test_what_is_for_any_node_and_no_node_has_is_told(tmp_path):
    text = '/**:\n  ros__parameters: {track_limit: 0.4, flush_period: 1.0, use_sim_time: true}\n'
    assert declarations.read([written(tmp_path, text)])['mpc'] == {'track_limit': 0.4}
    path = written(tmp_path, text.replace('limit', 'limt'))
    with pytest.warns(UserWarning) as told:
        declarations.read([path])
    assert [str(each.message) for each in told] == [
        f"{path}, line 1: no node has 'track_limt'; did you mean 'track_limit'?"]


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ParameterError, match='none.yaml'):
        declarations.read([tmp_path / 'none.yaml'])


@pytest.mark.parametrize('text, value', [
    ('3', 3), ('1e-4', 1e-4), ('1.0e4', 1e4), ('.inf', math.inf), ('[1.0, 2.0]', [1.0, 2.0]),
    ('true', True), ('lqr', 'lqr')])
def test_texts_are_values_as_ros_reads_them(text, value, tmp_path):
    assert value_of(text) == value
    assert type(value_of(text)) is type(value)
    path = written(tmp_path, f'mpc:\n  ros__parameters:\n    horizon: {text}\n')
    assert declarations.read([path])['mpc'] == {'horizon': value}


@pytest.mark.parametrize('text', ['[1.0, 2]', '', '[a, 1]'])
def test_what_ros_would_refuse_is_refused(text, tmp_path):
    path = written(tmp_path, f'mpc:\n  ros__parameters:\n    a:\n      b: {text}\n')
    with pytest.raises(ParameterError, match="parameter file .*: parameter 'a.b' is"):
        declarations.read([path])
    with pytest.raises(ParameterError, match="parameter 'horizon' is"):
        contestants.parse(f'ilqr:horizon={text}')


@pytest.fixture(scope='module')
def learned(tmp_path_factory):
    """Return the file of a model that says what the equations do."""
    file = tmp_path_factory.mktemp('learned') / 'model.json'
    file.write_text(model_of(of_chain(PendulumParameters())).to_text())
    return str(file)


@pytest.mark.parametrize('solver', ['ilqr', 'ddp', 'mppi'])
def test_a_learned_model_is_planned_with(learned, solver):
    """The same as the equations, it swings up as these do; state and force are estimated."""
    controller = controllers.controller({
        'solver': solver, 'dynamics': 'learned', 'model': learned, 'seed': 1})
    assert controller.belief.problem.model.pendulum.kind == of_chain(PendulumParameters()).kind
    episode = simulate(plants.plant({'position_noise': 1e-3, 'seed': 1}), controller, 6.0)
    assert measure(episode).success
    # the drive is left to estimate, and there is none
    assert controller.belief.drive.delay < 0.01 and controller.belief.drive.time_constant < 0.01
    assert controller.belief.drive.gain == pytest.approx(1.0, abs=0.1)
    assert controller.belief.problem.learned is controller.nominal.learned


def test_the_learned_model_matters(learned):
    """Of another pendulum it leads to other forces."""
    text = model_of(of_chain(PendulumParameters(link2_mass=0.8))).to_text()
    forces = [controllers.controller({'dynamics': 'learned', 'model': model}).update(
        0.0, np.array([0.0, 3.0, 3.1, 0.0, 0.1, 0.0])).U for model in (learned, text)]
    assert np.abs(forces[0] - forces[1]).max() > 0.1


@pytest.mark.parametrize(('values', 'words'), [
    ({'model': 'model.json'}, "'model' is 'model.json'; expected one of rk4, euler, or the file"),
    ({'dynamics': 'learned'}, "'model' is 'rk4': No such file"),
    ({'dynamics': 'learnt', 'model': 'rk4'}, "'dynamics' is 'learnt'; expected one of analytic")])
def test_dynamics_and_model_go_together(values, words):
    with pytest.raises(ParameterError, match=words):
        controllers.controller(values)

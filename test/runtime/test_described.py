# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What an mpc makes of robot descriptions, beside what `parameters --urdf` makes of them."""

import numpy as np
import pytest
from rigs import RIG
from sensor_msgs.msg import JointState
from virtual import Running
import yaml

from dp_swing_ros.control import controllers
from dp_swing_ros.messages.fields import ERROR, OK, WARN
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.runtime.described import DescribedPendulum
from dp_swing_ros.tools.parameters import main


STEPPER = RIG.replace('</robot>', '<drive value="acceleration"/></robot>')


def ours(**changed):
    """Return the description that a plant publishes."""
    return urdf(PendulumParameters(**changed), LimitParameters())


def defaults(pendulum):
    """Return the value of each parameter of an mpc that is not given."""
    return {name: field.default for name, field in pendulum.fields.items()}


@pytest.mark.parametrize('text', [RIG, ours(links=3, link2_centre=0.3, cart_dry_friction=0.5)])
def test_its_parameters_are_those_of_the_file_that_is_made_of_it(text, tmp_path):
    pendulum = DescribedPendulum({})
    assert pendulum.hear(text).level == OK
    (tmp_path / 'rig.urdf').write_text(text)
    assert main(['--urdf', str(tmp_path / 'rig.urdf'), '-o', str(tmp_path / 'rig.yaml')]) == 0
    file = yaml.safe_load((tmp_path / 'rig.yaml').read_text())
    given = {name: value for each in file.values()
             for name, value in each['ros__parameters'].items()}
    # what has a dimension goes with the bodies, told in either way
    assert defaults(pendulum) == controllers.MPC.complete(given)


def test_it_is_said_in_one_line_what_is_taken_and_what_cannot_be():
    text = DescribedPendulum({}).hear(RIG).text
    assert '\n' not in text and 'links 2' in text and 'link1_mass 0.15' in text
    assert 'joint2_dry_friction' not in text   # it has none
    assert 'no word for gravity, drive, actuation_delay' in text and 'elbow has ends' in text
    assert 'joint1_stiffness' in text.partition('no word for ')[2]
    assert 'gravity 9.81' in DescribedPendulum({}).hear(ours()).text   # in an element of its own


@pytest.mark.parametrize('given, text, words', [
    ({}, '<robot', 'no XML'),
    ({}, '<robot name="arm"><link name="base"/></robot>', '0 prismatic joints'),
    ({}, RIG.replace('xyz="0.11 0 0"', 'xyz="1e200 0 0"'), 'beyond all bounds'),
    ({}, ours().replace('"0 0 0.5"', '""'), 'mimics another'),
    ({'links': 1}, ours(), 'links is 2 in the robot description, and parameter links is 1'),
    ({'links': 3}, RIG, 'links is 2 in the robot description, and parameter links is 3'),
    ({'drive': 'acceleration'}, ours(drive='velocity'), 'drive is velocity in the robot '
     'description, and parameter drive is acceleration; expected the same'),
    ({'drive': 'velocity'}, STEPPER, 'drive is acceleration in the robot description, and '
     'parameter drive is velocity; expected the same'),
    ({}, RIG.replace('</robot>', '<drive value="belt"/></robot>'), "'drive' is 'belt'; expected"),
    ({'link3_mass': 0.5}, RIG, "'link3_mass' is one of a pendulum with 3 links"),
    ({'link1_mass': 0.2}, RIG, 'link1_mass is 0.15 in the robot description, and parameter '
     'link1_mass is 0.2'),
    ({'joint_names': ['a', 'b', 'c']}, RIG, "and parameter joint_names is ('a', 'b', 'c')"),
    ({'track_limit': 0.5}, RIG, 'track_limit is 0.4 in the robot description, and parameter '
     'track_limit is 0.5'),
    ({'link1_inertia_factor': 0.9}, RIG, 'both say the same'),
    ({'link1_mass': 'heavy'}, RIG, "'link1_mass' is 'heavy'; expected a number")])
def test_what_is_none_or_of_another_pendulum_is_refused_and_the_next_one_taken(given, text, words):
    pendulum = DescribedPendulum(given)
    said = pendulum.hear(text)
    assert said.level == ERROR and words in said.text and said.text.endswith(
        'waiting for another robot description')
    assert not pendulum.fields and pendulum.hear(text) is None   # once
    pendulum.given = {}
    assert pendulum.hear(ours(link1_mass=0.3)).level == OK
    assert defaults(pendulum)['link1_mass'] == 0.3


def test_what_is_given_and_described_alike_is_no_conflict_and_a_limit_may_be_smaller():
    pendulum = DescribedPendulum({
        'links': 2, 'link1_mass': 0.15, 'joint_signs': (1, -1, 1), 'force_limit': 9})
    said = pendulum.hear(RIG)
    assert said.level == OK and 'track_limit 0.4' in said.text and 'force_limit' not in said.text
    assert pendulum.fields['track_limit'].default == 0.4


@pytest.mark.parametrize('text, said', [
    (ours(), 'velocity'), (RIG, 'velocity'), (STEPPER, 'acceleration')])
def test_who_names_no_drive_may_have_any(text, said):
    pendulum = DescribedPendulum({'drive': said})
    heard = pendulum.hear(text)
    assert heard.level == OK and pendulum.values.get('drive', 'velocity') == said
    assert ('drive' in heard.text.partition('no word for ')[2]) == (said == 'velocity')


def test_a_later_one_changes_nothing():
    pendulum = DescribedPendulum({})
    pendulum.hear(ours())
    before = defaults(pendulum)
    assert pendulum.hear(ours()) is None
    said = pendulum.hear(ours(link2_mass=0.7))
    assert said.level == WARN and 'link2_mass is 0.7 now, it was 0.5;' in said.text
    for text, words in (('<robot', 'no XML'), (RIG, 'cart_mass is 0.55 now, it was 1'),
                        (RIG, 'gravity is None now, it was 9.81')):
        pendulum.text = None
        said = pendulum.hear(text)
        assert said.level == WARN and words in said.text
    assert pendulum.hear(ours()) is None   # the first one again
    assert defaults(pendulum) == before


def test_an_mpc_of_it_answers_the_joints_by_their_names_and_zeros():
    pendulum = DescribedPendulum({'clock': 'lockstep'})
    pendulum.hear(RIG)
    running = Running(**{**defaults(pendulum), **pendulum.given})
    # all at zero: it hangs, left of the middle of its rail
    running.hear(JointState(name=['elbow', 'drive', 'shoulder'], position=[0.0] * 3,
                            velocity=[0.0] * 3))
    np.testing.assert_allclose(running.plan.X[0], hanging() - [0.1, 0, 0, 0, 0, 0], atol=1e-8)
    assert 0 < abs(running.forces[0]) <= 12.0

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions as others write them, beside what MuJoCo makes of the same text."""

import math

import mujoco
import numpy as np
import pytest
from rigs import RIG

from dp_swing_ros import declarations
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.description import parameters_of
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.sensors import SensorParameters
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.tools.parameters import main


def changed(*pairs):
    """Return the rig with something else in it."""
    text = RIG
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


def test_it_moves_as_mujoco_moves_the_same_text(rng):
    found = parameters_of(RIG)
    physical = group(PendulumParameters, found.values)
    sensors = group(SensorParameters, {'zero': 'given', **found.values})
    p = Pendulum.of(physical).without_dry_friction()
    model = mujoco.MjModel.from_xml_string(RIG)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT   # ends, and dry friction
    data = mujoco.MjData(model)
    for _ in range(50):
        measured = rng.normal(size=6) * (0.3, 2, 2, 1, 5, 5)
        data.qpos[:], data.qvel[:] = np.split(measured, 2)
        force = rng.normal() * 10
        data.qfrc_applied[0] = force
        mujoco.mj_forward(model, data)
        x = sensors.state_of(measured)
        ours = np.array(p.accelerations(list(x), force))
        theirs = sensors.state_of(np.concatenate((measured[:3], data.qacc)))[3:]
        np.testing.assert_allclose(ours, theirs, rtol=1e-6, atol=1e-6)


def test_numbers_are_those_of_the_description():
    found = parameters_of(RIG)
    values = found.values
    assert values['cart_mass'] == pytest.approx(0.55)
    assert values['link1_mass'] == pytest.approx(0.15) and values['links'] == 2
    assert values['link1_length'] == pytest.approx(0.17)
    assert values['link1_centre'] == pytest.approx((0.12 * 0.08 + 0.03 * 0.17) / 0.15)
    assert values['link2_centre'] == pytest.approx(0.11)
    assert values['link2_length'] == pytest.approx(0.22)
    assert (values['track_limit'], values['force_limit']) == (pytest.approx(0.4), 12.0)
    assert values['joint_names'] == ['drive', 'shoulder', 'elbow']
    assert values['joint_signs'] == [1.0, -1.0, 1.0] and values['relative_angles'] is True
    assert values['joint_offsets'] == pytest.approx([0.1, math.pi, 0.0], abs=1e-8)
    assert (values['cart_friction'], values['joint1_dry_friction']) == (3.5, 0.001)
    assert values['cart_speed_limit'] == 2.0
    assert len(found.left_out) == 1 and 'elbow has ends' in found.left_out[0]


@pytest.mark.parametrize('links', [1, 2, 3])
def test_a_description_of_ours_gives_the_same_parameters(links):
    physical = PendulumParameters(links=links, link1_length=0.4, link1_centre=0.15,
                                  joint1_dry_friction=0.01, cart_dry_friction=0.5)
    limits = LimitParameters(track_limit=0.7)
    values = parameters_of(urdf(physical, limits)).values
    assert group(PendulumParameters, values) == physical
    assert group(LimitParameters, values) == limits


def test_what_has_no_parameter_is_said():
    found = parameters_of(changed(('xyz="0 0.01 -0.08"', 'xyz="0.02 0.01 -0.08"')))
    assert any('16 mm beside the line' in each for each in found.left_out)


@pytest.mark.parametrize('pairs, words', [
    ([('type="prismatic"', 'type="continuous"')], '0 prismatic joints'),
    ([('name="elbow" type="revolute"', 'name="elbow" type="floating"')], 'elbow (floating)'),
    ([('<child link="lower"/>', '<child link="lower"/><mimic joint="shoulder"/>')], 'mimics'),
    ([('<parent link="upper"/><child link="lower"/>',
       '<parent link="slide"/><child link="lower"/>')], 'begin at one body'),
    ([('<axis xyz="0 -1 0"/>', '<axis xyz="1 0 0"/>')], 'across the plane'),
    ([('<axis xyz="1 0 0"/>', '<axis xyz="0 0 1"/>')], 'expected a horizontal one'),
    ([('</robot>', '<joint name="loop" type="fixed"><parent link="lower"/><child link="slide"/>'
       '</joint></robot>')], 'slide hangs on two joints'),
    ([('<mass value="0.1"/>', '<mass value="0"/>')], 'lower has no mass'),
    ([('<child link="lower"/>', '<child link="nobody"/>')], "'nobody', which is not there"),
    ([('xyz="0 0.01 -0.08"', 'xyz="0 0.01 0.30"')], 'beyond its joint'),
    ([('<axis xyz="0 -1 0"/>', '<axis xyz="0 down 0"/>')], 'could not convert'),
    ([('<robot name="rig">', '<robot>'), ('</robot>', '')], 'no XML')])
def test_what_is_no_pendulum_is_refused_in_words(pairs, words):
    with pytest.raises(ValueError, match=words.replace('(', r'\(').replace(')', r'\)')):
        parameters_of(changed(*pairs))


def test_the_file_is_read_by_plant_and_mpc(tmp_path, capsys):
    (tmp_path / 'rig.urdf').write_text(RIG)
    assert main(['--urdf', str(tmp_path / 'rig.urdf'), '-o', str(tmp_path / 'new/rig.yaml')]) == 0
    assert 'elbow has ends' in capsys.readouterr().out
    values = declarations.read([tmp_path / 'new/rig.yaml'])
    assert values['mpc']['link1_mass'] == values['plant']['link1_mass'] == pytest.approx(0.15)
    assert values['mpc']['joint_signs'] == [1.0, -1.0, 1.0]
    for node, declared in declarations.DECLARATIONS.items():
        declared.complete(values[node])
    assert main(['--urdf', str(tmp_path / 'none.urdf')]) == 2
    (tmp_path / 'no.urdf').write_text('<robot/>')
    assert main(['--urdf', str(tmp_path / 'no.urdf')]) == 2
    error = capsys.readouterr().err
    assert 'no.urdf: ' in error and 'Traceback' not in error

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command, from its words to the model and the picture that it leaves."""

from PIL import Image
import pytest

from dp_swing_ros.dynamics.files import load
from dp_swing_ros.tools.learn import main

PLANT = ('/**:\n  ros__parameters: {cart_mass: 0.5, link1_length: 0.6, link2_length: 0.6}\n'
         'plant:\n  ros__parameters: {position_noise: 0.01, velocity_noise: 0.01}\n')


def test_a_model_a_picture_and_a_line_a_trial(tmp_path, capsys):
    file = tmp_path / 'plant.yaml'
    file.write_text(PLANT)
    assert main(['--params', str(file), '--solver', 'mppi', '--trial', '5', '--total', '25',
                 '-o', str(tmp_path / 'learned')]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith('trial 1: 5.0 s of experience, ')
    assert lines[-1].startswith('held after ')
    model = load(str(tmp_path / 'learned' / 'model.json'), 2)
    assert model.kind == 'structured' and len(model.draws) == 5
    with Image.open(tmp_path / 'learned' / 'learning.png') as picture:
        assert min(picture.size) > 300


def test_what_is_not_held_is_said_and_what_was_learned_is_left(tmp_path, capsys):
    assert main(['--first', '2', '--total', '3', '-o', str(tmp_path / 'learned')]) == 1
    assert capsys.readouterr().out.splitlines()[-1].startswith('not held after ')
    assert (tmp_path / 'learned' / 'model.json').exists()


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--solver', 'none'], 'invalid choice'), (['--first', '0'], 'at least 0.5')])
def test_misuse_is_refused(arguments, words, capsys):
    with pytest.raises(SystemExit, match='2'):
        main(arguments)
    assert words in capsys.readouterr().err


def test_a_file_that_is_missing_leaves_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(['--params', 'none.yaml']) == 2
    assert 'none.yaml' in capsys.readouterr().err
    assert not list(tmp_path.iterdir())

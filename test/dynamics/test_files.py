# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The file of a learned model: the same again to the bit, and every mistake in it is told."""

import json
import os

from learned_dynamics import bent, model_of
import numpy as np
import pytest

from dp_swing_ros.dynamics.files import DEPTH, from_text, LARGEST_FILE, load
from dp_swing_ros.parameters import ParameterError


def test_it_is_read_back_to_the_bit(tmp_path):
    model, file = model_of(bent()), tmp_path / 'model.json'
    file.write_text(model.to_text())
    for found in (load(str(file), 2), load(model.to_text(), 2)):
        assert found.to_text() == model.to_text()
        assert found.dynamics.kind == model.dynamics.kind
        np.testing.assert_array_equal(found.dynamics.free, model.dynamics.free)
        x = np.linspace(-1, 1, 6)
        assert found.dynamics.accelerations(x, 2.0) == model.dynamics.accelerations(x, 2.0)


def changed(**values):
    return json.dumps({**json.loads(model_of(bent()).to_text()), **values})


def without(name):
    content = json.loads(model_of(bent()).to_text())
    del content[name]
    return json.dumps(content)


@pytest.mark.parametrize(('text', 'words'), [
    ('', 'Expecting value'),
    ('{"format"', 'Expecting'),
    ('[]', 'its format is not'),
    (changed(format='another'), 'its format is not'),
    (changed(kind='residual'), "are 'residual', of which .*; learn them anew: train makes"),
    (changed(links=9), 'of 9 links; expected one of 1, 2, 3'),
    (changed(noise=[1.0, 2.0]), r'numbers of shape \(2,\); expected finite ones, \(3,\)'),
    (changed(noise=[1.0, 'a', 2.0]), 'could not convert'),
    (changed(dynamics={}), 'incomplete'),
    (changed(delay=-0.1), 'delay is -0.1 s; expected 0 to 0.5 s'),
    (without('noise'), 'incomplete'),
    (model_of(bent()).to_text().replace('5.0', 'NaN', 1), 'no finite number'),
    (model_of(bent()).to_text().replace('5.0', '1e999', 1), 'finite'),
])
def test_what_is_wrong_is_told(text, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        from_text(text)
    file = tmp_path / 'model.json'
    file.write_text(text)
    with pytest.raises(ParameterError, match="parameter 'model' is .*; expected, with dynamics"):
        load(str(file), 2)


def test_a_file_of_before_that_has_more_is_read(tmp_path):
    """Other dynamics that the experience allows, and how fast it was."""
    model = model_of(bent())
    text = changed(draws=[model.dynamics.free.tolist()], largest=[10.0, 12.0, 20.0, 3.0])
    assert load(text, 2).to_text() == model.to_text()


def test_a_file_that_does_not_fit_or_is_none_is_refused(tmp_path):
    text = model_of(bent()).to_text()
    with pytest.raises(ParameterError, match='it is of 2 links, and links is 3'):
        load(text, 3)
    with pytest.raises(ParameterError, match='No such file'):
        load(str(tmp_path / 'none'), 2)
    with pytest.raises(ParameterError, match='Is a directory'):
        load(str(tmp_path), 2)
    (tmp_path / 'binary').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(ParameterError, match='decode'):
        load(str(tmp_path / 'binary'), 2)
    (tmp_path / 'large').write_bytes(bytes(LARGEST_FILE + 1))
    with pytest.raises(ParameterError, match='bytes'):
        load(str(tmp_path / 'large'), 2)


def test_what_is_no_file_or_nests_without_end_is_refused_in_one_line(tmp_path):
    """A device that never ends, a pipe that nobody writes into, and what a parser cannot hold."""
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'nested').write_text('[' * 25_000)
    nested = changed(about={'a': json.loads('[' * DEPTH + ']' * DEPTH)})
    for model, words in (('/dev/zero', 'no regular file'), (str(tmp_path / 'pipe'), 'no regular'),
                         (str(tmp_path / 'nested'), 'nests deeper'), (nested, 'nests deeper'),
                         ('{"a":' * 5_000, 'nests deeper'), ('{"a"' + ' ' * LARGEST_FILE, 'bytes'),
                         (changed(delay=10 ** 400), 'incomplete'), ('\0', 'null')):
        with pytest.raises(ParameterError, match=words) as refusal:
            load(model, 2)
        assert '\n' not in str(refusal.value)

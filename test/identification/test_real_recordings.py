# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a real pendulum by others, from their file to a file of parameters."""

from pathlib import Path
import re

import numpy as np
import pandas
import pytest

from dp_swing_ros import declarations
from dp_swing_ros.tools import identify, import_log

FILES = Path(__file__).parents[1] / 'recordings'
# of its authors, in numbers that do not depend on the scale of all masses: (I + m a^2) / (m a)
# of the links with what they carry, and from joint to joint [m]; see recordings/README.md
SINGLE, DOUBLE, JOINT = 0.15258, 0.19574, 0.172719


def offsets_in(text):
    """Return the joint_offsets that a file of identify tells."""
    listed = re.search(r'joint_offsets: \[(.*)\]', text).group(1)
    return [float(each) for each in listed.split(', ')]


def found(name, links, tmp_path, rows):
    """Return the parameters that the tools make of the first rows of a recording, by name."""
    log = tmp_path / f'{name}.csv'
    pandas.read_csv(FILES / f'{name}.csv.gz', nrows=rows)[::4].to_csv(log, index=False)
    joints = [f'joint{i}=theta{i}' for i in range(1, links + 1)]
    bag, rig = tmp_path / 'bag', tmp_path / 'rig.yaml'
    assert import_log.main([str(log), '-o', str(bag), '--columns', 't=t', *joints]) == 0
    assert identify.main([str(bag), '-o', str(rig), '--cart', 'given']) == 0
    values = declarations.read([rig])
    assert values['mpc'] == values['plant']
    return values['mpc'], offsets_in(rig.read_text())


def test_a_single_pendulum_is_as_its_authors_found_it(tmp_path, capsys):
    rig, (_, offset) = found('single', 1, tmp_path, 2000)
    assert abs(offset) < 2e-3   # [rad], whose zero was set by hand
    assert rig['link1_length'] * 2 / 3 == pytest.approx(SINGLE, rel=5e-3)
    said = capsys.readouterr().out
    assert 'the motion of the cart is given' in said and 'cart_mass' not in said
    assert 'joint1_friction' in rig and not any('cart' in name for name in rig)


def test_so_is_a_double_one_of_positions_alone(tmp_path, capsys):
    rig, offsets = found('double', 2, tmp_path, 1200)
    assert np.all(np.abs(offsets) < 2e-3)   # [rad]
    assert rig['link1_length'] == pytest.approx(JOINT, rel=1e-2)
    assert rig['link2_length'] * 2 / 3 == pytest.approx(DOUBLE, rel=5e-3)
    errors = capsys.readouterr().out.partition('RMS: ')[2].partition('\n')[0]
    after = [float(each.split('-> ')[1].split()[0]) for each in errors.split(', ')]
    assert len(after) == 2 and np.all(np.array(after) < 1.0), errors   # [mrad]

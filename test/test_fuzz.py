# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Running nodes that strangers attack by all that they take in live on, and answer states."""

import time

import fuzz_attacks
from fuzz_target import Target
import pytest

UNBOUNDED = (fuzz_attacks.parameters, fuzz_attacks.page)   # who may raise the limit of the force


@pytest.fixture(scope='module')
def target(tmp_path_factory):
    """Return the nodes, which end with the tests."""
    running = Target(tmp_path_factory.mktemp('fuzz'))
    try:
        running.begin()
        yield running
    finally:
        running.end()


@pytest.mark.parametrize('attack', fuzz_attacks.ATTACKS, ids=lambda attack: attack.__name__)
def test_no_attack_ends_a_node_or_costs_it_a_force(attack, target):
    target.honest = attack is not fuzz_attacks.announcements
    began = time.monotonic()
    attack(target)
    assert not target.complaints()
    target.heal()
    assert not target.faults(began, bounded=attack not in UNBOUNDED)


def test_all_end_at_an_interrupt_and_the_last_force_is_zero(target):
    assert not target.end()

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of nodes share: a node to talk to them with, and nodes in this process."""

from here import NodeHere
from peer import Peer
import pytest


@pytest.fixture
def peer():
    """Return a node in this process."""
    peer = Peer()
    yield peer
    peer.close()


@pytest.fixture
def start_here():
    """Return a function that starts a node in this process; in the end none is left."""
    started = []

    def start(name, parameters=(), arguments=()):
        started.append(NodeHere(name, parameters, arguments))
        return started[-1]
    yield start
    for node in reversed(started):
        if node.ended():
            node.wait()   # which puts back what it has replaced
        else:
            node.stop()

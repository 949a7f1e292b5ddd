# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of nodes share: a node to talk to them with, and nodes in this process."""

from here import start_here  # noqa: F401
from peer import Peer
import pytest


@pytest.fixture
def peer():
    """Return a node in this process."""
    peer = Peer()
    yield peer
    peer.close()

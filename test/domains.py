# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ROS domains for the tests of this process alone."""

import socket

DOMAINS = range(70, 102)   # two for each process of a run; up to 101 their ports are free


def claim_domain():
    """Return a ROS domain that no other test process here uses, and the lock that keeps it."""
    for domain in DOMAINS:
        lock = socket.socket(socket.AF_UNIX)
        try:
            lock.bind(f'\0dp_swing_ros_domain_{domain}')  # a name without a file, free at our end
            return domain, lock
        except OSError:
            lock.close()
    raise RuntimeError('the ROS domains 70 to 101 are all in use by other test runs')

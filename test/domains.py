# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ROS domains for the tests of this process alone."""

import socket
import time

DOMAINS = range(70, 102)   # two for each process of a run; up to 101 their ports are free
PATIENCE = 600.0           # [s] for other runs to end


def claim_domain():
    """Return a ROS domain that no other test process here uses, and the lock that keeps it."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        for domain in DOMAINS:
            lock = socket.socket(socket.AF_UNIX)
            try:
                # a name without a file, free at our end
                lock.bind(f'\0dp_swing_ros_domain_{domain}')
                return domain, lock
            except OSError:
                lock.close()
        time.sleep(1.0)
    raise RuntimeError('the ROS domains 70 to 101 are all in use by other test runs')

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A ROS domain of one's own: no other node is heard, and ours discover each other at once.

Left to themselves, nodes that keep to this machine may take 3 s to find each other.
"""

from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import socket

from ament_index_python.packages import get_package_share_directory, PackageNotFoundError

from dp_swing_ros.errors import UserError

DOMAINS = range(102)  # their ports lie below those that Linux gives to anybody
PORTS_PER_DOMAIN, FIRST_PORT = 250, 7400  # Source: the DDSI-RTPS specification, 9.6.1
PARTICIPANTS = 20     # looked for in a domain


@contextlib.contextmanager
def isolated() -> Iterator[str]:
    """
    Keep this process and its children on this machine and in a domain of their own; yield it.

    What the user has set, a ROS_DOMAIN_ID or a profile of Fast DDS, is kept.
    Raises UserError where no domain is free, or where the package is not installed.
    """
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    if 'FASTRTPS_DEFAULT_PROFILES_FILE' not in os.environ:
        os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(_fast_discovery())
    if domain_of_user():
        yield domain_of_user()
        return
    domain, claim = _claim_domain()
    with claim:
        os.environ['ROS_DOMAIN_ID'] = domain
        try:
            yield domain
        finally:
            os.environ.pop('ROS_DOMAIN_ID', None)


def domain_of_user() -> str:
    """Return the ROS domain that the user has set; empty where there is none."""
    return os.environ.get('ROS_DOMAIN_ID', '')


def _fast_discovery() -> Path:
    try:
        return Path(get_package_share_directory('dp_swing_ros'), 'config', 'fast_discovery.xml')
    except PackageNotFoundError:
        raise UserError('the package dp_swing_ros is not in the ament index; source its '
                        'install/setup.bash first') from None


def _claim_domain() -> tuple[str, socket.socket]:
    """Return the first domain without nodes, and the socket that claims it while it is open."""
    for domain in DOMAINS:
        base = FIRST_PORT + PORTS_PER_DOMAIN * domain
        claim = _udp_socket()
        try:
            # no participant uses the last port: it keeps apart two runs that start together
            claim.bind(('', base + PORTS_PER_DOMAIN - 1))
            for n in range(PARTICIPANTS):
                with _udp_socket() as participant:
                    participant.bind(('', base + 10 + 2 * n))
            return str(domain), claim
        except OSError:  # somebody has the port
            claim.close()
    raise UserError('there are nodes in every ROS domain of this machine; set ROS_DOMAIN_ID')


def _udp_socket() -> socket.socket:
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

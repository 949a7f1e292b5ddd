# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A ROS domain of one's own: other nodes neither see nor disturb, and ours meet at once.

Left to themselves, nodes that keep to this machine may take 3 s to find each other.
"""

from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import socket
from typing import NamedTuple

from ament_index_python.packages import get_package_share_directory, PackageNotFoundError

from dp_swing_ros.errors import UserError

DOMAINS = range(102)  # their ports lie below those that Linux gives to anybody
PORTS_PER_DOMAIN, FIRST_PORT = 250, 7400  # Source: the DDSI-RTPS specification, 9.6.1
PARTICIPANTS = 20     # looked for in a domain


class Domain(NamedTuple):
    """A ROS domain, and whether the user has set it."""

    number: str
    given: bool


@contextlib.contextmanager
def isolated() -> Iterator[Domain]:
    """
    Keep this process and its children on this machine and in a domain of their own; yield it.

    What the user has set, a ROS_DOMAIN_ID or a profile of Fast DDS, is kept.
    Raises UserError where no domain is free, or where the package is not installed.
    """
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    if 'FASTRTPS_DEFAULT_PROFILES_FILE' not in os.environ:
        os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(_fast_discovery())
    given = os.environ.get('ROS_DOMAIN_ID')
    if given:
        yield Domain(given, True)
        return
    domain, claim = _claim_domain()
    with claim:
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        try:
            yield Domain(str(domain), False)
        finally:
            os.environ.pop('ROS_DOMAIN_ID', None)


def _fast_discovery() -> Path:
    try:
        return Path(get_package_share_directory('dp_swing_ros'), 'config', 'fast_discovery.xml')
    except PackageNotFoundError:
        raise UserError('the package dp_swing_ros is not in the ament index; source its '
                        'install/setup.bash first') from None


def _claim_domain() -> tuple[int, socket.socket]:
    """Return the first domain without nodes, and the socket that claims it while it is open."""
    for domain in DOMAINS:
        base = FIRST_PORT + PORTS_PER_DOMAIN * domain
        # no participant uses the last port: it keeps apart two runs that start together
        claim = _bound(base + PORTS_PER_DOMAIN - 1)
        if claim is None:
            continue
        ports = (_bound(base + 10 + 2 * n) for n in range(PARTICIPANTS))
        if all(_closed(port) for port in ports):
            return domain, claim
        claim.close()
    raise UserError('there are nodes in every ROS domain of this machine; set ROS_DOMAIN_ID')


def _bound(port: int) -> socket.socket | None:
    """Return a socket on a UDP port, None where somebody has it."""
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        one.bind(('', port))
    except OSError:
        one.close()
        return None
    return one


def _closed(one: socket.socket | None) -> bool:
    """Close a socket; return whether there was one."""
    if one is not None:
        one.close()
    return one is not None

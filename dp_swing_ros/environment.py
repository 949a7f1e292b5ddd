# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What ROS reads of the environment, checked before it does.

Left to themselves rcl and Fast DDS end the process at some of it, and go on without the rest.
"""

import ctypes
import os
from pathlib import Path
from xml.etree import ElementTree

SWITCH = ('0', '1')
CHOICES = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': ('SUBNET', 'LOCALHOST', 'OFF', 'SYSTEM_DEFAULT'),
    'ROS_LOCALHOST_ONLY': SWITCH, 'ROS_DISABLE_LOANED_MESSAGES': SWITCH,
    'ROS_SECURITY_ENABLE': ('true', 'false'), 'ROS_SECURITY_STRATEGY': ('Enforce', 'Permissive'),
    'RCUTILS_LOGGING_USE_STDOUT': SWITCH, 'RCUTILS_LOGGING_BUFFERED_STREAM': SWITCH,
    'RCUTILS_COLORIZED_OUTPUT': SWITCH, 'RMW_FASTRTPS_USE_QOS_FROM_XML': SWITCH,
    'RMW_FASTRTPS_PUBLICATION_MODE': ('SYNCHRONOUS', 'ASYNCHRONOUS', 'AUTO')}
LARGEST_DOMAIN = 232   # whose ports there are. Source: the DDSI-RTPS specification, 9.6.1
OF_ROS = ('ROS_', 'RMW_', 'RCL_', 'RCUTILS_', 'FASTRTPS_', 'FASTDDS_')


def misused() -> str:
    """Return in one line what of the environment ROS cannot obey, if anything."""
    checks = {'ROS_DOMAIN_ID': _domain, 'RMW_IMPLEMENTATION': _middleware,
              'RCL_ASSERT_RMW_ID_MATCHES': _middleware,
              'FASTRTPS_DEFAULT_PROFILES_FILE': _profiles, **dict.fromkeys(CHOICES, _choice)}
    for name, check in checks.items():
        value = os.environ.get(name)   # empty is as good as unset
        if value and (expected := check(name, value)):
            return f'the environment variable {name} is {value[:80]!r}; {expected}, or unset it'
    return ''


def variables() -> str:
    """Return in words what the environment tells ROS, for an error that only ROS can explain."""
    found = [f'{name}={os.environ[name][:80]}' for name in sorted(os.environ)
             if name.startswith(OF_ROS)]
    return f'the environment says {", ".join(found) or "nothing"}'


def _choice(name: str, value: str) -> str:
    return '' if value in CHOICES[name] else f'expected one of {", ".join(CHOICES[name])}'


def _domain(_: str, value: str) -> str:
    is_one = value.isdecimal() and value.isascii() and int(value[:80]) <= LARGEST_DOMAIN
    return '' if is_one else f'expected a whole number from 0 to {LARGEST_DOMAIN}'


def _middleware(_: str, value: str) -> str:
    try:
        ctypes.CDLL(f'lib{value}.so')
        return ''
    except OSError as error:
        return f'it cannot be loaded ({error}); install it'


def _profiles(_: str, value: str) -> str:
    try:
        if not Path(value).is_file():
            return 'there is no such file; name one that is'
        ElementTree.parse(value)
        return ''
    except (OSError, SyntaxError) as error:
        return f'it is not read ({error}); name a file of XML'

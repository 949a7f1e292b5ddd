# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The text of message definitions, which a bag carries so that anyone can read it."""

import os
from pathlib import Path
import re
import sys
from typing import Iterator

from dp_swing_ros.errors import BagError

RULE = '=' * 80  # between the definitions of a schema
BUILT_IN = {'bool', 'byte', 'char', 'float32', 'float64', 'int8', 'uint8', 'int16', 'uint16',
            'int32', 'uint32', 'int64', 'uint64', 'string', 'wstring'}


def schema(message: str) -> str:
    """
    Return the definition of a type such as 'std_msgs/msg/Header' and of all that it is made of.

    Raises BagError if one is not installed. Source: the ros2msg encoding of MCAP.
    """
    texts, waiting = dict[str, str](), [message]
    for name in waiting:   # which grows
        if name not in texts:
            texts[name] = _definition(name)
            waiting.extend(_parts(name, texts[name]))
    root, *parts = texts
    return f'\n{RULE}\nMSG: '.join([
        texts[root], *(f'{part.replace("/msg/", "/")}\n{texts[part]}' for part in parts)])


def _definition(message: str) -> str:
    # A ROS installation names its places in AMENT_PREFIX_PATH; the wheels lie beside the Python.
    prefixes = [*filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)),
                sys.prefix]
    for prefix in prefixes:
        package, *place = message.split('/')
        path = Path(prefix, 'share', package, *place).with_suffix('.msg')
        if path.is_file():
            return path.read_text(encoding='utf-8')
    raise BagError(f'no definition of {message!r} under share/ of {", ".join(prefixes)}; '
                   'install its package or leave its topic out')


def _parts(message: str, definition: str) -> Iterator[str]:
    for line in definition.splitlines():
        field = re.match(r'\s*([A-Za-z]\w*)(?:/(\w+))?', line)
        if field is None or field[1] in BUILT_IN:
            continue
        package, name = field.groups() if field[2] else (message.split('/')[0], field[1])
        yield f'{package}/msg/{name}'

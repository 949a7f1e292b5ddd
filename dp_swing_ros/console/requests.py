# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a page may ask for: the one place where its messages become checked values.

Behind it there are only whole numbers that ROS has, finite ones, texts that can be encoded, and
lists and objects of these as deep as a request is.
"""

from collections.abc import Callable
import json
import math
import re
from reprlib import repr as shown
from typing import Any

from dp_swing_ros.parameters import LARGEST

FAR = 1e10   # no force [N], place [m] or time [s], since 1970 too, is beyond this
IMPOSSIBLE = re.compile('[\0\ud800-\udfff]')   # in a text of ROS
Request = dict[str, Any]


class RequestError(Exception):
    """A request cannot be obeyed; the message says why."""


def _is_number(value: Any) -> bool:
    # true and false are numbers too
    return type(value) in (int, float) and abs(value) <= FAR


def _is_point(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and not IMPOSSIBLE.search(value)


def _is_plain(value: Any) -> bool:
    """Return whether a parameter may be this, or have it in a list."""
    return _is_text(value) or isinstance(value, int) and abs(value) <= LARGEST \
        or isinstance(value, float) and math.isfinite(value)


def _are_values(value: Any) -> bool:
    return isinstance(value, dict) and all(map(_is_text, value)) and all(
        all(map(_is_plain, each)) if isinstance(each, list) else _is_plain(each)
        for each in value.values())


KINDS: dict[str, Callable[[Any], bool]] = {
    f'a number, {FAR:g} at most either way': _is_number,
    'a point [x, z]': _is_point,
    'a whole number from 0 on': lambda value: type(value) is int and 0 <= value < 100,
    'true or false': lambda value: isinstance(value, bool),
    'a text': _is_text,
    'an object, of values that a parameter may have': _are_values}
NUMBER, POINT, INDEX, SWITCH, TEXT, VALUES = KINDS

# what each needs
HANDS = {'pull': {'body': INDEX, 'along': NUMBER, 'to': POINT}, 'release': {},
         'push': {'force': NUMBER}, 'hold': {'force': NUMBER}}
CHANGES = {'set': {'node': TEXT, 'parameters': VALUES}, 'preset': {'name': TEXT},
           'reference': {'x': NUMBER}, 'goal': {'name': TEXT}, 'reset': {'node': TEXT},
           'enable': {'on': SWITCH}, 'pause': {'on': SWITCH}, 'step': {}, 'pace': {'pace': NUMBER},
           'record': {'on': SWITCH}}
# which change nothing for anybody else
LOOKS = {'history': {}, 'past': {'at': NUMBER}, 'branch': {'at': NUMBER, 'duration': NUMBER},
         'seek': {'at': NUMBER}, 'skip': {'states': NUMBER},
         'play': {'on': SWITCH, 'rate': NUMBER}}
REQUESTS: dict[str, dict[str, str]] = {**HANDS, **CHANGES, **LOOKS}


def parse(text: str | bytes) -> Request:
    """Return the request that a message is; raises RequestError where it is none."""
    if isinstance(text, bytes):
        raise RequestError('a message is binary; expected JSON as text')
    try:
        found = json.loads(text, parse_constant=_refuse)
    except (RecursionError, ValueError) as error:
        raise RequestError(f'{text[:80]!r} is not JSON: {error}') from None
    if not isinstance(found, dict) or not isinstance(found.get('do'), str):
        raise RequestError(f'{text[:80]!r} is not a request; expected an object with "do"')
    if not (found.get('id') is None or _is_plain(found['id'])):
        raise RequestError(f'the id of a request is {shown(found["id"])}; expected a number or a '
                           'text')
    return found


def _refuse(name: str) -> None:
    raise ValueError(f'{name} is no number of JSON')


def check(request: Request) -> Request:
    """Return what a request needs and no more; raises RequestError where it is not there."""
    name = request['do']
    if name not in REQUESTS:
        raise RequestError(f'unknown request {name[:80]!r}; expected one of '
                           f'{", ".join(REQUESTS)}')
    for field, kind in REQUESTS[name].items():
        if field not in request or not KINDS[kind](request[field]):
            raise RequestError(f'{name} needs {field}: {kind}; it is '
                               f'{shown(request.get(field))}')
    return {field: request[field] for field in ('do', 'id', *REQUESTS[name]) if field in request}

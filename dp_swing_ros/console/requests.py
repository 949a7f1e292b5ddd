# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a page may ask for, and what of it must be there."""

from collections.abc import Callable
import json
import math
from typing import Any

Request = dict[str, Any]


class RequestError(Exception):
    """A request cannot be obeyed; the message says why."""


def _is_number(value: Any) -> bool:
    # true and false are numbers too, and JSON has numbers that no float can hold
    try:
        return type(value) in (int, float) and math.isfinite(value)
    except OverflowError:
        return False


def _is_point(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))


KINDS: dict[str, Callable[[Any], bool]] = {
    'a number': _is_number,
    'a point [x, z]': _is_point,
    'a whole number from 0 on': lambda value: type(value) is int and 0 <= value < 100,
    'true or false': lambda value: isinstance(value, bool),
    'a text': lambda value: isinstance(value, str),
    'an object': lambda value: isinstance(value, dict)}
NUMBER, POINT, INDEX, SWITCH, TEXT, OBJECT = KINDS

# what each needs
HANDS = {'pull': {'body': INDEX, 'along': NUMBER, 'to': POINT}, 'release': {},
         'push': {'force': NUMBER}, 'hold': {'force': NUMBER}}
CHANGES = {'set': {'node': TEXT, 'parameters': OBJECT}, 'preset': {'name': TEXT},
           'reference': {'x': NUMBER}, 'goal': {'name': TEXT}, 'reset': {'node': TEXT},
           'enable': {'on': SWITCH}, 'pause': {'on': SWITCH}, 'step': {}, 'pace': {'pace': NUMBER},
           'record': {'on': SWITCH}}
LOOKS = {'history': {}, 'branch': {'at': NUMBER, 'duration': NUMBER}, 'seek': {'at': NUMBER},
         'play': {'on': SWITCH, 'rate': NUMBER}}   # which change nothing for anybody else
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
    return found


def _refuse(name: str) -> None:
    raise ValueError(f'{name} is no number of JSON')


def check(request: Request) -> None:
    """Raise RequestError where nobody knows a request, or it lacks something."""
    name = request['do']
    if name not in REQUESTS:
        raise RequestError(f'unknown request {name[:80]!r}; expected one of '
                           f'{", ".join(REQUESTS)}')
    for field, kind in REQUESTS[name].items():
        if field not in request or not KINDS[kind](request[field]):
            raise RequestError(f'{name} needs {field}: {kind}; it is '
                               f'{repr(request.get(field))[:80]}')

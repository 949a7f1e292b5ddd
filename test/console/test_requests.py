# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import json
import math
import random

import pytest

from dp_swing_ros.console.requests import check, parse, RequestError, REQUESTS

DEEP = '[' * 900 + ']' * 900   # which Python's own reader takes
HOSTILE = ('1e400', '-1e400', str(10 ** 400), str(2 ** 63), '9' * 5000, '"\\ud800"', '"\\u0000"',
           'NaN', 'Infinity', '[' * 25_000, DEEP, '{"a": ' * 900 + '1' + '}' * 900, 'null', '{}',
           '[]', '""', 'true', '1.5', '-1', '1e300', '[1, [2]]', '[{}]', '{"\\ud800": 1}',
           '{"rate": [1e400]}', f'{{"rate": {10 ** 400}}}', '{"rate": ["\\udfff"]}',
           f'{{"rate": {DEEP}}}', '{"rate": null}')


def checked(text):
    """Return what is behind the boundary, or None where the sender is told of an error."""
    try:
        return check(parse(text))
    except RequestError as error:
        str(error).encode()
        assert len(str(error)) < 1000
        return None


def assert_plain(value, depth=0):
    """Fail where a value is none that ROS and JSON can have."""
    assert depth <= 3
    if isinstance(value, (list, dict)):
        for each in value if isinstance(value, list) else [*value, *value.values()]:
            assert_plain(each, depth + 1)
    elif isinstance(value, float):
        assert math.isfinite(value)
    elif isinstance(value, int):
        assert -2 ** 63 <= value < 2 ** 63
    elif value is not None:
        value.encode()
        assert '\0' not in value


def test_what_is_hostile_anywhere_is_an_error_or_values_that_can_be_had():
    draw = random.Random(36)
    for do, needs in REQUESTS.items():
        for field in ('id', 'do', 'surplus', *needs):
            for text in HOSTILE:
                fields = dict.fromkeys(needs, '1') | {'do': f'"{do}"', field: text}
                found = checked('{%s}' % ', '.join(f'"{name}": {value}'
                                                   for name, value in fields.items()))
                if found is not None:
                    assert_plain(found)
                    json.dumps(found, allow_nan=False)
                    assert set(found) <= {'do', 'id', *needs}
    for _ in range(300):
        text = list('{"do": "push", "id": 7, "force": 1.5}')
        for _ in range(draw.randrange(1, 4)):
            text[draw.randrange(len(text))] = draw.choice('{}[]":,eE-+.0123456789\\u\x00\ud800 ')
        assert_plain(checked(''.join(text)))


@pytest.mark.parametrize('text, found', [
    ('{"do": "push", "force": -3, "id": "a"}', {'do': 'push', 'force': -3, 'id': 'a'}),
    ('{"do": "set", "node": "mpc", "parameters": {"a": [1, 2.5], "b": "inf", "c": true}}',
     {'do': 'set', 'node': 'mpc', 'parameters': {'a': [1, 2.5], 'b': 'inf', 'c': True}}),
    ('{"do": "history", "id": null, "more": [[]]}', {'do': 'history', 'id': None})])
def test_a_request_is_what_it_needs(text, found):
    assert checked(text) == found

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""YAML within bounds, which are no closer than they are said to be."""

import pytest

from dp_swing_ros.parameters.files import for_node, parse, parse_file, YamlError


def comment(size):
    return '1 #'.ljust(size, 'x')


@pytest.mark.parametrize('text, value', [
    ('- [1]\n' * 1000, [[1]] * 1000), ('[' * 32 + ']' * 32, None),
    (f'[{"1," * 49_999}]', [1] * 49_999), ('a' * (1 << 16), 'a' * (1 << 16)),
    (str(2 ** 64 - 1), 2 ** 64 - 1), (str(1 - 2 ** 64), 1 - 2 ** 64), (comment(1 << 20), 1)],
    ids=['siblings', 'levels', 'nodes', 'characters', 'bits', 'negative', 'size'])
def test_what_is_within_the_bounds_is_read(text, value, tmp_path):
    (tmp_path / 'file').write_text(text)
    assert parse(text) == parse_file(tmp_path / 'file')
    assert value is None or parse(text) == value


@pytest.mark.parametrize('tag', ['', '!!int ', '!!float '])
def test_numbers_of_base_60_are_texts(tag):
    text = ':'.join(['1'] + ['59'] * 15_000)   # as numbers they take a while, of their square
    assert parse(f'[{tag}"{text}", {text}, {text}.5, 1:30]' if tag else
                 f'[{text}, {text}, {text}.5, 1:30]') == [text, text, f'{text}.5', '1:30']


@pytest.mark.parametrize('text, words', [
    ('[' * 33 + ']' * 33, '32 levels'), (f'[{"1," * 50_000}]', '50000 nodes'),
    ('a' * ((1 << 16) + 1), '65536 characters in one value'), (str(2 ** 64), '65 bits'),
    (comment((1 << 20) + 1), '1048576 bytes'), ('[&a 1, *a]', 'alias'), ('!!int ""', 'index')],
    ids=['levels', 'nodes', 'characters', 'bits', 'size', 'alias', 'empty'])
def test_what_is_beyond_the_bounds_is_one_line(text, words, tmp_path):
    (tmp_path / 'file').write_text(text)
    for read, source in ((parse, text), (parse_file, tmp_path / 'file')):
        with pytest.raises(YamlError, match=words) as error:
            read(source)
        assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize('pattern, node, taken', [
    ('/**/mpc', '/mpc', 'ab'), ('/**/mpc', '/left/arm/mpc', 'ab'), ('mpc', '/mpc', 'ab'),
    ('/*/mpc', '/left/mpc', 'ab'), ('/*/mpc', '/mpc', ''), ('/mpc', '/left/mpc', ''),
    ('/left/mpc', '/left/mpc', 'ab'), ('/**/plant', '/mpc', ''), ('/**/pc', '/mpc', ''),
    ('/**', '/mpc', 'a'), ('/left/**', '/left/mpc', 'a'), ('/left/*', '/mpc', '')])
def test_a_node_takes_its_sections(pattern, node, taken):
    """Of those for any node what it has."""
    found = for_node([(pattern, {'a': 1, 'b': 2})], node, ['a', 'c'])
    assert ''.join(found) == taken

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import os
import socket

import pytest

from dp_swing_ros.console.access import Access, given_token, LOCAL
from dp_swing_ros.errors import UserError
from dp_swing_ros.parameters.console import TOKEN_VARIABLE


def test_a_token_is_taken_from_the_first_place_that_has_one(tmp_path, monkeypatch):
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    assert given_token('', '') == ''
    monkeypatch.setenv(TOKEN_VARIABLE, 'of the environment')
    file = tmp_path / 'token'
    file.write_text('of the file\n')
    assert given_token('', '') == 'of the environment'
    assert given_token('', str(file)) == 'of the file'
    assert given_token('itself', str(file)) == 'itself'


def test_what_is_no_token_is_refused_in_one_line(tmp_path, monkeypatch):
    fifo, empty, binary, long = (tmp_path / name for name in ('fifo', 'empty', 'binary', 'long'))
    os.mkfifo(fifo)
    empty.write_text('\n')
    binary.write_bytes(b'\xff\xfe')
    long.write_text('x' * 2000)
    for file in (fifo, empty, binary, long, tmp_path, tmp_path / 'none', '/dev/zero'):
        with pytest.raises(UserError, match='token_file') as error:
            given_token('', str(file))
        assert '\n' not in str(error.value)
    monkeypatch.setenv(TOKEN_VARIABLE, 'two\nlines')
    with pytest.raises(UserError, match=TOKEN_VARIABLE):
        given_token('', '')


def test_a_given_token_is_not_in_the_address_that_is_printed():
    assert 'abc' not in Access('0.0.0.0', 8080, 'abc').address
    made = Access('0.0.0.0', 8080, '')
    assert made.token in made.address
    assert 'token' not in Access('127.0.0.1', 8080, '').address


def test_a_page_is_ours_by_host_and_port():
    ours = Access('127.0.0.1', 8080, '')
    assert all(map(ours.is_own_origin, ('http://127.0.0.1:8080', 'http://localhost:8080')))
    for other in ('http://127.0.0.1:8081', 'http://localhost', 'http://example.org:8080',
                  'file://127.0.0.1:8080'):
        assert not ours.is_own_origin(other), other
    assert not ours.is_ours('somebody@127.0.0.1:8080')


def test_a_token_may_have_what_an_address_changes():
    access = Access('0.0.0.0', 8080, 'a+b')
    assert access.is_known('a+b', '') and access.is_known('a b', '')   # as browsers send it
    assert not access.is_known('a-b', '')


def test_who_is_bound_to_all_is_called_by_the_name_of_the_machine_too():
    name = socket.gethostname()
    for host in (name, name.upper(), f'{name}.local'):
        assert Access('0.0.0.0', 8080, 'abc').is_ours(f'{host}:8080')
        assert not Access('127.0.0.1', 8080, '').is_ours(f'{host}:8080') or name in LOCAL


@pytest.mark.parametrize(('address', 'port', 'host'), [
    ('127.0.0.1', 80, '127.0.0.1'), ('127.0.0.1', 80, 'localhost:80'), ('0.0.0.0', 80, '10.0.0.7'),
    ('ROBOT-PC', 8080, 'robot-pc:8080'), ('robot', 8080, 'ROBOT:8080'),
    ('0:0:0:0:0:0:0:1', 8080, '[::1]:8080'), ('::', 8080, '[fe80::1]:8080')])
def test_a_host_is_ours_as_browsers_write_it(address, port, host):
    ours = Access(address, port, 'abc')
    assert ours.is_ours(host) and ours.is_own_origin(f'http://{host}')
    assert not ours.is_ours('evil.example') and not ours.is_ours('evil.example:8080')

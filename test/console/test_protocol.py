# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a console does with callers that it should not trust; no pendulum is needed for it."""

import json
import re
import socket
import time

from conftest import starting, wait_until
from pages import deaf, get, memory, Page, port_of, token_of
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

ANY = {'port': 0}   # that is free


@pytest.fixture
def console(start_here):
    """Return a function that starts a console with parameters and waits until it serves."""
    def start(**parameters):
        node = start_here('console', {**ANY, **parameters})
        node.port = port_of(node)
        return node
    return start


@pytest.fixture(scope='module')
def shared(tmp_path_factory):
    """Return a console with its defaults, one for all tests, and its recordings."""
    folder = tmp_path_factory.mktemp('console')
    with starting(folder) as start:
        node = start('console', {**ANY, 'recordings': str(folder / 'runs')})
        node.port, node.recordings = port_of(node), folder / 'runs'
        yield node


@pytest.fixture
def node(shared):
    """Return that console; what it printed before the test counts no more."""
    host = f'{time.monotonic_ns()}.example'
    get(shared.port, Host=host)
    shared.wait_for(f"{host}' is not this console")   # after all lines of the tests before
    shared.seen = len(shared.output())
    yield shared
    assert 'Traceback' not in shared.output()


def refused(port, **options):
    """Return the status with which a socket is refused."""
    with pytest.raises(InvalidStatus) as error:
        Page(port, **options)
    return error.value.response.status_code


def opens(port):
    """Return whether there is room for a page."""
    try:
        with Page(port) as page:
            return page.receive()['kind'] == 'hello'
    except InvalidStatus:
        return False


def lines_of(node, text):
    return [line for line in node.output()[node.seen:].splitlines() if text in line]


def counted(node, text, count):
    """Return whether there are so many lines with a text; they may come after the answer."""
    return wait_until(lambda: len(lines_of(node, text)) >= count) \
        and len(lines_of(node, text)) == count


def test_the_page_is_served_with_a_policy_that_keeps_it_to_this_host(node):
    port = node.port
    answer, body = get(port)
    assert answer.status == 200
    assert b'<html' in body
    policy = answer.getheader('Content-Security-Policy')
    assert "default-src 'self'" in policy
    assert set(re.findall(r'\w+://[^ ;]+', policy)) == {
        f'ws://127.0.0.1:{port}', f'wss://127.0.0.1:{port}'}
    assert get(port, '/static/nothing.js')[0].status == 404
    assert get(port, '/elsewhere')[0].status == 404


@pytest.mark.parametrize('host', ['evil.example:{}', '127.0.0.1:80', '127.0.0.1', '', '[::1]',
                                  '127.0.0.1.evil.example:{}'])
def test_another_host_is_refused(node, host):
    host = host.format(node.port)
    assert get(node.port, Host=host)[0].status in (400, 403)
    for name in ('127.0.0.1', 'localhost', '[::1]'):
        assert get(node.port, Host=f'{name}:{node.port}')[0].status == 200


def test_the_socket_is_for_this_origin_alone(node):
    for origin in ('http://evil.example', 'null', 'http://127.0.0.1:80',
                   f'http://127.0.0.1.evil.example:{node.port}', f'ftp://127.0.0.1:{node.port}'):
        assert refused(node.port, origin=origin) == 403
    assert counted(node, 'is not this console', 5)   # one line each
    for origin in ('http://[', 'http://[::1'):
        assert refused(node.port, origin=origin) == 400
    with Page(node.port, origin=f'http://localhost:{node.port}') as page:
        assert page.receive()['kind'] == 'hello'
    with socket.create_connection(('127.0.0.1', node.port)) as stream:   # a name made to lead here
        with pytest.raises(InvalidStatus), connect(
                f'ws://evil.example:{node.port}/socket', sock=stream):
            pass


def test_a_token_is_asked_for_and_kept_in_a_cookie(console):
    node = console(token='of the test')
    assert 'of the test' not in node.output()
    for path in ('/', '/?token=wrong', '/static/index.html', '/recordings/x', '/?token='):
        answer, body = get(node.port, path)
        assert answer.status == 403
        assert b'token' in body
    assert refused(node.port) == refused(node.port, path='/socket?token=wrong') == 403
    answer, _ = get(node.port, '/?token=of%20the%20test')
    assert answer.status == 200
    cookie = answer.getheader('Set-Cookie')
    assert 'HttpOnly' in cookie
    assert 'SameSite=Strict' in cookie
    kept = {'Cookie': cookie.split(';')[0]}
    assert get(node.port, '/', **kept)[0].status == 200
    with Page(node.port, additional_headers=kept) as page:
        assert page.receive()['kind'] == 'hello'


def test_another_address_makes_a_token_of_its_own(console):
    node = console(address='0.0.0.0')
    assert len(token_of(node)) >= 32
    assert refused(node.port) == 403
    assert get(node.port, f'/?token={token_of(node)}')[0].status == 200


def test_a_port_that_is_taken_ends_it_with_one_line(start_here):
    with socket.create_server(('127.0.0.1', 0)) as other:
        node = start_here('console', {'port': other.getsockname()[1]})
        assert node.wait() == 2
    assert 'give another port' in node.complaint()
    assert len(node.complaint().splitlines()) == 1


MALFORMED = ('no JSON', '[1, 2]', '{"do": 5}', '"pull"', '[' * 60_000,
             '{"do": "push", "force": NaN}', '9' * 60_000, b'\x00\xff', '',
             '{"do": "step", "id": 1e400}', '{"do": "step", "id": "\\ud800"}',
             f'{{"do": "step", "id": {2 ** 63}}}', f'{{"do": "step", "id": {"[" * 900}')


def test_what_is_no_request_ends_the_socket_and_nothing_else(node):
    with Page(node.port) as other:
        for number, text in enumerate(MALFORMED, start=1):
            with Page(node.port) as page, pytest.raises(ConnectionClosed) as error:
                page.socket.send(text)
                while True:
                    page.receive()
            assert error.value.rcvd.code == 1007
            assert counted(node, 'WARN', number)
        with Page(node.port) as page, pytest.raises(ConnectionClosed) as error:
            page.socket.send('x' * ((1 << 16) + 1))
            while True:
                page.receive()
        assert error.value.rcvd.code == 1009
        assert not other.ask('reset', node='plant')['ok']


@pytest.mark.parametrize(('request_', 'words'), [
    ({'do': 'jump'}, 'unknown request'), ({'do': 'pull'}, 'pull needs body'),
    ({'do': 'push', 'force': '3'}, 'push needs force: a number'),
    ({'do': 'push', 'force': 10 ** 400}, 'push needs force: a number'),
    ({'do': 'pull', 'body': 1.5, 'along': 1, 'to': [0, 0]}, 'body: a whole number'),
    ({'do': 'pull', 'body': 1, 'along': 1, 'to': [0, 0, 0]}, 'to: a point'),
    ({'do': 'set', 'node': 'mpc', 'parameters': []}, 'parameters: an object'),
    ({'do': 'set', 'node': 'mpc', 'parameters': {}}, 'there is no mpc'),
    ({'do': 'set', 'node': '../..', 'parameters': {}}, 'there is no'),
    ({'do': 'reset', 'node': 'mpc'}, 'nobody offers mpc/reset'),
    ({'do': 'seek', 'at': 1}, 'this one is live'), ({'do': 'past', 'at': 1}, 'nothing is kept'),
    ({'do': 'skip', 'states': 1}, 'this one is live'), ({'do': 'past'}, 'past needs at'),
    ({'do': 'reset', 'node': '\ud800'}, 'reset needs node: a text'),
    ({'do': 'set', 'node': 'plant', 'parameters': {'rate': 2 ** 63}}, 'parameters: an object')],
    ids=lambda value: str(value)[:40])
def test_a_request_that_cannot_be_obeyed_is_answered_in_words(node, request_, words):
    with Page(node.port) as page:
        answer = page.ask(**request_)
        assert not answer['ok']
        assert words in answer['text']
        page.send(**request_)   # without an id there is no answer, and it goes on
        assert not page.ask(**request_)['ok']
    assert len(lines_of(node, 'WARN')) <= 1


def test_who_may_only_look_can_change_nothing(console):
    node = console(read_only=True)
    with Page(node.port) as page:
        page.until(lambda page: 'hello' in page.newest)
        assert page.newest['hello']['read_only']
        for request in ({'do': 'push', 'force': 1}, {'do': 'hold', 'force': 1},
                        {'do': 'pull', 'body': 0, 'along': 0, 'to': [0, 0]},
                        {'do': 'set', 'node': 'mpc', 'parameters': {}},
                        {'do': 'preset', 'name': 'rig'}, {'do': 'reference', 'x': 0},
                        {'do': 'goal', 'name': 'up_up'}, {'do': 'reset', 'node': 'plant'},
                        {'do': 'enable', 'on': False}, {'do': 'pause', 'on': True}, {'do': 'step'},
                        {'do': 'pace', 'pace': 1}, {'do': 'record', 'on': True}):
            answer = page.ask(**request)
            assert (answer['ok'], answer['text']) == (False, 'this console is read-only')


def test_of_a_hundred_pages_as_many_as_there_is_room_for_are_open(node):
    pages, turned_away = [], 0
    for _ in range(100):
        try:
            pages.append(Page(node.port))
        except InvalidStatus as error:
            assert error.response.status_code == 503
            turned_away += 1
    assert (len(pages), turned_away) == (32, 68)
    assert counted(node, '32 pages are open already', 68)
    pages.pop().socket.close()
    assert wait_until(lambda: opens(node.port))
    for page in pages:
        page.socket.close()


def asks(stream, **request):
    """Send a request as one frame, masked by zeros."""
    text = json.dumps(request).encode()
    stream.sendall(bytes([0x81, 0x80 | 126, *len(text).to_bytes(2, 'big'), 0, 0, 0, 0]) + text)


def test_a_page_that_asks_and_does_not_read_is_closed(node):
    with deaf(node.port) as stream, Page(node.port) as other:
        with pytest.raises(OSError):
            for _ in range(200_000):
                asks(stream, do='set', id='x' * 20_000, node='mpc', parameters={})
        node.wait_for('closed, for it does not read')
        before = memory(node)
        assert not other.ask('reset', node='plant')['ok']
        assert memory(node) < before + (1 << 24)
    assert len(lines_of(node, 'does not read')) == 1


def test_recordings_are_served_and_nothing_beside_them(node):
    folder, secret = node.recordings / 'one', node.recordings.parent / 'secret'
    folder.mkdir(parents=True)
    (folder / 'report.html').write_text('the report')
    secret.write_text('not for you')
    (folder / 'link').symlink_to(secret)
    answer, body = get(node.port, '/recordings/one/report.html')
    assert (answer.status, body) == (200, b'the report')
    assert answer.getheader('Content-Security-Policy').startswith('sandbox')
    for path in ('../secret', '%2e%2e/secret', '..%2fsecret', 'one/../../secret', 'one/link',
                 'one', '/etc/passwd', 'x' * 5000):
        answer, body = get(node.port, f'/recordings/{path}')
        assert answer.status >= 400, path
        assert b'not for you' not in body
    for path in ('/recordings/%00', '/recordings/one/%00/report.html', '/static/%00',
                 '/static/index.html%00', '/recordings/%ff', '/?token=%ff', '/static/%ed%a0%80'):
        assert get(node.port, path)[0].status == 400, path

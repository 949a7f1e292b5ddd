# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A page as a foreign WebSocket client: no browser, and nothing of ours."""

import http.client
import json
from pathlib import Path
import re
import socket
import time

from conftest import PATIENCE
from websockets.sync.client import connect

SHOWN = 400   # characters of a message, where a test fails


def port_of(node):
    """Return the port that a console serves at, once it does."""
    node.wait_for('the page is at')
    return int(re.search(r'the page is at http://[^/]*:(\d+)/', node.output())[1])


def token_of(node):
    """Return the token in the address that a console prints."""
    return re.search(r'\?token=(\S+)', node.output())[1]


class Page:
    """A page that is open, and the newest of each kind of message that it was sent."""

    def __init__(self, port, path='/socket', **options):
        self._connection = connect(
            f'ws://127.0.0.1:{port}{path}', max_size=None, close_timeout=0.2,
            open_timeout=PATIENCE, ping_timeout=PATIENCE, **options)
        self.socket = self._connection.__enter__()
        self.newest, self.count, self.asked = {}, 0, 0

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.socket.close()

    def receive(self, timeout=PATIENCE):
        """Return the next message."""
        message = json.loads(self.socket.recv(timeout))
        kind = message['kind']
        self.newest[f'{kind} {message["node"]}' if kind == 'parameters' else kind] = message
        self.count += 1
        return message

    def until(self, condition, timeout=PATIENCE):
        """Receive until a condition of the page holds; return what it came to."""
        end = time.monotonic() + timeout
        while not (found := condition(self)):
            assert time.monotonic() < end, {
                name: str(message)[:SHOWN] for name, message in self.newest.items()}
            try:
                self.receive(0.5)
            except TimeoutError:
                pass
        return found

    def send(self, do, **fields):
        """Ask for something that is not answered."""
        self.socket.send(json.dumps({'do': do, **fields}))

    def ask(self, do, kind='answer', **fields):
        """Ask for something, and return the answer."""
        self.asked += 1
        self.send(do, id=self.asked, **fields)
        return self.until(lambda page: page.newest.get(kind, {}).get('id') == self.asked
                          and page.newest[kind])

    def value(self, node, name):
        """Return what is known of a parameter; None before anything is."""
        found = self.newest.get(f'parameters {node}', {'parameters': []})['parameters']
        return next((each for each in found if each['name'] == name), None)


def get(port, path='/', **headers):
    """Return the answer to a request, and its body."""
    connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE)
    connection.putrequest('GET', path, skip_host='Host' in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer, body


def deaf(port):
    """Return a socket of a page that never reads."""
    stream = socket.socket()
    stream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    stream.connect(('127.0.0.1', port))
    stream.sendall(f'GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n'
                   'Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n'
                   'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n'.encode())
    return stream


def memory(node):
    """Return what a process holds [bytes]."""
    text = Path(f'/proc/{node.popen.pid}/status').read_text()
    return int(text.split('VmRSS:')[1].split()[0]) * 1024

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a stranger may send to running nodes: attacks of kinds that once broke something.

Nothing here knows the package but by its topics, services, parameters and page.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
import json
import math
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
import rclpy.parameter
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
import yaml

FLOATS = (0.0, -0.0, -1.0, math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 1e-9, 1e6, 1e9)
JOINTS = ('cart', 'joint1', 'joint2')
TOPICS = {'joint_states': JointState, 'force_command': Float64, 'disturbance': Float64,
          'mpc/plan': JointTrajectory, 'mpc/tries': PointCloud2, '/diagnostics': DiagnosticArray,
          'robot_description': String, 'configuration': String,
          'force_command_stamped': JointState, '/parameter_events': ParameterEvent}
SERVICES = {'plant/reset': Trigger, 'mpc/reset': Trigger, 'mpc/enable': SetBool,
            'plant/pause': SetBool, 'plant/step': Trigger}
REQUESTS: dict[str, dict[str, Any]] = {   # of a page, each field of which gets VALUES in turn
    'pull': {'body': 0, 'along': 0.5, 'to': [0, 1]}, 'push': {'force': 1},
    'set': {'node': 'mpc', 'parameters': {'horizon': 30}}}
VALUES = ('1e400', '-1e400', r'"\ud800"', r'{"\udfff": 1}', '9' * 30, '1' + '0' * 400, '-5',
          '18446744073709551616', '9223372036854775808', '1e308', '5e-324', '0.5', 'NaN',
          'Infinity', 'null', '[]', '{}', '""', '"x"', r'"\u0000"', '[[0, 1], {}]',
          '[1e400, 0]', '[1e308, -1e308]', '{"horizon": 1e400}',
          '{"force_limit": 1%s}' % ('0' * 400), r'{"solver": "\ud800"}',
          '{"seed": 36893488147419103232}', '[' * 5000 + ']' * 5000,
          '{"goal": {"a": [1]}}', '{"reference": [1e308, 0, 0, 0, 0, 0]}', '{"reference": [[]]}',
          '{"joint_names": [1, "x", null]}', '"%s"' % ('x' * 60_000))
MALFORMED = ('', '{', '[]', '3', '{"do": 3}', '{"do": []}', '[' * 60_000, '"' * 1000, b'\xff\0',
             b'', 'x' * 70_000, '{"do": "set", "do": "push"}', '{"do": "mro"}', '\ufeff{}')
HTTP = (b'GET / HTTP/1.1\r\nHost: HOST\r\nOrigin: http://[\r\n\r\n',
        b'GET /socket HTTP/1.1\r\nHost: HOST\r\nOrigin: http://[\r\nUpgrade: websocket\r\n'
        b'Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n'
        b'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n',
        b'GET /static/%00 HTTP/1.1\r\nHost: HOST\r\n\r\n',
        b'GET /recordings/a%00b HTTP/1.1\r\nHost: HOST\r\n\r\n',
        b'GET /static/../../../etc/passwd HTTP/1.1\r\nHost: HOST\r\n\r\n',
        b'GET /static/%ff%fe%c0%80 HTTP/1.1\r\nHost: HOST\r\n\r\n',
        b'GET /?token=%ff%00&token=x HTTP/1.1\r\nHost: HOST\r\n\r\n',
        b'GET / HTTP/1.1\r\nHost: [\r\n\r\n', b'GET / HTTP/1.1\r\nHost: \xff:99999999\r\n\r\n',
        b'GET / HTTP/1.1\r\n\r\n', b'GET //[ HTTP/1.1\r\nHost: HOST\r\n\r\n', b'\0\1\2\r\n\r\n',
        b'GET / HTTP/1.1\r\nHost: HOST\r\nCookie: \xff=\x80; a="\r\n\r\n',
        b'POST / HTTP/1.1\r\nHost: HOST\r\nContent-Length: 99999999999999\r\n\r\n',
        b'GET / HTTP/1.1\r\nHost: HOST\r\nRange: bytes=9-1\r\nIf-Modified-Since: x\r\n\r\n',
        b'GET /' + b'a' * 70_000 + b' HTTP/1.1\r\nHost: HOST\r\n\r\n')


def send(target: Any, topic: str, message: Any, count: int = 1, rate: float = 0.0) -> None:
    """Publish a message so often; states get stamps of their own, which nobody may answer."""
    publisher = target.publisher(topic, TOPICS[topic])
    for _ in range(count):
        now = message(target) if callable(message) else message
        if topic == 'joint_states' and not isinstance(now, bytes) and now.header.stamp == Time():
            now.header.stamp = target.strange_stamp()
        with suppress(RuntimeError):   # what the middleware does not even send
            publisher.publish(now)
        if rate:
            time.sleep(1 / rate)


def joint_states(names: Sequence[str], position: Sequence[float] | None = None, **fields: Any
                 ) -> Callable[[Any], JointState]:
    """Return what makes a state of these joints."""
    count = len(names)
    return lambda _: JointState(name=list(names), **{
        'position': position if position is not None else [0.0] * count,
        'velocity': [0.0] * count, 'effort': [0.0] * count, **fields})


def stamped(sec: int, nanosec: int = 0) -> Callable[[Any], JointState]:
    """Return what makes a state of our joints with another stamp."""
    def make(target: Any) -> JointState:
        message = joint_states(JOINTS)(target)
        message.header.stamp = Time(sec=sec, nanosec=nanosec)
        target.strange.add(sec * 10 ** 9 + nanosec)
        return message
    return make


def states(target: Any) -> None:
    """Send states of others: of other joints, of ours, and of what is none."""
    gripper = joint_states(('finger_left', 'finger_right'), [0.01, 0.01])
    for flood in (gripper, joint_states(JOINTS)):
        send(target, 'joint_states', flood, 50, 100.0)
    send(target, 'joint_states', lambda target: target.last_state, 25, 50.0)
    for value in FLOATS:
        send(target, 'joint_states', joint_states(JOINTS, [value] * 3))
    for odd in (joint_states(()), joint_states(JOINTS, []), joint_states(JOINTS, [1.0]),
                joint_states((), [1.0] * 3), joint_states(JOINTS * 2),
                joint_states(JOINTS, velocity=[], effort=[]),
                joint_states(JOINTS, velocity=[math.nan] * 3),
                joint_states([f'j{n}' for n in range(100_000)]),
                joint_states(['x' * 1_000_000, *JOINTS]), joint_states(('cart',))):
        send(target, 'joint_states', odd)
    for sec, nanosec in ((-2 ** 31, 0), (2 ** 31 - 1, 999_999_999), (0, 1), (1, 2 ** 32 - 1),
                         (-1, 5)):
        send(target, 'joint_states', stamped(sec, nanosec))


def forces(target: Any) -> None:
    """Send forces and pushes of others."""
    for topic in ('disturbance', 'force_command'):
        for value in FLOATS:
            send(target, topic, Float64(data=value), 3, 100.0)


def configuration(node: str, name: str, value: Any) -> Callable[[Any], String]:
    """Return what makes the announcement of a node with another field or parameter."""
    def make(target: Any) -> String:
        content = yaml.safe_load(target.announced[node])
        (content if name in content else content['parameters'])[name] = value
        return String(data=yaml.safe_dump(content))
    return make


def announcements(target: Any) -> None:
    """Send announcements of others on `configuration`."""
    wrong: Sequence[Any] = (
        0.0, -1.0, 'abc', math.nan, math.inf, 1e308, None, [], {}, [1, 'x'], 10 ** 400, True,
        'x' * 100_000, 0)
    texts = ('a: [' + ', '.join(['1' + ':59' * 8000] * 6) + ']',
             '\n'.join(f'k{n}: 190:20:30:15' for n in range(20_000)),
             'a: &a [x, x]\n' + '\n'.join(
                 f'{chr(98 + n)}: &{chr(98 + n)} [*{chr(97 + n)}, *{chr(97 + n)}]'
                 for n in range(24)),
             '[' * 5000, '{a: ' * 5000, '[1, 2]', '!!python/object/apply:os.system ["true"]',
             '\0\1\ufffe', 'a: &a {<<: *a}', '{[a]: {b: c}}', '0000-99-99',
             'x: ' + '1' * 1_000_000, '!!binary x', '', '...')
    for node, names in (('/plant', ('rate', 'links', 'revision')), ('/mpc', ('links', 'model'))):
        for name in names:
            for value in wrong:
                send(target, 'configuration', configuration(node, name, value))
    for text in texts:
        send(target, 'configuration', String(data=text), 3)
    send(target, 'configuration', lambda target: String(data=target.announced['/mpc']), 1000,
         5000.0)


def current(message: Any) -> Callable[[Any], Any]:
    """Return what gives a message the stamp of the newest state, so that pages show it."""
    def make(target: Any) -> Any:
        message.header.stamp = target.last_state.header.stamp
        return message
    return make


def shown(target: Any) -> None:
    """Send plans, tries, diagnostics and descriptions of others, which pages show."""
    def point(*positions: float) -> JointTrajectoryPoint:
        return JointTrajectoryPoint(positions=positions, velocities=positions, effort=[1.0])
    plans = [JointTrajectory(joint_names=list(JOINTS), points=points) for points in (
        [], [point()], [point(), point()], [point(1.0), point(1.0, 2.0)], [point()] * 3,
        [point(math.nan, math.inf, 1e308)] * 5, [point(0.0, 0.0, 0.0)] * 10_000)]
    fields = [PointField(name=name, offset=4 * n, datatype=7, count=1)
              for n, name in enumerate(('x', 'y', 'z', 'weight'))]
    clouds = [PointCloud2(width=width, height=height, point_step=size, row_step=size * width,
                          fields=fields, data=bytes(length)) for width, height, size, length in (
        (0, 0, 0, 0), (1, 1, 16, 0), (5, 5, 16, 399), (2 ** 32 - 1, 2 ** 32 - 1, 16, 16),
        (1, 1, 0, 4), (1, 3, 16, 47), (2, 2, 2 ** 31, 64))]
    keys = ('cost', 'estimate_cart_position', 'paused', 'solver', '', 'joint_states', 'revision')
    statuses = [
        DiagnosticArray(status=[DiagnosticStatus(
            level=b'\xff', name=name, message='\0',
            values=[KeyValue(key=key, value=value) for key in keys])])
        for name in ('mpc', 'plant', '') for value in ('nan', '1' * 5000, 'x', '[1')]
    descriptions = [String(data=text) for text in (
        '', '<', '<robot name="x">' * 3000, '<robot><link name="cart"/></robot>',
        '<!DOCTYPE a [' + ''.join(f'<!ENTITY e{n + 1} "&e{n};&e{n};&e{n};&e{n};">'
                                  for n in range(20)) + ']><robot>&e20;</robot>')]
    for topic, messages in (('mpc/plan', map(current, plans)), ('mpc/tries', map(current, clouds)),
                            ('/diagnostics', statuses), ('robot_description', descriptions)):
        for message in messages:
            target.page_sends(['{"do": "history"}'])   # frames are made where a page is open
            send(target, topic, message, 5, 100.0)


def serialised(target: Any) -> None:
    """Send messages of all topics whose bytes are no message."""
    for topic, kind in TOPICS.items():
        for seed in range(3):
            rng = np.random.default_rng(seed)
            content = bytearray(serialize_message(
                joint_states(JOINTS)(None) if kind is JointState else kind()))
            place = int(rng.integers(4, len(content)))
            send(target, topic, bytes(content[:place]))
            content[place:place + 4] = rng.bytes(4) if seed else b'\xff\xff\xff\x7f'
            send(target, topic, bytes(content))


# services and parameters

def services(target: Any) -> None:
    """Flood services, and ask those of parameters for what nobody asks."""
    odd = [Parameter(name=name, value=ParameterValue(type=kind))
           for name in ('', 'x', 'horizon', 'rate') for kind in range(0, 256, 5)]
    for node in ('mpc', 'plant', 'console', 'logger'):
        # what rclpy itself trips over has no answer
        target.call_many(SetParameters, f'{node}/set_parameters',
                         [SetParameters.Request(parameters=odd)], 0.3)
    names = ['', 'x' * 100_000, '\0', *['horizon'] * 100]
    target.call_many(GetParameters, 'mpc/get_parameters', [GetParameters.Request(names=names)],
                     1.0)
    for name, kind in SERVICES.items():
        target.call_many(kind, name, [kind.Request(**({'data': bool(n % 2)} if kind is SetBool
                                                      else {})) for n in range(40)], 0.3)


def parameters(target: Any) -> None:
    """Let the mpc learn its model from files that are none, or have no end."""
    for model in (target.folder / 'nested.json', target.folder / 'fifo', '/dev/zero',
                  '[' * 25_000):
        target.change('mpc', [rclpy.parameter.Parameter(name, value=value).to_parameter_msg()
                              for name, value in (('dynamics', 'learned'), ('model', str(model)))])


# the page

def page(target: Any) -> None:
    """Send what pages may send, wrong in each field of each request."""
    def texts(do: str) -> Iterator[str]:
        fields = {'id': 1, 'do': do, **REQUESTS[do]}
        for name in fields:
            for value in VALUES:
                parts = {each: json.dumps(right) for each, right in fields.items()} | {name: value}
                yield '{%s}' % ', '.join(f'"{each}": {part}' for each, part in parts.items())
    target.page_sends([text for do in REQUESTS for text in texts(do)])
    target.page_sends(MALFORMED)


def http(target: Any) -> None:
    """Send requests that no browser makes."""
    for content in HTTP:
        target.request(content)


def clock(target: Any) -> None:
    """Let /clock jump [s] under a plant and an mpc that go by it."""
    for by in ([1000.0], [-500.0], [5.0, -5.0] * 5, [1e6]):
        target.jump(by)


ATTACKS: Sequence[Callable[[Any], None]] = (
    states, forces, announcements, shown, serialised, services, parameters, page, http, clock)

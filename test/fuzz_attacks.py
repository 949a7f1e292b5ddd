# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a stranger may send: for each entry the attacks that once broke something, then drawn ones.

Nothing here knows the package but by its topics, services, parameters, page and files.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
import json
import math
from pathlib import Path
import re
import time
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
import yaml

Rng = np.random.Generator
FLOATS = (0.0, -0.0, -1.0, math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 1e-9, 1e6, 1e9)
INTEGERS = (0, -1, 1, 2 ** 31, 2 ** 63 - 1, -2 ** 63, 1_000_000)
TEXTS = ('', 'x', '\0', 'é\N{PILE OF POO}', '.' * 100_000, '[' * 25_000, '{"a":' * 5000, '/', '..',
         '/dev/zero', '/proc/self/mem', 'nan', '1e400', 'FIFO', 'NESTED')
JOINTS = ('cart', 'joint1', 'joint2')
TOPICS = {'joint_states': JointState, 'force_command': Float64, 'disturbance': Float64,
          'mpc/plan': JointTrajectory, 'mpc/tries': PointCloud2, '/diagnostics': DiagnosticArray,
          'robot_description': String, 'configuration': String,
          'force_command_stamped': JointState, '/parameter_events': ParameterEvent}
SERVICES = {'plant/reset': Trigger, 'mpc/reset': Trigger, 'mpc/enable': SetBool,
            'plant/pause': SetBool, 'plant/step': Trigger}
# how a page asks, and the values of JSON that fields get in turn
REQUESTS: dict[str, dict[str, Any]] = {
    'pull': {'body': 0, 'along': 0.5, 'to': [0, 1]}, 'hold': {'force': 1}, 'push': {'force': 1},
    'release': {}, 'set': {'node': 'mpc', 'parameters': {'horizon': 30}},
    'preset': {'name': 'x'}, 'goal': {'name': 'up_up'}, 'reference': {'x': 0},
    'reset': {'node': 'mpc'}, 'enable': {'on': True}, 'pause': {'on': False}, 'step': {},
    'pace': {'pace': 1}, 'record': {'on': False}, 'history': {},
    'branch': {'at': 1, 'duration': 1}, 'seek': {'at': 1}, 'play': {'on': True, 'rate': 1},
    'do_not': {}, '__init__': {}}
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


class Step(NamedTuple):
    """One thing that a stranger does, and what it is in words."""

    what: str
    do: Callable[[Any], object]   # to a Target


class Entry(NamedTuple):
    """A way in: what is known to have broken something, and more of the kind by chance."""

    known: Sequence[Sequence[Step]]
    draw: Callable[[Rng], Sequence[Step]]


def step(what: object, do: Callable[..., object], *arguments: object) -> Step:
    """Return a step that calls a function with the target and these arguments."""
    return Step(f'{what!s:.120}', lambda target: do(target, *arguments))


# topics

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


def states() -> Entry:
    """Return states of others: of other joints, of ours, and of what is none."""
    gripper = joint_states(('finger_left', 'finger_right'), [0.01, 0.01])
    floods = [
        [step('a gripper at 100 Hz', send, 'joint_states', gripper, 100, 100.0)],
        [step('zeros of our joints at 100 Hz', send, 'joint_states', joint_states(JOINTS), 100,
              100.0)],
        [step('each state again', send, 'joint_states', lambda target: target.last_state, 50,
              50.0)]]
    odd: dict[str, Any] = {
        f'all positions {value}': joint_states(JOINTS, [value] * 3) for value in FLOATS}
    odd |= {'no joints': joint_states(()), 'no positions': joint_states(JOINTS, []),
            'one position': joint_states(JOINTS, [1.0]), 'no names': joint_states((), [1.0] * 3),
            'names twice': joint_states(JOINTS * 2),
            'no velocities': joint_states(JOINTS, velocity=[], effort=[]),
            'nan velocities': joint_states(JOINTS, velocity=[math.nan] * 3),
            '100,000 joints': joint_states([f'j{n}' for n in range(100_000)]),
            'a name of 1 MB': joint_states(['x' * 1_000_000, *JOINTS]),
            'a cart alone': joint_states(('cart',))}
    odd |= {f'stamp {sec}.{nanosec}': stamped(sec, nanosec) for sec, nanosec in (
        (-2 ** 31, 0), (2 ** 31 - 1, 999_999_999), (0, 1), (1, 2 ** 32 - 1), (-1, 5))}
    known = floods + [[step(name, send, 'joint_states', make) for name, make in odd.items()]]

    def draw(rng: Rng) -> list[Step]:
        count = int(rng.integers(0, 6))
        names = list(rng.choice([*JOINTS, 'x', ''], count)) if rng.random() < 0.6 else JOINTS
        values = [float(rng.choice([*FLOATS, rng.normal()]))
                  for _ in range(int(rng.integers(6)) if rng.random() < 0.3 else len(names))]
        return [step(f'{[str(name) for name in names]} at {values}', send, 'joint_states',
                     joint_states([str(name) for name in names], values),
                     int(rng.integers(1, 50)), float(rng.choice([20.0, 200.0])))]
    return Entry(known, draw)


def forces() -> Entry:
    """Return forces and pushes of others."""
    def attack(topic: str, value: float, count: int = 3, rate: float = 100.0) -> Step:
        return step(f'{topic} {value} times {count}', send, topic, Float64(data=value), count,
                    rate)
    names = ('disturbance', 'force_command')

    def draw(rng: Rng) -> list[Step]:
        value = float(rng.choice([*FLOATS, *(10.0 ** rng.uniform(-3, 30, 5))]))
        return [attack(str(rng.choice(names)), value, int(rng.integers(1, 300)),
                       float(rng.choice([0.0, 500.0])))]
    return Entry([[attack(name, value) for value in FLOATS] for name in names], draw)


def configuration(node: str, name: str, value: Any) -> Callable[[Any], String]:
    """Return what makes the announcement of a node with another field or parameter."""
    def make(target: Any) -> String:
        content = yaml.safe_load(target.announced[node])
        (content if name in content else content['parameters'])[name] = value
        return String(data=yaml.safe_dump(content))
    return make


def announcements() -> Entry:
    """Return announcements of others on `configuration`."""
    wrong: Sequence[Any] = (
        0.0, -1.0, 'abc', math.nan, math.inf, 1e308, None, [], {}, [1, 'x'], 10 ** 400, True,
        'x' * 100_000, 0)
    names = {'/plant': ('rate', 'lockstep', 'links', 'disturbance_limit', 'link1_length',
                        'force_limit', 'track_limit', 'node', 'revision', 'resets', 'since',
                        'parameters', 'packages', 'version'),
             '/mpc': ('links', 'joint_names', 'joint_signs', 'relative_angles', 'track_margin',
                      'solver', 'goal', 'cart_mass', 'step', 'dynamics', 'model')}
    texts = {'base 60': 'a: [' + ', '.join(['1' + ':59' * 8000] * 6) + ']',
             'many base 60': '\n'.join(f'k{n}: 190:20:30:15' for n in range(20_000)),
             'laughs': 'a: &a [x, x]\n' + '\n'.join(
                 f'{chr(98 + n)}: &{chr(98 + n)} [*{chr(97 + n)}, *{chr(97 + n)}]'
                 for n in range(24)),
             'nested': '[' * 5000, 'nested maps': '{a: ' * 5000, 'a list': '[1, 2]',
             'objects': '!!python/object/apply:os.system ["true"]', 'not text': '\0\1\ufffe',
             'a merge': 'a: &a {<<: *a}', 'unhashable': '{[a]: {b: c}}', 'a date': '0000-99-99',
             '1 MB': 'x: ' + '1' * 1_000_000, 'binary': '!!binary x', 'empty': '', 'dots': '...'}

    def attack(node: str, name: str, value: Any) -> Step:
        return step(f'{node} {name}: {value!r:.40}', send, 'configuration',
                    configuration(node, name, value))
    known = [[attack(node, name, value) for value in wrong]
             for node, several in names.items() for name in several]
    known += [[step(name, send, 'configuration', String(data=text), 3)]
              for name, text in texts.items()]
    known += [[step('1,000 announcements', send, 'configuration',
                    lambda target: String(data=target.announced['/mpc']), 1000, 5000.0)]]

    def draw(rng: Rng) -> list[Step]:
        def change(target: Any) -> String:
            text = bytearray(target.announced[str(rng.choice(list(names)))], 'utf-8')
            for place in rng.integers(len(text), size=int(rng.integers(1, 8))):
                text[place] = int(rng.choice(bytearray(b'0:-[]{}&*!.e\n \0\xff')))
            return String(data=text.decode(errors='replace'))
        return [step('an announcement with bytes changed', send, 'configuration', change, 5)]
    return Entry(known, draw)


def current(message: Any) -> Callable[[Any], Any]:
    """Return what gives a message the stamp of the newest state, so that pages show it."""
    def make(target: Any) -> Any:
        message.header.stamp = target.last_state.header.stamp
        return message
    return make


def shown() -> Entry:
    """Return plans, tries, diagnostics and descriptions of others, which pages show."""
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
        (1, 1, 0, 4), (3, 1, 4, 12), (1, 3, 16, 47), (2, 2, 2 ** 31, 64), (7, 11, 16, 1232))]
    clouds += [PointCloud2(width=2, height=2, point_step=16, data=b'\xff' * 64, is_bigendian=True)]
    keys = ('cost', 'estimate_cart_position', 'paused', 'solver', '', 'joint_states', 'revision')
    statuses = [
        DiagnosticArray(status=[DiagnosticStatus(
            level=level, name=name, message=text,
            values=[KeyValue(key=key, value=value) for key in keys])])
        for name in ('mpc', 'plant', 'mpc: topics', '/', '')
        for value in ('nan', '1' * 5000, 'x', '[1')
        for level, text in ((b'\xff', '\0'), (b'\0', 'x' * 10_000))]
    descriptions = [String(data=text) for text in (
        '', '<', '<robot/>', '<robot name="x">' * 3000, '<robot><link name="cart"/></robot>',
        '<!DOCTYPE a [' + ''.join(f'<!ENTITY e{n + 1} "&e{n};&e{n};&e{n};&e{n};">'
                                  for n in range(20)) + ']><robot>&e20;</robot>')]
    made = {'mpc/plan': plans, 'mpc/tries': clouds, '/diagnostics': statuses,
            'robot_description': descriptions}

    def show(target: Any, topic: str, message: Any) -> None:
        target.page_sends(['{"do": "history"}'])   # frames are made where a page is open
        send(target, topic, message, 5, 40.0)
    known = [[step(f'{topic} number {n}', show, topic, current(message)
                   if hasattr(message, 'header') and topic != '/diagnostics' else message)
              for n, message in enumerate(messages)] for topic, messages in made.items()]

    def draw(rng: Rng) -> list[Step]:
        cloud = PointCloud2(
            width=int(rng.integers(20)), height=int(rng.integers(20)), fields=fields,
            point_step=int(rng.integers(30)), data=rng.bytes(int(rng.integers(5000))))
        plan = JointTrajectory(points=[point(*map(float, rng.choice(FLOATS, rng.integers(5))))
                                       for _ in range(int(rng.integers(5)))])
        return [step('a cloud', show, 'mpc/tries', current(cloud)),
                step('a plan', show, 'mpc/plan', current(plan))]
    return Entry(known, draw)


def serialised() -> Entry:
    """Return messages of all topics whose bytes are no message."""
    def damaged(topic: str, rng: Rng) -> bytes:
        content = bytearray(serialize_message(
            joint_states(JOINTS)(None) if TOPICS[topic] is JointState else TOPICS[topic]()))
        if rng.random() < 0.5:
            return bytes(content[:rng.integers(4, len(content))])
        place = int(rng.integers(4, len(content)))
        content[place:place + 4] = rng.bytes(4) if rng.random() < 0.5 else b'\xff\xff\xff\x7f'
        return bytes(content)

    def attack(topic: str, rng: Rng) -> Step:
        data = damaged(topic, rng)
        return step(f'{topic} {data.hex()}', send, topic, data)
    return Entry([[attack(topic, np.random.default_rng(seed)) for seed in range(6)]
                  for topic in TOPICS],
                 lambda rng: [attack(str(rng.choice(list(TOPICS))), rng) for _ in range(10)])


# services and parameters

def services() -> Entry:
    """Return floods of services, and what nobody asks services of parameters for."""
    def flood(target: Any, name: str, count: int) -> None:
        kind = SERVICES[name]
        target.call_many(kind, name, [kind.Request(**({'data': bool(n % 2)} if kind is SetBool
                                                      else {})) for n in range(count)])

    names = ['', 'x' * 100_000, '\0', *['horizon'] * 1000]
    asked: dict[str, tuple[Any, dict[str, Any]]] = {
        'set_parameters': (SetParameters, {'parameters': [
            Parameter(name=name, value=ParameterValue(type=kind))
            for name in ('', 'x', 'horizon', 'rate') for kind in range(0, 256, 5)]}),
        'get_parameters': (GetParameters, {'names': names}),
        'describe_parameters': (DescribeParameters, {'names': names}),
        'list_parameters': (ListParameters, {'prefixes': names, 'depth': 2 ** 64 - 1})}

    def ask(target: Any, node: str, question: str) -> None:
        kind, fields = asked[question]
        # what rclpy itself trips over has no answer
        target.call_many(kind, f'{node}/{question}', [kind.Request(**fields)], 1.0)
    known = [[step(f'odd {question} to {node}', ask, node, question)]
             for question in asked for node in ('mpc', 'plant', 'console', 'logger')]
    known += [[step(f'{name} 40 times', flood, name, 40)] for name in SERVICES]
    return Entry(known, lambda rng: [step('a flood', flood, str(rng.choice(list(SERVICES))),
                                          int(rng.integers(1, 300)))])


def values_of(described: Any, folder: Path) -> Iterator[Any]:
    """Yield what a parameter of such a descriptor may be set to, and what it may not."""
    for limits in (*described.floating_point_range, *described.integer_range):
        yield from (limits.from_value, limits.to_value, 2 * limits.to_value)
    files = {'FIFO': str(folder / 'fifo'), 'NESTED': str(folder / 'nested.json')}
    texts = [files.get(text, text) for text in TEXTS]
    words = re.findall(r'\w+', described.additional_constraints)
    kinds: dict[int, Sequence[Any]] = {
        ParameterType.PARAMETER_DOUBLE: FLOATS, ParameterType.PARAMETER_INTEGER: INTEGERS,
        ParameterType.PARAMETER_STRING: [*texts, *words], ParameterType.PARAMETER_BOOL: [],
        ParameterType.PARAMETER_STRING_ARRAY: [[], ['x'], [''] * 3, ['ddp'] * 2, ['\0'] * 9000],
        ParameterType.PARAMETER_DOUBLE_ARRAY: [[], [0.0], [math.nan] * 6, [1e308] * 6, [-1.0] * 3,
                                               [math.inf] * 6, [0.0] * 100_000]}
    yield from kinds.get(described.type, FLOATS)
    yield from (True, False, 1, 1.5, 'x', ['x'], [1.5], b'\0\xff', [True])


def parameter(name: str, value: Any) -> Parameter:
    """Return a parameter for the wire; the type is that of the value."""
    kinds = {bool: ('BOOL', 'bool_value'), int: ('INTEGER', 'integer_value'),
             float: ('DOUBLE', 'double_value'), str: ('STRING', 'string_value')}
    if isinstance(value, bytes):
        fields = {'type': ParameterType.PARAMETER_BYTE_ARRAY,
                  'byte_array_value': [bytes([each]) for each in value]}
    elif isinstance(value, list):
        kind, field = kinds[type(value[0]) if value else float]
        fields = {'type': getattr(ParameterType, f'PARAMETER_{kind}_ARRAY'),
                  field.replace('_value', '_array_value'): value}
    else:
        kind, field = kinds[type(value)]
        if kind == 'INTEGER':
            value = min(max(value, -2 ** 63), 2 ** 63 - 1)
        fields = {'type': getattr(ParameterType, f'PARAMETER_{kind}'), field: value}
    return Parameter(name=name, value=ParameterValue(**fields))


def parameters(described: dict[tuple[str, str], Any], folder: Path) -> Entry:
    """Return all parameters of all nodes, set to all that their descriptors bring to mind."""
    def change(node: str, name: str, values: Sequence[Any], patience: float) -> Step:
        beside = {'model': [parameter('dynamics', 'learned')],
                  'mppi.samples': [parameter('solver', 'mppi')]}.get(name, [])
        text = ', '.join(f'{value!r:.30}' for value in values)
        return step(f'{node} {name}: {text}', lambda target: target.change(
            node, [[*beside, parameter(name, value)] for value in values], patience))
    names = list(described)
    wanted = {key: list(values_of(described[key], folder)) for key in names}
    paths = [[change('mpc', 'model', [value], 2.0)] for value in (
        str(folder / 'nested.json'), str(folder / 'fifo'), '/dev/zero', '[' * 25_000)]
    bounds = [[change(node, name, [limits.from_value], 0.5)] for (node, name), of in
              described.items() for limits in of.floating_point_range
              if node in ('plant', 'mpc') and re.search('mass|length|inertia|step|rate', name)]
    # of all that each may be set to, both bounds and some of the rest
    several = [[change(*key, wanted[key][:2] + wanted[key][2::4], 0.0) for key in names[n:n + 8]]
               for n in range(0, len(names), 8)]

    def draw(rng: Rng) -> list[Step]:
        key = names[rng.integers(len(names))]
        return [change(*key, [wanted[key][rng.integers(len(wanted[key]))]], 2.0)]
    return Entry([*paths, *several, *bounds], draw)


# the page

def page() -> Entry:
    """Return what pages may send, wrong in each field of each request."""
    def texts(do: str) -> Iterator[tuple[str, str]]:
        fields = {'id': 1, 'do': do, **REQUESTS[do]}
        for name in fields:
            for value in VALUES:
                parts = {each: json.dumps(right) for each, right in fields.items()} | {name: value}
                yield f'{do} {name}: {value:.40}', '{%s}' % ', '.join(
                    f'"{each}": {part}' for each, part in parts.items())

    def talk(target: Any, several: Sequence[str | bytes]) -> None:
        target.page_sends(several)
    known = [[step(what, talk, [text]) for what, text in texts(do)] for do in REQUESTS]
    known += [[step(f'malformed {text[:20]!r}', talk, [text]) for text in MALFORMED]]

    def draw(rng: Rng) -> list[Step]:
        do = str(rng.choice(list(REQUESTS)))
        found = [text for _, text in texts(do)]
        text = bytearray(found[rng.integers(len(found))][:65_000], 'utf-8')
        for place in rng.integers(len(text), size=int(rng.integers(0, 4))):
            text[place] = int(rng.choice(bytearray(b'0123456789e-"{}[],:\\ud8')))
        return [step(f'{do} with changes', talk, [text.decode(errors='replace')])]
    return Entry(known, draw)


def http() -> Entry:
    """Return requests that no browser makes."""
    def draw(rng: Rng) -> list[Step]:
        content = bytearray(HTTP[rng.integers(len(HTTP))])
        for place in rng.integers(len(content), size=3):
            content[place] = int(rng.integers(256))
        return [step(bytes(content[:80]), lambda target: target.request(bytes(content)))]
    return Entry([[step(text[:80], lambda target, text=text: target.request(text))
                   for text in HTTP]], draw)


def clock() -> Entry:
    """Return jumps of /clock [s] under a plant and an mpc that go by it."""
    def jump(*by: float) -> Step:
        return step(f'/clock jumps by {by}', lambda target: target.jump(by))
    return Entry([[jump(1000.0)], [jump(-500.0)], [jump(*[5.0, -5.0] * 20)], [jump(1e6)],
                  [jump(1.7e9)], [jump(-1e12)]],
                 lambda rng: [jump(*(rng.choice([-1, 1], 3) * 10.0 ** rng.uniform(-1, 9, 3)))])

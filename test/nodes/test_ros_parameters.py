# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import contextlib
import dataclasses
import math
import sys

import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParametersAtomically
import rclpy
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import get_parameter_value, Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from dp_swing_ros import declarations
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.nodes import ros_parameters
from dp_swing_ros.nodes.ros_parameters import allow_changes, check_given, declare
from dp_swing_ros.parameters import named, parameter, ParameterError, Parameters, shown
from dp_swing_ros.parameters.console import ConsoleParameters
from dp_swing_ros.parameters.files import value_of
from dp_swing_ros.pendulum.state import joints, LINKS
from dp_swing_ros.tools.parameters import table

SCALARS = (bool, int, float, str)


@dataclasses.dataclass(frozen=True)
class Example(Parameters):
    rate: float = parameter(20.0, 'states per second', unit='Hz', minimum=1.0, maximum=1000.0)
    bound: float = parameter(1.0, 'a bound', finite=False)
    samples: int = parameter(5, 'number of samples', minimum=1)
    weights: tuple[float, ...] = parameter(
        (1.0, 2.0, 3.0, 4.0), 'weights', minimum=0.0, size={1: 4})
    names: tuple[str, ...] = parameter(('a', 'b'), 'names')
    kind: str = parameter('rk4', 'the kind', choices=lambda: ['rk4', 'euler'])
    fast: bool = parameter(False, 'in a hurry')
    fixed: int = parameter(3, 'a number of links', live=False)


@pytest.fixture
def make_node(tmp_path):
    """Return a function that makes a node with these ROS arguments."""
    nodes = []

    def make(*arguments):
        rclpy.init(args=['--ros-args', *arguments],
                   signal_handler_options=SignalHandlerOptions.NO)
        nodes.append(Node('example'))
        return nodes[0]

    yield make
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()


def declare_example(node, prefix=''):
    """Declare the example for one link; return its values."""
    values = declare(node, {prefix + name: field for name, field in named(Example).items()})
    return Example(**{name.removeprefix(prefix): value for name, value in values.items()})


def declare_pendulum(node, kind):
    fields = declarations.DECLARATIONS[kind].fields_for(ros_parameters.overrides(node))
    return declare(node, fields)


def given(*pairs):
    return [argument for pair in pairs for argument in ('-p', pair)]


def test_defaults(make_node):
    node = make_node()
    assert declare_example(node) == Example()
    assert node.get_parameter('weights').value == [1.0, 2.0, 3.0, 4.0]


def test_a_secret_is_for_its_node_alone(make_node, monkeypatch, capfd):
    told, fields = [], named(ConsoleParameters)
    monkeypatch.setattr(Configuration, 'to_text', lambda self: told.append(self) or '')
    node = make_node(*given('token:=xyzzy', 'port:=1234'))
    values = declare(node, fields, live=True)
    assert (values['token'], node.get_parameter('token').value) == ('xyzzy', '')
    assert [each.parameters['port'] for each in told] == [1234]
    assert 'xyzzy' not in repr(told)
    ros_parameters.allow_changes(node, fields, values, lambda _: None)
    for guess in ('plugh', 'xyzzy'):   # neither is an answer that tells which is right
        with pytest.raises(ParameterNotDeclaredException, match='read-only'):
            node.set_parameters([Parameter('token', value=guess)])
    output = ''.join(capfd.readouterr())
    assert 'xyzzy' not in output and 'plugh' not in output


def test_a_secret_that_is_none_is_not_told_either(make_node):
    with pytest.raises(ParameterError, match='a secret') as error:
        declare(make_node(*given('token:=12345')), named(ConsoleParameters))
    assert '12345' not in str(error.value)


def test_values_of_every_type(make_node):
    node = make_node(*given('rate:=5.5', 'bound:=.inf', 'samples:=7',
                            'weights:=[3.0, 4.0, 5.0, 6.0]', 'names:=[x]', 'kind:=euler',
                            'fast:=true'))
    assert declare_example(node) == Example(
        5.5, math.inf, 7, (3.0, 4.0, 5.0, 6.0), ('x',), 'euler', True)


def test_whole_numbers_will_do_for_numbers(make_node):
    node = make_node(*given('rate:=5', 'weights:=[3, 4, 5, 6]'))
    example = declare_example(node)
    assert (example.rate, example.weights) == (5.0, (3.0, 4.0, 5.0, 6.0))
    assert node.get_parameter('rate').type_ is Parameter.Type.DOUBLE


TEXTS = [
    *'1 -1 +1 1. .5 +.001 1e4 1.e4 1.0e4 1E4 1e+4 .inf inf -.inf +.inf Inf nan .NaN 010 0x10 0b1 '
    '1_000 1:30 9223372036854775807 9223372036854775808 1e400 1e-400 true Yes Y n off On oN null '
    '~ "1" 2020-01-01 = << [1,2] [1.0,2.0] [1,2.0] [1.0,2] [inf,.inf,1.0] [true,yes] [true,1] '
    '[a,b] [a,"1"] [a,1] [] 0x1p3 1e 08 -0.0 1d . - --1 \u0661 \xe9'
    .split(), '{a: 1}', '', '""', 'a b', ' 1', '1 #2', '| \n 3']


def test_our_own_reading_is_that_of_ros():
    """What tools take of a command line or file is what a node takes; for the same they refuse."""
    for text in TEXTS:
        with contextlib.ExitStack() as stack:
            stack.callback(rclpy.try_shutdown)
            try:
                rclpy.init(args=['--ros-args', '-p', f'a:={text}'],
                           signal_handler_options=SignalHandlerOptions.NO)
                node = Node('example')
                stack.callback(node.destroy_node)
                found = ros_parameters.overrides(node)['a']
            except RuntimeError:
                with pytest.raises(ParameterError):
                    value_of(text)
                continue
        ours = value_of(text)
        assert repr(ours) == repr(found if isinstance(found, SCALARS) else list(found)), text


@pytest.mark.parametrize('rule, words', [
    ('a.weights:=[0, 3.14, 1, 2]',
     "parameter 'a.weights' is [0, 3.14, 1, 2]; ROS wants the values of a list alike: "
     '[0.0, 3.14, 1.0, 2.0]'),
    ('node:a:=[x, 1]', "parameter 'a' is ['x', 1]; ROS wants the values of a list alike"),
    ('a:=', "parameter 'a' is None; expected a value"),
    ('a:={b: 1}', "parameter 'a' is {'b': 1}; expected a value")])
def test_what_ros_cannot_read_is_named_with_a_remedy(tmp_path, rule, words):
    name, value = rule.rsplit(':', 2)[-2], rule.split(':=')[1]
    file = tmp_path / 'a.yaml'
    file.write_text(f'/**/plant:\n  ros__parameters:\n    {name}: {value}\n')
    for arguments in (['-p', rule], ['--params-file', str(file)]):
        if value.startswith('{') and '-p' not in arguments:
            continue   # in a file it is a:b
        with pytest.raises(RuntimeError):
            remove_ros_args(['plant', '--ros-args', *arguments])
        with pytest.raises(ParameterError) as error:
            check_given(['plant', '--ros-args', *arguments])
        assert words in str(error.value)


def test_prefix_file_and_empty_list(make_node, tmp_path):
    file = tmp_path / 'example.yaml'
    file.write_text('example:\n  ros__parameters:\n'
                    '    mppi:\n      samples: 9\n      names: []\n')
    node = make_node('--params-file', str(file))
    assert declare_example(node, 'mppi.') == Example(samples=9, names=())


@pytest.mark.parametrize('wrong, text', [
    ('rate:=0.5', r"'mppi.rate' is 0.5; expected at least 1 Hz, at most 1000 Hz "
     r'\(states per second\)'),
    ('rate:=1001.0', 'at most 1000 Hz'),
    ('rate:=.nan', 'a finite number'),
    ('rate:=.inf', 'a finite number'),
    ('bound:=.nan', 'a finite number'),
    ('rate:=fast', 'a number'),
    ('rate:=true', 'a number'),
    ('samples:=0', 'at least 1'),
    ('samples:=1.5', 'a whole number'),
    ('samples:=true', 'a whole number'),
    ('weights:=[1.0]', 'a list of 4 numbers'),
    ('weights:=[]', 'a list of 4 numbers'),
    ('weights:=12', 'a list of 4 numbers'),
    ('weights:=ab', 'a list of 4 numbers'),
    ("weights:=['1', '2', '3', '4']", 'a list of 4 numbers'),
    ('weights:=[1.0, -1.0, 1.0, 1.0]', 'at least 0'),
    ('names:=[1, 2]', 'a list, each a text'),
    ('names:=a', 'a list, each a text'),
    ('kind:=rk5', 'one of rk4, euler'),
    ('kind:=5', 'a text'),
    ('fast:=1', 'true or false'),
])
def test_bad_value_is_refused(make_node, wrong, text):
    node = make_node(*given(f'mppi.{wrong}'))
    with pytest.raises(ParameterError, match=text):
        declare_example(node, 'mppi.')


def test_unknown_name_is_refused_with_the_choices(make_node):
    node = make_node(*given('smaples:=5'))
    with pytest.raises(ParameterError) as caught:
        declare_example(node)
    assert str(caught.value) == (
        "unknown parameter 'smaples' of the node 'example'; did you mean 'samples'?")


def test_where_no_name_is_near_all_are_listed(make_node):
    with pytest.raises(ParameterError, match='available: bound, fast, fixed, kind, names, rate, '):
        declare_example(make_node(*given('xyzzy:=5')))


def test_a_node_whose_parameters_stay_names_an_unknown_one_that_is_set(make_node):
    node = make_node()
    declare_example(node)
    with pytest.raises(ParameterNotDeclaredException, match="'smaples'.* did you mean 'samples'"):
        node.set_parameters([Parameter('smaples', value=3)])


@pytest.mark.parametrize('section, warned', [
    ('/**/exmaple', True), ('/rig/example', True), ('/**/example', False), ('/**', False)])
def test_a_file_that_holds_nothing_for_a_node_is_warned_of(
        section, warned, make_node, tmp_path, monkeypatch, capfd):
    file = tmp_path / 'file.yaml'
    file.write_text(f'{section}:\n  ros__parameters: {{samples: 3}}\n')
    monkeypatch.setattr('sys.argv', ['example', '--ros-args', '--params-file', str(file)])
    declare_example(make_node('--params-file', str(file)))
    text = f'{file} holds nothing for /example, but for {section}'
    assert (text in ''.join(capfd.readouterr())) == warned


def test_parameters_of_other_nodes_are_not_meant(make_node):
    node = make_node(*given('other:smaples:=5'))
    declare_example(node)


@pytest.mark.parametrize('own, more, refused', [
    ('', [], False), ('example:\n  ros__parameters: {smaples: 5}\n', [], True),
    ('', ['-p', 'smaples:=5'], True), ('', ['-p', 'example:smaples:=5'], True)])
def test_unknown_names_for_any_node_are_for_others_unless_told_to_this_one(
        make_node, tmp_path, monkeypatch, own, more, refused):
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**:\n  ros__parameters: {smaples: 5}\n' + own)
    arguments = ['--params-file', str(file), *more]
    monkeypatch.setattr(sys, 'argv', ['example', '--ros-args', *arguments])
    node = make_node(*arguments)
    with pytest.raises(ParameterError) if refused else contextlib.nullcontext():
        declare_example(node)


def test_descriptors_tell_everything(make_node):
    node = make_node()
    declare_example(node)
    rate, samples = node.describe_parameter('rate'), node.describe_parameter('samples')
    assert rate.description == 'states per second [Hz] (default: 20)'
    assert rate.read_only
    assert (rate.floating_point_range[0].from_value,
            rate.floating_point_range[0].to_value) == (1.0, 1000.0)
    assert (samples.integer_range[0].from_value,
            samples.integer_range[0].to_value) == (1, 2 ** 63 - 1)
    assert node.describe_parameter('kind').additional_constraints == 'one of rk4, euler'
    assert node.describe_parameter('weights').additional_constraints == \
        '2 numbers and 2 a link, each at least 0'


def test_values_do_not_change_at_run_time(make_node):
    node = make_node()
    declare_example(node)
    result = node.set_parameters([Parameter('rate', value=5.0)])[0]
    assert not result.successful
    assert node.get_parameter('rate').value == 20.0


@pytest.fixture
def ask(make_node):
    """Return what asks a node for changes as `ros2 param` does, and returns why it refuses."""
    node, fields = make_node(), named(Example)
    allow_changes(node, fields, declare(node, fields, live=True), lambda values: Example(**values))
    client = node.create_client(SetParametersAtomically, 'example/set_parameters_atomically')

    def ask(**values):
        future = client.call_async(SetParametersAtomically.Request(parameters=[
            ParameterMessage(name=name, value=get_parameter_value(text))
            for name, text in values.items()]))
        rclpy.spin_until_future_complete(node, future, timeout_sec=30)
        return future.result().result.reason
    yield node, ask


def test_a_running_node_takes_numbers_as_people_write_them(ask):
    node, change = ask
    for name, text, value in [
            ('rate', '1e1', 10.0), ('rate', '1.e1', 10.0), ('rate', '3', 3.0),
            ('bound', 'inf', math.inf), ('bound', '-.inf', -math.inf), ('bound', '+.001', 0.001),
            ('bound', '1.0e4', 1e4), ('samples', '0x10', 16), ('fast', 'y', True),
            ('weights', '[1, 2, 3, 4]', [1.0, 2.0, 3.0, 4.0]), ('names', '[]', []),
            ('weights', '[1e0, 2.e0, 3e0, 4e0]', [1.0, 2.0, 3.0, 4.0])]:
        assert change(**{name: text}) == '', text
        found = node.get_parameter(name).value
        assert (found if isinstance(found, SCALARS) else list(found)) == value


@pytest.mark.parametrize('name, text, words', [
    ('rate', 'inf', 'a finite number'), ('rate', 'x', 'expected a number'),
    ('rate', '5e3', 'at most 1000 Hz'), ('samples', '1e1', 'expected a whole number'),
    ('weights', '[1, 2.0, 3, 4]', 'alike: [1.0, 2.0, 3.0, 4.0]'), ('weights', '7', 'of 4 numbers'),
    ('kind', '5', 'expected a text'), ('smaples', '5', "did you mean 'samples'"),
    ('fixed', '4', 'read-only while the node runs: fixed')])
def test_a_running_node_refuses_in_words_and_changes_nothing(ask, name, text, words):
    node, change = ask
    why = change(bound='5.0', **{name: text})
    assert words in why and name in why
    assert node.get_parameter('bound').value == 1.0


def test_what_stays_may_be_said_again(ask):
    node, change = ask
    assert change(fixed='3', bound='5.0') == ''
    assert node.get_parameter('bound').value == 5.0


@pytest.mark.parametrize('kind', declarations.DECLARATIONS)
@pytest.mark.parametrize('links', LINKS)
def test_shown_defaults_can_be_pasted(make_node, kind, links):
    fields = declarations.DECLARATIONS[kind].fields(links)
    rules = [f'links:={links}', *(f'{name}:={shown(field.default)}'
                                  for name, field in fields.items()
                                  if isinstance(field.default, tuple))]
    values = declare_pendulum(make_node(*given(*rules)), kind)
    for name, value in values.items():
        if isinstance(value, tuple):   # an empty text stands for an empty list
            assert value == tuple(each for each in fields[name].default if each != '')


@pytest.mark.parametrize('links', LINKS)
@pytest.mark.parametrize('kind', declarations.DECLARATIONS)
def test_a_pendulum_has_the_parameters_of_its_links(make_node, kind, links):
    node = make_node(*given(f'links:={links}'))
    values = declare_pendulum(node, kind)
    assert values == declarations.DECLARATIONS[kind].complete({'links': links})
    for name in ('link{}_mass', 'link{}_length', 'link{}_inertia_factor', 'joint{}_friction'):
        assert [node.has_parameter(name.format(i)) for i in LINKS] == [i <= links for i in LINKS]
    listed = 'initial_state' if kind == 'plant' else 'reference'
    assert len(node.get_parameter(listed).value) == 2 * len(joints(links))


@pytest.mark.parametrize('pairs, words', [
    (['link3_mass:=0.5'], ("'link3_mass'", '3 links', 'has 2', 'parameter links')),
    (['links:=1', 'joint2_friction:=0.1'], ("'joint2_friction'", '2 links', 'has 1')),
    (['links:=4'], ("'links' is 4", 'at most 3')),
    (['links:=3', 'initial_state:=[0.0, 0.0, 0.0, 0.0]'], ('initial_state', '8 numbers'))])
def test_what_a_pendulum_of_so_many_links_lacks_is_refused(make_node, pairs, words):
    node = make_node(*given(*pairs))
    with pytest.raises(ParameterError) as caught:
        declare_pendulum(node, 'plant')
    assert all(word in str(caught.value) for word in words), caught.value


def test_table():
    fields = {f'mppi.{name}': field for name, field in named(Example).items()}
    assert table(fields).splitlines() == [
        '| parameter | default | unit | range | description |',
        '| --- | --- | --- | --- | --- |',
        '| `mppi.rate` | `20` | Hz | at least 1, at most 1000 | states per second |',
        '| `mppi.bound` | `1` |  |  | a bound |',
        '| `mppi.samples` | `5` |  | at least 1 | number of samples |',
        '| `mppi.weights` | `[1.0, 2.0, 3.0, 4.0]` |  | 2 numbers and 2 a link, each at least 0 | '
        'weights |',
        '| `mppi.names` | `[a, b]` |  |  | names |',
        '| `mppi.kind` | `rk4` |  | one of rk4, euler | the kind |',
        '| `mppi.fast` | `false` |  |  | in a hurry |',
        '| `mppi.fixed` | `3` |  |  | a number of links; stays |']


def test_whatever_a_change_raises_refuses_it_and_what_fails_later_is_put_back(make_node):
    node, fields, asked = make_node(), named(Example), []
    before = declare(node, fields, live=True)

    def change(values):
        asked.append(values)
        if values['samples'] > 5:
            raise (RecursionError, MemoryError, SystemExit)[values['samples'] - 6]('too much')
    put_back = allow_changes(node, fields, before, change)
    for samples, name in ((6, 'RecursionError'), (7, 'MemoryError'), (8, 'SystemExit')):
        result, = node.set_parameters([Parameter('samples', value=samples)])
        assert (result.successful, result.reason) == (False, f'refused: {name}: too much')
    with pytest.raises(ParameterNotDeclaredException, match='expected a list'):   # for rclpy
        node.set_parameters([Parameter('weights', value=3)])
    result = node.set_parameters_atomically(
        [Parameter('samples', value=4), Parameter('rate', value=5.0)])
    assert result.successful and asked[-1]['rate'] == 5.0
    count = len(asked)
    put_back(before)
    assert [node.get_parameter(name).value for name in ('samples', 'rate')] == [5, 20.0]
    assert len(asked) == count
    assert node.set_parameters([Parameter('samples', value=4)])[0].successful
    assert asked[-1] == {**before, 'samples': 4}

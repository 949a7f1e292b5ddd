# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The layouts for Foxglove and PlotJuggler: whole, and of what a bag really holds."""

import json
import math
from pathlib import Path
import re
from xml.etree import ElementTree

import pytest

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.topics import TOPICS

CONFIG = Path(__file__).parents[1] / 'config'
NAMES = ['/' + topic.name.lstrip('/') for topic in TOPICS]
FOXGLOVE = json.loads((CONFIG / 'foxglove.json').read_text())
PLOTJUGGLER = ElementTree.parse(CONFIG / 'plotjuggler.xml').getroot()
PANELS = {'3D', 'Plot', 'DiagnosticSummary', 'DiagnosticStatusPanel'}
PATHS = [path['value'] for panel in FOXGLOVE['configById'].values()
         for path in panel.get('paths', [])]
CURVES = [curve.get('name') for curve in PLOTJUGGLER.iter('curve')]
COLOUR = re.compile(r'#[0-9a-f]{6}')
# of Foxglove's message paths: .field, [index], [first:last] and {field=="text"}
PART = re.compile(r'\.(?P<field>\w+)|\[(?P<index>-?\d+)\]|\[(?P<slice>:)\]'
                  r'|\{(?P<key>\w+)=="(?P<text>[^"]*)"\}')


@pytest.fixture(scope='module')
def messages(lockstep_bag):
    """Return the messages of a real run by topic."""
    bag = Bag(lockstep_bag)
    found = {name: [] for name in bag.topics}
    for entry in bag.entries:
        found[entry.topic].append(bag.decoded(entry))
    return found


def topic_of(path):
    """Return the topic that a message path or a series begins with."""
    found = [name for name in NAMES if re.match(re.escape(name) + r'[./\[]', path)]
    assert found, f'{path} begins with none of {NAMES}'
    return max(found, key=len)


def resolved(path, message):
    """Return the values that a path of Foxglove, without its topic, has in a message."""
    values, place = [message], 0
    while place < len(path):
        part = PART.match(path, place)
        assert part, f'{path[place:]!r} of {path!r} is no message path'
        place = part.end()
        if part['field']:
            values = [getattr(value, part['field']) for value in values]
        elif part['index']:
            values = [value[int(part['index'])] for value in values]
        elif part['slice']:
            values = [element for value in values for element in value]
        else:
            values = [value for value in values if getattr(value, part['key']) == part['text']]
    return values


def leaves(layout):
    """Return the panels of a layout as they lie in its splits."""
    if isinstance(layout, str):
        return [layout]
    assert set(layout) == {'direction', 'splitPercentage', 'first', 'second'}
    assert layout['direction'] in ('row', 'column') and 0 < layout['splitPercentage'] < 100
    return leaves(layout['first']) + leaves(layout['second'])


def test_foxglove_layout_is_whole():
    assert list(FOXGLOVE) == ['configById', 'globalVariables', 'userNodes', 'playbackConfig',
                              'layout']
    shown = leaves(FOXGLOVE['layout'])
    assert sorted(shown) == sorted(FOXGLOVE['configById'])
    assert {panel.split('!')[0] for panel in shown} == PANELS


def test_foxglove_plots_have_what_they_need():
    for name, panel in FOXGLOVE['configById'].items():
        if name.startswith('Plot!'):
            assert panel['title'] and panel['paths']
            assert panel['xAxisVal'] in ('timestamp', 'index')
            for path in panel['paths']:
                assert path['enabled'] and path['label'] and COLOUR.fullmatch(path['color'])
                assert path['timestampMethod'] == 'receiveTime'  # a Float64 has no other


@pytest.mark.parametrize('path', PATHS)
def test_path_leads_to_numbers(path, messages):
    topic = topic_of(path)
    values = [value for message in messages[topic]
              for value in resolved(path.removeprefix(topic), message)]
    assert len(values) > 90  # of the hundred ticks of the run
    # Foxglove plots a text that is a number, too
    assert all(math.isfinite(float(value)) for value in values)


def test_foxglove_draws_the_pendulum_and_its_diagnostics(messages):
    panels = FOXGLOVE['configById']
    urdf, = [layer for layer in panels['3D!pendulum']['layers'].values()
             if layer['layerId'] == 'foxglove.Urdf']
    robot = ElementTree.fromstring(messages[urdf['topic']][0].data)
    assert panels['3D!pendulum']['followTf'] in [link.get('name') for link in robot.iter('link')]
    joints = [joint.get('name') for joint in robot.iter('joint') if joint.find('mimic') is None]
    assert messages[urdf['jointStatesTopic']][0].name == joints
    detail = panels['DiagnosticStatusPanel!mpc']
    assert (detail['selectedHardwareId'], detail['selectedName']) in {
        (status.hardware_id, status.name)
        for message in messages[detail['topicToRender']] for status in message.status}
    assert panels['DiagnosticSummary!all']['topicToRender'] in messages


def flattened(value, name):
    """Return the numbers in a message as PlotJuggler names those of any type."""
    if isinstance(value, (int, float)):
        return {name: value}
    if isinstance(value, list):
        parts = [(f'{name}[{index}]', part) for index, part in enumerate(value)]
    else:
        parts = [(f'{name}/{field}', getattr(value, field))
                 for field in getattr(value, '__slots__', ())]
    return {key: number for path, part in parts for key, number in flattened(part, path).items()}


def series(messages):
    """Return the series that PlotJuggler makes of a bag; it has parsers for two of the types."""
    found = {}
    for message in messages['/joint_states']:
        for index, joint in enumerate(message.name):
            for field in ('position', 'velocity', 'effort'):
                found[f'/joint_states/{joint}/{field}'] = getattr(message, field)[index]
    for message in messages['/diagnostics']:
        for status in message.status:
            for pair in status.values:
                found[f'/diagnostics/{status.name}/{pair.key}'] = pair.value
    for topic in ('/force_command', '/mpc/plan'):
        for message in messages[topic]:
            found.update(flattened(message, topic))
    return found


@pytest.mark.parametrize('curve', CURVES)
def test_curve_is_a_series_of_numbers(curve, messages):
    topic_of(curve)
    assert math.isfinite(float(series(messages)[curve]))


def test_plotjuggler_layout_is_whole():
    assert [child.tag for child in PLOTJUGGLER] == [
        'tabbed_widget', 'use_relative_time_offset', 'Plugins', 'customMathEquations', 'snippets']
    *tabs, current = PLOTJUGGLER.find('tabbed_widget')
    assert int(current.get('index')) < len(tabs)
    for tab in tabs:
        assert tab.tag == 'Tab' and tab.get('tab_name') and int(tab.get('containers')) == len(tab)
        for splitter in tab.iter('DockSplitter'):
            sizes = [float(size) for size in splitter.get('sizes').split(';')]
            assert len(splitter) == int(splitter.get('count')) == len(sizes)
            assert sum(sizes) == pytest.approx(1.0)
            assert splitter.get('orientation') in ('-', '|')
    areas = list(PLOTJUGGLER.iter('DockArea'))
    assert areas and all(area.get('name') and [plot.tag for plot in area] == ['plot']
                         for area in areas)
    for plot in PLOTJUGGLER.iter('plot'):
        assert plot.get('mode') == 'TimeSeries'
        assert plot.find('range') is not None and plot.find('limitY') is not None
        assert all(COLOUR.fullmatch(curve.get('color')) for curve in plot.iter('curve'))

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from base64 import b64encode
import dataclasses
from hashlib import sha256
from html.parser import HTMLParser
import json
import math

from chromium import CHROMIUM, DRIVER, Page
import numpy as np
from PIL import Image
import pytest
from recorded_runs import told, write_bag
from synthetic import first, resized, swing_up, without_ticks

from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.figures import style
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.report.page import page, Shown
from dp_swing_ros.report.recording import named, recording

VOID = {'img', 'input', 'link', 'meta'}


class Strict(HTMLParser):
    """Reads a page; every element must be closed in turn, every attribute be there once."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.texts = [], [], {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        assert len(dict(attributes)) == len(attributes), attributes
        self.elements.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.setdefault(self.open[-1] if self.open else '', []).append(data)

    def of(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]

    def text(self, tag):
        return [' '.join(text.split()) for text in self.texts.get(tag, [])]


def png(folder, name):
    path = folder / f'{name}.png'
    Image.new('L', (4, 3)).save(path)
    return path


def shown(folder, episodes, configurations=()):
    """Record episodes and return them with a picture each."""
    runs = named([recording(write_bag(episode, folder / f'bag{n}', configurations))
                  for n, episode in enumerate(episodes)])
    pictures = {name: png(folder, name) for name in ('hero', 'timeline')}
    return {name: Shown(run, pictures) for name, run in runs.items()}


def unlimited(episode):
    limits = dataclasses.replace(episode.limits, force_limit=math.inf, track_limit=math.inf)
    X = episode.X.copy()
    X[10] = math.nan
    return dataclasses.replace(episode, limits=limits, X=X)


# the colour at a share of the length of a link, in the first frame
COLOUR_AT = """
  const run = JSON.parse(document.querySelector('.player script').textContent);
  const pen = document.querySelector('.player canvas').getContext('2d');
  const [link, share] = arguments, [from, to] = run.joints[0].slice(link, link + 2);
  const place = new DOMPoint(...from.map((start, i) => start + share * (to[i] - start)));
  const {x, y} = place.matrixTransform(pen.getTransform());
  const {data} = pen.getImageData(Math.round(x), Math.round(y), 1, 1);
  return '#' + [...data].slice(0, 3).map(part => part.toString(16).padStart(2, '0')).join('');
"""
HOSTILE = '</title><script>alert(1)</script>" onload="x'
CASES = {
    'one': [swing_up()], 'short': [first(swing_up(), 2)],
    'no controller': [without_ticks(swing_up())], 'unlimited': [unlimited(swing_up())],
    'several': [swing_up(), swing_up(solver='ddp'), without_ticks(swing_up())],
    'hostile': [swing_up(solver=HOSTILE), swing_up(solver='<b>')]}


@pytest.mark.parametrize('case', CASES)
def test_page_is_well_formed_and_fetches_nothing(case, tmp_path):
    told_of = [told('mpc', {'horizon': 12, '<i>': '</script><script>alert(2)</script>'})]
    runs = shown(tmp_path, CASES[case], told_of)
    text = page(runs, png(tmp_path, 'overlay') if len(runs) > 1 else None)
    assert text.startswith('<!DOCTYPE html>\n<html lang="en">')
    strict = Strict(text)
    images = strict.of('img')
    assert len(images) == 2 * len(runs) + (len(runs) > 1)
    assert all(image['alt'] and image['src'].startswith('data:image/') for image in images)
    identities = [attributes['id'] for _, attributes in strict.elements if 'id' in attributes]
    assert len(set(identities)) == len(identities) == len(runs)
    for tag, attributes in strict.elements:
        assert tag not in ('link', 'iframe', 'object', 'b', 'i')
        assert not any(name.startswith('on') or name == 'action' for name in attributes)
        if 'href' in attributes:
            assert attributes['href'].removeprefix('#') in identities
    assert 'http:' not in text and 'https:' not in text and 'url(' not in text
    # the data of each run, and the one script that the page lets run
    scripts = strict.of('script')
    assert [script.get('type') for script in scripts] == ['application/json'] * len(runs) + [None]
    assert not any('src' in script for script in scripts)


def test_browser_is_told_to_run_no_script_but_the_player(tmp_path):
    strict = Strict(page(shown(tmp_path, [swing_up()])))
    policy = next(each['content'] for each in strict.of('meta')
                  if each.get('http-equiv') == 'Content-Security-Policy')
    digest = b64encode(sha256(strict.texts['script'][-1].encode()).digest()).decode()
    assert policy == ("default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
                      f"script-src 'sha256-{digest}'")


def test_name_of_a_solver_is_text(tmp_path):
    strict = Strict(page(shown(tmp_path, [swing_up(solver=HOSTILE)])))
    assert strict.text('h1') == [f'{HOSTILE}: upright to the end']


def test_page_tells_figures_and_parameters_and_how_it_was_recorded(tmp_path):
    (name, run), = shown(tmp_path, [swing_up()], [
        told('plant', {'rate': 20.0, 'seed': 3}), told('mpc', {'horizon': 12})]).items()
    run = run._replace(recording=run.recording._replace(lost={'joint_states': 5}))
    strict = Strict(page({name: run}))
    cells, heads = strict.text('td'), strict.text('th')
    assert f'{measure(run.recording.episode).settling_time:.2f}' in cells
    assert 'settling time' in heads
    assert strict.text('h1') == ['iLQR: upright to the end']
    assert strict.text('summary') == ['All 3 parameters', 'Robot description (URDF)']
    # what differs stands on top, with its default; then all
    codes = strict.text('code')
    assert codes[:6] == ['seed', '3', '0', 'horizon', '12', '30']
    assert codes.count('rate') == 1
    assert strict.text('dd')[-4:] == [
        'plant, mpc', '0.1, commit abc, sources 123', 'numpy 2.0', 'a machine']
    assert cells[-len(run.recording.counts) * 2:].count('5') == 1
    assert run.recording.description in strict.texts['code']
    assert strict.text('time')[0] == '1970-01-01 00:16:40 UTC'


def test_bag_that_tells_nothing_says_so(tmp_path):
    strict = Strict(page(shown(tmp_path, [without_ticks(swing_up())])))
    assert 'Not known: the bag has nothing on the topic' in strict.text('p')
    assert strict.text('summary') == ['Robot description (URDF)']
    assert strict.text('h1') == ['no controller: upright to the end']


def test_several_runs_have_a_column_each_and_what_differs(tmp_path):
    runs = {}
    for solver, horizon in (('ilqr', 30), ('ddp', 20)):
        folder = tmp_path / solver
        folder.mkdir()
        runs |= shown(folder, [swing_up(solver=solver)], [told('mpc', {'horizon': horizon})])
    strict = Strict(page(runs, png(tmp_path, 'overlay')))
    assert strict.text('h1') == ['2 runs side by side']
    assert [link['href'] for link in strict.of('a')] == ['#run-1', '#run-2']
    heads = strict.text('th')
    assert heads[:3] == ['ilqr', 'ddp', 'unit']
    assert strict.text('code')[:3] == ['horizon', '30', '20']
    assert 'ddp: upright to the end' in strict.text('h2')


def test_film_is_json_with_gaps_as_null(tmp_path):
    strict = Strict(page(shown(tmp_path, [unlimited(swing_up(duration=2.0))])))
    film = json.loads(strict.texts['script'][0], parse_constant=pytest.fail)
    assert len(film['joints']) == len(film['forces']) == 101
    assert film['joints'][0] == [[0.0, 0.0], [0.0, -1.0], [0.0, -2.0]]
    assert film['joints'][25] is None
    assert film['period'] == pytest.approx(0.02)


@pytest.mark.parametrize('links', [1, 2, 3])
def test_film_has_a_colour_a_link_and_a_point_a_joint(links, tmp_path):
    (name, run), = shown(tmp_path, [swing_up()]).items()
    run = run._replace(recording=run.recording._replace(episode=swing_up(links=links)))
    film = json.loads(Strict(page({name: run})).texts['script'][0])
    assert len(set(film['links'])) == links
    assert all(len(joints) == links + 1 for joints in film['joints'])
    assert film['joints'][-1][-1] == [0.0, links]


@pytest.mark.skipif(not (CHROMIUM and DRIVER), reason='chromium or chromedriver is not there')
def test_player_shows_a_centre_of_mass_that_is_not_in_the_middle_and_what_acts(tmp_path):
    (name, run), = shown(tmp_path, [swing_up()]).items()
    episode = dataclasses.replace(run.recording.episode, physical=PendulumParameters(
        drive='velocity', link1_centre=0.75))
    file = tmp_path / 'report.html'
    file.write_text(page({name: run._replace(recording=run.recording._replace(episode=episode))}))
    with Page() as browser:
        browser.driver.get(file.as_uri())
        colours = [browser.driver.execute_script(COLOUR_AT, *place)
                   for place in ((0, 0.75), (0, 0.5), (1, 0.5))]
        assert colours == [colour.lower() for colour in (style.CART, *style.LINKS[:2])]
        assert browser.text('.player output').endswith(' m/s²')
        assert browser.errors() == []


def test_film_of_a_long_run_stays_small(tmp_path):
    strict = Strict(page(shown(tmp_path, [swing_up(duration=400.0)])))
    film = json.loads(strict.texts['script'][0])
    assert len(film['joints']) == 3001
    assert film['period'] * 3000 == pytest.approx(400.0)


def test_animation_stands_in_where_scripts_are_off(tmp_path):
    (name, run), = shown(tmp_path, [swing_up()]).items()
    gif = tmp_path / 'animation.gif'
    Image.new('L', (4, 3)).save(gif)
    strict = Strict(page({name: Shown(run.recording, {**run.pictures, 'animation': gif})}))
    assert len(strict.of('noscript')) == 1
    assert strict.of('img')[0]['src'].startswith('data:image/gif;base64,')


def test_film_of_a_small_pendulum_is_that_of_a_large_one_in_own_units(tmp_path):
    (name, run), = shown(tmp_path, [swing_up()]).items()
    pages = [page({name: run._replace(recording=run.recording._replace(episode=one))})
             for one in (swing_up(), resized(swing_up(), 0.25, 0.1))]
    large, small = (json.loads(Strict(text).texts['script'][0]) for text in pages)
    assert small['period'] == pytest.approx(0.5 * large['period'])
    assert len(small['joints']) == len(large['joints'])
    for part in ('joints', 'track', 'cart', 'half_width', 'reach', 'size'):
        assert np.allclose(small[part], np.multiply(large[part], 0.25), atol=2e-5), part
    assert np.allclose(small['forces'], np.multiply(large['forces'], 0.1), atol=1e-3)
    arrow = {name: small['arrow'][name] / size for name, size in large['arrow'].items()}
    assert arrow == pytest.approx({'gap': 0.25, 'scale': 2.5, 'head': 0.25, 'least': 0.1})
    assert 'the last second of the upper tip' in pages[0]
    assert 'the last 0.5 s of the upper tip' in pages[1]

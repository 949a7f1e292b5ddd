# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the console in a real browser, beside a real plant and a real mpc."""

import dataclasses
from itertools import cycle
import math
import re
import signal
from threading import Event
import time
from urllib.parse import urlsplit

from chromium import CHROMIUM, DRIVER, Page, PHONE
from conftest import starting, wait_until
from peer import Peer
import pytest
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from recorded_runs import write_bag
from selenium.webdriver import ActionChains, Keys
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger
from synthetic import resized, swing_up

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.console.player import Player
from dp_swing_ros.console.server import Options, Server
from dp_swing_ros.pendulum.units import decimals, rounded

pytestmark = pytest.mark.skipif(
    not (CHROMIUM and DRIVER),
    reason='chromium or chromedriver is not on the PATH (Debian: chromium, chromium-driver)')

# the numbers of 30 drawings, and until there were six forces: at the arrow, in the header, of the
# plot
FORCES = """
  const done = arguments[0], pen = CanvasRenderingContext2D.prototype, write = pen.fillText;
  const text = name => document.querySelector(name).textContent, drawings = [];
  const green = getComputedStyle(document.documentElement).getPropertyValue('--force');
  let words = [];
  // where the pull has settled, it would be one force
  const kicks = setInterval(() => document.querySelector('#kick-right').click(), 1000);
  pen.fillText = function (word, ...rest) {
    if (this.canvas.id === 'picture' && this.fillStyle === green.toLowerCase()) words.push(word);
    write.call(this, word, ...rest);
  };
  const look = () => {
    if (words.length) drawings.push([words[0], text('#now-applied'), text('.force .value')]);
    words = [];
    const forces = new Set(drawings.map(([force]) => force));
    if (drawings.length < 30 || forces.size < 6) requestAnimationFrame(look);
    else { clearInterval(kicks); pen.fillText = write; done(drawings); }
  };
  requestAnimationFrame(look);
"""
# how many pixels of a line across the middle of link 1 have the colour of each link
COLOURS = """
  const picture = document.querySelector('#picture'), places = JSON.parse(picture.dataset.places);
  const ratio = picture.width / picture.clientWidth;
  const [x, y] = [0, 1].map(n => ratio * (places[0][n] + places[1][n]) / 2);
  const {data} = picture.getContext('2d').getImageData(x - 20, y, 40, 1);
  const style = getComputedStyle(document.documentElement);
  return ['link1', 'link2'].map(link => {
    const colour = style.getPropertyValue(`--${link}`);
    const rgb = [1, 3, 5].map(n => parseInt(colour.slice(n, n + 2), 16));
    const off = n => rgb.reduce((sum, value, k) => sum + Math.abs(data[n + k] - value), 0);
    return [...Array(40).keys()].filter(n => off(4 * n) < 30).length;
  });
"""
# the colour at a share of the length of each link, whose it is of the page's, if of one
ALONG = """
  const picture = document.querySelector('#picture'), places = JSON.parse(picture.dataset.places);
  const ratio = picture.width / picture.clientWidth, pen = picture.getContext('2d');
  const style = getComputedStyle(document.documentElement);
  return arguments[0].map((share, link) => {
    const [x, y] = [0, 1].map(n => ratio * (
      places[link][n] + share * (places[link + 1][n] - places[link][n])));
    const {data} = pen.getImageData(Math.round(x), Math.round(y), 1, 1);
    return ['ink', 'link1', 'link2'].find(name => {
      const colour = style.getPropertyValue(`--${name}`);
      const off = (n, k) => Math.abs(data[k] - parseInt(colour.slice(n, n + 2), 16));
      return [1, 3, 5].every((n, k) => off(n, k) < 9);
    });
  });
"""
# what an element says while the page is looked at
LISTEN = """
  const place = document.querySelector(arguments[0]), said = window.said = [];
  new MutationObserver(() => said.push(place.textContent)).observe(
    place, {childList: true, characterData: true, subtree: true});
"""

# what takes its time takes a tenth of it
SOONER = """
  const wait = window.setTimeout;
  window.setTimeout = (act, delay) => wait(act, delay / 10);
"""

UPRIGHT = 0.1   # [rad]
SLOW = 0.1      # [m/s, rad/s]


class Nodes:
    """Nodes of this module: an upright plant, an mpc, a console, and more."""

    def __init__(self, folder, start):
        self.folder, self.start, self.living = folder, start, {}
        self.begin('mpc').wait_for('ready')
        # in lockstep, so that a machine that is busy with something else only takes longer
        self.begin('plant', lockstep=True, pace=1.0)
        self.address = address_of(self.start(
            'console', {'port': 0, 'recordings': str(self.folder)}))

    def begin(self, role, **parameters):
        """Start the plant or the mpc, and return it."""
        given = {'start': 'up_up'} if role == 'plant' else {'shown_tries': 10}
        self.living[role] = self.start(role, {**given, **parameters})
        return self.living[role]


def address_of(console):
    console.wait_for('the page is at')
    return re.search(r'the page is at (http\S+)', console.output())[1]


@pytest.fixture(scope='module')
def nodes(tmp_path_factory):
    folder = tmp_path_factory.mktemp('browser')
    with starting(folder) as start:
        yield Nodes(folder, start)


@pytest.fixture(scope='module')
def browser():
    """Return a browser, one for all tests, as it takes a while to start."""
    with Page() as page:
        yield page


@pytest.fixture
def page(browser, nodes):
    """Return the page of the console as it is at first."""
    browser.open(nodes.address)
    yield browser
    assert browser.errors() == []


@pytest.fixture
def any_page(browser, nodes):
    """Return the page of the console, also as the test before has left it."""
    if browser.driver.current_url != nodes.address:
        browser.open(nodes.address)
    yield browser
    assert browser.errors() == []


@pytest.fixture(scope='module')
def ears():
    """Return a node that hears with ROS's own defaults what is published, as anybody's would."""
    peer = Peer()
    peer.pushes, peer.states = [], []
    # all of a drag: while the browser is at work, nobody takes them, and ten are soon there
    peer.node.create_subscription(
        Float64, 'disturbance', lambda message: peer.pushes.append(message.data), 1000)
    peer.node.create_subscription(JointState, 'joint_states', peer.states.append, 10)
    yield peer
    peer.close()


def value_of(ears, node, name):
    return ears.call(GetParameters, f'/{node}/get_parameters', names=[name]).values[0]


def put(ears, node, **values):
    answer = ears.call(SetParameters, f'/{node}/set_parameters', parameters=[
        Parameter(name, value=value).to_parameter_msg() for name, value in values.items()])
    assert all(each.successful for each in answer.results), answer.results


def rests(state):
    """Return whether the pendulum stands upright and hardly moves."""
    lean = max(abs(math.remainder(angle, math.tau)) for angle in state.position[1:])
    return lean < UPRIGHT and max(map(abs, state.velocity)) < SLOW


def pause(ears, paused):
    """Let the plant wait, or go on."""
    assert ears.call(SetBool, '/plant/pause', data=paused).success


def comes_to_rest(ears, states=10):
    """Wait until the pendulum stands still for so many states."""
    ears.states.clear()
    return ears.until(lambda: len(ears.states) >= states
                      and all(map(rests, ears.states[-states:])))


def stands(ears):
    """Let the pendulum begin anew; return whether it stands still."""
    ears.call(Trigger, '/plant/reset')
    return comes_to_rest(ears, 5)


def rest(ears):
    """Return whether nobody pulls for a while."""
    ears.pushes.clear()
    ears.spin(0.5)
    return not ears.pushes


def first_pull(ears):
    """Return the first force [N] of a pull that counts: a link swings to the hand and beyond."""
    return next((push for push in ears.pushes if abs(push) > 2.0), 0.0)


def go_to(page, at):
    """Move the slider of the time machine."""
    page.driver.execute_script(
        "const slider = document.querySelector('#instant'); slider.value = arguments[0];"
        "slider.dispatchEvent(new Event('input'));", at)


# without the nodes, which go on once they are there

@pytest.fixture
def open_bag(browser):
    """Return a function that plays a bag, which the browser shows; in the end it looks away."""
    servers = []

    def serve(bag, port=0):   # as `console BAG` does, in a process of its own
        player = Player(Bag(bag))
        servers.append(Server(Options('127.0.0.1', port, '', False, None), player, print))
        player.publish(servers[-1])
        servers[-1].start()
        if not port:
            browser.open(servers[-1].access.address)
        return servers[-1]
    yield serve
    errors = browser.errors()
    browser.leave()
    for server in servers:
        server.stop()
    assert errors == []


def test_a_bag_is_played(browser, open_bag, lockstep_bag):
    open_bag(lockstep_bag)
    assert browser.text('#nodes') == 'a bag'
    browser.driver.execute_script(
        "const slider = document.querySelector('#instant'); slider.value = 1;"
        "slider.dispatchEvent(new Event('input'));")
    browser.await_text('#now-time', '1.0 s')
    browser.find('#instant').send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    browser.await_text('#instant-time', '1.10 of')
    browser.find('#instant').send_keys(Keys.ARROW_LEFT)
    browser.await_text('#instant-time', '1.05 of')
    browser.find('#play').click()
    browser.until(lambda: float(browser.find('#instant').get_attribute('value')) > 1.5,
                  'a bag that plays')
    browser.find('#play').click()
    browser.await_text('#play', 'Play')
    assert not browser.find('#record').is_displayed()


def test_a_small_pendulum_is_seen_as_a_large_one(browser, open_bag, tmp_path):
    seen = []
    for name, size in (('large', 1.0), ('small', 0.15)):
        open_bag(write_bag(resized(swing_up(), size, 0.1), tmp_path / name))
        at = 1.51 * size ** 0.5   # just after a state
        go_to(browser, at)   # which stops it
        browser.until(lambda: abs(browser.now() - at) < 0.06, 'the instant')
        time.sleep(0.5)   # until it has been drawn
        seen.append(browser.places())
    for large, small in zip(*seen):
        assert small == pytest.approx(large, abs=1.0)   # [px]


def test_a_driven_cart_has_accelerations(browser, open_bag, tmp_path):
    episode = swing_up()
    bodies = dataclasses.replace(episode.physical, drive='velocity')
    open_bag(write_bag(dataclasses.replace(episode, physical=bodies), tmp_path / 'bag'))
    browser.until(lambda: browser.text('#now-applied').endswith(' m/s^2'), 'its unit')
    assert browser.text('#plots figure.force').startswith('Acceleration')


def test_a_centre_of_mass_is_seen_where_it_is_not_in_the_middle(browser, open_bag, tmp_path):
    episode = swing_up()
    bodies = dataclasses.replace(episode.physical, link1_centre=0.75)
    open_bag(write_bag(dataclasses.replace(episode, physical=bodies), tmp_path / 'bag'))
    go_to(browser, 3.51)   # where it is upright; which stops it

    def colours(*shares):
        return browser.driver.execute_script(ALONG, shares)
    # where it is, and where it would be in the middle, and half way to that
    browser.until(lambda: (colours(0.75, 0.5), colours(0.5, 0.25)) == (
        ['ink', 'link2'], ['link1', 'link2']), 'the centre of mass')


def test_a_console_that_hangs_or_ends_is_noticed_until_it_is_back(browser, open_bag, tmp_path):
    def lost():
        return browser.find('#lost').is_displayed()

    bag, going_on = write_bag(swing_up(), tmp_path / 'bag'), Event()
    server = open_bag(bag)
    server.call(going_on.wait)
    try:
        browser.until(lost, 'that nobody answers')
    finally:
        going_on.set()   # else it could not be stopped
    browser.until(lambda: not lost(), 'the console again')
    browser.until(lambda: browser.text('#now-status'), 'a status')
    server.stop()
    browser.until(lost, 'that nobody answers')
    assert 'Trying again' in browser.text('#lost')
    open_bag(bag, urlsplit(browser.driver.current_url).port)
    browser.until(lambda: not lost(), 'the console again')
    browser.errors()   # of which some are of the time without a console


def test_nothing_comes_from_another_host(page, nodes):
    loaded = page.driver.execute_script(
        "return performance.getEntriesByType('resource').map(each => each.name)")
    assert len(loaded) > 10
    assert [url for url in loaded if not url.startswith(nodes.address.split('?')[0])] == []
    page.await_text('#nodes', '/plant · /mpc')


def test_it_is_dark_where_that_is_preferred(any_page):
    def background():
        return any_page.find('body').value_of_css_property('background-color')
    light = background()
    any_page.prefer('dark')
    any_page.until(lambda: background() != light, 'another background')
    any_page.prefer('light')


def test_the_picture_moves(page, ears):
    assert stands(ears)
    before = page.places(), page.picture()
    page.drag(0, 1, 40, lambda: page.places()[0][0] > before[0][0][0] + 3, 'a cart that moved')
    assert page.picture() != before[1]
    page.let_go()


@pytest.mark.parametrize('body, way', [(0, 1), (2, -1)])
def test_a_drag_pulls_where_it_goes(page, ears, body, way):
    assert stands(ears)
    ears.pushes.clear()
    # how long it took until it was seen
    page.drag(body, way, 30 if body else 60, page.drags, 'a drag')
    assert ears.until(lambda: len(ears.pushes) > 3)
    page.let_go()
    assert first_pull(ears) * way > 0
    assert max(map(abs, ears.pushes)) <= 30.0 + 1e-9
    assert wait_until(lambda: rest(ears))   # it was let go
    assert comes_to_rest(ears)


def test_keys_push_and_help(page, ears):
    assert wait_until(lambda: rest(ears))   # what was sent before is heard
    ActionChains(page.driver).key_down(Keys.ARROW_LEFT).perform()
    assert ears.until(lambda: len(ears.pushes) > 2)
    ActionChains(page.driver).key_up(Keys.ARROW_LEFT).perform()
    assert all(push < 0 for push in ears.pushes)
    ActionChains(page.driver).send_keys('?').perform()
    assert page.find('#help').is_displayed()
    ActionChains(page.driver).send_keys(Keys.ESCAPE).perform()
    assert not page.find('#help').is_displayed()


def test_a_click_on_the_track_moves_the_reference(page, ears):
    assert stands(ears)
    cart, height = page.places()[0]
    page.hand_at(cart + 80, height + 50).click().perform()
    assert ears.until(lambda: value_of(ears, 'mpc', 'reference').double_array_value[0] > 0.2)
    page.hand_at(page.find('#picture').rect['width'] / 2, height + 50).click().perform()
    assert ears.until(
        lambda: abs(value_of(ears, 'mpc', 'reference').double_array_value[0]) < 0.05)


def test_a_slider_changes_the_mpc(page, ears):
    page.controls()
    before = value_of(ears, 'mpc', 'force_weight').double_value
    page.find('#mpc-force_weight-0').send_keys(Keys.ARROW_RIGHT)
    assert ears.until(lambda: value_of(ears, 'mpc', 'force_weight').double_value > before)
    page.until(lambda: page.find('#mpc-force_weight .usual').is_displayed(),
               'a button for the usual value')
    page.find('#mpc-force_weight .usual').click()
    assert ears.until(lambda: value_of(ears, 'mpc', 'force_weight').double_value == before)


def test_a_small_whole_number_is_changed_by_one_and_what_is_typed_stays(page, ears):
    page.controls()
    before = value_of(ears, 'mpc', 'other_starts').integer_value
    page.find('#mpc-other_starts-0').send_keys(Keys.ARROW_RIGHT)
    assert ears.until(lambda: value_of(ears, 'mpc', 'other_starts').integer_value == before + 1)
    field = page.find('#mpc-horizon .number')
    field.send_keys(Keys.CONTROL, 'a')
    field.send_keys('4')
    put(ears, 'mpc', other_starts=before)   # while somebody types
    shown = page.find('#mpc-other_starts .number')
    page.until(lambda: shown.get_attribute('value') == str(before), 'the change')
    assert field.get_attribute('value') == '4'
    field.send_keys('1', Keys.ENTER)
    assert ears.until(lambda: value_of(ears, 'mpc', 'horizon').integer_value == 41)
    put(ears, 'mpc', horizon=30)


def test_a_refusal_says_why(page, ears):
    page.controls()
    before = value_of(ears, 'mpc', 'state_weights').double_array_value
    field = page.all('#mpc-state_weights .number')[1]
    field.send_keys(Keys.CONTROL, 'a')
    field.send_keys('-5', Keys.ENTER)
    page.await_text('#mpc-state_weights .refusal', 'at least 0')
    assert float(field.get_attribute('value')) == before[1]
    assert value_of(ears, 'mpc', 'state_weights').double_array_value == before


def test_search_finds_by_description(page):
    page.controls()
    page.find('#search').send_keys('temperature')
    names = [each.get_attribute('id') for each in page.all('.control') if each.is_displayed()]
    assert 'mpc-mppi.temperature' in names
    assert 'mpc-horizon' not in names
    counted = re.fullmatch(r'(\d+) of (\d+) parameters match', page.text('#found'))
    assert list(map(int, counted.groups())) == [len(names), len(page.all('.control'))]


def test_the_horizon_is_told_in_seconds(page, ears):
    page.controls()
    page.await_text('#mpc-horizon-seconds', '= 1.50 s')
    page.find('#mpc-horizon-0').send_keys(Keys.ARROW_RIGHT)
    assert ears.until(lambda: value_of(ears, 'mpc', 'horizon').integer_value > 30)
    steps = value_of(ears, 'mpc', 'horizon').integer_value
    page.await_text('#mpc-horizon-seconds', f'= {0.05 * steps:.2f} s')
    page.until(lambda: page.find('#mpc-horizon .usual').is_displayed(),
               'a button for the usual value')
    page.find('#mpc-horizon .usual').click()
    page.await_text('#mpc-horizon-seconds', '= 1.50 s')


def test_a_notice_goes_away(page):
    page.driver.execute_script(SOONER)
    page.driver.execute_script(LISTEN, '#notice')   # it may be gone before it is looked at
    page.find('#reset').click()
    page.until(lambda: any('the plant is back' in each for each in page.driver.execute_script(
        'return window.said')), 'a notice')
    page.until(lambda: not page.text('#notice'), 'an empty notice')


def test_one_drawing_has_one_force_and_all_pages_one_time(page, nodes, ears):
    def has_begun():
        if page.now() >= 5:   # it was looked at too late
            ears.call(Trigger, '/plant/reset')
        return 0.5 < page.now() < 5
    assert stands(ears)
    # so that the forces are large, and change
    page.drag(0, 1, 40, page.holds, 'a hand that holds')
    drawings = page.driver.execute_async_script(FORCES)
    page.let_go()
    assert len(drawings) >= 30 and len({arrow for arrow, _, _ in drawings}) > 5
    for arrow, header, plot in drawings:
        assert header == arrow
        assert plot == f'applied {arrow}'
    ears.call(Trigger, '/plant/reset')
    page.until(has_begun, 'the time since the reset')
    pause(ears, True)
    page.await_text('#now-status', 'paused')
    before = page.now()
    page.open(nodes.address)   # as one that is opened later
    page.await_text('#now-status', 'paused')
    assert page.now() == pytest.approx(before, abs=0.11)   # a state may have been on its way
    pause(ears, False)


def test_links_that_lie_on_each_other_are_both_seen(page, ears):
    start = value_of(ears, 'plant', 'start').string_value
    put(ears, 'mpc', goal='down_up')
    put(ears, 'plant', start='down_up')
    ears.call(Trigger, '/plant/reset')
    page.until(lambda: math.dist(*page.places()[::2]) < 5, 'a folded pendulum')
    colours = page.driver.execute_script(COLOURS)
    put(ears, 'mpc', goal='up_up')
    put(ears, 'plant', start=start)
    ears.call(Trigger, '/plant/reset')
    assert min(colours) >= 2, colours
    icons = [each.get_attribute('innerHTML') for each in page.all('#goals svg')]
    assert len(set(icons)) == 4


def test_a_disabled_mpc_draws_no_plan(page, ears):
    def planned():
        return page.driver.execute_async_script("""
          const done = arguments[0], socket = new WebSocket(`ws://${location.host}/socket`);
          socket.onmessage = event => { const message = JSON.parse(event.data);
            if (message.kind === 'frame') { socket.close(); done(Boolean(message.plan)); } }""")
    assert stands(ears)
    page.until(planned, 'a plan')
    page.find('#enable').click()
    page.await_text('#now-status', 'disabled')
    page.until(lambda: not planned(), 'no plan')
    page.find('#enable').click()
    page.until(planned, 'a plan')
    ears.call(Trigger, '/plant/reset')


def test_forced_colours_keep_swatches(any_page):
    page = any_page

    def swatches():
        return page.driver.execute_script(
            "return Object.fromEntries([...document.querySelectorAll('.legend span')].map(chip =>"
            "[chip.textContent, getComputedStyle(chip, '::before').backgroundColor]))")
    page.until(lambda: len(set(swatches().values())) > 5, 'the colours of a tick')
    usual = swatches()
    assert len(set(usual.values())) > 5
    page.prefer('light', 'active')
    assert usual.items() <= swatches().items()
    page.prefer('light')


@pytest.mark.parametrize('size', [(844, 390), (640, 360)])   # a phone on its side; at 200 %
def test_the_stage_leaves_room(any_page, size):
    page = any_page
    page.resize(*size)
    stage, aside = (page.driver.execute_script(
        'document.querySelector(arguments[0]).scrollIntoView();'
        'const box = document.querySelector(arguments[0]).getBoundingClientRect();'
        'return [box.left, box.top, box.right, box.bottom]', name) for name in ('#stage', 'aside'))
    assert page.driver.execute_script('return document.documentElement.scrollWidth') <= size[0]
    assert aside[0] >= stage[2]   # beside each other
    assert aside[2] - aside[0] > 0.4 * size[0] < 2 * (stage[2] - stage[0])
    page.driver.execute_script('scrollTo(0, document.body.scrollHeight)')
    picture = page.find('#picture').rect
    top = page.driver.execute_script('return scrollY')
    assert top <= picture['y'] < picture['y'] + picture['height'] <= top + size[1]   # in sight
    page.resize()


def test_axes_use_one_notation(any_page):
    script = ("import('/static/dom.js').then(({ticked}) => arguments[1]("
              'ticked(arguments[0]).map(([, text]) => text)))')
    for values, texts in (
            ([0, 5, 10], ['0', '5', '10']), ([0, 1.25, 2.5], ['0', '1.25', '2.50']),
            ([-0.1, 0, 0.1], ['−0.1', '0', '0.1']), ([0, 12500, 25000], ['0', '12500', '25000']),
            ([0, 50000, 100000], ['0', '0.5e5', '1.0e5']),
            ([0, 0.00005, 0.0001], ['0', '0.5e−4', '1.0e−4'])):
        assert any_page.driver.execute_async_script(script, values) == texts


def test_small_numbers_are_seen_and_ticks_are_round(any_page):
    script = ("import('/static/dom.js').then(({decimals, rounded}) => arguments[1]("
              '[arguments[0].map(rounded), arguments[0].map(times => decimals(2, times))]))')
    sizes = [1, 0.25, 0.15, 0.03, 1.02, 40]
    found = any_page.driver.execute_async_script(script, sizes)
    assert found[0] == pytest.approx([rounded(size) for size in sizes])
    assert found[1] == [decimals(2, size) for size in sizes]


def look_back(page, at):
    """Look at an instant so many seconds ago."""
    page.find('#look').click()
    page.until(lambda: page.find('#branch').is_enabled(), 'a branch')
    go_to(page, at)


def numbers(page, seconds):
    """Return the times and costs that the page shows for a while."""
    found, end = set(), time.monotonic() + seconds
    while time.monotonic() < end:
        found.add(tuple(page.driver.execute_script(
            "return ['#now-time', '#now-cost'].map("
            'each => document.querySelector(each).textContent)')))
        time.sleep(0.02)
    return {(at, cost) for at, cost in found if at != '–'}   # as before the first frame


def alike(live, then):
    """Return how many costs of at least three digits were shown at the same times, to a second."""
    # live, a report and its state come each on their own; back then they belong together
    return len({cost for at, cost in live for when, same in then if cost == same and len(cost) > 2
                and abs(float(at.split()[0]) - float(when.split()[0])) < 1.0})


def box(page, selector):
    return page.driver.execute_script(
        'const {top, bottom, height} = document.querySelector(arguments[0])'
        '.getBoundingClientRect(); return {top, bottom, height}', selector)


def test_the_hint_lies_below_the_picture_and_on_a_phone_the_numbers_too(any_page):
    page = any_page
    for size in ((1280, 720), (1920, 1080), PHONE):
        page.resize(*size)
        try:
            assert box(page, '#picture')['bottom'] <= box(page, '#hands-on')['top'] + 0.5
            if size == PHONE:
                assert box(page, '#picture')['bottom'] <= box(page, '#now')['top'] + 0.5
                assert box(page, '#now')['bottom'] <= box(page, '#hands-on')['top'] + 0.5
        finally:
            page.resize()


def test_a_branch_shows_trajectories(page, ears):
    def trajectories():
        return page.all('#trajectories-list figure')

    def refusals():
        said = page.driver.execute_script('return window.said')
        return [each for each in said if each and 'takes over' not in each]
    assert stands(ears)
    page.find('#kick-right').click()
    ears.spin(2.5)
    pause(ears, True)   # while solvers are at work
    page.driver.execute_script(LISTEN, '#notice')
    look_back(page, -2)
    page.choose('#branch-duration', '2')
    page.find('#branch').click()
    page.until(lambda: trajectories() or refusals(), 'trajectories')
    assert len(trajectories()) >= 3, refusals()
    assert all('cost' in each.text for each in page.all('#trajectories-list figure'))
    assert all('regret' in each.text or 'the least' in each.text
               for each in page.all('#trajectories-list figure'))
    page.resize(1280, 720)
    try:
        assert box(page, '#stage')['height'] >= 359
        for n in range(len(page.all('#trajectories-list figure'))):   # each can be scrolled to
            card = f'#trajectories-list figure:nth-child({n + 1})'
            page.driver.execute_script(
                'document.querySelector(arguments[0]).scrollIntoView()', card)
            assert box(page, '#trajectories')['bottom'] >= box(page, card)['bottom']
    finally:
        page.resize()
    pause(ears, False)
    page.find('#look').click()
    page.await_text('#instant-time', 'live')
    assert not page.find('#trajectories').is_displayed()
    page.find('#trajectories-tab').click()   # until it is closed
    page.find('#close-trajectories').click()
    assert not page.find('#trajectories-tab').is_displayed()
    assert page.find('#thoughts').is_displayed()


def test_a_phone_in_the_hand(page, ears):
    def touch():
        page.touch('touchStart', 0)
        page.touch('touchMove', 25)

    def pulls():
        if not page.holds():   # as in `drag`
            page.touch('touchEnd', None)
            touch()
        return first_pull(ears) > 0
    assert stands(ears)
    page.resize(*PHONE)
    try:
        page.until(lambda: page.places()[0][0] < PHONE[0], 'a cart on the phone')
        assert wait_until(lambda: rest(ears))
        touch()
        assert ears.until(pulls)
        page.touch('touchEnd', None)
        assert page.driver.execute_script('return scrollY') == 0   # it pulled, and did not scroll
        page.controls()
        assert page.driver.execute_script(
            'return document.documentElement.scrollWidth') <= PHONE[0]
    finally:
        page.resize()


def test_a_plant_in_lockstep_is_paused_and_stepped(page):
    page.until(lambda: page.find('#pause').is_displayed(), 'a pause')
    page.find('#pause').click()
    page.await_text('#pause', 'Go on')
    time.sleep(0.6)
    stands_at = page.now()
    for _ in range(4):
        page.find('#step').click()
        time.sleep(0.2)
    page.until(lambda: page.now() > stands_at, 'a time that goes on')
    assert page.now() < stands_at + 0.5
    time.sleep(2.5)   # for which a plant that is not paused would be silent
    assert not page.find('#silence').is_displayed()
    page.choose('#pace', '0.5')
    page.find('#pause').click()
    page.await_text('#pause', 'Pause')
    page.choose('#pace', '1')


def test_read_only_refuses(browser, nodes, ears, start_here):
    console = start_here('console', {'port': 0, 'read_only': True}, ['-r', '__node:=watcher'])
    browser.open(address_of(console))
    assert browser.find('#read-only').is_displayed()
    browser.until(lambda: browser.all('#goals button'), 'goals')
    assert stands(ears) and wait_until(lambda: rest(ears))
    browser.grip(0, 1)
    ears.spin(0.5)
    browser.let_go()
    for name in ('#kick-right', '#reset', '#enable', '#record', '#goals button'):
        assert not browser.find(name).is_enabled(), name
    browser.controls()
    assert not browser.find('#mpc-solver-0').is_enabled()
    # who goes past the page is told by the console
    answer = browser.driver.execute_async_script(
        'const done = arguments[0], socket = new WebSocket(`ws://${location.host}/socket`);'
        "socket.onopen = () => socket.send(JSON.stringify({do: 'push', id: 7, force: 20}));"
        'socket.onmessage = event => { const message = JSON.parse(event.data);'
        "  if (message.kind === 'answer') done(message); }")
    assert answer['ok'] is False and 'read' in answer['text']
    assert ears.pushes == []
    browser.leave()
    console.stop()


def test_looking_back_shows_what_it_thought_then(page, ears):
    page.until(lambda: page.all('#goals button'), 'goals')
    live = set()
    for goal in cycle(page.all('#goals button')):   # so that the cost changes for seconds
        if alike(live, live) > 15:
            break
        goal.click()
        live |= numbers(page, 2.0)
    pause(ears, True)   # so that the time of the last instant is known
    page.await_text('#now-status', 'paused')
    look_back(page, 0)
    last, first = page.now(), float(page.find('#instant').get_attribute('min'))
    then, instants = set(), []
    while len(instants) < 20 or len(instants) < 400 and not alike(live, then) > 5:
        page.find('#instant').send_keys(Keys.ARROW_LEFT)   # the slider has the focus
        instants.append(float(page.text('#instant-time').split()[0].replace('−', '-')))
        # on a busy machine it is shown later; in tenths, and the last may have been on its way
        wait_until(lambda: abs(page.now() - last - instants[-1]) < 0.16, 2.0)
        then |= numbers(page, 0.15)
        if instants[-1] < first + 0.01:
            break
    steps = [a - b for a, b in zip(instants, instants[1:])]
    assert min(steps) > 0   # and of a state, which on a busy machine may be late
    assert sorted(steps)[len(steps) // 2] > 0.039
    assert alike(live, then) > 5, (live, then)
    assert page.driver.execute_script(   # there is a scale
        "const strip = document.querySelector('#strip'), pen = strip.getContext('2d');"
        'return pen.getImageData(0, strip.height - 12, strip.width, 12).data.some(each => each)')
    page.find('#look').click()
    page.await_text('#instant-time', 'live')
    pause(ears, False)
    page.all('#goals button')[-1].click()


# with a plant that does not wait for the mpc, which loads MPPI in the first test

@pytest.fixture(scope='module')
def real_time(nodes):
    """Put a plant in real time in the place of that in lockstep."""
    nodes.living['plant'].stop()
    nodes.begin('plant').wait_for('states a second')


def choose_until(page, selector, value, condition, what):
    """Choose until something has come: an mpc refuses what it cannot make in 2 s."""
    chosen = -math.inf

    def is_there():
        nonlocal chosen
        if time.monotonic() > chosen + 5.0:
            page.choose(selector, value)
            chosen = time.monotonic()
        return condition()
    page.until(is_there, what)


def test_the_solver_is_switched(page, nodes, real_time):
    page.controls()
    page.await_text('#now-solver', 'iLQR')
    page.driver.execute_script(LISTEN, '#now-solver')
    plant = nodes.living['plant']
    plant.signal(signal.SIGSTOP)   # no state comes that the new one would answer
    choose_until(page, '#mpc-solver-0', 'mppi',
                 lambda: page.text('#now-solver') == 'MPPI loading …', 'a solver that loads')
    plant.signal(signal.SIGCONT)
    choose_until(page, '#mpc-solver-0', 'mppi', lambda: page.text('#now-solver') == 'MPPI', 'MPPI')
    said = page.driver.execute_script('return window.said')
    assert set(said) - {'–'} <= {'iLQR', 'MPPI loading …', 'MPPI'}   # – where it was not in time
    choose_until(page, '#mpc-solver-0', 'ilqr', lambda: page.text('#now-solver') == 'iLQR', 'iLQR')


def test_a_preset_changes_what_can_change(page, ears, real_time):
    before = value_of(ears, 'mpc', 'mppi.samples').integer_value
    page.controls()
    choose_until(page, '#preset', 'textbook_mppi', lambda: value_of(
        ears, 'mpc', 'mppi.samples').integer_value > before, 'more samples')
    choose_until(page, '#preset', 'defaults', lambda: value_of(
        ears, 'mpc', 'mppi.samples').integer_value == before, 'as many samples as before')


def test_what_the_mpc_has_learned_is_beside_what_the_plant_has(page):
    def learned():   # at once, for the rows are soon others
        return set(page.driver.execute_script(
            "const rows = document.querySelectorAll('#learned tbody th');"
            'return [...rows].map(each => each.textContent)'))
    page.until(lambda: len(learned()) > 5, 'what was learned')
    names = learned()
    assert {'cart mass', 'link1 mass', 'force gain'} <= names
    assert not {'step', 'time noise', 'enabled'} & names   # parameters, too, and of the tick


def test_who_is_dead_is_named_and_faded_until_it_is_back(page, nodes, real_time):
    def opacity(selector):
        return float(page.find(selector).value_of_css_property('opacity'))

    for role, faded, clear in (('mpc', '#plots .of-mpc', '#picture'),
                               ('plant', '#picture', '#lost')):
        page.until(lambda: page.all('#statuses .ok'), 'a status that is well')
        page.until(lambda: not page.find('#silence').is_displayed(), 'nobody silent')
        assert opacity(faded) == 1
        nodes.living[role].stop(signal.SIGKILL)
        # for how long depends on when it is looked at: the number goes on
        page.await_text('#silence', f'{role} has been silent for ')
        page.await_text('#now-status', f'{role} is silent')   # with the next drawing
        assert opacity(faded) < 0.5
        assert opacity(clear) == 1
        page.until(lambda: any(role in each.text for each in page.all('#statuses .stale')),
                   f'a stale status of the {role}')
        nodes.begin(role)
        page.until(lambda: not page.find('#silence').is_displayed(), 'nobody silent')


def test_a_recording_is_made(page, nodes):
    """In the end, which ends also the report on it, of seconds."""
    page.find('#record').click()
    page.await_text('#record', 'Stop')
    page.until(lambda: page.find('#record').is_enabled() and int(
        re.search(r'\((\d+) s\)', page.text('#record'))[1]) >= 1, 'a second of a recording')
    page.find('#record').click()
    page.until(lambda: page.all('#recordings a'), 'a recording')
    link = page.find('#recordings li').text.split()[0]
    assert any(link in str(path) for path in nodes.folder.rglob('metadata.yaml'))

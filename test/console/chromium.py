# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the console in Debian's chromium, driven by selenium: for tests and for pictures."""

import json
import shutil

import psutil
from selenium import webdriver
from selenium.common.exceptions import StaleElementReferenceException
from selenium.webdriver import ActionChains
from selenium.webdriver.support.wait import WebDriverWait

CHROMIUM, DRIVER = shutil.which('chromium'), shutil.which('chromedriver')
DESKTOP, PHONE = (1440, 900), (390, 844)   # [px]
PATIENCE, POLL = 90.0, 0.1   # [s]
# what the page does, and tries again, where the console is held up for long
CLOSED_EARLY = 'WebSocket is closed before the connection is established'
# draws seldom, as a machine does that is busy with something else
SELDOM = """
  const draw = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = callback => setTimeout(() => draw(callback), 100);
"""


class Page:
    """The page in a browser, as a user has it; used as a context manager."""

    def __init__(self):
        options = webdriver.ChromeOptions()
        options.binary_location = CHROMIUM
        for argument in ('--headless=new', '--no-sandbox', '--disable-gpu', '--hide-scrollbars',
                         '--disable-dev-shm-usage', '--force-device-scale-factor=1'):
            options.add_argument(argument)
        options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
        self.driver = webdriver.Chrome(options, webdriver.ChromeService(DRIVER))
        self.driver.set_script_timeout(PATIENCE)   # of 30 drawings, where they take long
        self.driver.execute_cdp_cmd('Page.addScriptToEvaluateOnNewDocument', {'source': SELDOM})
        self.resize()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.driver.quit()

    def resize(self, width=DESKTOP[0], height=DESKTOP[1]):
        self.driver.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {
            'width': width, 'height': height, 'deviceScaleFactor': 1, 'mobile': width < 600})

    def prefer(self, scheme, forced='none'):
        self.driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': [
            {'name': 'prefers-color-scheme', 'value': scheme},
            {'name': 'forced-colors', 'value': forced}]})

    def open(self, address):
        """Load the page and wait until it shows the pendulum."""
        self.driver.get_log('browser')
        self.driver.get(address)
        self.until(lambda: len(self.places()) > 1, 'a pendulum')

    def leave(self):
        """Look at nothing, so that it does not miss what is gone."""
        self.driver.get('about:blank')

    def find(self, selector):
        return self.driver.find_element('css selector', selector)

    def all(self, selector):
        return self.driver.find_elements('css selector', selector)

    def choose(self, selector, value):
        self.find(f'{selector} option[value="{value}"]').click()

    def text(self, selector):
        return self.driver.execute_script(
            'return document.querySelector(arguments[0])?.textContent', selector) or ''

    def until(self, condition, what):
        """Wait for something; raises TimeoutException where it does not come."""
        # what the page writes anew while it is looked at is looked at again
        WebDriverWait(self.driver, PATIENCE, POLL, [StaleElementReferenceException]).until(
            lambda _: condition(), f'the page has not shown {what}')

    def await_text(self, selector, text):
        """Wait until an element holds a text; raises as `until`."""
        self.until(lambda: text in self.text(selector), f'{text!r} in {selector}')

    def now(self):
        """Return the time that the page shows [s]."""
        return float(self.text('#now-time').split()[0])

    def places(self):
        """Return where on the picture cart and ends of links are [px]."""
        return json.loads(self.find('#picture').get_attribute('data-places') or '[]')

    def picture(self):
        return self.driver.execute_script(
            "return document.querySelector('#picture').toDataURL()")

    def hand_at(self, left, top):
        """Return actions that begin at a place of the picture [px]."""
        picture = self.find('#picture')
        actions = ActionChains(self.driver, duration=30)
        return actions.move_to_element_with_offset(
            picture, round(left - picture.rect['width'] / 2),
            round(top - picture.rect['height'] / 2))

    def grip(self, body, way, distance=60):
        """Grip a body where it is and move the hand to a side."""
        places = self.places()
        left, top = places[0] if body == 0 else (
            (a + b) / 2 for a, b in zip(places[body - 1], places[body]))
        actions = self.hand_at(left, top).click_and_hold()
        for _ in range(4):
            actions.move_by_offset(way * distance // 4, 0)
        actions.perform()

    def holds(self):
        """Return whether the hand holds a body."""
        return 'held' in (self.find('#picture').get_attribute('class') or '')

    def drag(self, body, way, distance, condition, what):
        """Grip a body until something has come; raises as `until`. The hand still holds it."""
        def is_there():
            if not self.holds():   # on a busy machine it misses, or a lost connection lets go
                self.let_go()
                self.grip(body, way, distance)
            return condition()
        self.until(is_there, what)

    def touch(self, kind, right):
        """Touch the cart, or so far right of it [px], with a finger."""
        if kind == 'touchStart':
            corner = self.driver.execute_script(
                "const box = document.querySelector('#picture').getBoundingClientRect();"
                'return [box.left, box.top]')
            self.finger = [a + b for a, b in zip(corner, self.places()[0])]
        points = [] if right is None else [{'x': self.finger[0] + right, 'y': self.finger[1]}]
        self.driver.execute_cdp_cmd('Input.dispatchTouchEvent', {
            'type': kind, 'touchPoints': points})

    def drags(self):
        """Return how long each drag took until its force was in the picture [ms]."""
        return self.driver.execute_script(
            "return performance.getEntriesByName('drag-to-visible').map(each => each.duration)")

    def processes(self):
        """Return the processes of the browser."""
        return psutil.Process(self.driver.service.process.pid).children(recursive=True)

    def let_go(self):
        ActionChains(self.driver).release().perform()

    def controls(self):
        """Show the controls, all groups open."""
        self.driver.execute_script("document.querySelector('#search-tab').click();")
        self.until(lambda: self.all('#mpc-solver-0'), 'the parameters of the mpc')
        self.driver.execute_script(
            "document.querySelectorAll('#parameters details').forEach(each => each.open = true)")

    def errors(self):
        return [each['message'] for each in self.driver.get_log('browser')
                if each['level'] == 'SEVERE' and CLOSED_EARLY not in each['message']]

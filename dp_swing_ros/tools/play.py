# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros play`: plant, mpc and a page on them, until Ctrl-C."""

import argparse
from collections.abc import Callable, Sequence
from functools import partial
import math
import os
from pathlib import Path
import re
import sys
import time
import webbrowser

from dp_swing_ros.parameters.console import ConsoleParameters
from dp_swing_ros.parameters.files import locate
from dp_swing_ros.pendulum.state import DEFAULT_LINKS, LINKS
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tools.command_lines import (
    dated, ELSE, execute, given, new_folder, OK, program, within)
from dp_swing_ros.tools.demo import DEFAULTS, given_in, refuse_company
from dp_swing_ros.tools.processes import (
    attributed, Crew, isolated, located, Process, ProcessError)

POLL = 0.1         # [s]
TRIES = 20         # trajectories of each solve that the page shows
PAGE = re.compile(r'the page is at (\S+)')
OPENED = 'a page is open'
PATIENCE = 120.0   # [s] for a page to be opened


def main(argv: Sequence[str] | None = None) -> int:
    """Play until Ctrl-C; return the exit code."""
    parser = argparse.ArgumentParser(
        prog=program('play'),
        description='Start mpc and console, open the page in a browser where there is one, and '
                    'start the plant once the page is open: pull at the pendulum, change '
                    'parameters, watch what the mpc plans. Ctrl-C ends it all.')
    default = ELSE.format
    parser.add_argument('--solver', choices=list(SOLVERS),
                        help=default(DEFAULTS['mpc']['solver']))
    parser.add_argument('--links', type=int, choices=LINKS,
                        help=f'of the pendulum {default(DEFAULT_LINKS)}')
    parser.add_argument('--lockstep', action=argparse.BooleanOptionalAction,
                        help='the plant waits for the mpc, and so can be paused, stepped and '
                             f'slowed down {default("not")}')
    parser.add_argument('--params', type=Path, metavar='FILE', action='append', default=[],
                        help='YAML file with parameters for plant, mpc and console')
    parser.add_argument('--port', type=within(int, 0, 65535),
                        help=f'of the page {default(ConsoleParameters().port)}; 0: any '
                             'that is free')
    parser.add_argument('--browser', action=argparse.BooleanOptionalAction, default=True,
                        help='open the page')
    return execute(parser, _play, argv, (ProcessError,))


def _play(arguments: argparse.Namespace) -> int:
    files = list(map(locate, arguments.params))
    parameters = {'console': given(arguments, 'port'), 'mpc': given(arguments, 'solver', 'links'),
                  'plant': given(arguments, 'lockstep', 'links')}
    if 'shown_tries' not in given_in(files, 'mpc'):
        parameters['mpc']['shown_tries'] = TRIES
    if arguments.lockstep and 'pace' not in given_in(files, 'plant'):
        parameters['plant']['pace'] = 1.0
    located(files, parameters)
    folder = new_folder(Path('runs', dated('play')))
    shared_domain = os.environ.get('ROS_DOMAIN_ID')
    with isolated() as domain, Crew() as crew:
        print(f'ROS_DOMAIN_ID={domain}', flush=True)
        if shared_domain:
            refuse_company(set(parameters))

        def start(name: str) -> Process:
            return crew.start(name, parameters[name], folder / f'{name}.log', files)

        try:
            follow([start('console'), start('mpc')], partial(start, 'plant'), arguments.browser)
        except KeyboardInterrupt:   # the usual end
            print(f'the logs are in {folder}', flush=True)
    return OK


def follow(processes: Sequence[Process], start_plant: Callable[[], Process],
           browse: bool) -> None:
    """
    Print what the processes say, open the page, and start the plant once it is open.

    So nobody misses the swing-up; at the latest it comes after PATIENCE. Raises ProcessError where
    a process ends.
    """
    starts = math.inf   # [s]
    while True:
        for process in processes:
            for line in process.new_lines():
                print(attributed(process.name, line), flush=True)
                if page := PAGE.search(line):
                    print('play: the plant starts once the page is open, or in '
                          f'{PATIENCE:g} s', flush=True)
                    starts = time.monotonic() + PATIENCE
                    if browse:
                        _open(page[1])
                elif OPENED in line:
                    starts = time.monotonic()
            process.check()
        if time.monotonic() >= starts:
            starts, processes = math.inf, [*processes, start_plant()]
        time.sleep(POLL)


def _open(address: str) -> None:
    # without a screen there may be a browser for the terminal, which would take it over
    if sys.platform == 'darwin' or {'DISPLAY', 'WAYLAND_DISPLAY'} & set(os.environ):
        webbrowser.open(address)

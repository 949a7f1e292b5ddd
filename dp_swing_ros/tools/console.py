# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros console BAG`: the page of the console on a recorded run, without ROS."""

import argparse
from collections.abc import Sequence
import sys
from threading import Event

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.console.access import given_token
from dp_swing_ros.console.player import Player
from dp_swing_ros.console.server import Options, Server
from dp_swing_ros.parameters.console import ConsoleParameters, TOKEN_VARIABLE
from dp_swing_ros.tools.command_lines import bag_parser, execute, OK, within

DEFAULTS = ConsoleParameters()


def main(argv: Sequence[str] | None = None) -> int:
    """Play the bag that the command line names until Ctrl-C; return the exit code."""
    parser = bag_parser(
        'console', 'Play a recorded run in the browser, in the page that shows live ones: look '
        'at each state, and let each solver take over. Without a bag it is the console of a live '
        'run, a node: see `console --help`.')
    parser.add_argument('--address', default=DEFAULTS.address,
                        help='to serve the page at (default: %(default)s; any but one of this '
                             'machine alone asks for a token)')
    parser.add_argument('--port', type=within(int, 0, 65535), default=DEFAULTS.port,
                        help='to serve the page at (default: %(default)s; 0: any that is free)')
    parser.add_argument('--token', default=DEFAULTS.token,
                        help='what the address must be opened with (default: that of --token-file '
                             f'or of the environment variable {TOKEN_VARIABLE}, else made, where '
                             'one is needed)')
    parser.add_argument('--token-file', default=DEFAULTS.token_file, metavar='FILE',
                        help='file with the token')
    return execute(parser, _play, argv)


def _play(arguments: argparse.Namespace) -> int:
    bag = Bag(arguments.bag, arguments.partial, arguments.namespace, arguments.node)
    player = Player(bag)
    # of recordings there are none here
    token = given_token(arguments.token, arguments.token_file)
    server = Server(Options(arguments.address, arguments.port, token, False, None), player,
                    lambda line: print(line, file=sys.stderr, flush=True))
    player.publish(server)
    server.start()
    print(f'the page is at {server.access.address}', flush=True)
    try:
        Event().wait()
    except KeyboardInterrupt:
        server.stop()
    return OK

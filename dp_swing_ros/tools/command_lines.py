# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the command lines share: names, arguments, progress bars, signals and exit codes."""

import argparse
from collections.abc import Callable, Iterable, Iterator, Sequence
import contextlib
from datetime import datetime
import functools
import math
import os
from pathlib import Path
import signal
import sys
import threading
from typing import Any

from tqdm import tqdm

from dp_swing_ros.errors import UserError
from dp_swing_ros.executables import INTERRUPTED, on_signals
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.topics import COMMAND_TOPICS

OK, FAILED, MISUSED = 0, 1, 2  # exit codes, and INTERRUPTED
LATER = 0.05  # [s]
ELSE = '(default: as in --params, else {})'   # of a parameter of a node
SHOWN = 80  # [characters] of what was given
# topics of a bag that tell how bodies move, by whatever drive
MOTION = f'joint_states and one of {", ".join(topic.name for topic in COMMAND_TOPICS)}'


def program(tool: str) -> str:
    """Return how a tool was called: by ros2 run, or without colcon by the package's one name."""
    called = Path(sys.argv[0]).name
    if called == '__main__.py':
        return f'python -m dp_swing_ros {tool}'
    return f'dp_swing_ros {tool}' if called == 'dp_swing_ros' else f'ros2 run dp_swing_ros {tool}'


def bag_parser(tool: str, description: str, **bag: Any) -> argparse.ArgumentParser:
    """Return the parser of a tool that reads recorded bags; `bag` is for the argument BAG."""
    parser = argparse.ArgumentParser(prog=program(tool), description=description)
    parser.add_argument('bag', type=Path, metavar='BAG', **{
        'help': 'folder of a bag that the logger recorded, or its .mcap file', **bag})
    parser.add_argument('--partial', action='store_true',
                        help='read what there is of a bag whose logger was killed')
    parser.add_argument('--namespace', metavar='NAME',
                        help='of several pendulums in a bag, that whose topics lie in this '
                             'namespace, such as /second (/ for the one in none)')
    parser.add_argument('--node', action='append', default=[], metavar='NAME',
                        help='of several controllers or plants in a bag, the one of this name, '
                             'such as /left_controller; may be given once for each')
    return parser


def print_incomplete(bags: Iterable[Any]) -> None:
    """Print what is missing in each of some bags where anything is."""
    for bag in bags:
        if bag.incomplete:
            print(f'{bag}: {bag.incomplete}')


def given(arguments: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Return those of some options that were given; what else files or nodes say prevails."""
    return {name: value for name in names if (value := getattr(arguments, name)) is not None}


def within(kind: type, low: float, high: float = math.inf) -> Callable[[str], Any]:
    """Return what reads a finite number between two, both included, and refuses others."""
    def number(text: str) -> Any:
        value = kind(text)
        if not (low <= value <= high and value < math.inf):
            raise argparse.ArgumentTypeError(
                f'{text[:SHOWN]} is not {"a whole number" if kind is int else "a number"} of at '
                f'least {low:g}' + (f' and at most {high:g}' if high < math.inf else ''))
        return value
    return number


def beside(bag: Path, what: str) -> Path:
    """Return the folder for what is made of a bag: beside it, where rosbag2 does not look."""
    bag = bag.resolve()
    return bag.with_name(f'{bag.stem if bag.suffix == ".mcap" else bag.name}_{what}')


def dated(name: str) -> str:
    """Return the name of a folder for what is made now."""
    return f'{name}_{datetime.now():%Y%m%d_%H%M%S}'


def new_folder(folder: Path) -> Path:
    """Make a folder and return it; raises UserError where there is something already."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f'{folder} exists already; give another --output')
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def progress(*arguments: Any, **options: Any) -> Any:
    """Return a progress bar, as tqdm; for terminals alone, and gone at the end."""
    return tqdm(*arguments, leave=False, disable=None, **options)


class _Interrupts:
    """Signals that ask this process to end, as KeyboardInterrupt in its main thread."""

    def __init__(self) -> None:
        self._number = 0   # of the signal that came
        self._report, sys.unraisablehook = sys.unraisablehook, self._again
        on_signals(self._interrupt)

    def _interrupt(self, number: int, _: Any) -> None:
        self._number = number
        raise KeyboardInterrupt

    def _again(self, ignored: 'sys.UnraisableHookArgs') -> None:
        """Interrupt again, a little later: Python drops what destructors and callbacks raise."""
        if ignored.exc_type is KeyboardInterrupt:
            again = threading.Timer(LATER, os.kill, (os.getpid(), self._number))
            again.daemon = True
            again.start()
        elif not self._number:   # else it may be of what was interrupted while it was made
            self._report(ignored)


@contextlib.contextmanager
def postponed() -> Iterator[list[int]]:
    """
    Let the signals that ask this process to end wait until the context has ended.

    Yields those that came; who obeys them clears the list.
    """
    came = list[int]()
    handlers = on_signals(lambda number, _: came.append(number))
    try:
        yield came
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for one in came:
            signal.raise_signal(one)


@functools.cache
def interrupt_on_signals() -> None:
    """Raise KeyboardInterrupt at every signal that asks this process to end."""
    _Interrupts()


def execute(parser: argparse.ArgumentParser, work: Callable[[argparse.Namespace], int],
            argv: Sequence[str] | None, failures: tuple[type[Exception], ...] = ()) -> int:
    """
    Do the work that a command line asks for and return its exit code.

    What the user can put right is one line; `failures` are the errors that are no misuse. The
    text of a KeyboardInterrupt, which every signal to end raises, is printed with it.
    """
    arguments = parser.parse_args(argv)
    tool = parser.prog.split()[-1]
    try:
        interrupt_on_signals()
        return work(arguments)
    except BrokenPipeError:   # whoever called ends in silence: see executables.piped
        raise
    except failures + (UserError, ParameterError, OSError) as error:
        print(f'{tool}: error: {error}', file=sys.stderr)
        return FAILED if isinstance(error, failures) else MISUSED
    except MemoryError:
        print(f'{tool}: error: this takes more memory than there is; give less at once',
              file=sys.stderr)
        return MISUSED
    except KeyboardInterrupt as interrupt:
        print('; '.join([f'{tool}: interrupted', *interrupt.args]), file=sys.stderr)
        return INTERRUPTED

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Attack running nodes and tools by all that they take in, and print what that does to them.

Topics, services, parameters, the page and files: first what has once broken something, then what
a seed draws. After each attack all nodes live, a fresh state is answered with a finite force, a
page gets frames, and no log has a traceback. The exit code is 1 where that was not so. What is
found can be repeated alone, by --only.
"""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import suppress
import os
from pathlib import Path
import socket
import sys
import tempfile
import time
import zlib

import fuzz_attacks as attacks
from fuzz_attacks import Entry, Step
from fuzz_files import files
from fuzz_target import Target
import numpy as np

STALL = 0.5        # [s] and a period of the states without a force, which is looked at again
CULPRITS = 4       # steps of an attack that are told apart, at most


class Fuzzer:
    """Attacks, judges, and keeps what it found."""

    def __init__(self, target: Target, seed: int, entries: Sequence[str] = ()) -> None:
        """Take what is attacked, and by what; all entries where none is named."""
        self.target, self.seed, self.began = target, seed, time.monotonic()
        made = {'states': attacks.states, 'forces': attacks.forces,
                'configuration': attacks.announcements, 'shown': attacks.shown,
                'bytes': attacks.serialised, 'services': attacks.services,
                'parameters': lambda: attacks.parameters(target.described, target.folder),
                'page': attacks.page, 'http': attacks.http, 'clock': attacks.clock,
                'files': lambda: files(target.folder)}
        self.entries: dict[str, Entry] = {
            name: make() for name, make in made.items() if name in entries or not entries}
        self.found: list[str] = []
        self.spent = dict.fromkeys(self.entries, 0.0)
        self.done = dict.fromkeys(self.entries, 0)

    def attack(self, name: str, number: int) -> None:
        """Make one attack, and find out which of its steps did what it did."""
        began, entry = time.monotonic(), self.entries[name]
        steps = entry.known[number] if number < len(entry.known) else entry.draw(
            np.random.default_rng([self.seed, zlib.crc32(name.encode()), number]))
        complaints = self.complaints(name, steps)
        if complaints and len(steps) > 1:
            self.revive(name)
        if complaints and not (len(steps) > 1 and self.told_apart(name, number, steps)):
            self.revive(name)
            self.report(name, number, '; '.join(step.what for step in steps)[:300], complaints)
        self.spent[name] += time.monotonic() - began
        self.done[name] += 1

    def told_apart(self, name: str, number: int, steps: Sequence[Step]) -> int:
        """Report which steps alone do something, the first few; return how many do."""
        culprits = 0
        for step in steps:
            complaints = self.complaints(name, [step])
            if complaints:
                self.revive(name)
                self.report(name, number, step.what, complaints)
                culprits += 1
            if culprits == CULPRITS:
                break
        return culprits

    def revive(self, name: str) -> None:
        """Leave sound nodes after an attack on them."""
        if name != 'files':
            self.target.revive()

    def complaints(self, name: str, steps: Sequence[Step]) -> list[str]:
        """Make an attack and return what is wrong then."""
        found, target = [], self.target
        target.honest = name != 'configuration'
        began = time.monotonic()
        try:
            for step in steps:
                step.do(target)
        except AssertionError as error:
            found.append(str(error))
        if name == 'files':
            return found
        found += target.complaints()
        if not found:
            target.heal()
            found += target.faults(began, bounded=name not in ('parameters', 'page'))
            if not found and target.loop.gap(began, time.monotonic()) > (
                    STALL + target.period(began)):
                found += self.stalled(steps)
        return found

    def stalled(self, steps: Sequence[Step]) -> list[str]:
        """Return whether no force comes again and again at an attack, and never at rest."""
        gaps, rests, loop = list[float](), list[float](), self.target.loop
        start = time.monotonic()
        for _ in range(3):
            for which, act in ((gaps, True), (rests, False)):
                began = time.monotonic()
                for step in steps if act else ():
                    step.do(self.target)
                while time.monotonic() < began + 2.0:
                    time.sleep(0.05)
                which.append(loop.gap(began, time.monotonic()))
        if min(gaps) > max(STALL + self.target.period(start), 2 * max(rests)):
            return [f'no force for {min(gaps):.2f} s, at rest {max(rests):.2f} s at most']
        return []

    def report(self, name: str, number: int, what: str, complaints: Sequence[str]) -> None:
        """Print what was found, and how to find it again."""
        line = (f'{name}:{number} {what}: {"; ".join(complaints)} '
                f'[--seed {self.seed} --only {name}:{number}]')
        self.found.append(line)
        print(f'{time.monotonic() - self.began:.0f} s: {line}', flush=True)

    def turns(self, seconds: float, known: int) -> Iterator[str]:
        """Yield the entry whose turn it is: what is known, up to a number, then by time spent."""
        end = time.monotonic() + seconds
        for number in range(known):
            left = [name for name, entry in self.entries.items() if number < len(entry.known)]
            if not left:
                break
            yield from left
        while time.monotonic() < end:
            yield min(self.spent, key=self.spent.__getitem__)


def isolate() -> socket.socket:
    """Keep to this machine and, unless one is given, a ROS domain of our own; return its lock."""
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(
        Path(__file__).parents[1] / 'config' / 'fast_discovery.xml'))
    lock = socket.socket(socket.AF_UNIX)
    for domain in range(70, 102) if 'ROS_DOMAIN_ID' not in os.environ else ():
        with suppress(OSError):
            lock.bind(f'\0dp_swing_ros_domain_{domain}')   # as the tests do
            os.environ['ROS_DOMAIN_ID'] = str(domain)
            break
    return lock


def main(argv: Sequence[str] | None = None) -> int:
    """Attack for a time, and say what was found."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seconds', type=float, default=0.0,
                        help='at least (default: what is known, once)')
    parser.add_argument('--known', type=int, default=sys.maxsize,
                        help='at most so many attacks of what is known, of each entry')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--entries', nargs='+', default=[], help='default: all')
    parser.add_argument('--only', metavar='ENTRY:NUMBER', help='one attack alone')
    arguments = parser.parse_args(argv)
    lock = isolate()
    only = arguments.only.split(':') if arguments.only else None
    with tempfile.TemporaryDirectory(prefix='fuzz_') as folder:
        os.environ.setdefault('ROS_LOG_DIR', folder)
        entries = [only[0]] if only else arguments.entries
        target = Target(Path(folder), alone=entries == ['files'])
        fuzzer = Fuzzer(target, arguments.seed, entries)
        try:
            if only:
                fuzzer.attack(only[0], int(only[1]))
            else:
                for name in fuzzer.turns(arguments.seconds, arguments.known):
                    fuzzer.attack(name, fuzzer.done[name])
        finally:
            fuzzer.found += target.end()
    lock.close()
    print(*(f'{name}: {number} attacks, {fuzzer.spent[name]:.0f} s'
            for name, number in fuzzer.done.items()), f'{len(fuzzer.found)} found', sep='\n')
    return 1 if fuzzer.found else 0


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Print every constant of the package that has a unit, and whether it goes with the pendulum.

A number with a unit belongs to one pendulum, unless it is one of machines, messages or people. The
comment of a constant has its unit in brackets first; one that goes with the pendulum's own units
is then called `scaled`.
"""

import ast
from collections.abc import Iterator
import io
from pathlib import Path
import re
import tokenize
from typing import NamedTuple

PACKAGE = Path(__file__).parents[1] / 'dp_swing_ros'
UNIT = re.compile(
    r'\[(?=[^\]]*(?<!\w)(?:m|s|ns|ms|min|N|kg|J|Hz)(?![a-z]))([^\]]+)\](?:,? (scaled))?')
SCALED, FIXED = 'own units', 'fixed'
HEAD = """\
# Constants with a unit

Made by `make docs` from their comments. `own units`: the number is that of the default bodies, and
for others goes with [the units of the pendulum](theory.md#units-of-the-pendulum). The others are
fixed, for what stands beside them: of clocks, messages, machines, people, or of rounding. Rooms
that draw, talk, record or read are left out: their seconds are those of machines and people, and
what they draw goes with the bodies that they draw.
"""
# rooms whose seconds are those of machines, messages and people
BESIDE = ('bags', 'console', 'figures', 'messages', 'nodes', 'parameters', 'recovery', 'report',
          'rerun', 'runtime', 'tools', 'executables.py', 'errors.py', 'topics.py', '__main__.py')


class Constant(NamedTuple):
    """A constant: where, its name and value, and its comment, with the unit first."""

    place: str
    name: str
    value: str
    comment: str

    @property
    def verdict(self) -> str:
        """Return whether it goes with the pendulum."""
        found = UNIT.search(self.comment)
        return SCALED if found and found[2] else FIXED


def constants() -> Iterator[Constant]:
    """Yield the constants with a unit of the rooms that know a pendulum."""
    for path in sorted(PACKAGE.rglob('*.py')):
        place = path.relative_to(PACKAGE)
        if place.parts[0] not in BESIDE:
            yield from constants_of(path.read_text(encoding='utf-8'), str(place))


def constants_of(text: str, place: str) -> Iterator[Constant]:
    """Yield those of a module."""
    comments = {token.start[0]: token.string.lstrip('# ')
                for token in tokenize.generate_tokens(io.StringIO(text).readline)
                if token.type == tokenize.COMMENT}
    for node in ast.parse(text).body:
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None:
            comment = comments.get(node.end_lineno or 0, '')
            names = ast.unparse(node.targets[0] if isinstance(node, ast.Assign) else node.target)
            if UNIT.search(comment) and names.upper() == names:
                yield Constant(place, names.strip('()'), ast.unparse(node.value).strip('()'),
                               comment)


def page() -> str:
    """Return the page of all of them."""
    rows = [f'| `{each.place}` | `{each.name}` | `{each.value}` | {each.verdict} | '
            f'{each.comment.replace("|", chr(92) + "|")} |' for each in constants()]
    return '\n'.join([HEAD, '| module | constant | value | verdict | what it is |',
                      '| --- | --- | --- | --- | --- |', *rows, ''])


if __name__ == '__main__':
    print(page(), end='')

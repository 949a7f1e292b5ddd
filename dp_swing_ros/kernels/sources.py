# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a module's kernels are compiled from: its source, and the sources of what it imports.

All that a kernel has inlined, kernels, constants and tuples, its module defines or imports. So
the imports are followed, within this package and within that of a plug-in, and every other
package that uses this one. They are found in the text, each on a line of its own, for to parse it
takes longer than a start may: what only looks like an import adds a source and does no harm.
"""

from collections.abc import Iterator
import functools
import hashlib
import os.path
from pathlib import Path
import re
import sys
from typing import NamedTuple

PACKAGE = Path(__file__).parents[1]
OURS = os.path.join(PACKAGE, '')
IMPORT = re.compile(r'^[ \t]*(?:from\s+(\.*)([\w.]*)\s+import\s+'
                    r'(\([^)]*\)|(?:[^\n\\]|\\\n)*)|import\s+([\w., \t]+))', re.M)


def _file(path: str) -> str | None:
    """Return the file of the module at a path without an extension."""
    for file in (f'{path}.py', os.path.join(path, '__init__.py')):
        if os.path.isfile(file):
            return file
    return None


@functools.cache
def _root(folder: str) -> str:
    """Return the folder of the outermost package that a folder belongs to, or itself."""
    parent = os.path.dirname(folder)
    inside = all(os.path.isfile(os.path.join(each, '__init__.py')) for each in (folder, parent))
    return _root(parent) if inside else folder


@functools.cache
def _loaded(name: str, importer: str) -> str | None:
    """Return the file of a loaded module, where what it defines may be in kernels."""
    file = getattr(sys.modules.get(name), '__file__', None)
    if not file or not file.endswith('.py') or not os.path.isfile(file):
        return None
    near = _root(os.path.dirname(file)) == _root(os.path.dirname(importer))
    return file if near or PACKAGE.name.encode() in Path(file).read_bytes() else None


def _module(dots: str, name: str, importer: str) -> str | None:
    """Return the file of a module that is imported by another."""
    top, *inner = name.split('.')
    if dots:
        folder = importer
        for _ in dots:
            folder = os.path.dirname(folder)
        return _file(os.path.join(folder, top, *inner))
    if top == PACKAGE.name:
        return _file(OURS + '/'.join(inner))
    return None if importer.startswith(OURS) else _loaded(name, importer)


class Module(NamedTuple):
    """A module as its text says: which it is, and the files of what it imports."""

    digest: bytes
    imports: frozenset[str]


@functools.cache
def _read(file: str) -> Module:
    """Return what the text of a module says."""
    root, text = _root(os.path.dirname(file)), Path(file).read_bytes()
    packaged = os.path.isfile(os.path.join(root, '__init__.py'))
    name = os.path.relpath(file, root) if packaged else ''   # of a module alone its text counts
    return Module(hashlib.sha256(f'{name} '.encode() + text).digest(),
                  frozenset(filter(None, _imported(text.decode(errors='replace'), file))))


def _imported(text: str, file: str) -> Iterator[str | None]:
    for dots, name, names, modules in IMPORT.findall(text):
        for module in modules.split(','):
            if module.strip():
                yield _module('', module.split()[0], file)
        if dots or name:
            base = _module(dots, name, file)
            yield base
            if not base or base.endswith('__init__.py'):
                for each in re.findall(r'\w+', names):   # which may be modules, too
                    yield _module(dots, f'{name}.{each}'.lstrip('.'), file)


@functools.cache
def sources(file: str) -> frozenset[str]:
    """Return the files that a module's kernels are compiled from."""
    found, waiting = set(), {os.path.abspath(file)}
    while waiting:
        each = waiting.pop()
        found.add(each)
        waiting |= _read(each).imports - found
    return frozenset(found)


@functools.cache
def digest(file: str) -> str:
    """Return a digest of what a module's kernels are compiled from; copies have the same."""
    parts = sorted(_read(each).digest for each in sources(file))
    return hashlib.sha256(b''.join(parts)).hexdigest()[:16]

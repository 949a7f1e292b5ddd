# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ran: version and commit of this package, what it computes with, and where."""

from collections.abc import Iterable
import hashlib
from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path
import platform
import re
import subprocess

PACKAGE = Path(__file__).parent
COMPUTING = ('numpy', 'numba', 'scipy')
# what no episode depends on
AFTERWARDS = ('__main__.py', 'bags/', 'console/', 'environment.py',
              'evaluation/campaign/manifest.py',
              'evaluation/campaign/report.py', 'evaluation/campaign/runner.py',
              'evaluation/campaign/summary.py', 'evaluation/comparison.py', 'executables.py',
              'figures/', 'identification/', 'learning/', 'messages/', 'nodes/',
              'parameters/console.py', 'parameters/nodes.py', 'pendulum/description.py',
              'pendulum/geometry.py', 'pendulum/urdf.py', 'provenance.py',
              'recovery/', 'report/', 'rerun/', 'runtime/', 'tables.py', 'tools/', 'topics.py')


def machine() -> str:
    """Return processor, cores and system in words."""
    try:
        found = re.search(r'model name\s*: (.*)', Path('/proc/cpuinfo').read_text())
    except OSError:
        found = None
    cpu = found[1] if found else platform.processor() or 'unknown processor'
    return f'{cpu}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}'


def packages(names: Iterable[str] = COMPUTING) -> dict[str, str]:
    """Return the versions of Python and of packages that are installed."""
    return {'CPython': platform.python_version(), **{name: version(name) for name in names}}


def package_version() -> str:
    """Return the version of this package, if it is installed."""
    try:
        return version('dp_swing_ros')
    except PackageNotFoundError:
        return 'not installed'


def commit() -> str:
    """Return the commit of the checkout around this package, and whether it was changed since."""
    try:
        return subprocess.run(
            ['git', '-C', str(PACKAGE), 'describe', '--always', '--dirty', '--abbrev=10'],
            capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return 'unknown'


def sources(without: tuple[str, ...] = AFTERWARDS) -> str:
    """Return a digest of all that decides an episode, or of all but other modules."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob('*.py')):
        place = path.relative_to(PACKAGE).as_posix()
        if not place.startswith(without):
            digest.update(place.encode() + path.read_bytes())
    return digest.hexdigest()[:16]

# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a campaign is, kept beside its table: rows of two campaigns must never mix."""

from collections.abc import Iterable
from datetime import datetime
import hashlib
from importlib.metadata import PackageNotFoundError, version
import json
import os
from pathlib import Path
import platform
import re
import subprocess
from typing import Any

from dp_swing_ros.campaign.contestants import Contestant
from dp_swing_ros.campaign.rows import CampaignError
from dp_swing_ros.scenarios import SCENARIOS

PACKAGE = Path(__file__).parents[1]
COMPUTING = ('numpy', 'numba', 'scipy', 'joblib')
AFTERWARDS = ('figures/', 'nodes/', 'tools/', 'campaign/report.py', 'campaign/scores.py',
              'campaign/summary.py', 'comparison.py')  # what no episode depends on
DECIDES = ('contestants', 'scenarios', 'duration', 'sources')  # rows depend on these


def describe(contestants: Iterable[Contestant], scenarios: Iterable[str], seeds: range | None,
             levels: int | None, duration: float) -> dict[str, Any]:
    """Return the description of a campaign, ready for JSON."""
    return {
        'contestants': {contestant.label: {
            'name': contestant.name, 'plant': contestant.plant, 'mpc': contestant.mpc}
            for contestant in contestants},
        'scenarios': {name: {'seeds': _bounds(seeds or SCENARIOS[name].seeds),
                             'levels': SCENARIOS[name].sweeps and (
                                 levels or SCENARIOS[name].levels) or 0}
                      for name in scenarios},
        'duration': duration, 'sources': sources(), 'version': package_version(),
        'commit': commit()}


def made(command: str) -> dict[str, str]:
    """Return when, where and with what a campaign is made."""
    packages = [f'{name} {version(name)}' for name in COMPUTING]
    return {
        'command': command, 'date': f'{datetime.now():%Y-%m-%d %H:%M}',
        'machine': f'{cpu()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}',
        'packages': ', '.join([f'CPython {platform.python_version()}', *packages])}


def cpu() -> str:
    """Return the model of the processor."""
    try:
        found = re.search(r'model name\s*: (.*)', Path('/proc/cpuinfo').read_text())
    except OSError:
        found = None
    return found[1] if found else platform.processor() or 'unknown processor'


def _bounds(seeds: range) -> list[int]:
    return [seeds.start, seeds.stop]


def sources() -> str:
    """Return a digest of all that decides an episode."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE.rglob('*.py')):
        place = path.relative_to(PACKAGE).as_posix()
        if not place.startswith(AFTERWARDS):
            digest.update(place.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


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


def keep(folder: Path, description: dict[str, Any]) -> None:
    """
    Write the description into the folder, or find it there.

    Raises CampaignError where the folder holds another campaign.
    """
    path = folder / 'campaign.json'
    description = json.loads(json.dumps(description))
    if not path.exists():
        path.write_text(json.dumps(description, indent=1) + '\n', encoding='utf-8')
        return
    before = load(folder)
    for part in DECIDES:
        if before.get(part) != description[part]:
            raise CampaignError(
                f'{folder} holds a campaign with other {part}: {_short(before.get(part))}, now '
                f'{_short(description[part])}; give another --output')


def load(folder: Path) -> dict[str, Any]:
    """
    Read the description of the campaign in a folder.

    Raises CampaignError where there is none.
    """
    path = folder / 'campaign.json'
    try:
        return json.loads(path.read_text(encoding='utf-8'))
    except (OSError, ValueError) as error:
        raise CampaignError(f'{folder} holds no campaign: {error}') from None


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 200 else f'{text[:200]}...'
